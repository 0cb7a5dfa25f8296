// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/trace.h"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

constexpr std::size_t kModelSpan = 10;  // motions over which a model is compared

}  // namespace

std::pair<double, double> work_joule(const std::vector<AnsweredPlace>& trace) {
  double sum = 0.0;
  double size = 0.0;
  for (std::size_t i = 1; i < trace.size(); ++i) {
    const double work = 0.5 * (trace[i].force_newton + trace[i - 1].force_newton)
                                  .dot(trace[i].position_m - trace[i - 1].position_m);
    sum += work;
    size += std::abs(work);
  }
  return {sum, size};
}

Variation variation_of(const std::vector<AnsweredPlace>& trace) {
  Vector3 least = Vector3::Constant(1e9);
  Vector3 most = -least;
  Variation variation;
  const std::size_t first = trace.size() / 3;
  for (std::size_t i = first; i < trace.size(); ++i) {
    variation.mean_newton += trace[i].force_newton / static_cast<double>(trace.size() - first);
    least = least.cwiseMin(trace[i].force_newton);
    most = most.cwiseMax(trace[i].force_newton);
    variation.range_newton = (most - least).norm();
    variation.most_newton = std::max(variation.most_newton, trace[i].force_newton.norm());
  }
  return variation;
}

void ModelComparison::add(const std::vector<AnsweredPlace>& trace) {
  for (std::size_t i = 0; i + kModelSpan < trace.size(); ++i) {
    const AnsweredPlace& from = trace[i];
    const AnsweredPlace& to = trace[i + kModelSpan];
    if (!from.slope_newton_per_m || !to.slope_newton_per_m) continue;
    const Vector3 predicted = *from.slope_newton_per_m * (to.position_m - from.position_m);
    predicted_ += predicted.squaredNorm();
    actual_ += predicted.dot(to.force_newton - from.force_newton);
  }
}

double ModelComparison::predicted_newton() const { return std::sqrt(predicted_); }

}  // namespace palpate
