// SPDX-License-Identifier: Apache-2.0
// scene_tool.h — one tool in a scene, and what the tissues remember of it. Its step is the step of
// the tissue: of physics_node, in lockstep and in the library.
#pragma once

#include <cstddef>
#include <memory>

#include "common/core/vector.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/scene/scene.h"

namespace palpate::physics {

/// Where a tool is and how it moves; frame W.
struct ToolState {
  Vector3 position_m = Vector3::Zero();             ///< of the centre of the tip
  ToolVelocity velocity{};                          ///< for damping
  Quaternion orientation = Quaternion::Identity();  ///< its z leads to the handle
  JawInput jaw{};                                   ///< counts with a gripper only
  bool is_energised = false;                        ///< its electrode; counts with one only
};

/// The state between two steps is the TissueMemory: proxies, friction, punctures and relaxation;
/// and that of the elastic tissues. The position of moving tissue follows from the time of the
/// step. step() is real-time safe: no allocation, no lock, no throw; except with elastic tissue at
/// ElasticPace::kVirtual.
class SceneTool {
 public:
  /// @param reach_m  the scene's; needed with elastic tissue only
  /// @param elastic  of all tools, which meet in it; null: none
  /// @param index    of this tool in it
  SceneTool(std::shared_ptr<const Scene> scene, double reach_m,
            std::shared_ptr<ElasticTissues> elastic, std::size_t index)
      : scene_(std::move(scene)),
        reach_m_(reach_m),
        elastic_(std::move(elastic)),
        index_(index),
        memory_(scene_->new_memory()) {}

  /// The force of all tissues on the tool, which has come here on a straight way.
  /// @param time_s  not before that of the last step
  SceneForce step(const ToolState& tool, double time_s) noexcept {
    const Vector3 shaft_to_handle = tool.orientation * Vector3::UnitZ();
    SceneForce force =
        scene_->step(memory_, tool.position_m, tool.velocity, time_s, shaft_to_handle);
    if (elastic_) {
      JawInput jaw = tool.jaw;
      jaw.inward_world = -shaft_to_handle;
      if (elastic_->gripper() && elastic_->gripper()->is_blade()) {
        jaw.inward_world = tool.orientation * elastic_->gripper()->blade_facing;
        jaw.edge_world = shaft_to_handle;
      }
      elastic_->step(index_, tool.position_m, time_s, reach_m_, force, jaw, tool.is_energised);
    }
    return force;
  }

  /// Continues as the other would, but for the elastic tissues. @pre  of the same scene
  void continue_as(const SceneTool& other) { memory_.continue_as(other.memory_); }

  [[nodiscard]] const Scene& scene() const noexcept { return *scene_; }
  [[nodiscard]] const TissueMemory& memory() const noexcept { return memory_; }
  /// null: none
  [[nodiscard]] ElasticTissues* elastic() const noexcept { return elastic_.get(); }
  [[nodiscard]] std::size_t index() const noexcept { return index_; }

 private:
  std::shared_ptr<const Scene> scene_;
  double reach_m_;
  std::shared_ptr<ElasticTissues> elastic_;
  std::size_t index_;
  TissueMemory memory_;
};

}  // namespace palpate::physics
