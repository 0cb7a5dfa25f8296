// SPDX-License-Identifier: Apache-2.0
// scene_messages.h — the scene that physics_node publishes to viewers (hop 5), and the hand target
// (hop 6) and the change of a tissue (hop 8) that a viewer sends, as plain structs in SI units.
// Wire form: scene.proto, hand_target.proto and tissue_change.proto in proto/palpate/v1. Not for
// the haptic loop: these structs allocate.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/core/messages.h"
#include "common/core/pointer_config.h"

namespace palpate {

/// The kind of body to which a surface belongs; values as in scene.proto.
enum class TissueShape : std::uint8_t {
  kUnknown = 0,
  kHalfSpace = 1,  ///< drawn as a patch of the plane
  kSphere = 2,
  kBox = 3,
  kPointCloud = 4,
  kTetrahedra = 5,
  kCapsule = 6,
  kTriangleSurface = 7,
};

/// A surface as triangles, or as points if there are none.
struct SurfaceMesh {
  std::vector<float> vertices_m;         ///< W: x,y,z,x,y,z,…
  std::vector<std::uint32_t> triangles;  ///< three indices each, counter-clockwise from outside

  [[nodiscard]] std::size_t vertex_count() const { return vertices_m.size() / 3; }
  [[nodiscard]] Vector3 vertex_m(std::uint32_t index) const {
    const float* at = vertices_m.data() + std::size_t{3} * index;
    return {at[0], at[1], at[2]};
  }
};

/// One tissue at rest: undeformed, and at the centre of its prescribed motion.
struct TissueSurface {
  std::string name;
  TissueShape shape = TissueShape::kUnknown;
  SurfaceMesh mesh;
  std::vector<float> vertex_stiffness_newton_per_m;  ///< per vertex; empty: uniform
  double stiffness_newton_per_m = 0.0;               ///< k; 0 if the material has none
  double damping_newton_s_per_m = 0.0;               ///< b; 0 if the material has none
  bool is_restorable = false;                        ///< TissueChange::restores is accepted
};

/// A box with the axes of W.
struct ReachBox {
  Vector3 center_m = Vector3::Zero();
  Vector3 half_extent_m = Vector3::Zero();  ///< each > 0
};

/// Hop 5: the description of the scene for viewers. Sent on every subscription and every change.
struct SceneState {
  Header header;               ///< physics_node's
  std::uint64_t revision = 0;  ///< from 1; increases whenever anything below changes
  std::string session_name;
  std::string session_text;  ///< the session including overrides, protobuf text format
  std::string controller;    ///< "none", "mofc guard", …
  double device_rate_hz = 0.0;
  double physics_rate_hz = 0.0;
  double peak_force_newton = 0.0;  ///< limit on |force on hand|
  double tip_radius_m = 0.0;
  double shaft_length_m = 0.0;  ///< from the tip's centre along +z of T; 0: no shaft
  double shaft_radius_m = 0.0;
  double workspace_scale_ratio = 1.0;  ///< tool displacement / hand displacement
  std::vector<TissueSurface> tissues;
  std::optional<PointerConfig> pointer;  ///< empty: HandTarget is not accepted
  bool accepts_changes = false;          ///< of tissues: TissueChange
  std::optional<ReachBox> reach{};       ///< of the tool; empty: unknown, or a clutch moves it
};

/// Hop 5: deformed vertices of one tissue, and the displacement of the whole tissue.
struct MeshFrame {
  Header header;  ///< physics_node's
  std::uint64_t scene_revision = 0;
  std::uint32_t tissue = 0;        ///< index in SceneState::tissues
  std::uint32_t first_vertex = 0;  ///< start of the range; other vertices are undeformed
  std::vector<float> vertices_m;   ///< W, deformed, before `displacement_world_m` is added
  Vector3 displacement_world_m = Vector3::Zero();  ///< of the tissue from its place in SceneState
  std::uint64_t device_sequence = 0;               ///< of the DeviceState that set the tool pose
  /// Equivalent strain of an elastic body, per vertex of the range, ≥ 0; empty: none.
  std::vector<float> vertex_strain{};
};

/// Hop 6: the intended position of the simulated hand.
struct HandTarget {
  Header header;                              ///< viewer_node's
  std::uint64_t holder_id = 0;                ///< one client of that viewer_node; not 0
  Vector3 hand_position_m = Vector3::Zero();  ///< D
  bool is_released = false;                   ///< the client releases the hand, which stays
  std::uint32_t buttons = 0;                  ///< bit i: button i is held
};

/// Hop 8: other material constants for a tissue, or all of an elastic body again.
struct TissueChange {
  Header header;                        ///< viewer_node's
  std::uint32_t tissue = 0;             ///< index in SceneState::tissues
  double stiffness_newton_per_m = 0.0;  ///< k ≥ 0; with b not both 0
  double damping_newton_s_per_m = 0.0;  ///< b ≥ 0
  bool restores = false;                ///< what was ablated; then k and b are 0
};

}  // namespace palpate
