// SPDX-License-Identifier: Apache-2.0
// tissue_memory.h — the state that the tissues of a scene keep about one tool between two steps.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/contact/relaxation.h"
#include "common/contact/tissue_step.h"
#include "common/contact/touch.h"
#include "common/core/vector.h"
#include "physics_node/scene/scene_force.h"

namespace palpate::physics {

/// Where each tissue holds the tool back (its proxy), where friction sticks, what is punctured, and
/// how far relaxing tissue has relaxed. Created by Scene::new_memory() and advanced by
/// Scene::step(); a default-constructed memory is that of tissue never touched.
///
/// The steps neither allocate nor throw.
class TissueMemory {
 public:
  TissueMemory() = default;
  /// @param most_touches  contacts with persistent state; further contacts are evaluated without
  ///     history (no friction, no puncture)
  TissueMemory(std::size_t most_touches, Relaxation relaxation)
      : relaxation_(std::move(relaxation)) {
    touches_.reserve(most_touches);
    next_.reserve(most_touches);
  }
  TissueMemory(TissueMemory&&) = default;
  TissueMemory& operator=(TissueMemory&&) = default;
  TissueMemory(const TissueMemory&) = delete;  // a copy of the vectors would have no spare room
  TissueMemory& operator=(const TissueMemory&) = delete;
  ~TissueMemory() = default;
  /// Continues as the other would. @pre  of the same scene
  void continue_as(const TissueMemory& other) {
    touches_.assign(other.touches_.begin(), other.touches_.end());  // keeps the spare room
    relaxation_ = other.relaxation_;
    pose_ = other.pose_;
    has_all_ = other.has_all_;
    counts_ = other.counts_;
  }

  /// The tool at the last step; none before the first.
  [[nodiscard]] const std::optional<ToolPose>& pose() const noexcept { return pose_; }
  /// The tissues near that pose.
  [[nodiscard]] std::span<const Touch> touches() const noexcept { return touches_; }
  [[nodiscard]] const Touch* find(std::uint32_t tissue, bool is_shaft) const noexcept {
    const auto touch = std::find_if(touches_.begin(), touches_.end(), [&](const Touch& t) {
      return t.tissue == tissue && t.is_shaft == is_shaft;
    });
    return touch != touches_.end() ? &*touch : nullptr;
  }
  [[nodiscard]] const Relaxation& relaxation() const noexcept { return relaxation_; }
  /// Of the last step.
  [[nodiscard]] const SceneCounts& counts() const noexcept { return counts_; }
  /// touches() are all tissues near this pose, so it need not be evaluated again.
  [[nodiscard]] bool is_complete_at(const ToolPose& pose) const noexcept {
    return has_all_ && pose_ == pose;
  }

  // One step: begin, then for each touch press and keep, then end.

  void begin_step(const ToolPose& now) noexcept {
    next_.clear();
    next_has_all_ = true;
    dt_s_ = pose_ ? std::max(0.0, now.time_s - pose_->time_s) : 0.0;
    now_ = now;
  }
  /// @param relaxing  index of the tissue in relaxation()
  void press(std::size_t relaxing, double depth_m) noexcept {
    relaxation_.press(relaxing, depth_m, dt_s_, now_.time_s);
  }
  /// False if there is no room: the touch has no history in the next step.
  [[nodiscard]] bool keep(const Touch& touch) noexcept {
    next_has_all_ = next_has_all_ && next_.size() < next_.capacity();
    if (next_has_all_) next_.push_back(touch);
    return next_has_all_;
  }
  void end_step() noexcept {
    relaxation_.finish_step(dt_s_, now_.time_s);
    std::swap(touches_, next_);
    pose_ = now_;
    has_all_ = next_has_all_;
  }
  void set_counts(const SceneCounts& counts) noexcept { counts_ = counts; }

 private:
  std::vector<Touch> touches_;
  std::vector<Touch> next_;  // of the step in progress
  Relaxation relaxation_;
  std::optional<ToolPose> pose_;
  ToolPose now_;       // of the step in progress
  double dt_s_ = 0.0;  // ≥ 0, of the step in progress
  bool has_all_ = false;
  bool next_has_all_ = false;
  SceneCounts counts_;
};

}  // namespace palpate::physics
