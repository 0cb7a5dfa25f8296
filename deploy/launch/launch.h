// launch.h — `palpate launch`: a deployment in real time, as processes, from start to a clean end.
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

#include "deploy/launch/supervisor.h"

namespace palpate {

struct LaunchOptions {
  std::filesystem::path session_file;
  std::vector<std::string> overrides = {};  ///< path=value, handed to every node
  std::optional<double> seconds = {};       ///< ends by itself after this time; none: runs on
  bool is_realtime = true;                  ///< false: nodes are started with --no-realtime
  bool is_insecure = false;                 ///< nodes are started with --insecure
  /// Of device, mofc, physics and viewer those that run here; of a session over several machines
  /// each has its own.
  std::set<std::string> nodes = {"device", "mofc", "physics"};
  bool is_together = false;                   ///< device and mofc in one process, device_mofc_node
  std::filesystem::path program_folder = {};  ///< of the nodes; empty: beside this executable
  SupervisorTiming timing = {};
  /// Called on launch()'s thread every `poll_interval` while the nodes run, and once more when all
  /// have ended: the place to read telemetry.
  std::function<void()> on_poll = {};
  std::chrono::milliseconds poll_interval{20};
};

enum class LaunchEnd : std::uint8_t {
  kTimeUp,   ///< `seconds` are over
  kSignal,   ///< SIGINT, SIGTERM or SIGHUP
  kAsked,    ///< the stop token
  kRefused,  ///< a node said by exit status 2 that its set-up is wrong
};

struct LaunchResult {
  LaunchEnd end = LaunchEnd::kTimeUp;
  std::vector<Supervisor::Restarts> restarts;  ///< of each node
  std::chrono::duration<double> wall{};        ///< from the first start to the last end

  /// Of the process: 0, or 2 when a node was refused (its message stands on stderr).
  [[nodiscard]] int exit_status() const;
};

/// Starts the nodes asked for, device and mofc for each side of the session, restarts what dies,
/// and ends all in the order device, mofc, physics, viewer. Device and mofc are one such process if
/// together. None waits for another, here or elsewhere. A device that is restarted ramps its force
/// up from nothing, also where the session has no start ramp. When it returns, no process of it is
/// left and no ipc file; when its own process is killed, the kernel kills the nodes.
///
/// A first signal stops in order, a second one kills. Throws SetupError if the session is wrong,
/// already launched, or a program is missing. One at a time per process; blocks.
LaunchResult launch(const LaunchOptions& options, const std::stop_token& stop = {});

}  // namespace palpate
