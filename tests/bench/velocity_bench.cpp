// SPDX-License-Identifier: Apache-2.0
// velocity_bench — how mofc_node's velocity estimators trade error against lag, on motions of the
// simulated hand measured by a 0.055 mm encoder, and the effect on a rigid damper in the loop.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "mofc_node/velocity_estimator.h"
#include "tests/bench/bench_output.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

const std::filesystem::path kSessions =
    std::filesystem::path(test::source_dir()) / "deploy/sessions";

constexpr double kResolution_m = 55e-6;
constexpr double kRigidDamping_newton_s_per_m = 150.0;

struct Estimator {
  const char* family;
  const char* label;
  const char* session;  ///< content of mofc.velocity_estimator
  bool has_wrong_mass = false;
};
const Estimator kEstimators[] = {
    {"difference", "difference", "difference {}"},
    {"difference + low-pass", "low-pass 2 ms", "difference { time_constant_ms: 2 }"},
    {"difference + low-pass", "low-pass 5 ms", "difference { time_constant_ms: 5 }"},
    {"difference + low-pass", "low-pass 10 ms", "difference { time_constant_ms: 10 }"},
    {"difference + low-pass", "low-pass 20 ms", "difference { time_constant_ms: 20 }"},
    {"FOAW end fit", "FOAW end 10 ms", "adaptive_window { max_window_ms: 10 end_fit: true }"},
    {"FOAW end fit", "FOAW end 20 ms", "adaptive_window { max_window_ms: 20 end_fit: true }"},
    {"FOAW best fit", "FOAW best 5 ms", "adaptive_window { max_window_ms: 5 }"},
    {"FOAW best fit", "FOAW best 10 ms", "adaptive_window { max_window_ms: 10 }"},
    {"FOAW best fit", "FOAW best 20 ms", "adaptive_window { max_window_ms: 20 }"},
    {"FOAW best fit", "FOAW best 30 ms", "adaptive_window { max_window_ms: 30 }"},
    {"FOAW + low-pass", "FOAW best 10 ms + 2 ms",
     "adaptive_window { max_window_ms: 10 time_constant_ms: 2 }"},
    {"FOAW + low-pass", "FOAW best 20 ms + 2 ms",
     "adaptive_window { max_window_ms: 20 time_constant_ms: 2 }"},
    {"FOAW + low-pass", "FOAW best 20 ms + 5 ms",
     "adaptive_window { max_window_ms: 20 time_constant_ms: 5 }"},
    {"Kalman v", "Kalman v 0.01, no force", "kalman_velocity { moving_mass_kg: 0 }"},
    {"Kalman v", "Kalman v 0.1, no force",
     "kalman_velocity { acceleration_density_m2_per_s3: 0.1 moving_mass_kg: 0 }"},
    {"Kalman v", "Kalman v 1, no force",
     "kalman_velocity { acceleration_density_m2_per_s3: 1 moving_mass_kg: 0 }"},
    {"Kalman v, force known", "Kalman v 0.001",
     "kalman_velocity { acceleration_density_m2_per_s3: 0.001 }"},
    {"Kalman v, force known", "Kalman v 0.01", "kalman_velocity {}"},
    {"Kalman v, force known", "Kalman v 0.1",
     "kalman_velocity { acceleration_density_m2_per_s3: 0.1 }"},
    {"Kalman a", "Kalman a 10, no force",
     "kalman_acceleration { jerk_density_m2_per_s5: 10 moving_mass_kg: 0 }"},
    {"Kalman a", "Kalman a 100, no force",
     "kalman_acceleration { jerk_density_m2_per_s5: 100 moving_mass_kg: 0 }"},
    {"Kalman a", "Kalman a 1000, no force",
     "kalman_acceleration { jerk_density_m2_per_s5: 1000 moving_mass_kg: 0 }"},
    {"Kalman a, force known", "Kalman a 10",
     "kalman_acceleration { jerk_density_m2_per_s5: 10 hand_stiffness_newton_per_m: 0 "
     "hand_damping_newton_s_per_m: 0 }"},
    {"Kalman hand", "Kalman hand (default)", "kalman_acceleration {}"},
    {"Kalman hand", "Kalman hand, half as stiff and damped",
     "kalman_acceleration { hand_stiffness_newton_per_m: 75 hand_damping_newton_s_per_m: 3 }",
     true},
    {"Kalman hand, wrong mass", "Kalman hand, mass set to 0.1 kg",
     "kalman_acceleration { moving_mass_kg: 0.1 }", true},
    {"Kalman hand, wrong mass", "Kalman hand, mass set to 0.2 kg",
     "kalman_acceleration { moving_mass_kg: 0.2 }", true},
    {"Kalman hand, wrong mass", "Kalman hand, mass set to 0.6 kg",
     "kalman_acceleration { moving_mass_kg: 0.6 }", true},
    {"Kalman hand, wrong mass", "Kalman hand, mass set to 1 kg",
     "kalman_acceleration { moving_mass_kg: 1 }", true},
};

/// Motion of the simulated hand in free space, with its mass, spring, damper and stiction.
struct Motion {
  const char* label;
  const char* hand;
  double seconds;
};
const Motion kMotions[] = {
    {"V 80 mm/s", "v { tangent { x: 1 y: 0.5 } }", 1.6},
    {"press 20 mm/s", "v { half_width_m: 0 height_m: 0.01 speed_m_per_s: 0.02 }", 1.1},
    {"press 5 mm/s", "v { half_width_m: 0 height_m: 0.005 speed_m_per_s: 0.005 }", 2.1},
    {"near stop", "sinusoid { amplitude_m { x: 0.0005 z: 0.0015 } frequency_hz { x: 1 z: 1 } }",
     3.0},
    {"sine 0.5 Hz", "sinusoid { amplitude_m { x: 0.003 z: 0.01 } frequency_hz { x: 0.5 z: 0.5 } }",
     4.0},
    {"sine 1 Hz", "sinusoid { amplitude_m { x: 0.003 z: 0.01 } frequency_hz { x: 1 z: 1 } }", 3.0},
    {"sine 2 Hz", "sinusoid { amplitude_m { x: 0.003 z: 0.01 } frequency_hz { x: 2 z: 2 } }", 2.0},
    {"sine 5 Hz", "sinusoid { amplitude_m { x: 0.002 z: 0.005 } frequency_hz { x: 5 z: 5 } }", 2.0},
};
constexpr double kSettle_s = 0.2;  // not judged: the hand and the filters begin at rest

struct Sample {
  TimePoint time{};
  Vector3 measured_m = Vector3::Zero();
  Vector3 velocity_m_per_s = Vector3::Zero();  // true
};

std::vector<Sample> record(const Motion& motion, double rate_hz) {
  const Session session =
      parse_session(fmt::format("name: 'motion' device {{ rate_hz: {} monitor: off }} hand {{ {} "
                                "}} mofc {{ controller: none }}",
                                rate_hz, motion.hand),
                    "velocity_bench");
  std::vector<Sample> samples;
  Lockstep lockstep(session, {}, [&](const TickRow& row, const IdealState&) {
    samples.push_back({row.device.sampled_at, row.device.measured_tool_position_world_m,
                       row.device.true_tool_velocity_world_m_per_s});
  });
  lockstep.run_until(from_seconds(motion.seconds));
  return samples;
}

struct Figures {
  double rms_m_per_s = 0.0;    ///< estimate − truth at the same time
  double lag_s = 0.0;          ///< that explains most of it
  double noise_m_per_s = 0.0;  ///< rms left after this lag
  double ripple_watt = 0.0;    ///< ledger energy for the estimate's travel beyond the truth's
  double update_ns = 0.0;
};

double rms_at_lag(const std::vector<Sample>& samples, const std::vector<Vector3>& estimates,
                  double rate_hz, double lag_s) {
  const double shift = lag_s * rate_hz;
  const auto whole = static_cast<std::size_t>(shift);
  const double rest = shift - static_cast<double>(whole);
  const auto first = static_cast<std::size_t>(kSettle_s * rate_hz);
  double sum = 0.0;
  for (std::size_t k = first; k < samples.size(); ++k) {
    const Vector3 truth = (1.0 - rest) * samples[k - whole].velocity_m_per_s +
                          rest * samples[k - whole - 1].velocity_m_per_s;
    sum += (estimates[k] - truth).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(samples.size() - first));
}

Figures judge(const Session& session, const std::vector<Sample>& samples, double rate_hz) {
  const auto estimator =
      mofc::make_velocity_estimator(session.side().mofc.velocity_estimator, kResolution_m, 1.0);
  std::vector<Vector3> estimates(samples.size());
  Figures figures;
  figures.update_ns = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < 3; ++pass) {  // the shortest time is the one without interruption
    estimator->reset();
    const SteadyClock wall;
    const TimePoint begin = wall.now();
    for (std::size_t k = 0; k < samples.size(); ++k) {
      estimates[k] = estimator->update(samples[k].measured_m, samples[k].time, Vector3::Zero());
    }
    const double ns = 1e9 * to_seconds(wall.now() - begin) / static_cast<double>(samples.size());
    figures.update_ns = std::min(figures.update_ns, ns);
  }

  // lag: the shift of the truth that fits best
  figures.rms_m_per_s = rms_at_lag(samples, estimates, rate_hz, 0.0);
  figures.noise_m_per_s = figures.rms_m_per_s;
  constexpr double kLagStep_s = 0.25e-3;
  for (double lag_s = kLagStep_s; lag_s < 0.06; lag_s += kLagStep_s) {
    const double rms = rms_at_lag(samples, estimates, rate_hz, lag_s);
    if (rms >= figures.noise_m_per_s) continue;
    figures.noise_m_per_s = rms;
    figures.lag_s = lag_s;
  }

  // a change of the force by dF costs the ledger q/2 · |dF|
  double travel_m_per_s = 0.0;
  const auto first = static_cast<std::size_t>(kSettle_s * rate_hz);
  for (std::size_t k = first; k < samples.size(); ++k) {
    travel_m_per_s += (estimates[k] - estimates[k - 1]).norm() -
                      (samples[k].velocity_m_per_s - samples[k - 1].velocity_m_per_s).norm();
  }
  figures.ripple_watt = 0.5 * kResolution_m * kRigidDamping_newton_s_per_m * travel_m_per_s /
                        to_seconds(samples.back().time - samples[first].time);
  return figures;
}

/// The V into tissue, device and physics at 1 kHz, mode guard: sums over phases of the free motion.
struct LoopFigures {
  double clamped = 0.0;
  double transparency = 0.0;
  double force_error = 0.0;
  double excess_reversals = 0.0;
  double path_deviation_m = 0.0;
};

LoopFigures run_loop(const Estimator& estimator, const std::string& tissue, int phases) {
  LoopFigures mean;
  for (int phase = 0; phase < phases; ++phase) {
    const double free_s = 2.0 + 0.0137 * phase;
    const Session session =
        load_session(kSessions / (tissue + ".txtpb"),
                     {"device.rate_hz=1000", "device.lease_us=2000", "physics.rate_hz=1000",
                      "mofc.wait_for_physics_ms=0", "mofc.mode=guard",
                      fmt::format("mofc.velocity_estimator={{ {} }}", estimator.session),
                      fmt::format("hand.v.free_motion_s={}", free_s)});
    const RunStatistics s = run_loopback(session, {.seconds = free_s + 2.0}).statistics;
    const double share = 1.0 / phases;
    mean.clamped += share * s.clamp_ratio();
    mean.transparency += share * s.ideal_transparency();
    mean.force_error += share * s.force_error_rms_ratio();
    mean.excess_reversals += share * static_cast<double>(s.excess_reversals());
    mean.path_deviation_m += share * s.path_deviation_rms_m();
  }
  return mean;
}

/// The default estimator on a session as shipped, or with another hand, encoder, rate or wall.
struct Case {
  const char* label;
  const char* session;
  std::vector<std::string> settings;
};
const std::string kAboveTheBall = "hand.sinusoid.amplitude_m={ x: 0 y: 0 z: 0.015 }";
const Case kCases[] = {
    {"1 kHz, counts of 0.055 mm (as shipped)", "default", {}},
    {"another phase of the presses", "default", {"hand.sinusoid.phase_rad.z=2"}},
    {"every press above the ball", "default", {kAboveTheBall}},
    {"counts of 0.01 mm",
     "default",
     {"device.simulated.position_resolution_m=1e-5", "device.profile.position_resolution_m=1e-5"}},
    {"counts of 0.2 mm",
     "default",
     {"device.simulated.position_resolution_m=2e-4", "device.profile.position_resolution_m=2e-4"}},
    {"500 Hz", "default", {"device.rate_hz=500", "device.lease_us=4000", "physics.rate_hz=500"}},
    {"4 kHz", "default", {"device.rate_hz=4000"}},
    {"taps at 3 Hz", "default", {"hand.sinusoid.frequency_hz.z=3"}},
    {"tremor, 3 mm at 10 Hz, above the ball",
     "default",
     {"hand.sinusoid.amplitude_m={ x: 0 y: 0 z: 0.003 }", "hand.sinusoid.frequency_hz.z=10"}},
    {"hand of 0.1 kg", "default", {"hand.mass_kg=0.1"}},
    {"hand of 0.6 kg", "default", {"hand.mass_kg=0.6"}},
    {"hand of 700 N/m, 10 N·s/m",
     "default",
     {"hand.stiffness_newton_per_m=700", "hand.damping_newton_s_per_m=10"}},
    {"ball of 3000 N/m, 30 N·s/m",
     "default",
     {"scene.tissue[1].kelvin_voigt={ stiffness_newton_per_m: 3000 damping_newton_s_per_m: 30 }"}},
    {"`liver`", "liver", {}},
    {"`cloud`", "cloud", {}},
};

Session session_with(const Estimator& estimator) {
  return parse_session("name: 'estimator'", "velocity_bench",
                       {fmt::format("mofc.velocity_estimator={{ {} }}", estimator.session)});
}

/// The points of one estimator in the figure: open loop at 1 kHz, and in the loop.
struct Point {
  double lag_ms = kNaN;               ///< sine 2 Hz
  double noise_mm_per_s = kNaN;       ///< press 20 mm/s
  double rms_mm_per_s = kNaN;         ///< mean over the motions
  double force_error_percent = kNaN;  ///< rigid V in the loop
};

/// One line per family.
void draw_error_lag(const std::filesystem::path& folder, const std::vector<Point>& points) {
  std::filesystem::create_directories(folder);
  std::string data;
  std::vector<std::string> families;
  for (std::size_t i = 0; i < std::size(kEstimators); ++i) {
    if (kEstimators[i].has_wrong_mass) continue;
    if (families.empty() || families.back() != kEstimators[i].family) {
      families.emplace_back(kEstimators[i].family);
      data += fmt::format("{}# {}\n", data.empty() ? "" : "\n\n", families.back());
    }
    const Point& p = points[i];
    data += fmt::format("{} {} {} {}\n", p.lag_ms, p.noise_mm_per_s, p.rms_mm_per_s,
                        p.force_error_percent);
  }
  const auto plotted = [&](const char* columns) {
    std::string plot = "plot ";
    for (std::size_t i = 0; i < families.size(); ++i) {
      plot += fmt::format(
          "{}'velocity_error_lag.txt' index {} using {} with linespoints lw 2 pt {} "
          "title '{}'",
          i > 0 ? ", \\\n     " : "", i, columns, i + 4, families[i]);
    }
    return plot + "\n";
  };
  write_file(folder / "velocity_error_lag.txt", data);
  draw_figure(folder, "velocity_error_lag",
              R"(set terminal svg size 1100,460 dynamic background rgb 'white' font 'sans,13'
set output 'velocity_error_lag.svg'
set datafile missing 'nan'
set multiplot layout 1,2 title 'Velocity estimators behind a 0.055 mm encoder at 1 kHz'
set grid
set logscale y
set xlabel 'lag, ms (sine 2 Hz)'
set ylabel 'noise, mm/s (press 20 mm/s)'
set key top right font ',10'
)" + plotted("1:2") +
                  R"(set nologscale y
set yrange [0:*]
set xlabel 'rms error, mm/s (mean of all motions)'
set ylabel 'rigid V in the loop: force error, % of the ideal'
set key bottom right font ',10'
)" + plotted("3:4") +
                  "unset multiplot\n");
}

void run(const BenchOptions& options) {
  Table table({{"motion", "motion", ""},
               {"rate_hz", "Hz", "{:.0f}"},
               {"estimator", "estimator", ""},
               {"rms_mm_per_s", "rms mm/s", "{:.2f}"},
               {"lag_ms", "lag ms", "{:.2f}"},
               {"noise_mm_per_s", "noise mm/s", "{:.2f}"},
               {"error_newton", "rms N", "{:.2f}"},
               {"ripple_mw", "ripple mW", "{:.2f}"},
               {"update_ns", "ns", "{:.0f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"transparency_percent", "transp. %", "{:.1f}"},
               {"force_error_percent", "force err. %", "{:.1f}"},
               {"excess_reversals", "excess rev.", "{:.1f}"},
               {"path_deviation_mm", "path mm", "{:.2f}"},
               {"beyond_jnd_percent", "> JND %", "{:.1f}"}});

  // open loop
  std::vector<Point> points(std::size(kEstimators));
  for (const double rate_hz : {1000.0, 4000.0}) {
    for (const Motion& motion : kMotions) {
      const std::vector<Sample> samples = record(motion, rate_hz);
      for (std::size_t i = 0; i < std::size(kEstimators); ++i) {
        if (kEstimators[i].has_wrong_mass) continue;  // without force the mass is not used
        const Figures f = judge(session_with(kEstimators[i]), samples, rate_hz);
        table.add({std::string(motion.label), rate_hz, std::string(kEstimators[i].label),
                   1e3 * f.rms_m_per_s, 1e3 * f.lag_s, 1e3 * f.noise_m_per_s,
                   kRigidDamping_newton_s_per_m * f.rms_m_per_s, 1e3 * f.ripple_watt, f.update_ns,
                   kNaN, kNaN, kNaN, kNaN, kNaN, kNaN});
        if (rate_hz > 1000.0) continue;
        if (std::string(motion.label) == "sine 2 Hz") points[i].lag_ms = 1e3 * f.lag_s;
        if (std::string(motion.label) == "press 20 mm/s") {
          points[i].noise_mm_per_s = 1e3 * f.noise_m_per_s;
        }
        if (&motion == &kMotions[0]) points[i].rms_mm_per_s = 0.0;
        points[i].rms_mm_per_s += 1e3 * f.rms_m_per_s / static_cast<double>(std::size(kMotions));
      }
      table.add_gap();
    }
  }

  // in the loop
  for (const char* tissue : {"paper_soft", "paper_rigid"}) {
    for (std::size_t i = 0; i < std::size(kEstimators); ++i) {
      const LoopFigures f = run_loop(kEstimators[i], tissue, options.is_quick ? 2 : 8);
      table.add({std::string(tissue) + " in the loop", 1000.0, std::string(kEstimators[i].label),
                 kNaN, kNaN, kNaN, kNaN, kNaN, kNaN, 100.0 * f.clamped, 100.0 * f.transparency,
                 100.0 * f.force_error, f.excess_reversals, 1e3 * f.path_deviation_m, kNaN});
      points[i].force_error_percent = 100.0 * f.force_error;  // of the last, the rigid one
    }
    table.add_gap();
  }

  for (const Case& c : kCases) {
    const Session session =
        load_session(kSessions / (std::string(c.session) + ".txtpb"), c.settings);
    const RunStatistics s = run_loopback(session, {.seconds = 10.0}).statistics;
    table.add({std::string(c.label), session.side().device.rate_hz, std::string("default"), kNaN,
               kNaN, kNaN, kNaN, kNaN, kNaN, 100.0 * s.clamp_ratio(),
               100.0 * s.ideal_transparency(), 100.0 * s.force_error_rms_ratio(),
               static_cast<double>(s.excess_reversals()), 1e3 * s.path_deviation_rms_m(),
               100.0 * s.beyond_jnd_ratio()});
  }
  table.publish(options);
  std::printf(
      "\nrms: estimate against the true velocity; × 150 N·s/m in N. Lag: the shift of the truth "
      "that"
      " fits best; noise: rms after it."
      "\nRipple: q/2 · Σ|dF| per second beyond the truth's, at 150 N·s/m: its cost to the ledger."
      "\nIn the loop: the paper's V, device and physics 1 kHz, mode guard; last, the sessions as "
      "shipped"
      " and changed, 10 s; figures against the ideal force and run.\n");
  if (!options.plot_folder.empty()) draw_error_lag(options.plot_folder, points);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Velocity estimators: error against lag, and in the loop.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv, [&] { palpate::bench::run(options); });
}
