// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/launch.h"

#include <unistd.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <condition_variable>
#include <csignal>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <variant>

#include "common/core/check.h"
#include "common/core/time.h"
#include "common/process/blocked_signals.h"
#include "common/process/log.h"
#include "common/process/realtime.h"
#include "common/process/run_node.h"
#include "common/session/session.h"
#include "common/session/session_file.h"
#include "common/telemetry/device_telemetry.h"
#include "deploy/launch/physics_command.h"
#include "deploy/launch/run_folder.h"

namespace palpate {
namespace {

namespace asio = boost::asio;
namespace fs = std::filesystem;

/// Start ramp of a restarted device if its session has none.
constexpr int kRestartRampMilliseconds = 500;

/// A stand-in for each real device; the device_nodes wait for it.
void add_emulators(const LaunchOptions& options, const Session& session, const fs::path& program,
                   std::vector<ChildSpec>& children) {
  for (const Side& side : session.sides) {
    if (!is_real(side.driver)) continue;
    ChildSpec& child =
        children.emplace_back(ChildSpec{.name = with_side(side.name, "emulator"),
                                        .program = program,
                                        .arguments = {"emulate", options.session_file.string()}});
    for (const std::string& assignment : options.overrides) {
      child.arguments.insert(child.arguments.end(), {"--set", assignment});
    }
    if (!side.name.empty()) child.arguments.insert(child.arguments.end(), {"--side", side.name});
    if (!options.is_realtime) child.arguments.emplace_back("--no-realtime");
  }
  if (children.empty()) {
    throw SetupError(session.file +
                     ": --emulate: the session's device is simulated already; leave "
                     "the option out");
  }
}

std::vector<ChildSpec> nodes_of(const LaunchOptions& options, const Session& session) {
  std::vector<std::string> arguments = {"--session", options.session_file.string()};
  for (const std::string& assignment : options.overrides) {
    arguments.insert(arguments.end(), {"--set", assignment});
  }
  if (!options.is_realtime) arguments.emplace_back("--no-realtime");
  if (options.is_insecure) arguments.emplace_back("--insecure");
  if (options.has_no_adversary) arguments.emplace_back("--no-adversary");
  if (options.is_quiet || options.has_short_log) {
    arguments.insert(arguments.end(), {"--log-level", "warn"});
  }

  const auto is_here = [&](const char* node) { return options.nodes.contains(node); };
  if (options.is_together && !(is_here("device") && is_here("mofc"))) {
    throw SetupError("--together device,mofc: both must be among --nodes");
  }

  const fs::path folder = options.program_folder.empty()
                              ? fs::read_symlink("/proc/self/exe").parent_path()
                              : options.program_folder;
  std::vector<ChildSpec> children;
  const auto add = [&](const std::string& name, const std::string& side = {}) -> ChildSpec& {
    const fs::path program = folder / (name + "_node");
    if (access(program.c_str(), X_OK) != 0) {
      throw SetupError(program.string() + ": " + std::generic_category().message(errno) +
                       "; build it with: cmake --build --preset release");
    }
    ChildSpec& child = children.emplace_back(
        ChildSpec{.name = with_side(side, name), .program = program, .arguments = arguments});
    if (!side.empty()) child.arguments.insert(child.arguments.end(), {"--side", side});
    return child;
  };

  if (options.is_emulated) add_emulators(options, session, folder / "palpate", children);

  // nodes that bind start before nodes that connect
  if (is_here("physics")) {
    if (session.physics_command.empty()) {
      add("physics");
    } else {
      children.push_back(physics_from_elsewhere(session, options.session_file, options.overrides,
                                                options.is_insecure));
      children.back().before_restart = options.before_restart;
    }
  }
  if (is_here("standby") && session.physics.standby) {
    ChildSpec& child = add("physics");
    child.name = "standby";
    child.arguments.emplace_back("--standby");
  }
  const std::vector<Side>& sides = session.sides;
  if (is_here("mofc") && !options.is_together) {
    for (const Side& side : sides) add("mofc", side.name);
  }
  for (std::size_t i = 0; is_here("device") && i < sides.size(); ++i) {
    ChildSpec& child = add(options.is_together ? "device_mofc" : "device", sides[i].name);
    if (options.is_unsafe) child.arguments.emplace_back("--unsafe");
    if (std::holds_alternative<PluginConfig>(sides[i].driver)) {
      child.before_restart = options.before_restart;
    }
    if (sides[i].device.start_ramp.count() > 0) continue;
    const std::string path = sides[i].name.empty() ? "" : "side[" + std::to_string(i) + "].";
    child.restart_arguments = {
        "--set", path + "device.start_ramp_ms=" + std::to_string(kRestartRampMilliseconds)};
  }
  if (is_here("viewer")) {
    ChildSpec& viewer = add("viewer");
    if (options.is_quiet) viewer.arguments.emplace_back("--quiet");
    viewer.descriptor = options.on_page ? options.on_page() : -1;
    if (viewer.descriptor >= 0) {
      viewer.arguments.insert(viewer.arguments.end(),
                              {"--listen-descriptor", std::to_string(viewer.descriptor)});
    }
  }
  return children;
}

/// The nodes of a kind at once.
std::vector<std::vector<std::string>> stop_order(const Session& session) {
  std::vector<std::vector<std::string>> stages;
  for (const char* node : {"device_mofc", "device", "mofc"}) {
    std::vector<std::string>& names = stages.emplace_back();
    for (const Side& side : session.sides) names.push_back(with_side(side.name, node));
  }
  for (const char* node : {"physics", "standby", "viewer"}) stages.push_back({node});
  return stages;
}

/// The highest of the ticks; 0: none.
int tick_priority(const LaunchOptions& options, const Session& session) {
  int priority = 0;
  for (const Side& side : session.sides) priority = std::max(priority, side.realtime.priority);
  return options.is_realtime ? priority : 0;
}

void write(const ChildEvent& event, spdlog::logger& log) {
  switch (event.kind) {
    case ChildEvent::Kind::kStarted:
      log.info("event=node_started node={} pid={}", event.name, event.pid);
      return;
    case ChildEvent::Kind::kDied:
      log.error("event=node_died node={} how=\"{}\" restart_in_ms={}", event.name, event.how,
                event.restart_in.count());
      return;
    case ChildEvent::Kind::kRefused:
      log.error("event=node_refused node={} how=\"{}\" remedy=\"see its message above\"",
                event.name, event.how);
      return;
    case ChildEvent::Kind::kStopped:
      log.info("event=node_stopped node={} how=\"{}\"", event.name, event.how);
      return;
    case ChildEvent::Kind::kKilled:
      log.warn("event=node_killed node={} how=\"{}\"", event.name, event.how);
      return;
  }
}

/// One run of the nodes. They are supervised in a thread of its own, ahead of their ticks: these
/// may saturate the processors, and must still be ended.
class Run {
 public:
  Run(const LaunchOptions& options, std::vector<ChildSpec> nodes, const Session& session,
      const RunFolder& folder, const BlockedSignals& blocked, spdlog::logger& log)
      : options_(options),
        folder_(folder),
        blocked_(blocked),
        log_(log),
        priority_(tick_priority(options, session)),
        signals_(io_, SIGINT, SIGTERM, SIGHUP),
        time_up_(io_),
        supervisor_(
            io_, std::move(nodes), stop_order(session), options.timing,
            [this](const ChildEvent& event) { on_event(event); }, [this] { on_end(); }) {
    for (const Side& side : session.sides) {
      if (std::holds_alternative<std::monostate>(side.driver)) continue;
      for (const char* node : {"device", "device_mofc"}) {
        real_devices_.push_back(with_side(side.name, node));
      }
    }
  }

  LaunchResult run(const std::stop_token& stop) {
    const auto begin = std::chrono::steady_clock::now();
    const std::stop_callback on_stop(
        stop, [this] { asio::post(io_, [this] { end(LaunchEnd::kRequested); }); });
    std::thread supervising([this] {
      run_ahead_of(priority_);
      blocked_.take();
      supervise();
    });
    std::exception_ptr failure;
    try {
      poll();
    } catch (...) {
      failure = std::current_exception();
      asio::post(io_, [this] { supervisor_.kill(); });
    }
    supervising.join();
    if (!failure) failure = failure_;
    if (!failure && options_.on_poll) options_.on_poll();
    if (options_.on_end) options_.on_end();
    if (failure) std::rethrow_exception(failure);
    return {.end = supervisor_.was_refused() ? LaunchEnd::kRefused : end_,
            .restarts = supervisor_.restarts(),
            .wall = std::chrono::steady_clock::now() - begin,
            .may_motors_push = may_motors_push_};
  }

 private:
  void on_event(const ChildEvent& event) {
    write(event, log_);
    const bool has_ended_badly =
        event.kind == ChildEvent::Kind::kKilled ||
        (event.kind == ChildEvent::Kind::kStopped && event.how != "exit status 0");
    if (!has_ended_badly ||
        std::find(real_devices_.begin(), real_devices_.end(), event.name) == real_devices_.end()) {
      return;
    }
    may_motors_push_ = true;
    log_.error("event=release_unconfirmed node={} remedy=\"{}\"", event.name,
               kReleaseUnconfirmedText);
  }

  /// Returns when no node is left.
  void supervise() {
    try {
      await_signal();
      supervisor_.start();
      if (options_.seconds) await_time_up(*options_.seconds);
      io_.run();
    } catch (...) {
      // end all nodes before the caller sees the exception
      failure_ = std::current_exception();
      supervisor_.kill();
      io_.restart();
      io_.run();
    }
    const std::lock_guard lock(mutex_);
    has_ended_ = true;
    ended_.notify_all();
  }

  /// Returns when the nodes have ended. Throws what on_poll() throws.
  void poll() {
    std::unique_lock lock(mutex_);
    while (!has_ended_) {
      lock.unlock();
      check_folder();
      if (options_.on_poll) options_.on_poll();
      lock.lock();
      ended_.wait_for(lock, options_.poll_interval, [this] { return has_ended_; });
    }
  }

  /// Without it the nodes run on, but one that is started again finds no other.
  void check_folder() {
    if (is_folder_lost_ || folder_.is_present()) return;
    is_folder_lost_ = true;
    log_.error(
        "event=run_folder_lost folder={} how=\"removed, or replaced by another launch\" "
        "remedy=\"stop this launch and start it again: a node that is restarted cannot reach the "
        "others\"",
        folder_.path().string());
  }

  void await_signal() {
    signals_.async_wait([this](const boost::system::error_code& error, int signal) {
      if (error) return;
      if (is_ending_) {
        supervisor_.kill();
        return;
      }
      log_.info("event=stopping signal={}", signal);
      await_signal();
      end(LaunchEnd::kSignal);
    });
  }

  void await_time_up(double seconds) {
    time_up_.expires_after(from_seconds(seconds));
    time_up_.async_wait([this](const boost::system::error_code& error) {
      if (!error) end(LaunchEnd::kTimeUp);
    });
  }

  void end(LaunchEnd why) {
    if (is_ending_) return;
    is_ending_ = true;
    end_ = why;
    supervisor_.stop();
  }

  /// Called when no node is left.
  void on_end() {
    signals_.cancel();
    time_up_.cancel();
  }

  const LaunchOptions& options_;
  const RunFolder& folder_;
  const BlockedSignals& blocked_;
  spdlog::logger& log_;
  int priority_;
  bool is_folder_lost_ = false;  // of the thread that polls
  asio::io_context io_;
  asio::signal_set signals_;
  asio::steady_timer time_up_;
  Supervisor supervisor_;
  bool is_ending_ = false;
  LaunchEnd end_ = LaunchEnd::kRequested;
  std::exception_ptr failure_;  // of the supervising thread, once it has ended
  std::mutex mutex_;
  std::condition_variable ended_;
  bool has_ended_ = false;                 // protected by the mutex
  std::vector<std::string> real_devices_;  // the nodes that may run them
  bool may_motors_push_ = false;           // of the supervising thread, until it has ended
};

}  // namespace

int LaunchResult::exit_status() const {
  if (end == LaunchEnd::kRefused) return kExitSetupError;
  const bool all_came_up =
      std::all_of(restarts.begin(), restarts.end(), [](const auto& node) { return node.came_up; });
  return all_came_up && !may_motors_push ? 0 : kExitFailure;
}

LaunchResult launch(const LaunchOptions& options, const std::stop_token& stop) {
  const Session session = load_session(options.session_file, options.overrides);
  const RunFolder run_folder(session.name);
  // the supervising thread handles them, ahead of the ticks; before the log's thread
  const BlockedSignals blocked{SIGINT, SIGTERM, SIGHUP, SIGCHLD};
  const Log log("palpate");
  if (options.is_quiet || options.has_short_log) log.logger().set_level(spdlog::level::warn);
  return Run(options, nodes_of(options, session), session, run_folder, blocked, log.logger())
      .run(stop);
}

}  // namespace palpate
