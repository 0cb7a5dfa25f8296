// SPDX-License-Identifier: Apache-2.0
#include "common/task/needle_insertion.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <variant>

#include "common/core/check.h"

namespace palpate {
namespace {

constexpr double kFarthestBehind_m = 0.2;  // of a tip from the membrane
constexpr double kAtSurface_m = 1e-8;
constexpr double kJustBefore_s = 0.02;  // a puncture
constexpr int kMostSteps = 64;          // along the way back; a plane that faces it takes one

AnalyticSurface surface_of(const Geometry& geometry) {
  return std::visit(
      [](const auto& shape) -> AnalyticSurface {
        if constexpr (std::is_same_v<std::decay_t<decltype(shape)>, FileGeometry>) {
          PALPATE_REQUIRE(false);  // the session is refused
          return {};
        } else {
          return AnalyticSurface(shape);
        }
      },
      geometry);
}

}  // namespace

NeedleInsertion::NeedleInsertion(const NeedleTask& task, const ToolShape& tool)
    : tool_(tool), direction_(task.direction), membrane_(task.membrane) {
  for (const NeedleLayer& layer : task.layers) {
    layers_.push_back({.tissue = layer.tissue,
                       .surface = surface_of(layer.geometry),
                       .material = layer.material});
    score_.layers.push_back({.name = layer.name, .is_spared = layer.is_spared});
  }
  score_.membrane = membrane_;
  score_.most_overshoot_m = task.most_overshoot_m.value_or(kNotKnown);
}

void NeedleInsertion::take(const SceneState& scene) {
  for (Layer& layer : layers_) {
    if (layer.tissue >= scene.tissues.size()) continue;
    const TissueSurface& tissue = scene.tissues[layer.tissue];
    if (!(tissue.stiffness_newton_per_m > 0.0)) continue;
    layer.material.stiffness_newton_per_m = tissue.stiffness_newton_per_m;
    layer.material.damping_newton_s_per_m = tissue.damping_newton_s_per_m;
  }
}

void NeedleInsertion::reset() {
  pose_.reset();
  for (Layer& layer : layers_) {
    layer.touch.reset();
    layer.relaxation = {};
    layer.is_broken_now = false;
  }
}

void NeedleInsertion::follow(const ToolPose& now) {
  const double dt_s = pose_ ? std::max(0.0, now.time_s - pose_->time_s) : 0.0;
  for (Layer& layer : layers_) step(layer, now, dt_s);
  pose_ = now;
}

/// As Scene::step() in physics_node and LocalTissues in mofc_node.
void NeedleInsertion::step(Layer& layer, const ToolPose& now, double dt_s) {
  const TissueMotionConfig at_rest;
  const TissueStep step(layer.surface, at_rest, tool_, now, pose_);
  const bool was_punctured = layer.is_punctured();
  Touch touch = step.follow_tip(layer.tissue, layer.touch ? &*layer.touch : nullptr);
  if (layer.material.relaxing_stiffness_newton_per_m > 0.0) {
    layer.relaxation.press(layer.material.relaxation_time_s,
                           touch.is_punctured ? 0.0 : touch.penetration_m(), dt_s);
  }
  settle(touch, step.moved_m(), layer.material, layer.relaxation.relaxed_m);
  layer.touch = touch;
  layer.is_broken_now = touch.is_punctured && !was_punctured;
}

void NeedleInsertion::count(double t_s, double newton, double elapsed_s) {
  const Vector3 front_m = pose_->tip_m + tool_.tip_radius_m * direction_;
  const Layer& outermost = layers_.front();
  if (!entry_m_ && (outermost.penetration_m() > 0.0 || outermost.is_punctured())) {
    entry_m_ = front_m - std::max(0.0, outermost.penetration_m()) * direction_;
    score_.depth_most_m = score_.sideways_m = 0.0;
  }
  double depth_m = kNotKnown;
  if (entry_m_) {
    const Vector3 from_entry_m = front_m - *entry_m_;
    depth_m = direction_.dot(from_entry_m);
    score_.depth_most_m = std::max(score_.depth_most_m, depth_m);
    // of the way outside nothing is asked
    if (depth_m > 0.0) {
      score_.sideways_m = std::max(score_.sideways_m, (from_entry_m - depth_m * direction_).norm());
    }
  }
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    if (!layers_[i].is_broken_now) continue;
    LayerScore& layer = score_.layers[i];
    if (++layer.punctures > 1) continue;
    layer.punctured_after_s = t_s;
    layer.puncture_depth_m = depth_m;
    // by now it has broken down: mofc_node may be a few ticks ahead
    layer.puncture_newton = newton;
    for (const auto& [at_s, before] : recent_) {
      layer.puncture_newton = std::max(layer.puncture_newton, before);
    }
  }
  recent_.emplace_back(t_s, newton);
  while (recent_.front().first < t_s - kJustBefore_s) recent_.pop_front();
  if (score_.layers[membrane_].punctures > 0) {
    score_.end_behind_m = behind_membrane_m();
    score_.overshoot_m = std::isfinite(score_.overshoot_m)
                             ? std::max(score_.overshoot_m, score_.end_behind_m)
                             : score_.end_behind_m;
  }
  const auto innermost = std::find_if(layers_.rbegin(), layers_.rend(), [](const Layer& layer) {
    return layer.penetration_m() > 0.0;
  });
  if (innermost != layers_.rend() && newton > 0.0) innermost->forces.add(newton, elapsed_s);
}

/// From the foremost point of the tip back along the insertion to the membrane; 0: it is not
/// behind.
double NeedleInsertion::behind_membrane_m() const {
  const Vector3 front_m = pose_->tip_m + tool_.tip_radius_m * direction_;
  double back_m = 0.0;
  for (int i = 0; i < kMostSteps && back_m < kFarthestBehind_m; ++i) {
    const double distance_m =
        layers_[membrane_].surface.view(front_m - back_m * direction_).distance_m;
    if (distance_m < kAtSurface_m) return back_m;
    back_m += distance_m;
  }
  return 0.0;
}

NeedleInsertion::Mark NeedleInsertion::mark(double t_s) {
  const LayerScore& membrane = score_.layers[membrane_];
  if (membrane.punctures == 0) return Mark::kTooEarly;
  if (std::isfinite(score_.told_after_s)) return Mark::kRepeated;
  score_.told_after_s = t_s - membrane.punctured_after_s;
  return Mark::kFirst;
}

void NeedleInsertion::finish() {
  for (std::size_t i = 0; i < layers_.size(); ++i) {
    score_.layers[i].force = layers_[i].forces.figures();
  }
}

}  // namespace palpate
