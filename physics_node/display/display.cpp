// SPDX-License-Identifier: Apache-2.0
#include "physics_node/display/display.h"

namespace palpate::physics {

SceneState scene_of(const Session& session, std::uint64_t session_id) {
  const Side& side = session.side();
  SceneState scene;
  scene.header.session_id = session_id;
  scene.session_name = session.name;
  scene.session_text = session.text;
  scene.controller = controller_text(side.mofc);
  scene.device_rate_hz = side.device.rate_hz;
  scene.physics_rate_hz = session.physics.rate_hz;
  scene.peak_force_newton = side.device.peak_force_newton;
  scene.tip_radius_m = session.scene.tip_radius_m;
  scene.shaft_length_m = session.scene.shaft_length_m;
  scene.shaft_radius_m = session.scene.shaft_radius_m;
  scene.workspace_scale_ratio = side.device.workspace.scale_ratio;
  const WorkspaceConfig& workspace = side.device.workspace;
  const std::optional<Vector3> half_extent_m = workspace_half_extent_m(side.driver);
  if (half_extent_m && !workspace.clutch_button) {
    scene.reach = ReachBox{.center_m = workspace.offset_m,
                           .half_extent_m = workspace.scale_ratio * *half_extent_m};
  }
  scene.pointer = side.hand.pointer;
  return scene;
}

}  // namespace palpate::physics
