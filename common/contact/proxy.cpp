// SPDX-License-Identifier: Apache-2.0
#include "common/contact/proxy.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

constexpr double kLeastClearance_m = 5e-4;
constexpr double kSlideRatio = kMostForcePerMotion - 1.0;
// Length of a partial step over the distance to the surface. A place that is then too close is
// pushed out by at most the rest, which is less than its own distance: neither motion passes
// through the surface.
constexpr double kStepRatio = 0.45;
// Longest direct move to the nearest place, over the clearance.
constexpr double kReachRatio = 0.9;
constexpr int kMostPushes = 4;
constexpr int kMostHalvings = 4;
// Places nearer than this are the same [m]; and the share of the depth by which two views may
// differ.
constexpr double kThere_m = 1e-6;
constexpr double kAgreementRatio = 0.01;

/// The surface from the proxy's side.
SurfaceView seen_from(const Surface& surface, const Vector3& point_m, Proxy& proxy) noexcept {
  ++proxy.hint.views;
  const SurfaceView seen = surface.view(point_m, proxy.hint);
  return proxy.side < 0.0 ? seen.from_behind() : seen;
}

/// The surface that a tool displaced by −`held_m` from its proxy is in contact with, where `at` is
/// the view from the proxy.
SurfaceView surface_of_contact(const SurfaceView& at, const Vector3& held_m,
                               double clearance) noexcept {
  const double depth_m = held_m.norm();
  SurfaceView surface = at;
  surface.distance_m = clearance - depth_m;
  surface.normal = held_m / depth_m;
  const Matrix3& H = at.curvature_per_m;
  constexpr double kSameDirection = 0.9999;
  // depth over the radius of curvature: deeper, the foot point is ill-defined
  constexpr double kDeepest = 0.9;
  if (surface.normal.dot(at.normal) > kSameDirection) {
    // one wall: the parallel surface at this depth
    surface.curvature_per_m.setZero();
    if (depth_m * H.norm() < kDeepest) {
      const Matrix3 parallel = (Matrix3::Identity() - depth_m * H).inverse() * H;
      surface.curvature_per_m = 0.5 * (parallel + parallel.transpose());
    }
    return surface;
  }
  // in a corner, or delayed by the speed limit: the proxy stays while the tool moves on in the
  // plane of both normals
  const Vector3 across = (at.normal - surface.normal.dot(at.normal) * surface.normal).normalized();
  surface.curvature_per_m = -across * across.transpose() / depth_m;
  surface.trust_radius_m =
      std::clamp(0.5 * depth_m, kMinTrustRadiusM, std::max(kMinTrustRadiusM, at.trust_radius_m));
  return surface;
}

Vector3 nearest_place(const SurfaceView& here, const Vector3& point_m, double clearance) noexcept {
  return here.distance_m < clearance
             ? Vector3(point_m + (clearance - here.distance_m) * here.normal)
             : point_m;
}

}  // namespace

double clearance_m(double radius_m) noexcept { return std::max(radius_m, kLeastClearance_m); }

Proxy free_at(const Surface& surface, const Vector3& point_m, SurfaceHint hint) noexcept {
  Proxy proxy{.point_m = point_m, .place_m = point_m, .hint = hint};
  if (surface.is_sheet() && seen_from(surface, point_m, proxy).distance_m < 0.0) proxy.side = -1.0;
  return proxy;
}

Proxy begun_at(const Surface& surface, double radius_m, const Vector3& point_m,
               SurfaceHint hint) noexcept {
  Proxy proxy{.point_m = point_m, .hint = hint};
  proxy.surface = seen_from(surface, point_m, proxy);
  if (surface.is_sheet() && proxy.surface.distance_m < 0.0) {
    proxy.side = -1.0;
    proxy.surface = proxy.surface.from_behind();
  }
  proxy.place_m = nearest_place(proxy.surface, point_m, clearance_m(radius_m));
  return proxy;
}

void move(const Surface& surface, double radius_m, const Vector3& point_m, double dt_s,
          Proxy& proxy, std::uint32_t most_views) noexcept {
  const double clearance = clearance_m(radius_m);
  const std::uint32_t views_before = proxy.hint.views;
  const auto look = [&](const Vector3& place) { return seen_from(surface, place, proxy); };
  const SurfaceView here = look(point_m);
  const Vector3 from_m = proxy.place_m;
  const double motion_m = (point_m - proxy.point_m).norm();
  const double most_m = kSlideRatio * motion_m + kCreep_m_per_s * dt_s;
  const Vector3 nearest_m = nearest_place(here, point_m, clearance);
  proxy.point_m = point_m;
  proxy.place_m = nearest_m;
  proxy.surface = here;
  if (here.is_plane()) return;  // there is no way around it
  if (!(motion_m <= kLongestMotion_m) || !std::isfinite(here.distance_m)) return;

  // directly to the nearest place, if the surface cannot be in between
  const double way_m = (nearest_m - from_m).norm();
  const auto is_within_reach = [&](double reach_m) {
    return reach_m <= kReachRatio * clearance &&
           look(nearest_m).distance_m >=
               clearance - kThere_m - kAgreementRatio * (clearance - here.distance_m);
  };
  if (way_m <= most_m) {
    if (nearest_m == point_m ? here.distance_m > way_m : is_within_reach(way_m)) return;
  }

  // in partial steps towards the tool, along the surface where it blocks the way
  Vector3 place_m = from_m;
  SurfaceView at = look(place_m);
  const auto push_out = [&] {
    for (int i = 0; i < kMostPushes && at.distance_m < clearance - kThere_m; ++i) {
      place_m += (clearance - at.distance_m) * at.normal;
      at = look(place_m);
    }
    return at.distance_m >= clearance - 2.0 * kThere_m;
  };
  if (!(at.distance_m > 0.0)) return;  // the surface has moved over the proxy
  push_out();
  double left_m = most_m;
  bool is_there = false;
  while (!is_there && proxy.hint.views - views_before < most_views) {
    Vector3 way = point_m - place_m;
    if (at.distance_m <= clearance + kThere_m) way -= std::min(0.0, way.dot(at.normal)) * at.normal;
    const double length_m = way.norm();
    is_there = true;
    if (length_m <= kThere_m || left_m <= kThere_m) break;  // no nearer than that
    double step_m = std::min({length_m, left_m, kStepRatio * at.distance_m});
    const Vector3 last_m = place_m;
    const SurfaceView last = at;
    const double to_go_m = (point_m - last_m).norm();
    for (int i = 0; i < kMostHalvings && is_there; ++i, step_m *= 0.25) {
      place_m = last_m + step_m / length_m * way;
      at = look(place_m);
      const bool is_free = push_out();
      const double moved_m = (place_m - last_m).norm();
      if (is_free && moved_m <= left_m * (1.0 + 1e-9) &&
          (point_m - place_m).norm() < to_go_m - kThere_m) {
        left_m -= moved_m;
        is_there = false;
      }
    }
    if (is_there) {
      place_m = last_m;
      at = last;
    }
  }
  if (!is_there && most_views >= kMostProxyViews) return;
  if (const double rest_m = (nearest_m - place_m).norm();
      nearest_m != point_m && rest_m <= left_m && is_within_reach(rest_m)) {
    return;
  }

  const Vector3 held_m = place_m - point_m;
  if (held_m.norm() <= kThere_m) {
    proxy.place_m = point_m;
    return;
  }
  proxy.place_m = place_m;
  proxy.surface = surface_of_contact(at, held_m, clearance);
}

}  // namespace palpate
