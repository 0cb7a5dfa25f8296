// loopback.h — a whole run of a session in lockstep, with its figures and files.
#pragma once

#include <optional>
#include <string>

#include "common/session/session.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/lockstep.h"
#include "viewer_node/recording/recording.h"

namespace palpate {

struct LoopbackOptions {
  std::optional<double> seconds = {};  ///< simulated; none: duration_s of the session
  std::string csv_file = {};           ///< empty: none
  viewer::RecordOptions record{};
  std::string recorded_by = "palpate loopback";
  LockstepOptions lockstep{.has_ideal = true};
};

/// Runs the session. Throws SetupError if a file cannot be created, std::runtime_error if writing
/// it fails later.
[[nodiscard]] RunReport run_loopback(const Session& session, const LoopbackOptions& options);

}  // namespace palpate
