// SPDX-License-Identifier: Apache-2.0
// proxy.h — the proxy of a sphere of the tool: the place nearest to the tool that the sphere can
// reach without passing through the surface (a god-object, [Zilles95]).
//
// A spring from the tool to the proxy is the contact force. The proxy only moves closer to the
// tool, so its motion dissipates energy and never generates any. In one step it moves at most 3
// times as far as the tool plus 10 mm/s. Where the way opens suddenly, for example when a deep
// press slips off an edge, the force therefore falls at that rate and does not jump. With the
// steepest slope k of the law along the normal, between two steps
//
//   |ΔF| ≤ k (4 |Δx| + 10 mm/s Δt)        kMostForcePerMotion, kCreep_m_per_s
//
// Each partial step is shorter than half the distance to the surface, so the proxy does not step
// over thin tissue, at any speed of the tool: thin sheets hold at any depth. Where the nearest
// place is within reach, the proxy moves there at once, and the contact's surface is exactly that
// of view().
//
// The proxy starts anew at the tool after a motion of more than 0.1 m in one step (a teleport) and
// after a slide along the surface that needs more views than allowed (about 40 radii). A
// tip with a radius below 0.5 mm is kept 0.5 mm off the surface, so it cannot enter gaps narrower
// than 1 mm.
#pragma once

#include <cstdint>

#include "common/contact/surface.h"
#include "common/core/vector.h"

namespace palpate {

/// A sphere of the tool and one surface; in the frame of the surface.
struct Proxy {
  Vector3 point_m = Vector3::Zero();  ///< centre of the sphere at the tool
  Vector3 place_m = Vector3::Zero();  ///< centre of the sphere at the proxy
  SurfaceView surface{};              ///< in contact, seen from point_m on the proxy's side
  double side = 1.0;                  ///< −1: behind a sheet
  SurfaceHint hint{};

  /// The surface keeps the proxy away from the tool.
  [[nodiscard]] bool is_held() const noexcept { return place_m != point_m; }
};

inline constexpr double kCreep_m_per_s = 0.01;
/// Bound on the change of force in one step, divided by the law's steepest slope and the tool's
/// motion.
inline constexpr double kMostForcePerMotion = 4.0;
inline constexpr double kLongestMotion_m = 0.1;
inline constexpr std::uint32_t kMostProxyViews = 96;

/// Distance from the surface at which the proxy of a sphere is kept.
[[nodiscard]] double clearance_m(double radius_m) noexcept;

/// A tool that starts here: the proxy is at the nearest place outside the surface.
[[nodiscard]] Proxy begun_at(const Surface& surface, double radius_m, const Vector3& point_m,
                             SurfaceHint hint) noexcept;

/// A tool that is here and not held by the surface.
[[nodiscard]] Proxy free_at(const Surface& surface, const Vector3& point_m,
                            SurfaceHint hint) noexcept;

/// Moves the tool to `point_m` within `dt_s` ≥ 0, and the proxy after it. Needs 1 to 3 views as a
/// rule. No allocation, no throw.
/// @param most_views  after which the proxy takes no further partial step, which itself needs up to
///     20; with fewer than kMostProxyViews it goes on in the next call instead of starting anew
void move(const Surface& surface, double radius_m, const Vector3& point_m, double dt_s,
          Proxy& proxy, std::uint32_t most_views = kMostProxyViews) noexcept;

}  // namespace palpate
