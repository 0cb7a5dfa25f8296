// SPDX-License-Identifier: Apache-2.0
// mujoco_engine.h — MuJoCo as the physics: an MJCF scene with the tool as a mocap body.
#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "physics_node/engines/mujoco/mujoco_surfaces.h"
#include "physics_node/sdk/physics.h"

namespace palpate::engines {

/// Frees what MuJoCo has made.
struct DeleteMujoco {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};

/// The scene must have one mocap body named `tool`, with the tip at its origin and the shaft along
/// its z axis. Its geoms, and those of the body (`probe`) that a weld or connect constraint ties to
/// it, are the tool; all contacts of these with other geoms are reported with position, normal,
/// depth and MuJoCo's force. Give these geoms margin = gap = 0.03, so that a tissue is known before
/// it is touched. A tool without a probe touches only bodies that can move: MuJoCo
/// computes no force between bodies that cannot.
///
/// A contact model is estimated from the forces: MuJoCo's constraints have no stiffness of their
/// own, it follows from masses and impedances (mujoco.org, "Computation", solver parameters).
class MujocoEngine final : public sdk::Engine {
 public:
  /// @throws sdk::SetupError  if the scene cannot be read, or breaks one of these rules
  MujocoEngine(const sdk::Setup& setup, const std::string& scene_file);

  /// @throws std::runtime_error  if the simulation diverges
  sdk::Answer step(const sdk::Motion& motion) override;
  std::vector<sdk::Surface> surfaces() override;
  bool deformed(std::size_t surface, std::vector<float>& vertices_m) override;

 private:
  void find_tool(const std::string& scene_file);
  void move_tool(const sdk::Motion& motion);
  void place_probe(const sdk::Motion& motion);
  [[nodiscard]] bool is_tool(int geom) const;
  /// All with force; of each tissue without, the nearest within the margin of the tool's geoms.
  [[nodiscard]] std::vector<sdk::Contact> contacts() const;
  [[nodiscard]] std::optional<sdk::Contact> contact_of(int contact) const;
  /// Contacts of one tissue share a contact model: the bodies that hang together, or one geom of
  /// the world.
  [[nodiscard]] std::uint32_t tissue_of(int geom) const;

  std::unique_ptr<mjModel, DeleteMujoco> model_;
  std::unique_ptr<mjData, DeleteMujoco> data_;
  int tool_ = -1;   // body
  int probe_ = -1;  // body; the tool itself without one
  int steps_ = 1;   // of MuJoCo for one of physics
  bool is_placed_ = false;
  std::optional<MujocoSurfaces> surfaces_;
};

}  // namespace palpate::engines
