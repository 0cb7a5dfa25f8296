// dented_surface.h — how a tissue without a deformation of its own is drawn while the tool presses
// on it. For the eye only: the force knows nothing of it.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "common/core/scene_messages.h"
#include "common/core/vector.h"
#include "physics_node/surfaces/geometry.h"

namespace palpate::physics {

/// Vertices [first, first + count).
struct VertexRange {
  std::size_t first = 0;
  std::size_t count = 0;
};

/// The vertices near the tip give way to it, along the normal n at the touch. With p the
/// penetration, r the tip's radius and d a vertex's distance from the axis of the touch:
///
///   d ≤ a   h = p − r + √(r² − d²)                      the tip's own surface
///   d > a   h = h(a) a/d ((R − d)/(R − a))²,  0 from R  the tail, 1/d like an elastic
///   half-space's;
///                                                       never inside the tip
///   a = min(√(r p), r/√2), the radius of a Hertz contact until the tip is half sunk
///   R = a + 4 max(a, p)
///
/// Released, it relaxes like the material: u' = −u/τ, τ = b/k. Outside the haptic step: allocates.
class DentedSurface {
 public:
  using View = std::function<SurfaceView(const Vector3& point_world_m)>;

  /// @param view          of the undeformed surface
  /// @param relaxation_s  τ ≥ 0; infinite: a dent stays
  DentedSurface(const SurfaceMesh& rest, View view, double tip_radius_m, double relaxation_s);

  /// The tip was here when `elapsed_s` ≥ 0 were over since the last call.
  void advance(const Vector3& tip_position_world_m, double elapsed_s);
  /// So was the tip of another tool at the time of the last advance().
  void press(const Vector3& tip_position_world_m);

  /// What moved since it was last taken; nothing below 10 µm, which nobody sees.
  [[nodiscard]] std::optional<VertexRange> take_moved();
  /// Everything that is not at rest, now taken.
  [[nodiscard]] std::optional<VertexRange> take_dented();
  /// The vertices of a range as they are now; W.
  [[nodiscard]] std::vector<float> vertices_m(const VertexRange& range) const;

  /// At rest again, at once.
  void reset();

 private:
  [[nodiscard]] std::optional<VertexRange> take(const std::function<bool(std::size_t)>& is_wanted);

  std::vector<Vector3> rest_m_;
  View view_;
  double tip_radius_m_;
  double relaxation_s_;
  std::vector<Vector3> displacement_m_;
  std::vector<Vector3> taken_m_;  // displacements as last taken
  bool is_at_rest_ = true;        // and taken so
};

}  // namespace palpate::physics
