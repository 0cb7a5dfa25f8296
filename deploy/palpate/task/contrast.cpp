// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/task/contrast.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "common/telemetry/metrics.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate {
namespace {

constexpr double kStep_s = 1.0;        // 1 mm/s: viscosity and inertia of tissue do not count
constexpr double kBehindTip_m = 1e-5;  // of the sphere that the body meets, behind the tip
constexpr int kMostSolutions = 20;     // until the body is in balance at a depth

bool can_be_felt(double with_newton, double without_newton) {
  return with_newton > without_newton &&
         is_beyond_force_jnd({0, 0, without_newton}, {0, 0, with_newton});
}

}  // namespace

double PressCurve::depth_m(double force_newton) const {
  for (std::size_t i = 1; i < newton.size(); ++i) {
    if (newton[i] < force_newton) continue;
    const double part = (force_newton - newton[i - 1]) / (newton[i] - newton[i - 1]);
    return kStep_m * (static_cast<double>(i - 1) + std::clamp(part, 0.0, 1.0));
  }
  return kStep_m * static_cast<double>(newton.empty() ? 0 : newton.size() - 1);
}

PressCurve press_curve(const physics::ElasticBody& body, double tip_radius_m,
                       const Vector3& above_m, const Vector3& normal, double most_newton,
                       double most_m) {
  physics::ElasticSimulation simulation(body, 1, tip_radius_m, kStep_s);
  const Vector3 place_m = above_m + tip_radius_m * normal;
  PressCurve curve{.newton = {0.0}};
  const auto steps = static_cast<std::size_t>(most_m / PressCurve::kStep_m);
  for (std::size_t i = 0; i <= steps && curve.newton.back() < most_newton; ++i) {
    const std::array<std::optional<physics::TipState>, 1> tip{
        physics::TipState{.tip_m = place_m - PressCurve::kStep_m * static_cast<double>(i) * normal,
                          .place_m = place_m}};
    bool is_balanced = false;
    for (int tries = 0; tries < kMostSolutions && !is_balanced; ++tries) {
      static_cast<void>(simulation.step(tip));
      is_balanced = simulation.report().search.is_converged && !simulation.touch(0).has_failed;
    }
    if (i == 0) continue;
    // nothing is known of a force that is not in balance, or where the body cannot give way
    const bool waits = (simulation.touch(0).centre_m - tip[0]->tip_m).norm() > kBehindTip_m;
    if (!is_balanced || waits) break;
    curve.newton.push_back(std::max(0.0, simulation.touch(0).force_on_tool_newton.dot(normal)));
  }
  return curve;
}

Contrast contrast_of(const PressCurve& with, const PressCurve& without) {
  Contrast contrast{.palpable_newton = std::numeric_limits<double>::quiet_NaN()};
  const std::size_t count = std::min(with.newton.size(), without.newton.size());
  for (std::size_t i = 1; i < count; ++i) {
    if (without.newton[i] > 0.0) contrast.ratio = with.newton[i] / without.newton[i] - 1.0;
    if (std::isfinite(contrast.palpable_newton)) continue;
    if (can_be_felt(with.newton[i], without.newton[i])) contrast.palpable_newton = with.newton[i];
  }
  return contrast;
}

}  // namespace palpate
