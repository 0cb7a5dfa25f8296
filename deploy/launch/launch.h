// SPDX-License-Identifier: Apache-2.0
// launch.h — runs a deployment in real time, as processes, from start to a clean end.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "common/core/vector.h"
#include "deploy/launch/supervisor.h"

namespace palpate {

struct LaunchOptions {
  std::filesystem::path session_file;
  std::vector<std::string> overrides = {};  ///< path=value, passed to every node
  std::optional<double> seconds = {};       ///< run time; none: until a signal or a stop request
  bool is_realtime = true;                  ///< false: nodes are started with --no-realtime
  bool is_insecure = false;                 ///< nodes are started with --insecure
  bool is_unsafe = false;                   ///< device nodes are started with --unsafe
  bool is_emulated = false;                 ///< real devices are emulated: `palpate emulate`
  bool has_no_adversary = false;            ///< nodes are started with --no-adversary
  bool is_quiet = false;                    ///< no status line; warnings and errors only
  bool has_short_log = false;               ///< warnings and errors only
  /// Called before the first node starts, if the viewer is among them. Returns the descriptor of a
  /// socket that listens for the page; −1: the viewer opens its own.
  std::function<int()> on_page = {};
  /// Nodes to run on this machine: some of device, mofc, physics, standby and viewer. The standby
  /// runs only if the session has one.
  std::set<std::string> nodes = {"device", "mofc", "physics", "standby"};
  bool is_together = false;                   ///< device and mofc in one process: device_mofc_node
  std::filesystem::path program_folder = {};  ///< of the nodes; empty: beside this executable
  SupervisorTiming timing = {};
  /// Called before a node that runs or loads what the session names is started again; a SetupError
  /// puts that off.
  std::function<void()> before_restart = {};
  /// Called on launch()'s thread every `poll_interval` while the nodes run, and once after all have
  /// ended. Use it to read telemetry.
  std::function<void()> on_poll = {};
  std::chrono::milliseconds poll_interval{20};
  /// Called on launch()'s thread after the last on_poll(), before the run folder is removed: close
  /// what is in it.
  std::function<void()> on_end = {};
};

enum class LaunchEnd : std::uint8_t {
  kTimeUp,     ///< `seconds` are over
  kSignal,     ///< SIGINT, SIGTERM or SIGHUP
  kRequested,  ///< the stop token
  kRefused,    ///< a node reported a wrong set-up by exit status 2
};

struct LaunchResult {
  LaunchEnd end = LaunchEnd::kTimeUp;
  std::vector<Supervisor::Restarts> restarts;  ///< of each node
  std::chrono::duration<double> wall{};        ///< from the first start to the last end
  std::size_t processors = 0;  ///< that all nodes of the session shared; 0: some ran elsewhere
  double load = kNaN;          ///< mean load of this machine in the last minute of the run
  /// The program of a real device was killed or crashed at the end, so nothing released its motors.
  bool may_motors_push = false;

  /// 2 if a node reported a wrong set-up, 1 if one never came up or motors may push, else 0. The
  /// node has printed the problem to stderr.
  [[nodiscard]] int exit_status() const;
};

/// Starts `nodes`, with one device and one mofc for each side of the session (one process for both
/// if `is_together`), restarts those that die and ends all in the order device, mofc, physics,
/// standby, viewer. If its run folder is removed or replaced meanwhile, it logs an error once. No
/// node waits for another. A restarted device ramps its force up from 0, even if the session has no
/// start ramp. When launch() returns, no process and no ipc file of the session is left; if its own
/// process is killed, so are the nodes and what they started.
///
/// The first signal stops the nodes in order, the second kills them. Throws SetupError if the
/// session is invalid or already launched, or if a program is missing. Blocks; one call at a time
/// per process.
LaunchResult launch(const LaunchOptions& options, const std::stop_token& stop = {});

}  // namespace palpate
