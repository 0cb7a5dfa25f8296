// SPDX-License-Identifier: Apache-2.0
#include "common/task/traction.h"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

/// NaN becomes the time of the first event.
void note_first(double& first_s, double t_s) {
  if (!std::isfinite(first_s)) first_s = t_s;
}

// A slip that rests for less goes on: tissue sticks and slips in turn.
constexpr double kSameSlip_s = 0.1;
// sums of periods, each rounded
constexpr double kRounding_s = 1e-6;

}  // namespace

Traction::Traction(const TractionTask& task) : task_(task) {
  score_.hold_s = task.hold_s;
  score_.tolerance_m = task.tolerance_m;
}

void Traction::reset() {
  grip_ = GripState::kNone;
  before_ = GripState::kNone;
  taken_m_.reset();
  streak_s_ = 0.0;
}

void Traction::follow(std::optional<GripState> grip, const Vector3& tip_m) {
  tip_m_ = tip_m;
  is_unknown_ = !grip && is_told_;
  if (!grip) return;
  is_told_ = true;
  const bool was_holding = is_holding(grip_);
  grip_ = *grip;
  if (is_holding(grip_) && !was_holding) taken_m_ = tip_m;
}

void Traction::count(double t_s, double newton, double elapsed_s) {
  if (is_unknown_) ++score_.unknown_ticks;
  if (grip_ != before_) note_change(t_s);
  before_ = grip_;
  if (grip_ == GripState::kSlips) {
    if (!(t_s - slipped_s_ < kSameSlip_s)) ++score_.slips;
    slipped_s_ = t_s;
  }
  if (is_holding(grip_)) {
    forces_.add(newton, elapsed_s);
    const double way_m = (tip_m_ - *taken_m_).norm();
    score_.retraction_m =
        std::isfinite(score_.retraction_m) ? std::max(score_.retraction_m, way_m) : way_m;
  }
  const bool is_there = is_at_target();
  if (is_there) note_first(score_.reached_after_s, t_s);
  if (std::isfinite(score_.reached_after_s) && !std::isfinite(score_.done_after_s)) {
    score_.watched_s += elapsed_s;
    if (is_there) score_.within_s += elapsed_s;
  }
  streak_s_ = is_there ? streak_s_ + elapsed_s : 0.0;
  score_.longest_s = std::max(score_.longest_s, streak_s_);
  if (streak_s_ >= task_.hold_s - kRounding_s) note_first(score_.done_after_s, t_s);
}

/// What the jaws do is not what they did in the tick before.
void Traction::note_change(double t_s) {
  // what was lost before the start is not of this task
  if (!before_ && !is_holding(grip_)) return;
  if (is_holding(grip_) && !(before_ && is_holding(*before_))) {
    ++score_.grips;
    note_first(score_.held_after_s, t_s);
  }
  switch (grip_) {
    case GripState::kTorn:
      ++score_.tears;
      note_first(score_.torn_after_s, t_s);
      break;
    case GripState::kSlipped:
      ++score_.slipped_out;
      break;
    case GripState::kNone:
    case GripState::kHolds:
    case GripState::kSlips:
    case GripState::kPierced:
    case GripState::kPierces:
    case GripState::kCuts:
      break;
  }
}

TractionScore Traction::score() const {
  TractionScore score = score_;
  score.force = forces_.figures();
  return score;
}

TaskState::Traction Traction::state() const {
  return {.target_m = task_.target_m,
          .tolerance_m = task_.tolerance_m,
          .hold_s = task_.hold_s,
          .held_s = score_.longest_s,
          .is_holding = is_holding(grip_),
          .is_at_target = is_at_target()};
}

}  // namespace palpate
