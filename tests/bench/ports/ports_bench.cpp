// SPDX-License-Identifier: Apache-2.0
// ports_bench — what one step of the clamp for joints costs, beside that for three axes.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/ports/port_guard.h"
#include "tests/bench/bench_output.h"

namespace palpate::bench {
namespace {

using namespace controllers;

constexpr double kQ = 55e-6;

/// Times of single steps.
class StepTimes {
 public:
  explicit StepTimes(int steps) { times_us_.reserve(static_cast<std::size_t>(steps)); }
  template <class Step>
  void time(Step&& step) {
    const auto begin = std::chrono::steady_clock::now();
    step();
    const std::chrono::duration<double, std::micro> elapsed =
        std::chrono::steady_clock::now() - begin;
    times_us_.push_back(elapsed.count());
  }
  [[nodiscard]] std::vector<double> take_us() { return std::move(times_us_); }

 private:
  std::vector<double> times_us_;
};

// a hand that presses a wall at 20 Hz: free, pressed, clamped and unclamped in turn
double swing(int k, double phase) { return 0.003 * std::cos(0.1257 * k + phase); }
double read(double x) { return std::round(x / kQ) * kQ; }

std::vector<double> three_axes(int steps, bool per_axis) {
  GuardParameters p{.mofc = {.f_d = 0.1, .f_co = 0.1, .T = 1e-3},
                    .resolution_m = kQ,
                    .delta_max_s = 3e-4,
                    .prompt_s = 2e-4,
                    .longest_lease_s = 20e-3};
  if (per_axis) p.per_axis = AxisFriction{{0.1, 0.2, 0.1}, {0.1, 0.05, 0.1}};
  GuardMofc guard(p);
  StepTimes times(steps);
  Vector3 force = Vector3::Zero();
  for (int k = 0; k < steps; ++k) {
    const Vector3 x(read(0.3 * swing(k, 0.4)), read(0.3 * swing(k, 0.9)), read(swing(k, 0.0)));
    const AppliedStretch stretch{1e-3, force, x, true};
    const ControlInput input{
        .hand_position_m = x,
        .applied = {&stretch, k > 0 ? 1U : 0U},
        .acting_force_on_hand_newton = force,
        .acting_lease_s = 2e-3,
        .requested_force_on_hand_newton = {0.5, 0.2, 3000.0 * std::max(0.0, -x.z())}};
    times.time([&] { force = guard.step(input).force_on_hand_newton; });
  }
  return times.take_us();
}

std::vector<double> ports(int steps, std::size_t count, bool has_priorities) {
  PortGuardParameters p;
  p.count = count;
  for (std::size_t i = 0; i < count; ++i) {
    p.ports[i] = {.f_d = 0.05 + 0.01 * static_cast<double>(i),
                  .f_co = 0.05,
                  .q = kQ,
                  .v_max = 0.5,
                  .priority = has_priorities ? static_cast<int>(i % 3) : 0};
  }
  p.times = {.hold_s = 1e-3, .delta_max_s = 3e-4, .prompt_s = 2e-4, .longest_lease_s = 20e-3};
  PortGuard guard(p);
  StepTimes times(steps);
  PortStretch stretch{.duration_s = 1e-3};
  for (int k = 0; k < steps; ++k) {
    PortInput input;
    input.acting_effort_on_hand = stretch.effort_on_hand;
    input.acting_lease_s = 2e-3;
    for (std::size_t i = 0; i < count; ++i) {
      const double x = read(swing(k, 0.5 * static_cast<double>(i)));
      input.position[i] = stretch.position_at_end[i] = x;
      input.requested_effort_on_hand[i] = i == 0 ? 0.5 : 3000.0 * std::max(0.0, -x);
    }
    if (k > 0) input.applied = {&stretch, 1};
    times.time([&] { stretch.effort_on_hand = guard.step(input).effort_on_hand; });
  }
  return times.take_us();
}

void add(Table& table, const std::string& label, std::vector<double> times_us) {
  std::sort(times_us.begin(), times_us.end());
  const std::size_t n = times_us.size();
  table.add({label, times_us[n / 2], times_us[n * 99 / 100], times_us[n * 999 / 1000]});
}

void run(const BenchOptions& options) {
  const int steps = options.is_quick ? 20'000 : 200'000;
  Table table({{"clamp", "clamp", ""},
               {"median_us", "median µs", "{:.2f}"},
               {"p99_us", "99 % µs", "{:.2f}"},
               {"p999_us", "99.9 % µs", "{:.2f}"}});
  add(table, "three axes, isotropic", three_axes(steps, false));
  add(table, "three axes, friction per axis", three_axes(steps, true));
  for (const std::size_t count : {1U, 3U, 4U, 6U, 7U, 8U}) {
    add(table, std::to_string(count) + " ports", ports(steps, count, false));
  }
  add(table, "7 ports, three priorities", ports(steps, 7, true));
  table.publish(options);
  std::printf("\n%d steps each, the reading of the clock included. %s\n", steps,
              machine_load().c_str());
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("One step of the clamp for joints, beside that for three axes.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv, [&] { palpate::bench::run(options); });
}
