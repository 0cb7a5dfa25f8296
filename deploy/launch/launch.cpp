// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/launch.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>
#include <span>
#include <system_error>

#include "common/core/check.h"
#include "common/core/time.h"
#include "common/core/user/files.h"
#include "common/process/log.h"
#include "common/process/run_node.h"
#include "common/session/session.h"
#include "common/session/session_file.h"
#include "deploy/launch/physics_command.h"

namespace palpate {
namespace {

namespace asio = boost::asio;
namespace fs = std::filesystem;

/// Start ramp of a restarted device if its session has none.
constexpr int kRestartRampMilliseconds = 500;

/// The folder of the session's ipc files. One launch at a time holds it; it is removed at the end.
class RunFolder {
 public:
  explicit RunFolder(const std::string& session_name) : path_(run_folder(session_name)) {
    if (const std::string why = make_private_folder(path_); !why.empty()) {
      refuse(why + ", with PALPATE_RUN_DIR");
    }
    folder_ = open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (folder_ < 0) refuse("cannot be opened: " + std::generic_category().message(errno));
    if (flock(folder_, LOCK_EX | LOCK_NB) != 0) {
      refuse("is in use: session \"" + session_name +
             "\" is already launched; stop that launch, or rename this one with "
             "--set name=OTHER");
    }
  }
  ~RunFolder() {
    remove_left_files();
    std::error_code not_empty;
    fs::remove(path_, not_empty);
    close(folder_);
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

 private:
  [[noreturn]] void refuse(const std::string& why) {
    if (folder_ >= 0) close(folder_);
    throw SetupError(path_.string() + ": " + why);
  }

  /// Removes sockets and their lock files, except those that a node started by hand still holds.
  void remove_left_files() const {
    std::error_code error;
    std::vector<fs::path> left;
    for (const fs::directory_entry& entry : fs::directory_iterator(path_, error)) {
      const bool is_lock = entry.path().extension() == ".lock";
      fs::path lock = entry.path();
      if (!is_lock) lock += ".lock";
      if ((is_lock || entry.is_socket(error)) && !is_held(lock)) left.push_back(entry.path());
    }
    for (const fs::path& file : left) fs::remove(file, error);
  }

  static bool is_held(const fs::path& lock) {
    const int file = open(lock.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0) return false;
    const bool is_held = flock(file, LOCK_EX | LOCK_NB) != 0;
    close(file);
    return is_held;
  }

  fs::path path_;
  int folder_ = -1;
};

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
    if (sides[i].device.start_ramp.count() > 0) continue;
    const std::string path = sides[i].name.empty() ? "" : "side[" + std::to_string(i) + "].";
    child.restart_arguments = {
        "--set", path + "device.start_ramp_ms=" + std::to_string(kRestartRampMilliseconds)};
  }
  if (is_here("viewer")) {
    ChildSpec& viewer = add("viewer");
    if (options.is_quiet) viewer.arguments.emplace_back("--quiet");
    const std::string address = options.on_page ? options.on_page() : "";
    if (!address.empty()) {
      viewer.arguments.insert(viewer.arguments.end(), {"--listen", address});
    }
  }
  return children;
}

std::vector<std::string> stop_order(const Session& session) {
  std::vector<std::string> names;
  for (const char* node : {"device_mofc", "device", "mofc"}) {
    for (const Side& side : session.sides) names.push_back(with_side(side.name, node));
  }
  names.insert(names.end(), {"physics", "standby", "viewer"});
  return names;
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

/// One run of the nodes, on one io_context.
class Run {
 public:
  Run(const LaunchOptions& options, std::vector<ChildSpec> nodes,
      const std::vector<std::string>& stop_order, spdlog::logger& log)
      : options_(options),
        log_(log),
        signals_(io_, SIGINT, SIGTERM, SIGHUP),
        time_up_(io_),
        poll_(io_),
        supervisor_(
            io_, std::move(nodes), stop_order, options.timing,
            [this](const ChildEvent& event) { write(event, log_); }, [this] { on_end(); }) {}

  LaunchResult run(const std::stop_token& stop) {
    const auto begin = std::chrono::steady_clock::now();
    const std::stop_callback on_stop(
        stop, [this] { asio::post(io_, [this] { end(LaunchEnd::kRequested); }); });
    try {
      await_signal();
      supervisor_.start();
      if (options_.seconds) await_time_up(*options_.seconds);
      if (options_.on_poll) poll();
      io_.run();
    } catch (...) {
      // end all nodes before the caller sees the exception
      supervisor_.kill();
      io_.restart();
      io_.run();
      if (options_.on_end) options_.on_end();
      throw;
    }
    if (options_.on_poll) options_.on_poll();
    if (options_.on_end) options_.on_end();
    return {.end = supervisor_.was_refused() ? LaunchEnd::kRefused : end_,
            .restarts = supervisor_.restarts(),
            .wall = std::chrono::steady_clock::now() - begin};
  }

 private:
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

  void poll() {
    options_.on_poll();
    poll_.expires_after(options_.poll_interval);
    poll_.async_wait([this](const boost::system::error_code& error) {
      if (!error && !has_ended_) poll();
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
    has_ended_ = true;
    signals_.cancel();
    time_up_.cancel();
    poll_.cancel();
  }

  const LaunchOptions& options_;
  spdlog::logger& log_;
  asio::io_context io_;
  asio::signal_set signals_;
  asio::steady_timer time_up_;
  asio::steady_timer poll_;
  Supervisor supervisor_;
  bool is_ending_ = false;
  bool has_ended_ = false;
  LaunchEnd end_ = LaunchEnd::kRequested;
};

}  // namespace

int LaunchResult::exit_status() const {
  if (end == LaunchEnd::kRefused) return kExitSetupError;
  const bool all_came_up =
      std::all_of(restarts.begin(), restarts.end(), [](const auto& node) { return node.came_up; });
  return all_came_up ? 0 : kExitFailure;
}

LaunchResult launch(const LaunchOptions& options, const std::stop_token& stop) {
  const Session session = load_session(options.session_file, options.overrides);
  const RunFolder run_folder(session.name);
  const Log log("palpate");
  if (options.is_quiet || options.has_short_log) log.logger().set_level(spdlog::level::warn);
  return Run(options, nodes_of(options, session), stop_order(session), log.logger()).run(stop);
}

}  // namespace palpate
