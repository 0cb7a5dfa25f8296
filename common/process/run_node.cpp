#include "common/process/run_node.h"

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/version.h"
#include "common/session/session_file.h"

namespace palpate {
namespace {

namespace asio = boost::asio;

/// Turns signals and the end of the time into requests, on a thread of its own.
class Signals {
 public:
  explicit Signals(std::optional<double> seconds)
      : signals_(io_, SIGINT, SIGTERM, SIGHUP),
        user_signals_(io_, SIGUSR1, SIGUSR2),
        timer_(io_),
        minute_(io_) {
    await_user_signal();
    signals_.async_wait([this](const boost::system::error_code& error, int) {
      if (error) return;
      signals_.clear();  // the next one has its default effect: it kills
      source_.request_stop();
    });
    if (seconds) {
      timer_.expires_after(std::chrono::duration_cast<std::chrono::nanoseconds>(
          std::chrono::duration<double>(*seconds)));
      timer_.async_wait([this](const boost::system::error_code& error) {
        if (!error) source_.request_stop();
      });
    }
    thread_ = std::thread([this] { io_.run(); });
  }
  /// Now and every minute, on the thread of the signals. Once at most.
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

/// Processes cannot meet at an endpoint inside one of them.
void refuse_inproc(const Session& session) {
  const auto refuse = [](const char* setting, const std::string& endpoint) {
    if (endpoint.starts_with("inproc://")) {
      throw SetupError(std::string(setting) + " = " + endpoint +
                       ": inproc joins nodes of one process only; give ipc://PATH or "
                       "tcp://HOST:PORT, or leave it out");
    }
  };
  for (const Side& side : session.sides) {
    refuse("links.exchange", side.links.exchange);
    refuse("links.tool_motion", side.links.tool_motion);
    refuse("links.interaction", side.links.interaction);
    refuse("links.device_telemetry", side.links.device_telemetry);
    refuse("links.mofc_telemetry", side.links.mofc_telemetry);
    refuse("links.hand_target", side.links.hand_target);
  }
  refuse("links.physics_telemetry", session.physics_telemetry);
}

}  // namespace

void allow_plain_tcp(Session& session) {
  if (!session.security.key_folder.empty()) {
    throw SetupError(
        "--insecure: the session has keys, security.key_folder; take one of the two out");
  }
  session.security.may_be_plain = true;
}

CLI::Validator is_time() {
  constexpr double kLongestSeconds = 1e9;  // far below what nanoseconds in 64 bits can hold
  return CLI::Validator(
      [](const std::string& text) {
        double seconds = 0.0;
        const bool is_number = CLI::detail::lexical_cast(text, seconds);
        if (is_number && seconds > 0.0 && seconds <= kLongestSeconds) return std::string();
        return "\"" + text + "\": give a time in s, more than 0 and at most 1e9";
      },
      "", "time");
}

std::uint64_t random_session_id() {
  std::random_device device;
  std::uniform_int_distribution<std::uint64_t> any(1);
  return any(device);
}

FlightFiles flight_files(const NodeContext& context, const std::string& node) {
  return {.folder = run_folder(context.session.name).parent_path(),
          .node = node,
          .session = context.session.name,
          .requests = context.requests,
          .log = context.log};
}

int run_node(int argc, char** argv, const NodeInfo& info,
             const std::function<void(NodeContext&)>& body) {
  const std::string program = info.name + "_node";
  std::signal(SIGPIPE, SIG_IGN);  // who reads our output may go, as in `viewer_node | head`
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may grow no more is an error of that file alone
  CLI::App app(info.description, program);
  std::filesystem::path session_file;
  std::vector<std::string> overrides;
  std::string side;
  std::optional<double> seconds;
  bool no_realtime = false;
  bool is_insecure = false;
  app.add_option("--session", session_file, "session file (*.txtpb), the same for every node")
      ->required()
      ->type_name("FILE");
  app.add_option("--set", overrides,
                 "override a field of the session, e.g. mofc.controller=none; repeatable")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  if (info.is_of_one_side) {
    app.add_option("--side", side, "of a session with several devices: which one is served")
        ->type_name("NAME");
  }
  app.add_option("--seconds", seconds, "stop after this time in s (default: run on)")
      ->type_name("S")
      ->check(is_time());
  app.add_flag("--no-realtime", no_realtime, "ordinary scheduling, whatever the session says");
  app.add_flag("--insecure", is_insecure,
               "tcp beyond loopback without keys: anybody on the network can look on and push");
  app.set_version_flag("--version", program + " " + version());
  std::string footer =
      "`palpate launch SESSION` starts all nodes of a session and keeps them running.";
  if (!info.signals.empty()) footer += "\n\n" + info.signals;
  app.footer(footer);
  if (info.add_options) info.add_options(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : kExitSetupError;
  }

  try {
    Session session = load_session(session_file, overrides);
    if (info.is_of_one_side) session = with_only_side(std::move(session), side);
    refuse_inproc(session);
    if (is_insecure) allow_plain_tcp(session);
    if (no_realtime) {
      for (Side& each : session.sides) {
        each.realtime = {.priority = 0, .cpu = -1, .wait = WaitStrategy::kBlock};
      }
    }

    const Log log(with_side(side, info.name));
    Signals signals(seconds);
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
                        .requests = signals.requests()};
    context.log.info("event=start session={} session_id={:x} version={}", session.name,
                     context.session_id, version());
    body(context);
    context.log.info("event=stop");
    return 0;
  } catch (const SetupError& e) {
    std::fprintf(stderr, "%s: %s\n", program.c_str(), e.what());
    return kExitSetupError;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: failed: %s\n", program.c_str(), e.what());
  } catch (...) {
    std::fprintf(stderr, "%s: failed: unknown exception\n", program.c_str());
  }
  return kExitFailure;
}

}  // namespace palpate
