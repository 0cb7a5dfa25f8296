// SPDX-License-Identifier: Apache-2.0
#include "physics_node/display/dented_surface.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace palpate::physics {
namespace {

constexpr double kSmallestTip_m = 1e-3;  // the dent of a finer tip would fall between vertices
constexpr double kVisible_m = 1e-5;      // smaller changes are not sent
constexpr double kGone_m = 1e-6;         // smaller displacements decay to 0

/// Depth of the dent at the distance `d` from its axis; see the header.
double dent_depth_m(double d, double p, double r) {
  const double a = std::min(std::sqrt(r * p), r / std::numbers::sqrt2);
  const auto under_tip = [&](double x) { return p - r + std::sqrt(r * r - x * x); };
  if (d <= a) return under_tip(d);
  const double reach = a + 4.0 * std::max(a, p);
  if (d >= reach) return 0.0;
  const double fade = (reach - d) / (reach - a);
  const double tail = under_tip(a) * (a / d) * fade * fade;
  return d < r ? std::max(tail, under_tip(d)) : tail;
}

}  // namespace

DentedSurface::DentedSurface(const SurfaceMesh& rest, View view, double tip_radius_m,
                             double relaxation_s)
    : view_(std::move(view)),
      tip_radius_m_(tip_radius_m),
      relaxation_s_(relaxation_s),
      displacement_m_(rest.vertex_count(), Vector3::Zero()),
      taken_m_(displacement_m_) {
  for (std::size_t i = 0; i < rest.vertex_count(); ++i) {
    rest_m_.emplace_back(rest.vertices_m[3 * i], rest.vertices_m[3 * i + 1],
                         rest.vertices_m[3 * i + 2]);
  }
}

void DentedSurface::advance(const Vector3& tip_position_world_m, double elapsed_s) {
  if (!is_at_rest_) {
    const double kept = relaxation_s_ > 0.0 ? std::exp(-elapsed_s / relaxation_s_) : 0.0;
    for (Vector3& displacement_m : displacement_m_) {
      displacement_m *= kept;
      if (displacement_m.squaredNorm() < kGone_m * kGone_m) displacement_m.setZero();
    }
  }
  press(tip_position_world_m);
}

void DentedSurface::press(const Vector3& tip_position_world_m) {
  const SurfaceView surface = view_(tip_position_world_m);
  const double penetration_m = tip_radius_m_ - surface.distance_m;
  if (!(penetration_m > 0.0) || !std::isfinite(penetration_m)) return;
  is_at_rest_ = false;

  const Vector3 touch_m = tip_position_world_m - surface.distance_m * surface.normal;
  const double radius_m = std::max(tip_radius_m_, kSmallestTip_m);
  for (std::size_t i = 0; i < rest_m_.size(); ++i) {
    // only near the contact: not the far side of a thin body
    const Vector3 from_touch_m = rest_m_[i] - touch_m;
    const double height_m = surface.normal.dot(from_touch_m);
    const double from_axis_m = (from_touch_m - height_m * surface.normal).norm();
    if (std::abs(height_m) > std::max(penetration_m, 2.0 * radius_m)) continue;
    const double depth_m = dent_depth_m(from_axis_m, penetration_m, radius_m);
    if (depth_m * depth_m > displacement_m_[i].squaredNorm()) {
      displacement_m_[i] = -depth_m * surface.normal;
    }
  }
}

std::optional<VertexRange> DentedSurface::take(const std::function<bool(std::size_t)>& is_wanted) {
  std::size_t first = rest_m_.size();
  std::size_t end = 0;
  for (std::size_t i = 0; i < rest_m_.size(); ++i) {
    if (!is_wanted(i)) continue;
    first = std::min(first, i);
    end = i + 1;
  }
  if (first >= end) return std::nullopt;
  for (std::size_t i = first; i < end; ++i) taken_m_[i] = displacement_m_[i];
  return VertexRange{first, end - first};
}

std::optional<VertexRange> DentedSurface::take_moved() {
  if (is_at_rest_) return std::nullopt;
  const auto moved = take([this](std::size_t i) {
    // a vertex that is back at rest counts, however small the step
    const bool is_back = displacement_m_[i].isZero(0.0) && !taken_m_[i].isZero(0.0);
    return is_back || (displacement_m_[i] - taken_m_[i]).squaredNorm() > kVisible_m * kVisible_m;
  });
  const auto is_zero = [](const Vector3& v) { return v.isZero(0.0); };
  is_at_rest_ = std::all_of(displacement_m_.begin(), displacement_m_.end(), is_zero) &&
                std::all_of(taken_m_.begin(), taken_m_.end(), is_zero);
  return moved;
}

std::optional<VertexRange> DentedSurface::take_dented() {
  if (is_at_rest_) return std::nullopt;
  return take([this](std::size_t i) {
    return !displacement_m_[i].isZero(0.0) || !taken_m_[i].isZero(0.0);
  });
}

std::vector<float> DentedSurface::vertices_m(const VertexRange& range) const {
  std::vector<float> vertices_m;
  vertices_m.reserve(3 * range.count);
  for (std::size_t i = range.first; i < range.first + range.count; ++i) {
    const Vector3 at_m = rest_m_[i] + displacement_m_[i];
    for (const double x : at_m) vertices_m.push_back(static_cast<float>(x));
  }
  return vertices_m;
}

void DentedSurface::reset() {
  std::fill(displacement_m_.begin(), displacement_m_.end(), Vector3::Zero());
  taken_m_ = displacement_m_;
  is_at_rest_ = true;
}

}  // namespace palpate::physics
