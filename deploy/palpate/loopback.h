// loopback.h — `palpate loopback`: a session in lockstep, with its figures.
#pragma once

#include <optional>
#include <string>

#include "common/session/session.h"
#include "deploy/lockstep/lockstep.h"
#include "common/telemetry/summary.h"
#include "viewer_node/recording/recording.h"

namespace palpate {

struct LoopbackOptions {
  std::optional<double> seconds = {};  ///< else the session's duration_s
  std::string csv_file = {};           ///< empty: none
  viewer::RecordOptions record{};
  std::string recorded_by = "palpate loopback";
  LockstepOptions lockstep{.has_ideal = true};
};

/// Runs the session. Throws SetupError if a file cannot be written, std::runtime_error if
/// writing it failed on the way.
[[nodiscard]] RunReport run_loopback(const Session& session, const LoopbackOptions& options);

}  // namespace palpate
