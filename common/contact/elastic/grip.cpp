// SPDX-License-Identifier: Apache-2.0
#include "common/contact/elastic/grip.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace palpate {
namespace {

constexpr int kMostHalvings = 60;  // to the rounding of a double

/// Coulomb friction along the edge of a blade, a step of its own.
void slide_along_edge(const NeedleLaw& blade, double most_newton,
                      const Matrix3& stiffness_newton_per_m, GripSlip& slip) noexcept {
  const Vector3& e = blade.edge_world;
  const double along_newton = slip.force_on_tool_newton.dot(e);
  const double excess = std::abs(along_newton) - most_newton;
  if (!(excess > 0.0)) return;
  const Vector3 softens = stiffness_newton_per_m * e;  // the force, by the way
  const double way_m = -std::copysign(excess, along_newton) / e.dot(softens);
  slip.slip_m += way_m * e;
  slip.force_on_tool_newton += way_m * softens;
}

}  // namespace

GripSlip slip_in_jaws(const Vector3& force_on_tool_newton, const Matrix3& stiffness_newton_per_m,
                      double most_newton) noexcept {
  const double newton = force_on_tool_newton.norm();
  if (newton <= most_newton) return {.force_on_tool_newton = force_on_tool_newton};

  Eigen::SelfAdjointEigenSolver<Matrix3> axes;
  axes.compute(stiffness_newton_per_m);
  const Vector3& k = axes.eigenvalues();
  const Vector3 along = axes.eigenvectors().transpose() * force_on_tool_newton;
  const auto held = [&](double mu) -> Vector3 {
    return (along.array() / (1.0 + mu * k.array())).matrix();
  };
  // |F'| falls from |F| at 0 to at most the limit where the softest axis alone would have it
  double low = 0.0;
  double high = (newton / most_newton - 1.0) / k[0];
  for (int i = 0; i < kMostHalvings && low < high; ++i) {
    const double middle = 0.5 * (low + high);
    (held(middle).norm() > most_newton ? low : high) = middle;
  }
  const Vector3 left = axes.eigenvectors() * held(high);
  const Vector3 slip_m = -high * left;
  if (left.allFinite() && slip_m.allFinite() && left.norm() <= newton) {
    return {.force_on_tool_newton = left, .slip_m = slip_m};
  }
  const Vector3 cut = most_newton / newton * force_on_tool_newton;
  return {.force_on_tool_newton = cut.allFinite() ? cut : Vector3::Zero()};
}

GripSlip slip_of_needle(const Vector3& force_on_tool_newton, const Matrix3& stiffness_newton_per_m,
                        const NeedleLaw& needle, double depth_m) noexcept {
  const Vector3& d = needle.inward_world;
  const double k = d.dot(stiffness_newton_per_m * d);
  const double push = -force_on_tool_newton.dot(d);
  const double z = std::max(0.0, depth_m);
  const double friction = needle.friction_newton_per_m;
  const double rubs_newton = needle.friction_newton + friction * z;
  GripSlip slip{.force_on_tool_newton = force_on_tool_newton};
  double way_m = 0.0;
  if (const double excess = push - needle.spreading_newton - rubs_newton; excess > 0.0) {
    // in the hole; beyond its end, by what is left after cutting
    const double in_hole_m = excess / (k + friction);
    const double to_end_m = std::max(0.0, needle.deepest_m - z);
    const double beyond_m = (excess - needle.cutting_newton) / (k + friction);
    way_m = in_hole_m <= to_end_m ? in_hole_m : std::max(to_end_m, beyond_m);
  } else if (const double pull = -push - rubs_newton; pull > 0.0) {
    way_m = -pull / k;
    slip.is_out = !(way_m > -z);
    if (slip.is_out) way_m = -z;
  }
  slip.slip_m = way_m * d;
  slip.force_on_tool_newton += stiffness_newton_per_m * slip.slip_m;
  if (needle.is_blade()) slide_along_edge(needle, rubs_newton, stiffness_newton_per_m, slip);
  if (slip.is_out) slip.force_on_tool_newton.setZero();
  if (slip.slip_m.allFinite() && slip.force_on_tool_newton.allFinite()) return slip;
  return {};
}

GripSlip slip_of(Grip& grip, const Vector3& slip_m, const Vector3& force_on_tool_newton,
                 const Matrix3& stiffness_newton_per_m) noexcept {
  NeedleLaw& needle = grip.needle;
  if (!needle.is_there()) {
    return slip_in_jaws(force_on_tool_newton, stiffness_newton_per_m, grip.slip_newton);
  }
  const double depth_m = slip_m.dot(needle.inward_world);
  GripSlip slip = slip_of_needle(force_on_tool_newton, stiffness_newton_per_m, needle, depth_m);
  needle.deepest_m = std::max(needle.deepest_m, depth_m + slip.slip_m.dot(needle.inward_world));
  return slip;
}

}  // namespace palpate
