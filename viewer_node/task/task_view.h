// SPDX-License-Identifier: Apache-2.0
// task_view.h — the task of a session as a viewer sees it: of a run, or of each pass of a replay.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/session/session.h"
#include "common/task/evaluator.h"
#include "common/telemetry/run_messages.h"
#include "common/telemetry/telemetry_message.h"
#include "viewer_node/task/task_journal.h"

namespace palpate::viewer {

class TaskView {
 public:
  /// @param session  with a task; must outlive it
  /// @param journal  of a viewer_node that may be started again; null: none
  explicit TaskView(const Session& session, std::unique_ptr<TaskJournal> journal = nullptr)
      : session_(session),
        evaluator_(*session.task, session.scene.tool()),
        journal_(std::move(journal)) {}

  void take(const TickRow& row);
  /// Scenes and the state of the run count. @param message  as received
  void take(const TelemetryMessage& message);
  void take(const RunState& run);

  [[nodiscard]] TaskState state() const { return evaluator_.state(); }
  [[nodiscard]] bool has_ended() const { return evaluator_.has_ended(); }
  [[nodiscard]] bool knows_area() const { return evaluator_.knows_area(); }
  [[nodiscard]] TaskMap map() const { return evaluator_.map(); }
  [[nodiscard]] const TaskScore& score() const { return evaluator_.score(); }
  /// Whether everything may be shown: the task has ended, or this is a replay.
  [[nodiscard]] bool may_reveal() const { return is_replay_ || evaluator_.has_ended(); }

 private:
  void begin_anew();
  void journal(const TickRow& row);
  [[nodiscard]] bool waits(const TickRow& row) const;

  const Session& session_;
  TaskEvaluator evaluator_;
  std::optional<SceneState> scene_;
  RunState run_;  // newest
  std::uint64_t device_session_id_ = 0;
  bool is_replay_ = false;
  std::unique_ptr<TaskJournal> journal_;
  bool has_restored_ = false;
  TimePoint began_at_{};            // of the first row
  bool has_run_ = false;            // a state of the run has been received
  bool is_behind_ = false;          // what the process before has kept is still to be taken
  std::vector<TickRow> waiting_{};  // behind it
};

}  // namespace palpate::viewer
