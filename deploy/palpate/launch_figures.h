// launch_figures.h — the figures of a `palpate launch`, as JSON and as text.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/telemetry.h"
#include "deploy/launch/launch.h"
#include "viewer_node/feed/telemetry_mirror.h"

namespace palpate {

/// Figures of one device over the whole run: unlike the counters of a node, they do not start again
/// at 0 when the node is restarted.
struct ObservedFigures {
  DurationHistogram reply_time;
  DurationHistogram lateness;
  double minimum_true_energy_joule = kNaN;  ///< NaN: not reported, as with real hardware
  double max_force_newton = 0.0;
  double largest_jump_newton = 0.0;

  /// Call it for every row.
  void add(const TickRow& row);
  /// Call it after each batch of telemetry.
  void add(const DeviceCounters& device);
};

/// One device of the run.
struct ObservedDevice {
  const Side& side;
  const viewer::TelemetryMirror& mirror;
  const ObservedFigures& figures;
};

/// Keys: docs/glossary.md. With several devices each has its figures under `sides`, by name.
/// @param devices  empty: no telemetry was received, only restarts and the wall time are known
[[nodiscard]] nlohmann::ordered_json launch_json(const std::string& name,
                                                 const std::vector<ObservedDevice>& devices,
                                                 const LaunchResult& result);
/// A dozen lines per device for a terminal.
[[nodiscard]] std::string launch_text(const std::string& name,
                                      const std::vector<ObservedDevice>& devices,
                                      const LaunchResult& result);

}  // namespace palpate
