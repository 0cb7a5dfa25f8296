// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/task/task_view.h"

#include <utility>
#include <variant>

namespace palpate::viewer {
namespace {

constexpr double kEnd_s = 1e-3;  // of a replay that stands there
// A launch sends the marks of the run, and physics_node the surface, about once a second.
constexpr Duration kMarksPatience = std::chrono::seconds(5);
// Of a task that has not begun.
constexpr std::size_t kMostBytesBefore = std::size_t{8} << 20U;

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
  journal(row);
  if (!is_behind_) {
    evaluator_.take(row);
    return;
  }
  waiting_.push_back(row);
  if (waits(row)) return;
  is_behind_ = false;
  if (journal_) journal_->replay([&](const TickRow& one) { evaluator_.take(one); });
  for (const TickRow& one : waiting_) evaluator_.take(one);
  waiting_ = {};
}

/// What a process before this one has seen comes first.
void TaskView::journal(const TickRow& row) {
  if (is_replay_) journal_.reset();
  if (!journal_) return;
  if (!std::exchange(has_restored_, true)) {
    began_at_ = row.device.sampled_at;
    is_behind_ = journal_->continues(row);
  }
  if (evaluator_.has_ended()) return;
  if (!is_behind_ && !evaluator_.has_begun() && journal_->size_bytes() > kMostBytesBefore) {
    journal_->clear();
  }
  journal_->append(row);
}

/// Rows of a process before this one are of the past, so that all marks and the surface must be
/// there first.
bool TaskView::waits(const TickRow& row) const {
  const bool needs_scene =
      session_.task->palpation() != nullptr || !session_.task->tissue_limits.empty();
  const bool has_all = has_run_ && (scene_ || !needs_scene);
  return !has_all && row.device.sampled_at - began_at_ < kMarksPatience;
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
  has_run_ = true;
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
