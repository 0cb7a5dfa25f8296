// SPDX-License-Identifier: Apache-2.0
#include "common/process/run_node.h"

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/missing_address.h"
#include "common/core/user/output_file.h"
#include "common/core/version.h"
#include "common/process/endpoints.h"
#include "common/process/options.h"
#include "common/process/realtime.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"

namespace palpate {
namespace {

namespace asio = boost::asio;

/// Between two attempts to bind an address that this machine does not have yet.
constexpr auto kAddressRetry = std::chrono::seconds(1);

/// Turns signals and the end of --seconds into requests, on a thread of its own.
class Signals {
 public:
  /// @param priority  of the tick: the thread runs ahead of it, so that a tick that saturates the
  ///     processor cannot delay the stop
  Signals(std::optional<double> seconds, int priority)
      : signals_(io_, SIGINT, SIGTERM, SIGHUP),
        user_signals_(io_, SIGUSR1, SIGUSR2),
        timer_(io_),
        minute_(io_) {
    await_user_signal();
    signals_.async_wait([this](const boost::system::error_code& error, int) {
      if (error) return;
      signals_.clear();  // the next signal has its default effect and kills
      source_.request_stop();
    });
    if (seconds) {
      timer_.expires_after(from_seconds(*seconds));
      timer_.async_wait([this](const boost::system::error_code& error) {
        if (!error) source_.request_stop();
      });
    }
    thread_ = std::thread([this, priority] {
      run_ahead_of(priority);
      io_.run();
    });
  }
  /// Calls `what` now and then every minute on the thread of the signals. Call it at most once.
  void each_minute(std::function<void()> what) {
    what();
    minute_.expires_after(std::chrono::minutes(1));
    minute_.async_wait([this, what = std::move(what)](const boost::system::error_code& error) {
      if (!error) each_minute(what);
    });
  }
  ~Signals() {
    io_.stop();
    thread_.join();
  }
  Signals(const Signals&) = delete;
  Signals& operator=(const Signals&) = delete;

  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }
  [[nodiscard]] const SignalRequests& requests() const { return requests_; }

 private:
  void await_user_signal() {
    user_signals_.async_wait([this](const boost::system::error_code& error, int signal) {
      if (error) return;
      ++(signal == SIGUSR1 ? requests_.recordings : requests_.fault_resets);
      await_user_signal();
    });
  }

  asio::io_context io_;
  asio::signal_set signals_;
  asio::signal_set user_signals_;
  SignalRequests requests_;
  asio::steady_timer timer_;
  asio::steady_timer minute_;
  std::stop_source source_;
  std::thread thread_;
};

/// Runs the node. While this machine does not have an address that the node binds, tries again.
void run_once_addressed(const std::function<void(NodeContext&)>& body, NodeContext& context) {
  std::mutex mutex;
  std::condition_variable_any stopped;
  for (bool has_said = false; !context.stop.stop_requested(); has_said = true) {
    try {
      return body(context);
    } catch (const MissingAddress& e) {
      if (!has_said) context.log.warn("event=waiting_for_address what=\"{}\"", e.what());
    }
    std::unique_lock lock(mutex);
    stopped.wait_for(lock, context.stop, kAddressRetry, [] { return false; });
  }
}

/// inproc endpoints exist inside one process only.
void refuse_inproc(const Session& session, const Side& side) {
  for (const auto& [setting, endpoint] : endpoints_of(session, side)) {
    if (endpoint.starts_with("inproc://")) {
      throw SetupError(std::string(setting) + " = " + endpoint +
                       ": inproc connects nodes of one process only; give ipc://PATH or "
                       "tcp://HOST:PORT, or leave it out");
    }
  }
}

}  // namespace

void allow_plain_tcp(Session& session) {
  if (!session.security.key_folder.empty()) {
    throw SetupError(
        "--insecure: the session has keys (security.key_folder); remove one of the two");
  }
  session.security.may_be_plain = true;
}

void leave_adversary_out(Session& session, bool has_no_adversary) {
  if (session.adversary.is_any() && !has_no_adversary) {
    throw SetupError(
        session.file +
        ": adversary attacks the clamp, in simulation only; use `palpate loopback`, or "
        "give --no-adversary to run the session without it");
  }
  session.adversary = {};
}

void ignore_output_signals() {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

std::uint64_t random_session_id() {
  std::random_device device;
  std::uniform_int_distribution<std::uint64_t> any(1);
  return any(device);
}

FlightFiles flight_files(const NodeContext& context, const std::string& node) {
  // a service's folder outlives a reboot, the run folder does not
  const char* const state = std::getenv("STATE_DIRECTORY");  // NOLINT(concurrency-mt-unsafe)
  return {.folder = state != nullptr && *state != '\0'
                        ? std::filesystem::path(state)
                        : run_folder(context.session.name).parent_path(),
          .node = node,
          .session = context.session.name,
          .requests = context.requests,
          .log = context.log};
}

int run_node(int argc, char** argv, const NodeInfo& info,
             const std::function<void(NodeContext&)>& body) {
  const std::string program = info.program.empty() ? info.name + "_node" : info.program;
  ignore_output_signals();
  CLI::App app(info.description, program);
  std::filesystem::path session_file;
  std::vector<std::string> overrides;
  std::string side;
  std::optional<double> seconds;
  bool has_no_realtime = false;
  bool is_insecure = false;
  bool is_unsafe = false;
  CLI::Option* const session_option =
      app.add_option("--session", session_file, "session file (*.txtpb), the same for every node")
          ->type_name("FILE");
  add_override_option(app, overrides);
  if (info.is_of_one_side) {
    app.add_option("--side", side, "which device to serve, if the session has several")
        ->type_name("NAME");
  }
  add_seconds_option(app, seconds, "stop after this time in s (default: run until stopped)");
  add_no_realtime_flag(app, has_no_realtime);
  add_insecure_flag(app, is_insecure);
  bool has_no_adversary = false;
  add_no_adversary_flag(app, has_no_adversary);
  if (info.moves_device) add_unsafe_flag(app, is_unsafe);
  bool waits_for_address = false;
  app.add_flag("--wait-for-address", waits_for_address,
               "while this machine does not have an address to bind, try again every second "
               "instead of ending: for services that start before the network");
  std::string log_level = "info";
  app.add_option("--log-level", log_level, "least severe lines of the log (default: info)")
      ->type_name("LEVEL")
      ->check(CLI::IsMember({"info", "warn", "error"}));
  app.set_version_flag("--version", program + " " + version());
  std::string footer =
      "`palpate launch SESSION` starts all nodes of a session and restarts those that fail.";
  if (!info.signals.empty()) footer += "\n\n" + info.signals;
  app.footer(footer);
  if (info.add_options) info.add_options(app);
  std::optional<LaunchedSession> launched;
  try {
    if (info.launched) launched = info.launched();
    session_option->required(!launched);
    app.parse(argc, argv);
  } catch (const SetupError& e) {
    std::fprintf(stderr, "%s: %s\n", program.c_str(), e.what());
    return kExitSetupError;
  } catch (const CLI::ParseError& e) {
    return status_with_output(app.exit(e) == 0 ? 0 : kExitSetupError, program);
  }

  try {
    if (launched && session_file.empty()) {
      session_file = launched->file;
      overrides.insert(overrides.begin(), launched->overrides.begin(), launched->overrides.end());
      is_insecure = is_insecure || launched->is_insecure;
    }
    Session session = load_session(session_file, overrides);
    leave_adversary_out(session, has_no_adversary);
    if (info.is_of_one_side) session = with_only_side(std::move(session), side);
    for (const Side& each : session.sides) refuse_inproc(session, each);
    if (is_insecure) allow_plain_tcp(session);
    if (has_no_realtime) {
      for (Side& each : session.sides) {
        each.realtime = {.priority = 0, .cpu = -1, .wait = WaitStrategy::kBlock};
      }
    }

    request_short_slices();  // before the first thread starts
    const Log log(with_side(side, info.name_in_log ? info.name_in_log() : info.name));
    log.logger().set_level(spdlog::level::from_str(log_level));
    int priority = 0;
    for (const Side& each : session.sides) {
      priority = std::max(priority, each.realtime.priority);
    }
    Signals signals(seconds, priority);
    if (is_insecure) {
      signals.each_minute(
          [&log] { log.logger().warn("event=insecure what=\"tcp without keys\""); });
    }
    SteadyClock clock;
    NodeContext context{.session = session,
                        .session_id = random_session_id(),
                        .clock = clock,
                        .log = log.logger(),
                        .stop = signals.token(),
                        .requests = signals.requests(),
                        .is_unsafe = is_unsafe};
    context.log.info("event=start session={} session_id={:x} version={}", session.name,
                     context.session_id, version());
    try {
      waits_for_address ? run_once_addressed(body, context) : body(context);
    } catch (const SetupError& error) {
      throw SetupError(with_place(session, error.what()));
    }
    context.log.info("event=stop");
    return status_with_output(0, program);
  } catch (const SetupError& e) {
    std::fprintf(stderr, "%s%s: %s\n", line_start(STDERR_FILENO).c_str(), program.c_str(),
                 e.what());
    return kExitSetupError;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s%s: failed: %s\n", line_start(STDERR_FILENO).c_str(), program.c_str(),
                 e.what());
  } catch (...) {
    std::fprintf(stderr, "%s%s: failed: unknown exception\n", line_start(STDERR_FILENO).c_str(),
                 program.c_str());
  }
  return kExitFailure;
}

}  // namespace palpate
