// SPDX-License-Identifier: Apache-2.0
// task_view.h — the task of a session as a viewer sees it: of a run, or of each pass of a replay.
#pragma once

#include <optional>

#include "common/session/session.h"
#include "common/task/evaluator.h"
#include "common/telemetry/run_messages.h"
#include "common/telemetry/telemetry_message.h"

namespace palpate::viewer {

class TaskView {
 public:
  /// @param session  with a task; must outlive it
  explicit TaskView(const Session& session)
      : session_(session), evaluator_(*session.task, session.scene.tool()) {}

  void take(const TickRow& row);
  /// Scenes and the state of the run count. @param message  as received
  void take(const TelemetryMessage& message);
  void take(const RunState& run);

  [[nodiscard]] TaskState state() const { return evaluator_.state(); }
  [[nodiscard]] bool has_ended() const { return evaluator_.has_ended(); }
  /// What was searched; after the end.
  [[nodiscard]] TaskMap map() const { return evaluator_.map(); }
  [[nodiscard]] const TaskScore& score() const { return evaluator_.score(); }
  /// Whether everything may be shown: the task has ended, or this is a replay.
  [[nodiscard]] bool may_reveal() const { return is_replay_ || evaluator_.has_ended(); }

 private:
  void begin_anew();

  const Session& session_;
  TaskEvaluator evaluator_;
  std::optional<SceneState> scene_;
  RunState run_;  // newest
  std::uint64_t device_session_id_ = 0;
  bool is_replay_ = false;
};

}  // namespace palpate::viewer
