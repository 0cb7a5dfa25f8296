// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/elastic/bullet_rows.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "tests/bench/elastic/bullet_body.h"
#include "tests/bench/elastic/elastic_problems.h"

namespace palpate::bench {
namespace {

using elastic::Body;

/// Index of the node whose z tip_of() gives.
std::size_t tip_node(const Body& body) { return static_cast<std::size_t>(tip_of(body.mesh())) / 3; }

/// One step, its times added to the samples in µs.
void measured_step(BulletBody& bullet, double dt_s, Samples& wall, Samples& cpu) {
  const double from_wall = wall_s();
  const double from_cpu = cpu_s();
  bullet.step(dt_s);
  cpu.values.push_back(1e6 * (cpu_s() - from_cpu));
  wall.values.push_back(1e6 * (wall_s() - from_wall));
}

}  // namespace

Row bullet_step_row(const BeamSize& size, const Body& body, std::span<const double> converged_m) {
  const PeakMemory memory;
  BulletBody bullet(body);
  const std::size_t tip = tip_node(body);
  const double start_m = bullet.node_m(tip).z();
  Samples wall;
  Samples cpu;
  double error_m = 0.0;
  double way_m = 0.0;
  for (const double wanted_m : converged_m) {
    measured_step(bullet, 1e-3, wall, cpu);
    error_m = std::max(error_m, std::abs(bullet.node_m(tip).z() - wanted_m));
    way_m = std::max(way_m, std::abs(wanted_m - start_m));
  }
  return {.figures = {.problem = "step 1 ms",
                      .mesh = size.name,
                      .solver = "Bullet linear",
                      .median_us = wall.at(0.5),
                      .p99_us = wall.at(0.99),
                      .error_ratio = error_m / way_m},
          .cpu_median_us = cpu.at(0.5),
          .cpu_p99_us = cpu.at(0.99),
          .peak_mb = memory.megabytes()};
}

Row bullet_static_row(const BeamSize& size, const Body& body, double reference_m) {
  constexpr double kStep_s = 20e-3;
  constexpr std::size_t kMost = 200;
  constexpr std::size_t kStill = 10;  // steps in which the tip moves by less than 0.01 %
  const PeakMemory memory;
  BulletBody bullet(body);
  const std::size_t tip = tip_node(body);
  const double start_m = bullet.node_m(tip).z();
  Samples wall;
  Samples cpu;
  std::vector<double> way_m;
  std::size_t still = 0;
  while (way_m.size() < kMost && still < kStill) {
    measured_step(bullet, kStep_s, wall, cpu);
    const double moved_m = start_m - bullet.node_m(tip).z();
    still = !way_m.empty() && std::abs(moved_m - way_m.back()) < 1e-4 * moved_m ? still + 1 : 0;
    way_m.push_back(moved_m);
  }
  const double end_m = way_m.back();
  std::size_t steps = way_m.size();
  while (steps > 1 && std::abs(way_m[steps - 2] - end_m) < 0.01 * std::abs(end_m)) --steps;
  double total_s = 0.0;
  for (std::size_t i = 0; i < steps; ++i) total_s += 1e-6 * cpu.values[i];
  const bool is_neo_hookean = body.description().law == elastic::Law::kStableNeoHookean;
  return {.figures = {.problem = "static",
                      .mesh = size.name,
                      .solver = is_neo_hookean ? "Bullet NH" : "Bullet linear",
                      .median_us = wall.at(0.5),
                      .p99_us = wall.at(0.99),
                      .total_s = total_s,
                      .error_ratio = still == kStill ? end_m / reference_m - 1.0 : NAN},
          .cpu_median_us = cpu.at(0.5),
          .cpu_p99_us = cpu.at(0.99),
          .peak_mb = memory.megabytes()};
}

}  // namespace palpate::bench
