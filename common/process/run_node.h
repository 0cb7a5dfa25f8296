// run_node.h — start and stop of a node: command line, session, log, signals, exit status.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>

#include "common/core/clock.h"
#include "common/session/session.h"
#include "common/process/log.h"
#include "common/telemetry/flight_recorder.h"

namespace palpate {

/// Exit statuses of every program of the project.
inline constexpr int kExitFailure = 1;
inline constexpr int kExitSetupError = 2;  ///< the user's to mend; starting again would not help

struct NodeInfo {
  std::string name;             ///< "device"; the program is device_node
  std::string description;      ///< one sentence for --help
  std::string signals = {};     ///< for --help: what SIGUSR1 and SIGUSR2 do, if anything
  bool is_of_one_side = false;  ///< takes --side, and sees the session of that side
  /// Options of this node beside the common ones; optional.
  std::function<void(CLI::App&)> add_options = {};
};

/// What a node's main is handed.
struct NodeContext {
  const Session& session;    ///< --set applied; with --no-realtime it asks for nothing real-time
  std::uint64_t session_id;  ///< random, never 0: the header's of every message of this process
  SteadyClock& clock;
  spdlog::logger& log;   ///< never on the tick thread
  std::stop_token stop;  ///< SIGINT, SIGTERM, SIGHUP or the end of --seconds
  const SignalRequests& requests = kNoRequests;
};

/// For --insecure: tcp beyond loopback without keys. Throws SetupError if the session has keys.
void allow_plain_tcp(Session& session);

/// For --seconds: a finite number above 0.
[[nodiscard]] CLI::Validator is_time();

/// Random, never 0.
[[nodiscard]] std::uint64_t random_session_id();

/// In the parent of the run folder.
/// @param node  for the names of the files: "device", of a side "left.device"
[[nodiscard]] FlightFiles flight_files(const NodeContext& context, const std::string& node);

/// Parses the command line, loads the session and runs `body`, which returns soon after a stop was
/// requested. A second signal kills.
/// @return exit status: 0, kExitSetupError with the text of the problem printed once, or
///         kExitFailure for any other exception.
int run_node(int argc, char** argv, const NodeInfo& info,
             const std::function<void(NodeContext&)>& body);

}  // namespace palpate
