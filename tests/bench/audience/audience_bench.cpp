// SPDX-License-Identifier: Apache-2.0
// audience_bench — the cost of an audience: many WebSocket clients of one viewer_node that follows
// a relay, beside the haptic loop, which has a processor of its own; the row without audience is
// the comparison.
#include <sched.h>
#include <spdlog/fmt/fmt.h>
#include <sys/resource.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/link/telemetry_subscriber.h"
#include "common/session/session_file.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/quantile.h"
#include "tests/bench/audience/web_audience.h"
#include "tests/bench/bench_output.h"
#include "tests/support/peak_memory.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate::bench {
namespace {

using test::Program;

constexpr double kRateHz = 1000.0;
constexpr double kAudienceHz = 10.0;
/// With reconnects: the clients share one processor with their server here.
constexpr double kReconnectHz = 2.0;
constexpr auto kPatience = std::chrono::minutes(3);
constexpr int kFollowers = 20;  // of the relay, in the row that shows what one costs
// of the estimate on paper
constexpr double kFullCore_percent = 70.0;
constexpr int kHostProcessors = 8;

/// Two tissues, each drawn with about 10 000 vertices; the hand slides over both and dents them.
constexpr const char* kAudienceSession = R"(
name: "audience"
device { rate_hz: 1000 simulated {} }
hand { sinusoid { center_m { z: -0.001 } amplitude_m { x: 0.02 y: 0.01 z: 0.004 } frequency_hz { x: 0.2 y: 0.3 z: 1 } } }
physics { rate_hz: 1000 }
scene {
  tool { tip_radius_m: 0.004 }
  tissue { name: "bed" half_space {} kelvin_voigt { stiffness_newton_per_m: 300 damping_newton_s_per_m: 1 } }
  tissue { name: "organ" sphere { center_m { x: 0.02 z: -0.025 } radius_m: 0.03 } kelvin_voigt { stiffness_newton_per_m: 300 damping_newton_s_per_m: 1 } }
}
viewer { web { port: 0 } }
)";

/// The calling thread, and what it starts from now on, run on these processors.
void run_on(const std::vector<std::size_t>& processors) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const std::size_t processor : processors) CPU_SET(processor, &set);
  if (sched_setaffinity(0, sizeof(set), &set) != 0) throw SetupError("cannot set the affinity");
}

double processor_s(pid_t pid) {
  clockid_t clock{};
  timespec used{};
  if (clock_getcpuclockid(pid, &clock) != 0 || clock_gettime(clock, &used) != 0) return kNaN;
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

/// A relay, and a viewer_node that follows it.
class Viewers {
 public:
  Viewers(const std::string& session, const std::string& endpoint, std::size_t clients,
          double rate_hz = kAudienceHz)
      : relay_("viewer_node", {"--session", session, "--quiet", "--no-web", "--publish", endpoint}),
        viewer_((relay_.await_err("event=relay endpoint="), "viewer_node"),
                {"--session", session, "--quiet", "--follow", endpoint, "--listen", "127.0.0.1:0",
                 "--audience", std::to_string(clients), "--audience-rate",
                 fmt::format("{}", rate_hz)}) {
    const std::string url = viewer_.await_err("event=web url=http://127.0.0.1:");
    if (url.empty()) throw SetupError("viewer_node does not serve:\n" + viewer_.err());
    port_ = static_cast<std::uint16_t>(std::stoi(url));
  }
  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] pid_t viewer_pid() const { return viewer_.pid(); }
  [[nodiscard]] double relay_s() const { return processor_s(relay_.pid()); }
  [[nodiscard]] double viewer_s() const { return processor_s(viewer_.pid()); }

 private:
  Program relay_;
  Program viewer_;
  std::uint16_t port_ = 0;
};

/// Further followers of the relay, as so many viewer_nodes on other hosts would be.
class Followers {
 public:
  Followers(const std::string& endpoint, std::size_t count)
      : thread_([this, endpoint, count](const std::stop_token& stop) {
          SteadyClock clock;
          std::vector<std::unique_ptr<TelemetrySubscriber>> followers;
          for (std::size_t i = 0; i < count; ++i) {
            followers.push_back(std::make_unique<TelemetrySubscriber>(
                context_, clock, std::vector{connect_to(endpoint, std::string(kRelayLink))}));
            followers.back()->subscribe<SceneState>();
            followers.back()->subscribe<MeshFrame>();
          }
          TelemetryMessage message;
          TimePoint at;
          while (!stop.stop_requested()) {
            for (const auto& follower : followers) {
              while (follower->receive(message, at)) {
              }
            }
            clock.sleep_until(clock.now() + std::chrono::milliseconds(20));
          }
        }) {}

 private:
  ZmqContext context_;
  std::jthread thread_;
};

void await_scenes(const WebAudience& audience, std::size_t clients) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (audience.with_scene() < clients) {
    if (std::chrono::steady_clock::now() > deadline || audience.lost() > 0) {
      throw SetupError(fmt::format("{} of {} clients have the scene, {} are lost",
                                   audience.with_scene(), clients, audience.lost()));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

class Bench {
 public:
  Bench(std::string session, double seconds)
      : session_(std::move(session)),
        ticks_(static_cast<std::size_t>(seconds * kRateHz)),
        launch_(start(session_)),
        watcher_(load_session(session_), links_) {
    if (!watcher_.until([&] { return watcher_.sees_all_nodes(); })) {
      throw SetupError("the nodes do not run:\n" + launch_->err());
    }
    wait_for(2 * static_cast<std::size_t>(kRateHz));
  }
  ~Bench() {
    launch_->send_signal(SIGTERM);
    launch_->wait();
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

  /// What the estimate on paper needs, in % of a processor.
  struct Load {
    double viewer_percent = kNaN;
    double relay_percent = kNaN;
    double bytes_per_s = kNaN;
  };
  /// One row. @param clients  0: neither relay nor viewer_node
  /// @param followers  of the relay, viewer_node included
  Load measure(std::size_t clients, std::size_t followers, const std::string& relay_endpoint,
               Table& table) {
    std::optional<Viewers> viewers;
    std::optional<WebAudience> audience;
    std::optional<Followers> others;
    double joined_s = kNaN;
    if (clients > 0) {
      const auto begin = std::chrono::steady_clock::now();
      viewers.emplace(session_, relay_endpoint, clients);
      audience.emplace(viewers->port(), clients);
      await_scenes(*audience, clients);
      joined_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    }
    if (followers > 1) others.emplace(relay_endpoint, followers - 1);
    wait_for(static_cast<std::size_t>(kRateHz));

    const auto counts = [&] {
      struct Counts {
        std::chrono::steady_clock::time_point at = std::chrono::steady_clock::now();
        double viewer_s = kNaN, relay_s = kNaN, clients_s = kNaN;
        double bytes = kNaN, messages = kNaN, mesh_bytes = kNaN;
        std::vector<std::uint64_t> meshes{};
      } now;
      if (!audience) return now;
      now.viewer_s = viewers->viewer_s();
      now.relay_s = viewers->relay_s();
      now.clients_s = audience->processor_s();
      now.bytes = static_cast<double>(audience->bytes());
      now.messages = static_cast<double>(audience->messages());
      now.mesh_bytes = static_cast<double>(audience->mesh_bytes());
      now.meshes = audience->meshes();
      return now;
    };
    const auto before = counts();
    const std::size_t first = watcher_.rows().size();
    wait_for(ticks_);
    const auto after = counts();
    if (audience && audience->lost() > 0) {
      throw SetupError(fmt::format("{} clients were lost", audience->lost()));
    }

    const double span_s = std::chrono::duration<double>(after.at - before.at).count();
    std::vector<double> rates_hz;
    double meshes = 0.0;
    for (std::size_t i = 0; i < after.meshes.size(); ++i) {
      const auto count = static_cast<double>(after.meshes[i] - before.meshes[i]);
      meshes += count;
      rates_hz.push_back(count / span_s);
    }
    auto [lateness_us, answered_percent] = ticks_since(first);
    const double all = static_cast<double>(clients);
    const Load load{.viewer_percent = 100.0 * (after.viewer_s - before.viewer_s) / span_s,
                    .relay_percent = 100.0 * (after.relay_s - before.relay_s) / span_s,
                    .bytes_per_s = (after.bytes - before.bytes) / span_s};
    table.add(
        {all, static_cast<double>(followers), rates_hz.empty() ? kNaN : quantile(rates_hz, 0.5),
         rates_hz.empty() ? kNaN : quantile(rates_hz, 0.0),
         (after.mesh_bytes - before.mesh_bytes) / meshes, 1e-3 * load.bytes_per_s / all,
         1e-6 * load.bytes_per_s, (after.messages - before.messages) / span_s, load.viewer_percent,
         load.relay_percent, 100.0 * (after.clients_s - before.clients_s) / span_s, joined_s,
         quantile(lateness_us, 0.5), quantile(lateness_us, 0.99), quantile(lateness_us, 0.999),
         answered_percent});
    return load;
  }

  /// All clients of an audience come back at once, `times` times; a row each, the first without.
  void measure_reconnects(std::size_t clients, std::size_t times, const std::string& relay_endpoint,
                          Table& table) {
    const Viewers viewers(session_, relay_endpoint, clients, kReconnectHz);
    WebAudience audience(viewers.port(), clients);
    for (std::size_t round = 0; round <= times; ++round) {
      test::restart_peak_memory(viewers.viewer_pid());
      const std::size_t retries = audience.retries();
      const std::size_t first = watcher_.rows().size();
      const auto begin = std::chrono::steady_clock::now();
      if (round > 0) audience.reconnect();
      await_scenes(audience, clients);
      const double joined_s =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      wait_for(ticks_);
      if (audience.lost() > 0) {
        throw SetupError(fmt::format("{} clients were lost", audience.lost()));
      }
      Ticks ticks = ticks_since(first);
      table.add({static_cast<double>(round), static_cast<double>(clients), joined_s,
                 static_cast<double>(audience.retries() - retries),
                 static_cast<double>(audience.lost()), test::peak_memory_mib(viewers.viewer_pid()),
                 quantile(ticks.lateness_us, 0.99), ticks.answered_percent});
    }
  }

 private:
  struct Ticks {
    std::vector<double> lateness_us;
    double answered_percent = kNaN;
  };
  [[nodiscard]] Ticks ticks_since(std::size_t first) const {
    Ticks ticks;
    double answered = 0.0;
    for (std::size_t i = first; i < watcher_.rows().size(); ++i) {
      const DeviceTick& tick = watcher_.rows()[i].device;
      ticks.lateness_us.push_back(1e6 * to_seconds(tick.lateness));
      answered += tick.is_answered ? 1.0 : 0.0;
    }
    ticks.answered_percent = 100.0 * answered / static_cast<double>(ticks.lateness_us.size());
    return ticks;
  }
  /// On processor 0; everything that is started later runs on the others.
  static std::unique_ptr<Program> start(const std::string& session) {
    const std::size_t processors = std::thread::hardware_concurrency();
    if (processors < 2) throw SetupError("audience_bench needs two processors");
    run_on({0});
    auto launch = std::make_unique<Program>(
        "palpate", std::vector<std::string>{"launch", session, "--no-viewer"});
    std::vector<std::size_t> others;
    for (std::size_t i = 1; i < processors; ++i) others.push_back(i);
    run_on(others);
    return launch;
  }
  void wait_for(std::size_t ticks) {
    const TimePoint end =
        SteadyClock().now() + from_seconds(3.0 * static_cast<double>(ticks) / kRateHz + 30.0);
    const std::size_t wanted = watcher_.rows().size() + ticks;
    while (watcher_.rows().size() < wanted) {
      if (SteadyClock().now() > end) throw SetupError("the ticks stopped:\n" + launch_->err());
      static_cast<void>(watcher_.until([&] { return watcher_.rows().size() >= wanted; }));
    }
  }

  std::string session_;
  std::size_t ticks_;
  std::unique_ptr<Program> launch_;
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  test::Watcher watcher_;
};

/// @param reconnects  0: the cost of the audience; else all clients come back so many times
void measure_audience(const BenchOptions& options, std::size_t clients, double seconds,
                      std::size_t reconnects) {
  // each client of this program is a file descriptor here and one in viewer_node
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) == 0) {
    files.rlim_cur = std::max(files.rlim_cur, std::min<rlim_t>(files.rlim_max, clients + 256));
    setrlimit(RLIMIT_NOFILE, &files);
  }
  const test::TempFolder folder;
  const std::string session = folder.write("audience.txtpb", kAudienceSession);
  const std::string relay = "ipc://" + (folder.path() / "relay" / "hop5").string();
  if (reconnects > 0) {
    Table table({{"round", "round", "{:.0f}"},
                 {"clients", "clients", "{:.0f}"},
                 {"joined_s", "all have the scene after s", "{:.1f}"},
                 {"retries", "attempts refused", "{:.0f}"},
                 {"lost", "disconnected", "{:.0f}"},
                 {"viewer_peak_mib", "viewer_node, MiB at most", "{:.0f}"},
                 {"lateness_p99_us", "lateness p99 µs", "{:.0f}"},
                 {"answered_percent", "answered %", "{:.2f}"}});
    Bench(session, seconds).measure_reconnects(clients, reconnects, relay, table);
    table.publish(options);
    std::printf("Round 0: they join one after another. Load average %s.\n", machine_load().c_str());
    return;
  }
  Table table({{"clients", "clients", "{:.0f}"},
               {"followers", "followers of the relay", "{:.0f}"},
               {"meshes_per_s", "meshes/s and client", "{:.1f}"},
               {"least_meshes_per_s", "least", "{:.1f}"},
               {"bytes_per_mesh", "bytes/mesh", "{:.0f}"},
               {"kilobytes_per_s_and_client", "kB/s and client", "{:.1f}"},
               {"megabytes_per_s", "MB/s", "{:.1f}"},
               {"messages_per_s", "messages/s", "{:.0f}"},
               {"viewer_core_percent", "viewer_node, % of a core", "{:.1f}"},
               {"relay_core_percent", "relay, %", "{:.1f}"},
               {"clients_core_percent", "clients, %", "{:.1f}"},
               {"joined_s", "all joined after s", "{:.1f}"},
               {"lateness_p50_us", "lateness p50 µs", "{:.0f}"},
               {"lateness_p99_us", "p99", "{:.0f}"},
               {"lateness_p999_us", "p99.9", "{:.0f}"},
               {"answered_percent", "answered %", "{:.2f}"}});
  Bench bench(session, seconds);
  bench.measure(0, 0, relay, table);
  const Bench::Load alone = bench.measure(clients / 10, 1, relay, table);
  const Bench::Load shared = bench.measure(clients / 10, kFollowers, relay, table);
  const Bench::Load all = bench.measure(clients, 1, relay, table);
  bench.measure(0, 0, relay, table);
  table.publish(options);
  std::printf(
      "%.0f s each row; load average %s. The nodes run on processor 0, relay, viewer_node and "
      "clients on the\n"
      "others. The clients read what a page reads, at %.0f Hz; the two rows without show the "
      "scatter.\n",
      seconds, machine_load().c_str(), kAudienceHz);

  // the relay's cost of one more follower, and viewer_node's of one more client
  const double per_follower = (shared.relay_percent - alone.relay_percent) / (kFollowers - 1);
  const auto tenth = clients / 10;
  const double per_client =
      (all.viewer_percent - alone.viewer_percent) / static_cast<double>(clients - tenth);
  const double per_core = kFullCore_percent / per_client;
  const double bits_per_s = 8.0 * all.bytes_per_s / static_cast<double>(clients);
  std::printf(
      "On paper: a client costs %.4f %% of a processor, a follower %.2f %% of the relay's. One\n"
      "viewer_node serves %.0f clients with %.0f %% of a processor. Ten hosts of %d processors: "
      "%.0f\nclients, %.1f Gbit/s each host; their viewer_nodes take %.0f %% of the relay's "
      "processor.\n",
      per_client, per_follower, per_core, kFullCore_percent, kHostProcessors,
      10.0 * kHostProcessors * per_core, 1e-9 * bits_per_s * kHostProcessors * per_core,
      alone.relay_percent + 10.0 * kHostProcessors * per_follower);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("The cost of an audience: many WebSocket clients beside the haptic loop.");
  palpate::bench::BenchOptions options;
  std::size_t clients = 1000;
  double seconds = 60.0;
  app.add_option("--clients", clients, "of viewer_node (default: 1000)")
      ->type_name("N")
      ->check(CLI::Range(10, 10'000));
  std::size_t reconnects = 0;
  app.add_option("--reconnects", reconnects,
                 "instead: all clients leave and come back at once, N times")
      ->type_name("N")
      ->check(CLI::Range(1, 100));
  app.add_option("--seconds", seconds, "of each row (default: 60; with --quick 10)")
      ->type_name("S")
      ->check(CLI::Range(1.0, 3600.0));
  return palpate::bench::run_bench(app, options, argc, argv, [&] {
    const palpate::test::RunFolder run_folder;  // apart from other sessions
    if (options.is_quick && app.count("--seconds") == 0) seconds = 10.0;
    palpate::bench::measure_audience(options, clients, seconds, reconnects);
  });
}
