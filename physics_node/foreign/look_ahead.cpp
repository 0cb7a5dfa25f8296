// SPDX-License-Identifier: Apache-2.0
#include "physics_node/foreign/look_ahead.h"

#include <algorithm>
#include <cmath>

namespace palpate::physics {
namespace {

constexpr double kAhead_s = 0.15;
constexpr double kFarthest_m = 30e-3;
constexpr double kStill_m_per_s = 1e-3;
constexpr double kSurface_m = 0.05e-3;
constexpr double kShallow_m = 0.5e-3;  // below the surface
constexpr double kDeep_m = 2e-3;
constexpr double kSlope_m = 0.5e-3;
constexpr double kFeltNewton = 1e-3;
constexpr double kLeastError = 0.05;          // of the stiffness
constexpr double kMeasurable_m_per_s = 5e-3;  // slower, damping is lost in the rest

}  // namespace

std::optional<Ahead> look_ahead(const ForceAt& force_at, const Vector3& position_m,
                                const Vector3& velocity_m_per_s) {
  const double speed = velocity_m_per_s.norm();
  if (speed < kStill_m_per_s) return std::nullopt;
  const Vector3 along = velocity_m_per_s / speed;
  const double reach_m = std::min(speed * kAhead_s, kFarthest_m);
  const Vector3 as_far_as_m = position_m + reach_m * along;
  if (force_at(as_far_as_m).norm() <= kFeltNewton) return Ahead{std::nullopt, as_far_as_m};

  // the surface, between a place without force and one with
  double free_m = 0.0;
  double felt_m = reach_m;
  while (felt_m - free_m > kSurface_m) {
    const double middle_m = 0.5 * (free_m + felt_m);
    const bool is_felt = force_at(position_m + middle_m * along).norm() > kFeltNewton;
    (is_felt ? felt_m : free_m) = middle_m;
  }
  // the force there points out of the tissue
  const Vector3 surface_m = position_m + 0.5 * (free_m + felt_m) * along;
  const Vector3 outwards = force_at(surface_m + kShallow_m * along);
  if (outwards.norm() <= kFeltNewton) return std::nullopt;
  const Vector3 normal = outwards.normalized();
  const double shallow_m = -normal.dot(kShallow_m * along);
  if (shallow_m < 0.1 * kShallow_m) return std::nullopt;  // along the surface: no depth to speak of

  const double shallow = outwards.norm() / shallow_m;
  const double deep = normal.dot(force_at(surface_m - kDeep_m * normal)) / kDeep_m;
  if (deep <= 0.0) return std::nullopt;  // through it
  const Foreseen tissue{
      .surface_m = surface_m,
      .normal = normal,
      .stiffness_newton_per_m = deep,
      .slope_error_newton_per_m = std::max(kLeastError * deep, std::abs(deep - shallow)),
      .newton = deep * kDeep_m};
  return Ahead{tissue, as_far_as_m};
}

ContactLaw law_of(const ForceAt& force_at, const Observation& seen) {
  const Vector3 normal = seen.normal.value_or(seen.force_on_tool_newton.normalized());
  const double here = normal.dot(force_at(seen.position_m));
  const double deeper = normal.dot(force_at(seen.position_m - kSlope_m * normal));
  const double approach = -normal.dot(seen.velocity_m_per_s);
  const double rest = normal.dot(seen.force_on_tool_newton) - here;
  return {
      .stiffness_newton_per_m = (deeper - here) / kSlope_m,
      .damping_newton_s_per_m = std::abs(approach) > kMeasurable_m_per_s ? rest / approach : 0.0};
}

}  // namespace palpate::physics
