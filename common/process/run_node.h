// SPDX-License-Identifier: Apache-2.0
// run_node.h — start and stop of a node: command line, session, log, signals, exit status.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/process/log.h"
#include "common/session/session.h"
#include "common/telemetry/flight_recorder.h"

namespace CLI {
class App;
}

namespace palpate {

/// Exit statuses of every program of the project.
inline constexpr int kExitFailure = 1;
inline constexpr int kExitSetupError = 2;  ///< the user must act; a restart would not help

/// The session of a program that `palpate launch` started without arguments of its own.
struct LaunchedSession {
  std::string file;
  std::vector<std::string> overrides;
  bool is_insecure = false;
};

struct NodeInfo {
  std::string name;             ///< "device"
  std::string program = {};     ///< empty: "device_node"
  std::string description;      ///< one sentence for --help
  std::string signals = {};     ///< for --help: effect of SIGUSR1 and SIGUSR2; empty: none
  bool is_of_one_side = false;  ///< takes --side and gets the session of that side only
  bool moves_device = false;    ///< takes --unsafe
  /// Where --session is not given, the session that counts; none: --session is required. May be
  /// empty. May throw SetupError.
  std::function<std::optional<LaunchedSession>()> launched = {};
  /// Adds options of this node to the common ones; may be empty.
  std::function<void(CLI::App&)> add_options = {};
  /// Asked after the options are parsed; empty: `name`.
  std::function<std::string()> name_in_log = {};
};

/// What run_node passes to the body of a node.
struct NodeContext {
  const Session& session;    ///< with --set applied; with --no-realtime without real-time requests
  std::uint64_t session_id;  ///< random, never 0; in the header of every message of this process
  SteadyClock& clock;
  spdlog::logger& log;   ///< not for the tick thread
  std::stop_token stop;  ///< SIGINT, SIGTERM, SIGHUP or the end of --seconds
  const SignalRequests& requests = kNoRequests;
  bool is_unsafe = false;  ///< --unsafe: a real device may run without the monitor of the energy
};

/// For --insecure: allows tcp beyond loopback without keys. Throws SetupError if the session has
/// keys.
void allow_plain_tcp(Session& session);

/// Leaves the adversary of the session out if `has_no_adversary`, which is --no-adversary. Throws
/// SetupError if it has one otherwise: it is for lockstep, nothing of it reaches a device.
void leave_adversary_out(Session& session, bool has_no_adversary);

/// Makes writing to a closed pipe or beyond the file size limit an error of that write instead of a
/// signal that kills the process.
void ignore_output_signals();

/// Random, never 0.
[[nodiscard]] std::uint64_t random_session_id();

/// Where a node writes its flight recordings: `$STATE_DIRECTORY`, which systemd sets, else the
/// parent of the run folder.
/// @param node  for the names of the files: "device", of a side "left.device"
[[nodiscard]] FlightFiles flight_files(const NodeContext& context, const std::string& node);

/// Parses the command line, loads the session and runs `body`, which must return soon after
/// `context.stop` is requested. A second signal kills the process.
/// @return exit status: 0, kExitSetupError after a SetupError, kExitFailure after any other
///         exception; the text of an exception is printed once
int run_node(int argc, char** argv, const NodeInfo& info,
             const std::function<void(NodeContext&)>& body);

}  // namespace palpate
