// scene_messages.h — what physics_node tells viewers to draw (hop 5), and the one thing a viewer
// may say (hop 6). Like messages.h: plain structs, SI units; the wire form is
// proto/palpate/v1/scene.proto. Not for the haptic loop: these allocate.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/core/messages.h"
#include "common/core/pointer_config.h"

namespace palpate {

/// What kind of body a surface belongs to; values as in the .proto.
enum class TissueShape : std::uint8_t {
  kUnknown = 0,
  kHalfSpace = 1,  ///< a patch of the plane is drawn
  kSphere = 2,
  kBox = 3,
  kPointCloud = 4,
  kTetrahedra = 5,
  kCapsule = 6,
  kTriangleSurface = 7,
};

/// A surface as triangles; points where there are none.
struct SurfaceMesh {
  std::vector<float> vertices_m;         ///< W: x,y,z,x,y,z,…
  std::vector<std::uint32_t> triangles;  ///< three each, counter-clockwise seen from outside

  [[nodiscard]] std::size_t vertex_count() const { return vertices_m.size() / 3; }
};

/// One tissue, at rest: not dented, and in the middle of a motion of its own.
struct TissueSurface {
  std::string name;
  TissueShape shape = TissueShape::kUnknown;
  SurfaceMesh mesh;
  std::vector<float> vertex_stiffness_newton_per_m;  ///< one each; empty: the same everywhere
  double stiffness_newton_per_m = 0.0;               ///< k; 0 for materials without
  double damping_newton_s_per_m = 0.0;               ///< b; 0 for materials without
};

/// Hop 5: everything a viewer needs to draw. Sent on every subscription and on every change.
struct SceneState {
  Header header;               ///< physics_node's
  std::uint64_t revision = 0;  ///< from 1; another one: everything below may differ
  std::string session_name;
  std::string session_text;  ///< the session with its overrides, protobuf text format
  std::string controller;    ///< "none", "mofc guard", …
  double device_rate_hz = 0.0;
  double physics_rate_hz = 0.0;
  double peak_force_newton = 0.0;  ///< limit of |force on the hand|
  double tip_radius_m = 0.0;
  double shaft_length_m = 0.0;  ///< from the tip's centre along T's +z; 0: only a tip
  double shaft_radius_m = 0.0;
  double workspace_scale_ratio = 1.0;  ///< displacement of the tool / of the hand
  std::vector<TissueSurface> tissues;
  std::optional<PointerConfig> pointer;  ///< none: no HandTarget is accepted
};

/// Hop 5: vertices of one tissue that gave way, and where the tissue is as a whole.
struct MeshFrame {
  Header header;  ///< physics_node's
  std::uint64_t scene_revision = 0;
  std::uint32_t tissue = 0;        ///< index in SceneState::tissues
  std::uint32_t first_vertex = 0;  ///< the range begins here; what is outside stands still
  std::vector<float> vertices_m;   ///< W, deformed, of the tissue where SceneState has it
  Vector3 displacement_world_m = Vector3::Zero();  ///< of the whole tissue from there
  std::uint64_t device_sequence = 0;               ///< of the DeviceState whose tool did it
};

/// Hop 6: where the simulated hand should mean to be.
struct HandTarget {
  Header header;                              ///< viewer_node's
  std::uint64_t holder_id = 0;                ///< one client of that viewer_node; not 0
  Vector3 hand_position_m = Vector3::Zero();  ///< D
  bool is_released = false;                   ///< the holder lets go; the hand stays
};

}  // namespace palpate
