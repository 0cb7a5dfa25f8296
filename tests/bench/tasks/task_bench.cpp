// SPDX-License-Identifier: Apache-2.0
// task_bench — how exact the figures of a task are whose estimate is not: path and smoothness of
// motions that have closed forms, and the thresholds of staircases.
#include <CLI/CLI.hpp>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "common/task/hand_motion.h"
#include "deploy/study/staircase.h"
#include "tests/bench/bench_output.h"

namespace palpate::bench {
namespace {

constexpr double kTick_s = 1e-3;
constexpr double kEncoder_m = 55e-6;
constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

/// @param path_m, smoothness  exact; NaN where no closed form is compared
struct Motion {
  std::string what;
  double length_s;
  double path_m;
  double smoothness;
  std::function<Vector3(double t_s)> at_m;
};

std::vector<Motion> motions() {
  constexpr double kTwoPi = 2.0 * std::numbers::pi;
  std::vector<Motion> out;
  const auto taps = [&](const std::string& what, double stroke_m, double frequency_hz) {
    constexpr double kLength_s = 6.0;
    // x = A sin ωt: v_peak = Aω, ∫|x'''|² = A²ω⁶T/2 over whole periods
    const double omega = kTwoPi * frequency_hz;
    out.push_back({what, kLength_s, 2.0 * stroke_m * frequency_hz * kLength_s,
                   -std::log(std::pow(omega * kLength_s, 4) / 2.0), [=](double t_s) {
                     return Vector3(0.0, 0.0, 0.5 * stroke_m * std::sin(omega * t_s));
                   }});
  };
  out.push_back(
      {"circle of 2 cm, 0.5 Hz", 10.0, 10.0 * 0.5 * kTwoPi * 0.02, kNotKnown, [=](double t_s) {
         return Vector3(0.02 * std::cos(0.5 * kTwoPi * t_s), 0.02 * std::sin(0.5 * kTwoPi * t_s),
                        0.0);
       }});
  taps("taps of 20 mm, 1 Hz", 0.02, 1.0);
  taps("taps of 20 mm, 3 Hz", 0.02, 3.0);
  taps("taps of 10 mm, 1 Hz", 0.01, 1.0);
  taps("taps of 5 mm, 1 Hz", 0.005, 1.0);
  taps("taps of 2 mm, 1 Hz", 0.002, 1.0);
  taps("tremor of ±0.1 mm, 8 Hz", 0.0002, 8.0);
  for (const double length_s : {1.0, 2.0, 5.0, 10.0, 20.0}) {
    // from rest to rest with the least jerk: −ln(720/1.875²) [Flash85]
    out.push_back({"reach of 10 cm in " + std::to_string(static_cast<int>(length_s)) + " s",
                   length_s, 0.1, -std::log(720.0 / (1.875 * 1.875)), [=](double t_s) {
                     const double s = t_s / length_s;
                     return Vector3(0.1 * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s), 0.0, 0.0);
                   }});
  }
  return out;
}

HandMotion seen(const Motion& motion, double encoder_m) {
  HandMotion hand;
  const auto ticks = static_cast<int>(std::lround(motion.length_s / kTick_s));
  for (int i = 0; i <= ticks; ++i) {
    Vector3 at_m = motion.at_m(kTick_s * i);
    if (encoder_m > 0.0) {
      for (double& one : at_m) one = encoder_m * std::round(one / encoder_m);
    }
    hand.add(kTick_s * i, at_m);
  }
  hand.finish();
  return hand;
}

Table motion_table() {
  Table table({{"motion", "motion", ""},
               {"path_mm", "path mm", "{:.1f}"},
               {"path_error_percent", "seen, error %", "{:+.1f}"},
               {"path_error_fine_percent", "without encoder steps %", "{:+.1f}"},
               {"smoothness", "smoothness", "{:.2f}"},
               {"smoothness_seen", "seen", "{:.2f}"},
               {"smoothness_fine", "without encoder steps", "{:.2f}"}});
  for (const Motion& motion : motions()) {
    const HandMotion coarse = seen(motion, kEncoder_m);
    const HandMotion fine = seen(motion, 0.0);
    const auto error = [&](const HandMotion& hand) {
      return 100.0 * (hand.path_m() / motion.path_m - 1.0);
    };
    table.add({motion.what, 1e3 * motion.path_m, error(coarse), error(fine), motion.smoothness,
               coarse.log_dimensionless_jerk(), fine.log_dimensionless_jerk()});
  }
  return table;
}

/// Participants who are right with probability Φ(d/σ) of a difference d; two right answers settle
/// at Φ⁻¹(√½) σ [Levitt71].
Table staircase_table() {
  constexpr double kSigma = 0.2;
  constexpr double kQuantile = 0.5450;  // Φ⁻¹(√½)
  constexpr int kParticipants = 4000;
  Table table({{"start", "start, thresholds", "{:.1f}"},
               {"reversals", "reversals", "{:.0f}"},
               {"too_high_percent", "threshold too high by %", "{:.0f}"},
               {"spread_percent", "spread of one series, %", "{:.0f}"},
               {"trials", "trials", "{:.0f}"}});
  for (const auto& [start, reversals] :
       {std::pair{6.0, 14}, {2.5, 14}, {2.5, 20}, {1.0, 14}, {1.0, 20}}) {
    Random random(11);
    double sum = 0.0;
    double squares = 0.0;
    double trials = 0.0;
    for (int i = 0; i < kParticipants; ++i) {
      study::Staircase staircase({.field = "x",
                                  .start_ratio = start * kQuantile * kSigma,
                                  .reversals = static_cast<std::uint64_t>(reversals),
                                  .most_trials = 1'000'000});
      for (; !staircase.is_done(); ++trials) {
        staircase.answer(kSigma * random.normal() < staircase.difference_ratio());
      }
      const double error = std::log(staircase.threshold_ratio() / (kQuantile * kSigma));
      sum += error;
      squares += error * error;
    }
    const double mean = sum / kParticipants;
    table.add({start, static_cast<double>(reversals), 100.0 * std::expm1(mean),
               100.0 * std::sqrt(squares / kParticipants - mean * mean), trials / kParticipants});
  }
  return table;
}

void run(const BenchOptions& options) {
  const Table motion = motion_table();
  const Table staircase = staircase_table();
  std::printf("%s\nEncoder steps of 0.055 mm on each axis, ticks of 1 ms.\n\n%s\n",
              motion.text().c_str(), staircase.text().c_str());
  write_table(options, motion.csv());
  write_json(options, {{"motions", motion.json()}, {"staircases", staircase.json()}});
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("How exact path, smoothness and the thresholds of staircases are.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv, [&] { palpate::bench::run(options); });
}
