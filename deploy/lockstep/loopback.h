// SPDX-License-Identifier: Apache-2.0
// loopback.h — a whole run of a session in lockstep, with its figures and files.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "common/task/score.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/lockstep.h"
#include "viewer_node/recording/recording.h"

namespace palpate {

struct LoopbackOptions {
  std::optional<double> seconds = {};  ///< simulated; none: duration_s of the session
  std::string csv_file = {};           ///< empty: none
  bool may_overwrite = false;          ///< the table
  bool ends_with_reader = false;       ///< the run, when the reader of the table leaves
  viewer::RecordOptions record{};
  std::string recorded_by = "palpate loopback";
  /// Takes what went wrong with an output that could not be written to its end, while the others
  /// are; null: it is thrown.
  std::vector<std::string>* lost_outputs = nullptr;
  /// Takes the score of the session's task, if it has one and one side runs; may be null.
  std::optional<TaskScore>* task_score = nullptr;
  LockstepOptions lockstep{.has_ideal = true};
  /// Called every 10 ms of simulated time with the share of the run that is done, 0 … 1; false ends
  /// the run, whose figures and files then cover the time so far. May be empty.
  std::function<bool(double)> may_go_on{};
};

/// Runs the session. Throws SetupError if a file cannot be created, std::runtime_error if writing
/// it fails later, ReaderHasLeft with `ends_with_reader`.
[[nodiscard]] RunReport run_loopback(const Session& session, const LoopbackOptions& options);

/// Runs all sides of the session together. `csv_file` gives one table for each, run.SIDE.csv.
/// Cannot record; `lockstep` may not have on_side_row. Throws as run_loopback.
/// @return one report for each side
[[nodiscard]] std::vector<RunReport> run_all_sides(const Session& session,
                                                   const LoopbackOptions& options);

}  // namespace palpate
