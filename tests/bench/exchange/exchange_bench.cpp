// SPDX-License-Identifier: Apache-2.0
// exchange_bench — the round trip device → mofc → device of the real programs, compared with plain
// echoes of the same bytes, and the cost of its parts.
#include <fcntl.h>
#include <sched.h>
#include <spdlog/fmt/fmt.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/link/telemetry_subscriber.h"
#include "common/process/rate_loop.h"
#include "common/process/realtime.h"
#include "common/session/session_file.h"
#include "common/telemetry/quantile.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/exchange/echo_links.h"
#include "tests/support/machine/places.h"
#include "tests/support/run_folder.h"

namespace palpate::bench {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr auto kWarmUp = 500ms;

// --- processes --------------------------------------------------------------------------------

/// A process of this bench; ended by the destructor, and by the kernel if the bench dies.
class Child {
 public:
  /// Runs `body` in a forked child, in which no other thread of the parent exists.
  explicit Child(const std::function<void()>& body) : end_signal_(SIGKILL) {
    std::fflush(nullptr);
    pid_ = fork();
    if (pid_ < 0) throw std::system_error(errno, std::generic_category(), "fork");
    if (pid_ > 0) return;
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    int status = 1;
    try {
      body();
      status = 0;
    } catch (const std::exception& e) {
      std::fprintf(stderr, "exchange_bench: %s\n", e.what());
    }
    std::fflush(nullptr);
    _exit(status);
  }
  /// Runs a program of the build; its output goes to `log`.
  Child(const fs::path& program, const std::vector<std::string>& arguments, const fs::path& log)
      : Child([&] {
          const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
          dup2(out, STDOUT_FILENO);
          dup2(out, STDERR_FILENO);
          std::string name = program.string();
          std::vector<std::string> words = arguments;
          std::vector<char*> argv{name.data()};
          for (std::string& word : words) argv.push_back(word.data());
          argv.push_back(nullptr);
          execv(name.c_str(), argv.data());
          throw SetupError(name + ": cannot be started; build it");
        }) {
    end_signal_ = SIGTERM;
  }
  ~Child() {
    if (pid_ == 0) return;
    kill(pid_, end_signal_);
    waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Waits for its end. True if it succeeded.
  bool wait() {
    int status = 0;
    waitpid(std::exchange(pid_, 0), &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

 private:
  pid_t pid_ = 0;
  int end_signal_;
};

/// Numbers that a child passes to its parent.
class SharedNumbers {
 public:
  explicit SharedNumbers(std::size_t capacity) : capacity_(capacity) {
    void* const memory = mmap(nullptr, bytes(), PROT_READ | PROT_WRITE,
                              MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (memory == MAP_FAILED) throw std::system_error(errno, std::generic_category(), "mmap");
    numbers_ = static_cast<double*>(memory);
  }
  ~SharedNumbers() { munmap(numbers_, bytes()); }
  SharedNumbers(const SharedNumbers&) = delete;
  SharedNumbers& operator=(const SharedNumbers&) = delete;

  void add(double number) {
    if (count() < capacity_) numbers_[1 + count()] = number;
    numbers_[0] += 1.0;
  }
  [[nodiscard]] std::vector<double> all() const {
    return {numbers_ + 1, numbers_ + 1 + std::min(count(), capacity_)};
  }

 private:
  [[nodiscard]] std::size_t bytes() const { return (capacity_ + 1) * sizeof(double); }
  [[nodiscard]] std::size_t count() const { return static_cast<std::size_t>(numbers_[0]); }

  std::size_t capacity_;
  double* numbers_ = nullptr;  // the first one is how many
};

// --- measurements -----------------------------------------------------------------------------

struct Placement {
  const char* label;
  int priority;
  int near_cpu;  ///< device
  int far_cpu;   ///< mofc
};
constexpr Placement kOneProcessor{"FIFO, one processor", 80, 0, 0};
constexpr Placement kTwoProcessors{"FIFO, two processors", 80, 0, 1};
constexpr Placement kOrdinary{"ordinary, anywhere", 0, -1, -1};

struct Case {
  Placement placement;
  double rate_hz;
  bool is_loaded;
};

/// One link in one case.
struct Measured {
  std::vector<double> round_trips_us;  ///< sorted; infinite: not by the deadline
  double answered_ratio = kNaN;        ///< of the scheduled ticks
};

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return kNaN;
  return palpate::quantile(values, q);
}

double micro(Duration d) { return 1e6 * to_seconds(d); }

/// In a child: the scheduling of this process and of every thread that it will have.
void take_scheduling(int priority, int cpu) {
  if (cpu >= 0) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(static_cast<std::size_t>(cpu), &cpus);
    sched_setaffinity(0, sizeof(cpus), &cpus);
  }
  const sched_param parameters{.sched_priority = priority};
  if (priority > 0 && sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) {
    throw SetupError("SCHED_FIFO was permitted before and is not now");
  }
}

/// Round trips of a bare echo at the case's rate.
Measured measure(EchoLink& link, const Case& c, double seconds) {
  const auto wanted = static_cast<std::size_t>(seconds * c.rate_hz);
  SharedNumbers numbers(wanted);
  const Child far([&] {
    take_scheduling(c.placement.priority, c.placement.far_cpu);
    link.serve_far({.priority = c.placement.priority, .cpu = c.placement.far_cpu});
  });
  Child near([&] {
    alarm(static_cast<unsigned>(10.0 * seconds) + 30);  // an echo that never comes ends the bench
    take_scheduling(c.placement.priority, c.placement.near_cpu);
    const auto round_trip =
        link.open_near({.priority = c.placement.priority, .cpu = c.placement.near_cpu});
    SteadyClock clock(c.placement.priority > 0 ? WaitStrategy::kHybrid : WaitStrategy::kBlock);
    const TimePoint warm_at = clock.now() + kWarmUp;
    std::stop_source stop;
    std::size_t taken = 0;
    RateLoop(clock, c.rate_hz).run(stop.get_token(), [&](const Tick& tick) {
      const TimePoint begin = clock.now();
      round_trip();
      const Duration took = clock.now() - begin;
      if (tick.now < warm_at) return;
      numbers.add(micro(took));
      if (++taken == wanted) stop.request_stop();
    });
  });
  if (!near.wait()) throw SetupError("the near end of an echo failed");
  Measured measured{.round_trips_us = numbers.all()};
  std::sort(measured.round_trips_us.begin(), measured.round_trips_us.end());
  return measured;
}

/// The real programs with the default session.
class Deployment {
 public:
  Deployment(fs::path session_file, fs::path folder)
      : session_file_(std::move(session_file)), folder_(std::move(folder)) {}

  struct Wanted {
    bool is_together = false;
    int viewers = 0;  ///< beside the one that measures
  };

  Measured measure(const Case& c, const Wanted& wanted, double seconds) const {
    // a deadline late in the period: the bench measures the round trip, not punctuality
    const double reply_us = 0.9e6 / c.rate_hz;
    std::vector<std::string> settings = {
        fmt::format("device.rate_hz={}", c.rate_hz), fmt::format("device.reply_us={}", reply_us),
        fmt::format("realtime.priority={}", c.placement.priority),
        fmt::format("realtime.wait={}", c.placement.priority > 0 ? "hybrid" : "block")};
    const Session session = load_session(session_file_, settings);
    std::vector<std::unique_ptr<Child>> children;
    children.reserve(static_cast<std::size_t>(wanted.viewers) + 3);
    for (int i = 0; i < wanted.viewers; ++i) {
      children.push_back(std::make_unique<Child>([&] { look_on(session); }));
    }
    const fs::path programs = fs::read_symlink("/proc/self/exe").parent_path();
    const auto start = [&](const std::string& name, int cpu) {
      std::vector<std::string> arguments = {"--session", session_file_.string()};
      for (const std::string& setting : settings) {
        arguments.insert(arguments.end(), {"--set", setting});
      }
      arguments.insert(arguments.end(), {"--set", fmt::format("realtime.cpu={}", cpu)});
      children.push_back(
          std::make_unique<Child>(programs / (name + "_node"), arguments, folder_ / "log"));
    };
    start("physics", -1);
    if (wanted.is_together) {
      start("device_mofc", c.placement.near_cpu);
    } else {
      start("mofc", c.placement.far_cpu);
      start("device", c.placement.near_cpu);
    }
    Measured measured = watch(session, seconds);
    while (!children.empty()) children.pop_back();  // the device first
    return measured;
  }

 private:
  static std::vector<Attachment> telemetry_of(const Session& session) {
    return {connect_to(session.side().links.device_telemetry, "links.device_telemetry"),
            connect_to(session.side().links.mofc_telemetry, "links.mofc_telemetry"),
            connect_to(session.physics_telemetry, "links.physics_telemetry")};
  }

  static void look_on(const Session& session) {
    const SteadyClock clock;
    ZmqContext context;
    TelemetrySubscriber subscriber(context, clock, telemetry_of(session));
    TelemetryMessage message;
    TimePoint received_at;
    for (;;) {
      subscriber.wait_until(clock.now() + 1s);
      while (subscriber.receive(message, received_at)) {
      }
    }
  }

  /// Receives the telemetry of the device.
  Measured watch(const Session& session, double seconds) const {
    const SteadyClock clock;
    ZmqContext context;
    TelemetrySubscriber subscriber(context, clock, telemetry_of(session));
    TelemetryMessage message;
    TimePoint received_at;
    Measured measured;
    std::optional<TimePoint> answered_since;  // the device's clock, which is this one
    std::optional<DeviceCounters> before;
    const TimePoint deadline = clock.now() + 10s + from_seconds(seconds);
    for (;;) {
      if (clock.now() > deadline) {
        throw SetupError("the nodes do not run: see " + (folder_ / "log").string());
      }
      subscriber.wait_until(clock.now() + 50ms);
      while (subscriber.receive(message, received_at)) {
        const auto* batch = std::get_if<DeviceBatch>(&message);
        if (batch == nullptr) continue;
        for (const DeviceTick& tick : batch->records) {
          if (!answered_since && tick.is_answered) answered_since = tick.sampled_at;
          if (!before) continue;
          measured.round_trips_us.push_back(tick.is_answered ? micro(tick.reply_time) : kInfinity);
        }
        if (!answered_since || batch->header.sampled_at < *answered_since + kWarmUp) continue;
        const DeviceCounters& now = batch->counters;
        if (!before) before = now;
        if (batch->header.sampled_at < *answered_since + kWarmUp + from_seconds(seconds)) continue;
        const auto scheduled = [](const DeviceCounters& counters) {
          return static_cast<double>(counters.loop.ticks + counters.loop.skipped_ticks);
        };
        measured.answered_ratio = static_cast<double>(now.answered_ticks - before->answered_ticks) /
                                  (scheduled(now) - scheduled(*before));
        std::sort(measured.round_trips_us.begin(), measured.round_trips_us.end());
        return measured;
      }
    }
  }

  fs::path session_file_;
  fs::path folder_;
};

// --- the table --------------------------------------------------------------------------------

constexpr std::array kQuantiles{0.5, 0.99, 0.999, 1.0};
constexpr std::array kQuantileNames{"p50", "p99", "p99.9"};

/// One link in one case, round by round.
using Rounds = std::vector<Measured>;

/// Over the rounds: the median, and the quartiles.
struct Spread {
  double low = kNaN;
  double middle = kNaN;
  double high = kNaN;
};

Spread spread_of(const std::vector<double>& values) {
  return {quantile(values, 0.25), quantile(values, 0.5), quantile(values, 0.75)};
}

Spread spread_of(const Rounds& rounds, const std::function<double(const Measured&)>& figure) {
  std::vector<double> values;
  for (const Measured& round : rounds) values.push_back(figure(round));
  return spread_of(values);
}

Spread spread_of(const Rounds& rounds, double q) {
  return spread_of(rounds, [&](const Measured& m) { return quantile(m.round_trips_us, q); });
}

/// Of the quotients of the two in the same round.
Spread quotient(const Rounds& rounds, const Rounds& of, double q) {
  std::vector<double> values;
  for (std::size_t i = 0; i < rounds.size(); ++i) {
    values.push_back(quantile(rounds[i].round_trips_us, q) / quantile(of[i].round_trips_us, q));
  }
  return spread_of(values);
}

constexpr const char* kExchange = "palpate, ipc";
constexpr const char* kViewed = "palpate, ipc, 8 viewers";
constexpr const char* kTogether = "palpate, --together";
constexpr const char* kRaw = "ZeroMQ ipc";
constexpr const char* kRawInproc = "ZeroMQ inproc";
constexpr const char* kGazebo = "Gazebo Transport";

std::string case_text(const Case& c) {
  return fmt::format("{}, {:g} kHz, {}", c.placement.label, 1e-3 * c.rate_hz,
                     c.is_loaded ? "loaded" : "idle");
}

// The messages of an ordinary tick in contact.
DeviceState ordinary_state() {
  const Vector3 position_m(0.011, -0.002, -0.004);
  DeviceState state{.header = {.session_id = ~0ULL, .sequence = 1000, .sampled_at = TimePoint(1h)},
                    .hand_position_m = position_m,
                    .tool_position_world_m = position_m};
  // the previous command acted until the switch, this one since then
  state.applied_count = 2;
  state.applied[0] = {.force_on_hand_newton = Vector3(0.1, 0.2, 1.0),
                      .from = TimePoint(1h) - 1ms,
                      .until = TimePoint(1h) - 900us,
                      .hand_position_at_end_m = position_m};
  state.applied[1] = {.force_on_hand_newton = Vector3(0.1, 0.2, 1.1),
                      .from = TimePoint(1h) - 900us,
                      .until = TimePoint(1h),
                      .hand_position_at_end_m = position_m};
  return state;
}
ForceCommand ordinary_command() {
  return {.header = {.session_id = ~0ULL, .sequence = 1000, .sampled_at = TimePoint(1h)},
          .answers_session_id = ~0ULL,
          .answers_sequence = 1000,
          .force_on_hand_newton = Vector3(0.1, 0.2, 1.0),
          .valid_for = 2ms};
}
EchoBytes exchange_bytes() {
  return {.there = Codec<DeviceState>().encode(ordinary_state()),
          .back = Codec<ForceCommand>().encode(ordinary_command())};
}

/// The links of one case, in the order of the table.
struct CaseResults {
  Case measured_case;
  std::vector<std::pair<std::string, Rounds>> links{};

  [[nodiscard]] const Rounds* find(const char* link) const {
    for (const auto& [name, rounds] : links) {
      if (name == link) return &rounds;
    }
    return nullptr;
  }
};

struct Link {
  const char* name;
  std::function<Measured(const Case&)> measure;
};

struct Plan {
  int rounds = 0;
  double seconds = 0.0;  ///< of each measurement
  bool has_goals_only = false;
};

std::vector<Link> links_of(const Case& c, const Deployment& deployment, const fs::path& folder,
                           const Plan& plan) {
  const EchoBytes bytes = exchange_bytes();
  std::vector<Link> links;
  const auto add_exchange = [&](const char* name, const Deployment::Wanted& wanted) {
    links.push_back({name, [&deployment, wanted, seconds = plan.seconds](const Case& of) {
                       return deployment.measure(of, wanted, seconds);
                     }});
  };
  const auto add_echo = [&](const char* name, const auto& make) {
    links.push_back({name, [make, seconds = plan.seconds](const Case& of) {
                       return measure(*make(), of, seconds);
                     }});
  };
  add_exchange(kExchange, {});
  add_echo(kRaw, [bytes, folder] { return zmq_ipc_echo(bytes, folder.string()); });
  if (!plan.has_goals_only || !c.is_loaded) add_exchange(kViewed, {.viewers = 8});
#ifdef PALPATE_HAS_GAZEBO_TRANSPORT
  if (!plan.has_goals_only || !c.is_loaded) {
    add_echo(kGazebo, [bytes] { return gazebo_transport_echo(bytes); });
  }
#endif
  if (plan.has_goals_only) return links;
  add_exchange(kTogether, {.is_together = true});
  if (c.placement.near_cpu == c.placement.far_cpu) {
    add_echo(kRawInproc, [bytes] { return zmq_inproc_echo(bytes); });
  }
  add_echo("Unix stream", [bytes] { return unix_echo(bytes, SOCK_STREAM); });
  add_echo("Unix datagram", [bytes] { return unix_echo(bytes, SOCK_DGRAM); });
  add_echo("shared memory, futex", [bytes] { return shared_memory_echo(bytes); });
  return links;
}

/// Every link of every case once in each round, in alternating order, so that other work on the
/// machine affects all of them.
std::vector<CaseResults> run_cases(const std::vector<Case>& cases, const Deployment& deployment,
                                   const fs::path& folder, const Plan& plan) {
  struct Turn {
    std::size_t in_case;
    std::size_t in_links;
    std::function<Measured(const Case&)> measure;
  };
  std::vector<CaseResults> results;
  std::vector<Turn> turns;
  for (const Case& c : cases) {
    results.push_back({c});
    for (const Link& link : links_of(c, deployment, folder, plan)) {
      turns.push_back({results.size() - 1, results.back().links.size(), link.measure});
      results.back().links.emplace_back(link.name, Rounds{});
    }
  }
  for (int round = 0; round < plan.rounds; ++round) {
    std::fprintf(stderr, "round %d of %d …\n", round + 1, plan.rounds);
    for (const Turn& turn : turns) {
      const Case& c = cases[turn.in_case];
      std::vector<std::unique_ptr<Child>> load;
      for (int cpu = 0; c.is_loaded && cpu < 2; ++cpu) {
        load.push_back(std::make_unique<Child>([cpu] {
          take_scheduling(0, cpu);
          for (volatile std::uint64_t n = 0;;) n = n + 1;
        }));
      }
      results[turn.in_case].links[turn.in_links].second.push_back(turn.measure(c));
    }
    std::reverse(turns.begin(), turns.end());
  }
  return results;
}

void print_goals(const CaseResults& idle, const CaseResults& loaded) {
  const auto line = [](const std::string& what, const Spread& is, double goal) {
    const char* verdict = is.middle <= goal ? "met" : "missed";
    if (is.low <= goal && !(is.high <= goal)) verdict = "undecided: the rounds disagree";
    std::printf("  %-42s %5.2f (%.2f … %.2f)   goal ≤ %.2f  %s\n", what.c_str(), is.middle, is.low,
                is.high, goal, verdict);
  };
  std::printf("\nGoals; median of the quotients within a round, and their quartiles:\n");
  for (const auto& [results, goals] :
       {std::pair{&idle, std::array{1.4, 1.5, 1.5}}, {&loaded, std::array{1.4, 2.0, 2.5}}}) {
    for (std::size_t k = 0; k < goals.size(); ++k) {
      line(fmt::format("{}: exchange / ZeroMQ, {}",
                       results->measured_case.is_loaded ? "loaded" : "idle", kQuantileNames[k]),
           quotient(*results->find(kExchange), *results->find(kRaw), kQuantiles[k]), goals[k]);
    }
  }
  const Rounds& exchange = *idle.find(kExchange);
  if (const Rounds* gazebo = idle.find(kGazebo)) {
    line("idle: exchange / Gazebo Transport, p50", quotient(exchange, *gazebo, 0.5), 1.0);
  }
  line("idle: 8 viewers / none, p50", quotient(*idle.find(kViewed), exchange, 0.5), 1.15);
  line("loaded / idle exchange, p99", quotient(*loaded.find(kExchange), exchange, 0.99), 1.5);
}

// --- parts ------------------------------------------------------------------------------------

template <class T>
void add_codec_row(Table& table, const char* name, const T& message) {
  constexpr int kTurns = 200'000;
  const SteadyClock clock;
  Codec<T> codec;
  std::vector<std::byte> frame(codec.encode(message));
  const auto ns_per_turn = [&](const auto& turn) {
    const TimePoint begin = clock.now();
    for (int i = 0; i < kTurns; ++i) turn();
    return 1e9 * to_seconds(clock.now() - begin) / kTurns;
  };
  const double encode_ns = ns_per_turn([&] {
    frame.resize(codec.encode(message));
    codec.write(frame.data());
  });
  T decoded;
  const double decode_ns = ns_per_turn([&] {
    if (codec.decode(frame, decoded) != DecodeError::kNone) std::abort();
  });
  table.add({std::string(name), static_cast<double>(frame.size()), encode_ns, decode_ns});
}

void print_codec() {
  Table table({{"message", "message", ""},
               {"bytes", "bytes", "{:.0f}"},
               {"encode_ns", "encode ns", "{:.0f}"},
               {"decode_ns", "decode, check ns", "{:.0f}"}});
  add_codec_row(table, "DeviceState", ordinary_state());
  add_codec_row(table, "ForceCommand", ordinary_command());
  std::printf("\nCodec\n%s", table.text().c_str());
}

void print_lateness(bool has_fifo, double seconds) {
  Table table({{"scheduling", "scheduling", ""},
               {"wait", "wait", ""},
               {"rate_hz", "Hz", "{:.0f}"},
               {"p50_us", "p50 µs", "{:.1f}"},
               {"p99_us", "p99 µs", "{:.1f}"},
               {"p999_us", "p99.9 µs", "{:.1f}"},
               {"cpu_percent", "processor %", "{:.1f}"}});
  for (const int priority : {80, 0}) {
    if (priority > 0 && !has_fifo) continue;
    for (const auto& [name, wait] :
         {std::pair{"hybrid", WaitStrategy::kHybrid}, std::pair{"block", WaitStrategy::kBlock}}) {
      for (const double rate_hz : {1000.0, 4000.0}) {
        const auto turns = static_cast<std::size_t>(rate_hz * seconds);
        SharedNumbers numbers(turns + 1);
        Child child([&, strategy = wait] {
          take_scheduling(priority, priority > 0 ? 0 : -1);
          SteadyClock clock(strategy);
          std::stop_source stop;
          std::size_t begun = 0;
          RateLoop(clock, rate_hz).run(stop.get_token(), [&](const Tick& tick) {
            numbers.add(micro(tick.now - tick.scheduled_at));
            if (++begun == turns) stop.request_stop();
          });
          timespec used{};
          clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
          numbers.add(
              100.0 *
              (static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec)) /
              seconds);
        });
        if (!child.wait()) throw SetupError("a periodic loop failed");
        std::vector<double> lateness = numbers.all();
        const double cpu_percent = lateness.back();
        lateness.pop_back();
        table.add({std::string(priority > 0 ? "FIFO" : "ordinary"), std::string(name), rate_hz,
                   quantile(lateness, 0.5), quantile(lateness, 0.99), quantile(lateness, 0.999),
                   cpu_percent});
      }
    }
  }
  std::printf("\nLateness of a periodic loop\n%s", table.text().c_str());
}

// --- run --------------------------------------------------------------------------------------

void draw(const fs::path& folder, const CaseResults& results) {
  std::string data;
  for (const auto& [name, rounds] : results.links) {
    data += fmt::format("\"{}\" {} {} {}\n", name, spread_of(rounds, 0.5).middle,
                        spread_of(rounds, 0.99).middle, spread_of(rounds, 0.999).middle);
  }
  fs::create_directories(folder);
  write_file(folder / "exchange.txt", data);
  draw_figure(folder, "exchange",
              R"(set terminal svg size 760,420 dynamic background rgb 'white' font 'sans,13'
set output 'exchange.svg'
set title 'Round trip, )" +
                  case_text(results.measured_case) +
                  R"('
set style data histogram
set style fill solid
set logscale y
set ylabel 'µs'
set xtics rotate by -30
set grid y
plot 'exchange.txt' using 2:xtic(1) title 'p50', '' using 3 title 'p99', '' using 4 title 'p99.9'
)");
}

void run(const BenchOptions& options) {
  const test::RunFolder folder;  // the endpoints of the nodes and echoes
  const Deployment deployment(fs::path(test::source_dir()) / "deploy/sessions/default.txtpb",
                              folder.path());
  const bool has_fifo = may_use_fifo(kOneProcessor.priority);
  if (!has_fifo) {
    std::printf(
        "SCHED_FIFO is not permitted (ulimit -r %d permits it): ordinary scheduling only.\n",
        kOneProcessor.priority);
  }
  std::vector<Case> wanted;
  if (has_fifo) wanted = {{kOneProcessor, 1000.0, false}, {kOneProcessor, 1000.0, true}};
  if (has_fifo && !options.is_quick) {
    wanted.insert(wanted.end(), {{kOneProcessor, 4000.0, false},
                                 {kOneProcessor, 4000.0, true},
                                 {kTwoProcessors, 1000.0, false}});
  }
  if (!has_fifo || !options.is_quick) {
    wanted.insert(wanted.end(), {{kOrdinary, 1000.0, false}, {kOrdinary, 1000.0, true}});
  }
  const Plan plan{
      .rounds = options.is_quick ? 6 : 9, .seconds = 1.0, .has_goals_only = options.is_quick};

  const EchoBytes bytes = exchange_bytes();
  std::printf("%zu bytes there, %zu back; %d rounds of %g s; medians over the rounds; load %s\n\n",
              bytes.there, bytes.back, plan.rounds, plan.seconds, machine_load().c_str());
  const std::vector<CaseResults> cases = run_cases(wanted, deployment, folder.path(), plan);

  Table table({{"case", "case", ""},
               {"link", "link", ""},
               {"p50_us", "p50 µs", "{:.1f}"},
               {"p99_us", "p99 µs", "{:.1f}"},
               {"p999_us", "p99.9 µs", "{:.1f}"},
               {"max_us", "max µs", "{:.0f}"},
               {"p50_to_raw", "p50 / ZeroMQ", "{:.2f}"},
               {"p99_to_raw", "p99 / ZeroMQ", "{:.2f}"},
               {"p999_to_raw", "p99.9 / ZeroMQ", "{:.2f}"},
               {"answered_percent", "answered %", "{:.3f}"}});
  for (const CaseResults& results : cases) {
    const Rounds& raw = *results.find(kRaw);
    for (const auto& [name, rounds] : results.links) {
      std::vector<Table::Cell> row{case_text(results.measured_case), name};
      for (const double q : kQuantiles) row.emplace_back(spread_of(rounds, q).middle);
      for (std::size_t k = 0; k < kQuantileNames.size(); ++k) {
        row.emplace_back(quotient(rounds, raw, kQuantiles[k]).middle);
      }
      row.emplace_back(
          100.0 * spread_of(rounds, [](const Measured& m) { return m.answered_ratio; }).middle);
      table.add(std::move(row));
    }
    table.add_gap();
  }
  table.publish(options);
  std::printf(
      "palpate: device_node's time from sending to the decoded answer; –: not by the deadline, 0.9 "
      "periods. One viewer,\nwhich collects the figures, is always connected. Loaded: a busy loop "
      "on each processor.\n");
  print_goals(cases[0], cases[1]);
  print_codec();
  if (!options.is_quick) print_lateness(has_fifo, 2.0);
  if (!options.plot_folder.empty()) draw(options.plot_folder, cases.front());
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app(
      "Round trip device, mofc, device compared with plain echoes of the same bytes. With --quick "
      "only what the goals compare.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv, [&] { palpate::bench::run(options); });
}
