// SPDX-License-Identifier: Apache-2.0
// launch_figures.h — the figures of a `palpate launch`, as JSON and as text.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "deploy/launch/launch.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/recording/run_figures.h"

namespace palpate {

/// One device of the run.
struct ObservedDevice {
  const Side& side;
  const viewer::TelemetryMirror& mirror;
  const RunFigures& figures;
};

/// What is judged of a device's run. Counts the restarts of its nodes that no telemetry shows, too.
[[nodiscard]] RunFacts facts_of(const Session& session, const ObservedDevice& device,
                                const LaunchResult& result);

/// 1 if a device has latched a fault that nobody reset, or `result` is a failure; else as `result`.
[[nodiscard]] int exit_status(const std::vector<ObservedDevice>& devices,
                              const LaunchResult& result);

/// Keys: docs/glossary.md. With several devices each has its figures under `sides`, by name.
/// @param devices  empty: no telemetry was received, only restarts and the wall time are known
[[nodiscard]] nlohmann::ordered_json launch_json(const Session& session,
                                                 const std::vector<ObservedDevice>& devices,
                                                 const LaunchResult& result);
/// A dozen lines per device for a terminal.
[[nodiscard]] std::string launch_text(const Session& session,
                                      const std::vector<ObservedDevice>& devices,
                                      const LaunchResult& result);

}  // namespace palpate
