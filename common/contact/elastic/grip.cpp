// SPDX-License-Identifier: Apache-2.0
#include "common/contact/elastic/grip.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

constexpr int kMostHalvings = 60;  // to the rounding of a double

/// A needle or a blade that goes by w along a direction d, while a blade slides along its edge e
/// by Coulomb's law.
struct Yielding {
  double push_newton = 0.0;             ///< −F·d at w = 0
  double stiffness_newton_per_m = 0.0;  ///< d·K d, and what friction grows with the depth
  // of the edge; as they are here: there is none
  double along_newton = 0.0;              ///< F·e at w = 0
  double coupling_newton_per_m = 0.0;     ///< d·K e
  double along_newton_per_m = 1.0;        ///< e·K e
  double most_along_newton = kUnlimited;  ///< |F·e| afterwards

  static constexpr double kUnlimited = std::numeric_limits<double>::infinity();

  [[nodiscard]] double slide_m(double way_m) const noexcept {
    const double newton = along_newton + coupling_newton_per_m * way_m;
    const double excess = std::abs(newton) - most_along_newton;
    return excess > 0.0 ? -std::copysign(excess, newton) / along_newton_per_m : 0.0;
  }
  [[nodiscard]] double push_at(double way_m) const noexcept {
    return push_newton - stiffness_newton_per_m * way_m - coupling_newton_per_m * slide_m(way_m);
  }
  /// The way w ≥ 0 after which no more than this is left of the push, which falls with w in up to
  /// three straight pieces: the edge slides, sticks and slides the other way.
  [[nodiscard]] double way_to_m(double newton) const noexcept {
    double from_m = 0.0;
    double from_newton = push_at(0.0);
    if (!(from_newton > newton)) return 0.0;
    double softer = 0.0;  // where the edge slides
    if (coupling_newton_per_m != 0.0) {
      softer = coupling_newton_per_m * coupling_newton_per_m / along_newton_per_m;
      const double middle_m = -along_newton / coupling_newton_per_m;
      const double half_m = std::abs(most_along_newton / coupling_newton_per_m);
      for (const double to_m : {middle_m - half_m, middle_m + half_m}) {
        if (!(to_m > from_m)) continue;
        const double to_newton = push_at(to_m);
        if (to_newton <= newton) {
          return from_m + (from_newton - newton) / (from_newton - to_newton) * (to_m - from_m);
        }
        from_m = to_m;
        from_newton = to_newton;
      }
    }
    return from_m + (from_newton - newton) / (stiffness_newton_per_m - softer);
  }
};

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
  const Vector3& e = needle.edge_world;
  const double z = std::max(0.0, depth_m);
  const double friction = needle.friction_newton_per_m;
  const double rubs_newton = needle.friction_newton + friction * z;
  Yielding in{.push_newton = -force_on_tool_newton.dot(d),
              .stiffness_newton_per_m = d.dot(stiffness_newton_per_m * d) + friction};
  if (needle.is_blade()) {
    in.along_newton = force_on_tool_newton.dot(e);
    in.coupling_newton_per_m = d.dot(stiffness_newton_per_m * e);
    in.along_newton_per_m = e.dot(stiffness_newton_per_m * e);
    in.most_along_newton = rubs_newton;
  }
  Yielding out = in;
  out.push_newton = -in.push_newton;
  out.stiffness_newton_per_m -= friction;
  out.coupling_newton_per_m = -in.coupling_newton_per_m;

  GripSlip slip{.force_on_tool_newton = force_on_tool_newton};
  double way_m = 0.0;
  const double spreads_newton = needle.spreading_newton + rubs_newton;
  if (const double in_hole_m = in.way_to_m(spreads_newton); in_hole_m > 0.0) {
    // beyond the end of the hole by what is left after cutting
    const double to_end_m = std::max(0.0, needle.deepest_m - z);
    way_m = in_hole_m <= to_end_m
                ? in_hole_m
                : std::max(to_end_m, in.way_to_m(spreads_newton + needle.cutting_newton));
  } else if (const double back_m = out.way_to_m(rubs_newton); back_m > 0.0) {
    slip.is_out = !(back_m < z);
    way_m = slip.is_out ? -z : -back_m;
  }
  slip.slip_m = way_m * d;
  if (needle.is_blade()) slip.slip_m += in.slide_m(way_m) * e;
  slip.force_on_tool_newton += stiffness_newton_per_m * slip.slip_m;
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
