// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/task/task_view.h"

#include <utility>
#include <variant>

namespace palpate::viewer {
namespace {

constexpr double kEnd_s = 1e-3;  // of a replay that stands there

}  // namespace

void TaskView::begin_anew() {
  evaluator_ =
      TaskEvaluator(*session_.task, session_.scene.tool(), {.ignores_sessions = is_replay_});
  if (scene_) evaluator_.take(*scene_);
  evaluator_.take(run_.markers);
}

void TaskView::take(const TickRow& row) {
  const std::uint64_t before = std::exchange(device_session_id_, row.device_session_id);
  // each pass of a replay is like a restart
  if (is_replay_ && before != 0 && before != row.device_session_id) begin_anew();
  evaluator_.take(row);
}

void TaskView::take(const TelemetryMessage& message) {
  if (const auto* scene = std::get_if<SceneState>(&message)) {
    scene_ = *scene;
    evaluator_.take(*scene);
  } else if (const auto* run = std::get_if<RunState>(&message)) {
    take(*run);
  }
}

void TaskView::take(const RunState& run) {
  run_ = run;
  if (run.replay && !is_replay_) {
    is_replay_ = true;
    evaluator_.ignore_sessions();
  }
  evaluator_.take(run.markers);
  const bool is_at_end =
      run.replay && run.replay->is_paused && run.replay->position_s > run.replay->length_s - kEnd_s;
  if (is_at_end) evaluator_.finish();
}

}  // namespace palpate::viewer
