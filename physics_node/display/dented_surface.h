// SPDX-License-Identifier: Apache-2.0
// dented_surface.h — the drawn dent of a tissue without a deformation model while the tool presses
// on it. It does not affect the force.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "common/contact/surface_view.h"
#include "common/core/scene_messages.h"
#include "common/core/vector.h"

namespace palpate::physics {

/// Vertices [first, first + count).
struct VertexRange {
  std::size_t first = 0;
  std::size_t count = 0;
};

/// Vertices near the tip move along the normal at the contact. With p the penetration, r the tip's
/// radius, d a vertex's distance from the axis of the contact and h the depth of the dent:
///
///   d ≤ a   h = p − r + √(r² − d²)                      the surface of the tip
///   d > a   h = h(a) a/d ((R − d)/(R − a))²,  0 from R  the tail, 1/d as of an elastic half-space;
///                                                       never inside the tip
///   a = min(√(r p), r/√2), the radius of a Hertz contact until the tip is half sunk
///   R = a + 4 max(a, p)
///
/// After release the displacement u decays like the material: u' = −u/τ, τ = b/k. Allocates; not
/// for the haptic step.
class DentedSurface {
 public:
  using View = std::function<SurfaceView(const Vector3& point_world_m)>;

  /// @param view          of the undeformed surface
  /// @param relaxation_s  τ ≥ 0; infinite: dents are permanent
  DentedSurface(const SurfaceMesh& rest, View view, double tip_radius_m, double relaxation_s);

  /// Advances by `elapsed_s` ≥ 0, then presses with the tip at this place.
  void advance(const Vector3& tip_position_world_m, double elapsed_s);
  /// Presses with the tip of another tool at the time of the last advance().
  void press(const Vector3& tip_position_world_m);

  /// @param relaxation_s  as for the constructor
  void set_relaxation(double relaxation_s) { relaxation_s_ = relaxation_s; }

  /// The vertices that moved since they were last taken, by more than 10 µm or back to rest.
  [[nodiscard]] std::optional<VertexRange> take_moved();
  /// All vertices that are not at rest; they count as taken.
  [[nodiscard]] std::optional<VertexRange> take_dented();
  /// The current vertices of a range; W.
  [[nodiscard]] std::vector<float> vertices_m(const VertexRange& range) const;

  /// Returns all vertices to rest at once.
  void reset();

 private:
  [[nodiscard]] std::optional<VertexRange> take(const std::function<bool(std::size_t)>& is_wanted);

  std::vector<Vector3> rest_m_;
  View view_;
  double tip_radius_m_;
  double relaxation_s_;
  std::vector<Vector3> displacement_m_;
  std::vector<Vector3> taken_m_;  // displacements as last taken
  bool is_at_rest_ = true;        // all displacements are 0, and taken as 0
};

}  // namespace palpate::physics
