// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/solve_speed.h"

#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate {
namespace {

constexpr std::array<double, 4> kRates_hz{50.0, 25.0, 10.0, 5.0};
constexpr double kShare = 0.5;  // of one processor
constexpr int kSolutions = 2;
constexpr double kStep_s = 0.04;
constexpr double kWay_m = 0.001;  // of the tip in a step: 25 mm/s
// The time of a solution grows about with this power of the number of elements.
constexpr double kPower = 1.5;
// Tetrahedra, instead of so many that they are not timed.
constexpr double kAdvised = 5000.0;

double processor_s() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

SolveSpeed solve_speed_of(const physics::ElasticBody& body, double tip_radius_m, double depth_m) {
  if (body.body->node_count() > kMostTimedNodes)
    return {.rate_hz = kRates_hz.back(), .is_too_slow = true};
  const Vector3 above_m(0.0, 0.0, tip_radius_m);
  physics::ElasticSimulation simulation(body, 1, tip_radius_m, kStep_s);
  double begin_s = 0.0;
  for (int i = 0; i <= kSolutions; ++i) {
    if (i == 1) begin_s = processor_s();  // the first one prepares
    const std::array<std::optional<physics::TipState>, 1> tip{physics::TipState{
        .tip_m = above_m - Vector3(0, 0, std::min(depth_m, kWay_m * (i + 1))), .place_m = above_m}};
    static_cast<void>(simulation.step(tip));
  }
  SolveSpeed speed{.solution_s = (processor_s() - begin_s) / kSolutions};
  const auto* const rate = std::find_if(kRates_hz.begin(), kRates_hz.end(),
                                        [&](double hz) { return hz * speed.solution_s <= kShare; });
  speed.is_too_slow = rate == kRates_hz.end();
  speed.rate_hz = speed.is_too_slow ? kRates_hz.back() : *rate;
  return speed;
}

std::string speed_report(const SolveSpeed& speed, std::size_t tetrahedra) {
  std::array<char, 200> line{};
  if (speed.solution_s > 0.0) {
    std::snprintf(line.data(), line.size(),
                  "  a full solution takes %.0f ms on this machine: solve_rate_hz %g\n",
                  1e3 * speed.solution_s, speed.rate_hz);
  } else {
    std::snprintf(line.data(), line.size(), "  solve_rate_hz %g: not timed, more than %zu nodes\n",
                  speed.rate_hz, kMostTimedNodes);
  }
  std::string text = line.data();
  if (!speed.is_too_slow) return text;
  const double share = speed.solution_s > 0.0
                           ? std::pow(kShare / (speed.rate_hz * speed.solution_s), 1.0 / kPower)
                           : kAdvised / static_cast<double>(tetrahedra);
  std::snprintf(
      line.data(), line.size(),
      "  WARNING: too slow to follow a hand; give --tetrahedra %.0f or fewer, or a "
      "faster machine\n",
      std::max(200.0, 100.0 * std::floor(share * static_cast<double>(tetrahedra) / 100.0)));
  return text + line.data();
}

}  // namespace palpate
