// proxy.h — where the tissue lets a sphere of the tool be: as near to the tool as it can go without
// passing through the surface (a god-object, [Zilles95]).
//
// The tissue holds the sphere by a spring from the tool to the proxy. The proxy only ever moves
// closer to the tool, so what it does takes energy and never gives any. In one step it moves at
// most 3 times as far as the tool and 10 mm/s more; so where the way suddenly opens, as when a deep
// press slips off an edge, the force falls at that rate and does not step. With the steepest slope
// k of the law along the normal, from one step to the next
//
//   |ΔF| ≤ k (4 |Δx| + 10 mm/s Δt)        kMostForcePerMotion, kCreep_m_per_s
//
// It goes from place to place by less than half of its distance to the surface, so that nothing
// thinner than that is stepped over, however fast the tool: thin sheets hold at any depth. Where
// the nearest place is within reach it is taken at once, and the surface felt is that of view(),
// exactly.
//
// Not followed, but begun anew where the tool is: a motion of more than 0.1 m in one step (a
// teleport), and a slide along the surface too long for the steps there are (about 40 radii). A tip
// finer than 0.5 mm is kept 0.5 mm off the surface, so gaps narrower than 1 mm are closed to it.
#pragma once

#include "common/core/vector.h"
#include "physics_node/files/surface_files.h"

namespace palpate::physics {

/// A sphere of the tool and one tissue; places as the tissue sees them, moved with it.
struct Proxy {
  Vector3 point_m = Vector3::Zero();  ///< centre of the sphere, where the tool is
  Vector3 place_m = Vector3::Zero();  ///< and where the tissue lets it be
  SurfaceView surface{};              ///< as felt at point_m, from the side where the proxy is
  double side = 1.0;                  ///< −1: behind a sheet
  SurfaceHint hint{};

  /// The tissue holds it back.
  [[nodiscard]] bool is_held() const noexcept { return place_m != point_m; }
};

inline constexpr double kCreep_m_per_s = 0.01;
/// Bound on the change of force in one step, over the law's steepest slope and the tool's motion.
inline constexpr double kMostForcePerMotion = 4.0;
inline constexpr double kLongestMotion_m = 0.1;

/// How far from the surface the proxy of a sphere is kept.
[[nodiscard]] double clearance_m(double radius_m) noexcept;

/// As if the tool had begun here: held out by the nearest place of the surface.
[[nodiscard]] Proxy begun_at(const Shape& shape, double radius_m, const Vector3& point_m,
                             SurfaceHint hint) noexcept;

/// Not held, before the first look at the tissue.
[[nodiscard]] Proxy free_at(const Shape& shape, const Vector3& point_m, SurfaceHint hint) noexcept;

/// The tool goes to `point_m` within `dt_s` ≥ 0. At most some 100 views; 1 to 3 as a rule.
/// No allocation, no throw.
void move(const Shape& shape, double radius_m, const Vector3& point_m, double dt_s,
          Proxy& proxy) noexcept;

}  // namespace palpate::physics
