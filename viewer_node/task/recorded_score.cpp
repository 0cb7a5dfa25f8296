// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/task/recorded_score.h"

#include <string>
#include <variant>

#include "common/core/check.h"
#include "common/task/evaluator.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/recording/recording_copy.h"

namespace palpate {
namespace {

constexpr int kMessagesPerProgress = 100;

/// Without its hand: the file of its path may be gone, and the score does not need it.
Session scored_session(const RecordingFile& recording) {
  return recorded_session(recording, {"hand={}"});
}

}  // namespace

bool has_task(const RecordingFile& recording) {
  try {
    return scored_session(recording).task.has_value();
  } catch (const SetupError&) {
    return false;
  }
}

TaskScore score_of(RecordingFile& recording, const std::function<void(double)>& on_progress) {
  const Session session = scored_session(recording);
  if (!session.task) {
    throw SetupError("recording " + recording.mcap().path() +
                     ": its session has no task; give task { … } in the session and record again");
  }
  TaskEvaluator evaluator(*session.task, session.scene.tool());
  evaluator.take(recording.markers());
  viewer::TelemetryMirror mirror;
  mirror.on_row = [&](const TickRow& row) { evaluator.take(row); };
  recording.seek(0);
  int messages = 0;
  while (const RecordingFile::Item* item = recording.next()) {
    const TimePoint at{Duration(static_cast<std::int64_t>(item->log_time_ns))};
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { evaluator.take(message); }) evaluator.take(message);
          if constexpr (requires { mirror.take(message, at); }) mirror.take(message, at);
        },
        item->message);
    if (on_progress && ++messages % kMessagesPerProgress == 0) {
      on_progress(recording.passed_ratio());
    }
  }
  mirror.flush_rows();
  evaluator.finish(viewer::breaks_off(recording.mcap()));
  return evaluator.score();
}

}  // namespace palpate
