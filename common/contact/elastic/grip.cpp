// SPDX-License-Identifier: Apache-2.0
#include "common/contact/elastic/grip.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace palpate {
namespace {

constexpr int kMostHalvings = 60;  // to the rounding of a double

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

}  // namespace palpate
