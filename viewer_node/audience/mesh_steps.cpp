// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/audience/mesh_steps.h"

#include <cmath>
#include <cstddef>
#include <vector>

namespace palpate::viewer {
namespace {

std::int32_t steps_of(double displacement_m, double step_m) {
  return static_cast<std::int32_t>(std::lround(displacement_m / step_m));
}

MeshSteps::Tissue tissue_steps(const std::vector<float>& rest_m, const MeshFrame& frame,
                               double step_m) {
  MeshSteps::Tissue tissue{.tissue = frame.tissue};
  bool is_displaced = false;  // the run that grows
  std::uint32_t length = 0;
  // a frame without vertices displaces the tissue as a whole only
  for (std::size_t i = 0; i + 2 < frame.vertices_m.size(); i += 3) {
    std::array<std::int32_t, 3> steps{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      steps[axis] = steps_of(
          static_cast<double>(frame.vertices_m[i + axis]) - static_cast<double>(rest_m[i + axis]),
          step_m);
    }
    const bool has_moved = steps[0] != 0 || steps[1] != 0 || steps[2] != 0;
    if (has_moved != is_displaced) {
      tissue.runs.push_back(length);
      is_displaced = has_moved;
      length = 0;
    }
    ++length;
    if (!has_moved) continue;
    tissue.displacement_steps.insert(tissue.displacement_steps.end(), steps.begin(), steps.end());
  }
  if (is_displaced) tissue.runs.push_back(length);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    tissue.offset_steps[axis] =
        steps_of(frame.displacement_world_m[static_cast<Eigen::Index>(axis)], step_m);
  }
  return tissue;
}

}  // namespace

MeshSteps mesh_steps(const SceneState& scene, std::span<const MeshFrame> frames, double step_m) {
  MeshSteps result{
      .session_id = scene.header.session_id, .scene_revision = scene.revision, .step_m = step_m};
  for (const MeshFrame& frame : frames) {
    MeshSteps::Tissue tissue =
        tissue_steps(scene.tissues[frame.tissue].mesh.vertices_m, frame, step_m);
    const bool is_displaced =
        !tissue.runs.empty() || tissue.offset_steps != std::array<std::int32_t, 3>{};
    if (is_displaced) result.tissues.push_back(std::move(tissue));
  }
  return result;
}

}  // namespace palpate::viewer
