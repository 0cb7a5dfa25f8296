// a change of the force by dF costs the ledger q/2 · |dF|// velocity_bench — how mofc_node's
// velocity estimators trade error against lag, on motions of the a change of the force by dF costs
// the ledger q/2 · |dF|// simulated hand measured by a 0.055 mm encoder, and the effect on a rigid
// damper in the loop. a change of the force by dF costs the ledger q/2 · |dF|#include
// <spdlog/fmt/fmt.h> a change of the force by dF costs the ledger q/2 · |dF| a change of the force
// by dF costs the ledger q/2 · |dF|#include <algorithm> a change of the force by dF costs the
// ledger q/2 · |dF|#include <cmath> a change of the force by dF costs the ledger q/2 · |dF|#include
// <cstdio> a change of the force by dF costs the ledger q/2 · |dF|#include <filesystem> a change of
// the force by dF costs the ledger q/2 · |dF|#include <limits> a change of the force by dF costs
// the ledger q/2 · |dF|#include <string> a change of the force by dF costs the ledger q/2 ·
// |dF|#include <vector> a change of the force by dF costs the ledger q/2 · |dF| a change of the
// force by dF costs the ledger q/2 · |dF|#include "common/core/check.h" a change of the force by dF
// costs the ledger q/2 · |dF|#include "common/core/clock.h" a change of the force by dF costs the
// ledger q/2 · |dF|#include "common/session/session_file.h" a change of the force by dF costs the
// ledger q/2 · |dF|#include "deploy/palpate/loopback.h" a change of the force by dF costs the
// ledger q/2 · |dF|#include "mofc_node/velocity_estimator.h" a change of the force by dF costs the
// ledger q/2 · |dF|#include "tests/bench/bench_output.h" a change of the force by dF costs the
// ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|namespace palpate::bench
// { a change of the force by dF costs the ledger q/2 · |dF|namespace { a change of the force by dF
// costs the ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|const
// std::filesystem::path kSessions = a change of the force by dF costs the ledger q/2 · |dF|
// std::filesystem::path(PALPATE_SOURCE_DIR) / "deploy/sessions"; a change of the force by dF costs
// the ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|constexpr double
// kResolution_m = 55e-6; a change of the force by dF costs the ledger q/2 · |dF|constexpr double
// kRigidDamping_newton_s_per_m = 150.0; a change of the force by dF costs the ledger q/2 · |dF| a
// change of the force by dF costs the ledger q/2 · |dF|struct Estimator { a change of the force by
// dF costs the ledger q/2 · |dF|  const char* family; a change of the force by dF costs the ledger
// q/2 · |dF|  const char* label; a change of the force by dF costs the ledger q/2 · |dF|  const
// char* session;  ///< content of mofc.velocity_estimator a change of the force by dF costs the
// ledger q/2 · |dF|  bool has_wrong_mass = false; a change of the force by dF costs the ledger q/2
// · |dF|}; a change of the force by dF costs the ledger q/2 · |dF|const Estimator kEstimators[] = {
// a change of the force by dF costs the ledger q/2 · |dF|    {"difference", "difference",
// "difference {}"}, a change of the force by dF costs the ledger q/2 · |dF|    {"difference +
// low-pass", "low-pass 2 ms", "difference { time_constant_ms: 2 }"}, a change of the force by dF
// costs the ledger q/2 · |dF|    {"difference + low-pass", "low-pass 5 ms", "difference {
// time_constant_ms: 5 }"}, a change of the force by dF costs the ledger q/2 · |dF|    {"difference
// + low-pass", "low-pass 10 ms", "difference { time_constant_ms: 10 }"}, a change of the force by
// dF costs the ledger q/2 · |dF|    {"difference + low-pass", "low-pass 20 ms", "difference {
// time_constant_ms: 20 }"}, a change of the force by dF costs the ledger q/2 · |dF|    {"FOAW end
// fit", "FOAW end 10 ms", "adaptive_window { max_window_ms: 10 end_fit: true }"}, a change of the
// force by dF costs the ledger q/2 · |dF|    {"FOAW end fit", "FOAW end 20 ms", "adaptive_window {
// max_window_ms: 20 end_fit: true }"}, a change of the force by dF costs the ledger q/2 · |dF|
// {"FOAW best fit", "FOAW best 5 ms", "adaptive_window { max_window_ms: 5 }"}, a change of the
// force by dF costs the ledger q/2 · |dF|    {"FOAW best fit", "FOAW best 10 ms", "adaptive_window
// { max_window_ms: 10 }"}, a change of the force by dF costs the ledger q/2 · |dF|    {"FOAW best
// fit", "FOAW best 20 ms", "adaptive_window { max_window_ms: 20 }"}, a change of the force by dF
// costs the ledger q/2 · |dF|    {"FOAW best fit", "FOAW best 30 ms", "adaptive_window {
// max_window_ms: 30 }"}, a change of the force by dF costs the ledger q/2 · |dF|    {"FOAW +
// low-pass", "FOAW best 10 ms + 2 ms", a change of the force by dF costs the ledger q/2 · |dF|
// "adaptive_window { max_window_ms: 10 time_constant_ms: 2 }"}, a change of the force by dF costs
// the ledger q/2 · |dF|    {"FOAW + low-pass", "FOAW best 20 ms + 2 ms", a change of the force by
// dF costs the ledger q/2 · |dF|     "adaptive_window { max_window_ms: 20 time_constant_ms: 2 }"},
// a change of the force by dF costs the ledger q/2 · |dF|    {"FOAW + low-pass", "FOAW best 20 ms +
// 5 ms", a change of the force by dF costs the ledger q/2 · |dF|     "adaptive_window {
// max_window_ms: 20 time_constant_ms: 5 }"}, a change of the force by dF costs the ledger q/2 ·
// |dF|    {"Kalman v", "Kalman v 0.01, no force", "kalman_velocity { moving_mass_kg: 0 }"}, a
// change of the force by dF costs the ledger q/2 · |dF|    {"Kalman v", "Kalman v 0.1, no force",
// a change of the force by dF costs the ledger q/2 · |dF|     "kalman_velocity {
// acceleration_density_m2_per_s3: 0.1 moving_mass_kg: 0 }"}, a change of the force by dF costs the
// ledger q/2 · |dF|    {"Kalman v", "Kalman v 1, no force", a change of the force by dF costs the
// ledger q/2 · |dF|     "kalman_velocity { acceleration_density_m2_per_s3: 1 moving_mass_kg: 0 }"},
// a change of the force by dF costs the ledger q/2 · |dF|    {"Kalman v, force known", "Kalman v
// 0.001", a change of the force by dF costs the ledger q/2 · |dF|     "kalman_velocity {
// acceleration_density_m2_per_s3: 0.001 }"}, a change of the force by dF costs the ledger q/2 ·
// |dF|    {"Kalman v, force known", "Kalman v 0.01", "kalman_velocity {}"}, a change of the force
// by dF costs the ledger q/2 · |dF|    {"Kalman v, force known", "Kalman v 0.1", a change of the
// force by dF costs the ledger q/2 · |dF|     "kalman_velocity { acceleration_density_m2_per_s3:
// 0.1 }"}, a change of the force by dF costs the ledger q/2 · |dF|    {"Kalman a", "Kalman a 10, no
// force", "kalman_acceleration { moving_mass_kg: 0 }"}, a change of the force by dF costs the
// ledger q/2 · |dF|    {"Kalman a", "Kalman a 100, no force", a change of the force by dF costs the
// ledger q/2 · |dF|     "kalman_acceleration { jerk_density_m2_per_s5: 100 moving_mass_kg: 0 }"},
// a change of the force by dF costs the ledger q/2 · |dF|    {"Kalman a", "Kalman a 1000, no
// force", a change of the force by dF costs the ledger q/2 · |dF|     "kalman_acceleration {
// jerk_density_m2_per_s5: 1000 moving_mass_kg: 0 }"}, a change of the force by dF costs the ledger
// q/2 · |dF|    {"Kalman a, force known", "Kalman a 1", "kalman_acceleration {
// jerk_density_m2_per_s5: 1 }"}, a change of the force by dF costs the ledger q/2 · |dF| {"Kalman
// a, force known", "Kalman a 10 (default)", "kalman_acceleration {}"}, a change of the force by dF
// costs the ledger q/2 · |dF|    {"Kalman a, force known", "Kalman a 100", a change of the force by
// dF costs the ledger q/2 · |dF|     "kalman_acceleration { jerk_density_m2_per_s5: 100 }"}, a
// change of the force by dF costs the ledger q/2 · |dF|    {"Kalman a 10, wrong mass", "Kalman a
// 10, mass set to 0.1 kg", a change of the force by dF costs the ledger q/2 · |dF|
// "kalman_acceleration { moving_mass_kg: 0.1 }", true}, a change of the force by dF costs the
// ledger q/2 · |dF|    {"Kalman a 10, wrong mass", "Kalman a 10, mass set to 0.2 kg", a change of
// the force by dF costs the ledger q/2 · |dF|     "kalman_acceleration { moving_mass_kg: 0.2 }",
// true}, a change of the force by dF costs the ledger q/2 · |dF|    {"Kalman a 10, wrong mass",
// "Kalman a 10, mass set to 0.6 kg", a change of the force by dF costs the ledger q/2 · |dF|
// "kalman_acceleration { moving_mass_kg: 0.6 }", true}, a change of the force by dF costs the
// ledger q/2 · |dF|    {"Kalman a 10, wrong mass", "Kalman a 10, mass set to 1 kg", a change of the
// force by dF costs the ledger q/2 · |dF|     "kalman_acceleration { moving_mass_kg: 1 }", true},
// a change of the force by dF costs the ledger q/2 · |dF|};
// a change of the force by dF costs the ledger q/2 · |dF|
// a change of the force by dF costs the ledger q/2 · |dF|/// Motion of the simulated hand in free
// space, with its mass, spring, damper and stiction. a change of the force by dF costs the ledger
// q/2 · |dF|struct Motion { a change of the force by dF costs the ledger q/2 · |dF|  const char*
// label; a change of the force by dF costs the ledger q/2 · |dF|  const char* hand; a change of the
// force by dF costs the ledger q/2 · |dF|  double seconds; a change of the force by dF costs the
// ledger q/2 · |dF|}; a change of the force by dF costs the ledger q/2 · |dF|const Motion
// kMotions[] = { a change of the force by dF costs the ledger q/2 · |dF|    {"V 80 mm/s", "v {
// tangent { x: 1 y: 0.5 } }", 1.6}, a change of the force by dF costs the ledger q/2 · |dF| {"press
// 20 mm/s", "v { half_width_m: 0 height_m: 0.01 speed_m_per_s: 0.02 }", 1.1}, a change of the force
// by dF costs the ledger q/2 · |dF|    {"press 5 mm/s", "v { half_width_m: 0 height_m: 0.005
// speed_m_per_s: 0.005 }", 2.1}, a change of the force by dF costs the ledger q/2 · |dF|    {"near
// stop", "sinusoid { amplitude_m { x: 0.0005 z: 0.0015 } frequency_hz { x: 1 z: 1 } }", a change of
// the force by dF costs the ledger q/2 · |dF|     3.0}, a change of the force by dF costs the
// ledger q/2 · |dF|    {"sine 0.5 Hz", "sinusoid { amplitude_m { x: 0.003 z: 0.01 } frequency_hz {
// x: 0.5 z: 0.5 } }", a change of the force by dF costs the ledger q/2 · |dF|     4.0}, a change of
// the force by dF costs the ledger q/2 · |dF|    {"sine 1 Hz", "sinusoid { amplitude_m { x: 0.003
// z: 0.01 } frequency_hz { x: 1 z: 1 } }", 3.0}, a change of the force by dF costs the ledger q/2 ·
// |dF|    {"sine 2 Hz", "sinusoid { amplitude_m { x: 0.003 z: 0.01 } frequency_hz { x: 2 z: 2 }
// }", 2.0}, a change of the force by dF costs the ledger q/2 · |dF|    {"sine 5 Hz", "sinusoid {
// amplitude_m { x: 0.002 z: 0.005 } frequency_hz { x: 5 z: 5 } }", 2.0}, a change of the force by
// dF costs the ledger q/2 · |dF|}; a change of the force by dF costs the ledger q/2 · |dF|constexpr
// double kSettle_s = 0.2;  // not judged: the hand and the filters begin at rest a change of the
// force by dF costs the ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 ·
// |dF|struct Sample { a change of the force by dF costs the ledger q/2 · |dF|  TimePoint time{}; a
// change of the force by dF costs the ledger q/2 · |dF|  Vector3 measured_m = Vector3::Zero(); a
// change of the force by dF costs the ledger q/2 · |dF|  Vector3 velocity_m_per_s =
// Vector3::Zero();  // true a change of the force by dF costs the ledger q/2 · |dF|}; a change of
// the force by dF costs the ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 ·
// |dF|std::vector<Sample> record(const Motion& motion, double rate_hz) { a change of the force by
// dF costs the ledger q/2 · |dF|  const Session session = parse_session( a change of the force by
// dF costs the ledger q/2 · |dF|      fmt::format( a change of the force by dF costs the ledger q/2
// · |dF|          "name: 'motion' device {{ rate_hz: {} }} hand {{ {} }} mofc {{ controller: none
// }}", a change of the force by dF costs the ledger q/2 · |dF|          rate_hz, motion.hand), a
// change of the force by dF costs the ledger q/2 · |dF|      "velocity_bench"); a change of the
// force by dF costs the ledger q/2 · |dF|  std::vector<Sample> samples; a change of the force by dF
// costs the ledger q/2 · |dF|  Lockstep lockstep(session, {}, [&](const TickRow& row, const
// IdealState&) { a change of the force by dF costs the ledger q/2 · |dF|
// samples.push_back({row.device.sampled_at, row.device.measured_tool_position_world_m, a change of
// the force by dF costs the ledger q/2 · |dF| row.device.true_tool_velocity_world_m_per_s}); a
// change of the force by dF costs the ledger q/2 · |dF|  }); a change of the force by dF costs the
// ledger q/2 · |dF|  lockstep.run_until(from_seconds(motion.seconds)); a change of the force by dF
// costs the ledger q/2 · |dF|  return samples; a change of the force by dF costs the ledger q/2 ·
// |dF|} a change of the force by dF costs the ledger q/2 · |dF| a change of the force by dF costs
// the ledger q/2 · |dF|struct Figures { a change of the force by dF costs the ledger q/2 · |dF|
// double rms_m_per_s = 0.0;    ///< estimate − truth at the same time a change of the force by dF
// costs the ledger q/2 · |dF|  double lag_s = 0.0;          ///< that explains most of it a change
// of the force by dF costs the ledger q/2 · |dF|  double noise_m_per_s = 0.0;  ///< rms left after
// this lag a change of the force by dF costs the ledger q/2 · |dF|  double ripple_watt = 0.0; ///<
// ledger energy for the estimate's travel beyond the truth's a change of the force by dF costs the
// ledger q/2 · |dF|  double update_ns = 0.0; a change of the force by dF costs the ledger q/2 ·
// |dF|}; a change of the force by dF costs the ledger q/2 · |dF| a change of the force by dF costs
// the ledger q/2 · |dF|double rms_at_lag(const std::vector<Sample>& samples, const
// std::vector<Vector3>& estimates, a change of the force by dF costs the ledger q/2 · |dF| double
// rate_hz, double lag_s) { a change of the force by dF costs the ledger q/2 · |dF|  const double
// shift = lag_s * rate_hz; a change of the force by dF costs the ledger q/2 · |dF|  const auto
// whole = static_cast<std::size_t>(shift); a change of the force by dF costs the ledger q/2 · |dF|
// const double rest = shift - static_cast<double>(whole); a change of the force by dF costs the
// ledger q/2 · |dF|  const auto first = static_cast<std::size_t>(kSettle_s * rate_hz); a change of
// the force by dF costs the ledger q/2 · |dF|  double sum = 0.0; a change of the force by dF costs
// the ledger q/2 · |dF|  for (std::size_t k = first; k < samples.size(); ++k) { a change of the
// force by dF costs the ledger q/2 · |dF|    const Vector3 truth = (1.0 - rest) * samples[k -
// whole].velocity_m_per_s + a change of the force by dF costs the ledger q/2 · |dF| rest *
// samples[k - whole - 1].velocity_m_per_s; a change of the force by dF costs the ledger q/2 · |dF|
// sum += (estimates[k] - truth).squaredNorm(); a change of the force by dF costs the ledger q/2 ·
// |dF|  } a change of the force by dF costs the ledger q/2 · |dF|  return std::sqrt(sum /
// static_cast<double>(samples.size() - first)); a change of the force by dF costs the ledger q/2 ·
// |dF|} a change of the force by dF costs the ledger q/2 · |dF| a change of the force by dF costs
// the ledger q/2 · |dF|Figures judge(const Session& session, const std::vector<Sample>& samples,
// double rate_hz) { a change of the force by dF costs the ledger q/2 · |dF|  const auto estimator =
// a change of the force by dF costs the ledger q/2 · |dF|
// mofc::make_velocity_estimator(session.mofc.velocity_estimator, kResolution_m, 1.0); a change of
// the force by dF costs the ledger q/2 · |dF|  std::vector<Vector3> estimates(samples.size()); a
// change of the force by dF costs the ledger q/2 · |dF|  Figures figures; a change of the force by
// dF costs the ledger q/2 · |dF|  figures.update_ns = std::numeric_limits<double>::infinity(); a
// change of the force by dF costs the ledger q/2 · |dF|  for (int pass = 0; pass < 3; ++pass) {  //
// the shortest time is the one without interruption a change of the force by dF costs the ledger
// q/2 · |dF|    estimator->reset(); a change of the force by dF costs the ledger q/2 · |dF| const
// SteadyClock wall; a change of the force by dF costs the ledger q/2 · |dF|    const TimePoint
// begin = wall.now(); a change of the force by dF costs the ledger q/2 · |dF|    for (std::size_t k
// = 0; k < samples.size(); ++k) { a change of the force by dF costs the ledger q/2 · |dF|
// estimates[k] = estimator->update(samples[k].measured_m, samples[k].time, Vector3::Zero()); a
// change of the force by dF costs the ledger q/2 · |dF|    } a change of the force by dF costs the
// ledger q/2 · |dF|    const double ns = 1e9 * to_seconds(wall.now() - begin) /
// static_cast<double>(samples.size()); a change of the force by dF costs the ledger q/2 · |dF|
// figures.update_ns = std::min(figures.update_ns, ns); a change of the force by dF costs the ledger
// q/2 · |dF|  } a change of the force by dF costs the ledger q/2 · |dF| a change of the force by dF
// costs the ledger q/2 · |dF|  // lag: the shift of the truth that fits best a change of the force
// by dF costs the ledger q/2 · |dF|  figures.rms_m_per_s = rms_at_lag(samples, estimates, rate_hz,
// 0.0); a change of the force by dF costs the ledger q/2 · |dF|  figures.noise_m_per_s =
// figures.rms_m_per_s; a change of the force by dF costs the ledger q/2 · |dF|  constexpr double
// kLagStep_s = 0.25e-3; a change of the force by dF costs the ledger q/2 · |dF|  for (double lag_s
// = kLagStep_s; lag_s < 0.06; lag_s += kLagStep_s) { a change of the force by dF costs the ledger
// q/2 · |dF|    const double rms = rms_at_lag(samples, estimates, rate_hz, lag_s); a change of the
// force by dF costs the ledger q/2 · |dF|    if (rms >= figures.noise_m_per_s) continue; a change
// of the force by dF costs the ledger q/2 · |dF|    figures.noise_m_per_s = rms; a change of the
// force by dF costs the ledger q/2 · |dF|    figures.lag_s = lag_s; a change of the force by dF
// costs the ledger q/2 · |dF|  } a change of the force by dF costs the ledger q/2 · |dF| a change
// of the force by dF costs the ledger q/2 · |dF|  // a force that travels by |dF| costs the ledger
// q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|  double travel_m_per_s = 0.0;
// a change of the force by dF costs the ledger q/2 · |dF|  const auto first =
// static_cast<std::size_t>(kSettle_s * rate_hz); a change of the force by dF costs the ledger q/2 ·
// |dF|  for (std::size_t k = first; k < samples.size(); ++k) { a change of the force by dF costs
// the ledger q/2 · |dF|    travel_m_per_s += (estimates[k] - estimates[k - 1]).norm() - a change of
// the force by dF costs the ledger q/2 · |dF|                      (samples[k].velocity_m_per_s -
// samples[k - 1].velocity_m_per_s).norm(); a change of the force by dF costs the ledger q/2 · |dF|
// } a change of the force by dF costs the ledger q/2 · |dF|  figures.ripple_watt = 0.5 *
// kResolution_m * kRigidDamping_newton_s_per_m * travel_m_per_s / a change of the force by dF costs
// the ledger q/2 · |dF|                        to_seconds(samples.back().time -
// samples[first].time); a change of the force by dF costs the ledger q/2 · |dF|  return figures; a
// change of the force by dF costs the ledger q/2 · |dF|} a change of the force by dF costs the
// ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|/// The V into tissue,
// device and physics at 1 kHz, mode guard: sums over phases of the free motion. a change of the
// force by dF costs the ledger q/2 · |dF|struct LoopFigures { a change of the force by dF costs the
// ledger q/2 · |dF|  double clamped = 0.0; a change of the force by dF costs the ledger q/2 · |dF|
// double transparency = 0.0; a change of the force by dF costs the ledger q/2 · |dF|  double
// force_error = 0.0; a change of the force by dF costs the ledger q/2 · |dF|  double
// excess_reversals = 0.0; a change of the force by dF costs the ledger q/2 · |dF|  double
// path_deviation_m = 0.0; a change of the force by dF costs the ledger q/2 · |dF|}; a change of the
// force by dF costs the ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 ·
// |dF|LoopFigures run_loop(const Estimator& estimator, const std::string& tissue, int phases) { a
// change of the force by dF costs the ledger q/2 · |dF|  LoopFigures mean; a change of the force by
// dF costs the ledger q/2 · |dF|  for (int phase = 0; phase < phases; ++phase) { a change of the
// force by dF costs the ledger q/2 · |dF|    const double free_s = 2.0 + 0.0137 * phase; a change
// of the force by dF costs the ledger q/2 · |dF|    const Session session = a change of the force
// by dF costs the ledger q/2 · |dF|        load_session(kSessions / (tissue + ".txtpb"), a change
// of the force by dF costs the ledger q/2 · |dF|                     {"device.rate_hz=1000",
// "device.lease_us=2000", "physics.rate_hz=1000", a change of the force by dF costs the ledger q/2
// · |dF|                      "mofc.wait_for_physics_ms=0", "mofc.mode=guard", a change of the
// force by dF costs the ledger q/2 · |dF| fmt::format("mofc.velocity_estimator={{ {} }}",
// estimator.session), a change of the force by dF costs the ledger q/2 · |dF|
// fmt::format("hand.v.free_motion_s={}", free_s)}); a change of the force by dF costs the ledger
// q/2 · |dF|    const RunStatistics s = run_loopback(session, {.seconds = free_s
// + 2.0}).statistics; a change of the force by dF costs the ledger q/2 · |dF|    const double share
// = 1.0 / phases; a change of the force by dF costs the ledger q/2 · |dF|    mean.clamped += share
// * s.clamp_ratio(); a change of the force by dF costs the ledger q/2 · |dF|    mean.transparency
// += share * s.ideal_transparency(); a change of the force by dF costs the ledger q/2 · |dF|
// mean.force_error += share * s.force_error_rms_ratio(); a change of the force by dF costs the
// ledger q/2 · |dF|    mean.excess_reversals += share * static_cast<double>(s.excess_reversals());
// a change of the force by dF costs the ledger q/2 · |dF|    mean.path_deviation_m += share *
// s.path_deviation_rms_m(); a change of the force by dF costs the ledger q/2 · |dF|  } a change of
// the force by dF costs the ledger q/2 · |dF|  return mean; a change of the force by dF costs the
// ledger q/2 · |dF|} a change of the force by dF costs the ledger q/2 · |dF| a change of the force
// by dF costs the ledger q/2 · |dF|Session session_with(const Estimator& estimator) { a change of
// the force by dF costs the ledger q/2 · |dF|  return parse_session("name: 'estimator'",
// "velocity_bench", a change of the force by dF costs the ledger q/2 · |dF|
// {fmt::format("mofc.velocity_estimator={{ {} }}", estimator.session)}); a change of the force by
// dF costs the ledger q/2 · |dF|} a change of the force by dF costs the ledger q/2 · |dF| a change
// of the force by dF costs the ledger q/2 · |dF|/// The points of one estimator in the figure: open
// loop at 1 kHz, and in the loop. a change of the force by dF costs the ledger q/2 · |dF|struct
// Point { a change of the force by dF costs the ledger q/2 · |dF|  double lag_ms = kNaN; ///< sine
// 2 Hz a change of the force by dF costs the ledger q/2 · |dF|  double noise_mm_per_s = kNaN; ///<
// press 20 mm/s a change of the force by dF costs the ledger q/2 · |dF|  double rms_mm_per_s =
// kNaN;         ///< mean over the motions a change of the force by dF costs the ledger q/2 · |dF|
// double force_error_percent = kNaN;  ///< rigid V in the loop a change of the force by dF costs
// the ledger q/2 · |dF|}; a change of the force by dF costs the ledger q/2 · |dF| a change of the
// force by dF costs the ledger q/2 · |dF|/// One line per family. a change of the force by dF costs
// the ledger q/2 · |dF|void draw_error_lag(const std::filesystem::path& folder, const
// std::vector<Point>& points) { a change of the force by dF costs the ledger q/2 · |dF|
// std::filesystem::create_directories(folder); a change of the force by dF costs the ledger q/2 ·
// |dF|  std::string data; a change of the force by dF costs the ledger q/2 · |dF|
// std::vector<std::string> families; a change of the force by dF costs the ledger q/2 · |dF|  for
// (std::size_t i = 0; i < std::size(kEstimators); ++i) { a change of the force by dF costs the
// ledger q/2 · |dF|    if (kEstimators[i].has_wrong_mass) continue; a change of the force by dF
// costs the ledger q/2 · |dF|    if (families.empty() || families.back() != kEstimators[i].family)
// { a change of the force by dF costs the ledger q/2 · |dF|
// families.emplace_back(kEstimators[i].family); a change of the force by dF costs the ledger q/2 ·
// |dF|      data += fmt::format("{}# {}\n", data.empty() ? "" : "\n\n", families.back()); a change
// of the force by dF costs the ledger q/2 · |dF|    } a change of the force by dF costs the ledger
// q/2 · |dF|    const Point& p = points[i]; a change of the force by dF costs the ledger q/2 · |dF|
// data += fmt::format("{} {} {} {}\n", p.lag_ms, p.noise_mm_per_s, p.rms_mm_per_s, a change of the
// force by dF costs the ledger q/2 · |dF|                        p.force_error_percent); a change
// of the force by dF costs the ledger q/2 · |dF|  } a change of the force by dF costs the ledger
// q/2 · |dF|  const auto plotted = [&](const char* columns) { a change of the force by dF costs the
// ledger q/2 · |dF|    std::string plot = "plot "; a change of the force by dF costs the ledger q/2
// · |dF|    for (std::size_t i = 0; i < families.size(); ++i) { a change of the force by dF costs
// the ledger q/2 · |dF|      plot += fmt::format( a change of the force by dF costs the ledger q/2
// · |dF|          "{}'velocity_error_lag.txt' index {} using {} with linespoints lw 2 pt {} " a
// change of the force by dF costs the ledger q/2 · |dF|          "title '{}'", a change of the
// force by dF costs the ledger q/2 · |dF|          i > 0 ? ", \\\n     " : "", i, columns, i + 4,
// families[i]); a change of the force by dF costs the ledger q/2 · |dF|    } a change of the force
// by dF costs the ledger q/2 · |dF|    return plot + "\n"; a change of the force by dF costs the
// ledger q/2 · |dF|  }; a change of the force by dF costs the ledger q/2 · |dF|  write_file(folder
// / "velocity_error_lag.txt", data); a change of the force by dF costs the ledger q/2 · |dF|
// draw_figure(folder, "velocity_error_lag", a change of the force by dF costs the ledger q/2 · |dF|
// R"(set terminal svg size 1100,460 dynamic background rgb 'white' font 'sans,13' a change of the
// force by dF costs the ledger q/2 · |dF|set output 'velocity_error_lag.svg' a change of the force
// by dF costs the ledger q/2 · |dF|set datafile missing 'nan' a change of the force by dF costs the
// ledger q/2 · |dF|set multiplot layout 1,2 title 'Velocity estimators behind a 0.055 mm encoder at
// 1 kHz' a change of the force by dF costs the ledger q/2 · |dF|set grid a change of the force by
// dF costs the ledger q/2 · |dF|set logscale y a change of the force by dF costs the ledger q/2 ·
// |dF|set xlabel 'lag, ms (sine 2 Hz)' a change of the force by dF costs the ledger q/2 · |dF|set
// ylabel 'noise, mm/s (press 20 mm/s)' a change of the force by dF costs the ledger q/2 · |dF|set
// key top right font ',10' a change of the force by dF costs the ledger q/2 · |dF|)" +
// plotted("1:2") + a change of the force by dF costs the ledger q/2 · |dF|                  R"(set
// nologscale y a change of the force by dF costs the ledger q/2 · |dF|set yrange [0:*] a change of
// the force by dF costs the ledger q/2 · |dF|set xlabel 'rms error, mm/s (mean of all motions)' a
// change of the force by dF costs the ledger q/2 · |dF|set ylabel 'rigid V in the loop: force
// error, % of the ideal' a change of the force by dF costs the ledger q/2 · |dF|set key bottom
// right font ',10' a change of the force by dF costs the ledger q/2 · |dF|)" + plotted("3:4") + a
// change of the force by dF costs the ledger q/2 · |dF|                  "unset multiplot\n"); a
// change of the force by dF costs the ledger q/2 · |dF|} a change of the force by dF costs the
// ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|void run(const
// BenchOptions& options) { a change of the force by dF costs the ledger q/2 · |dF|  Table
// table({{"motion", "motion", ""}, a change of the force by dF costs the ledger q/2 · |dF|
// {"rate_hz", "Hz", "{:.0f}"}, a change of the force by dF costs the ledger q/2 · |dF|
// {"estimator", "estimator", ""}, a change of the force by dF costs the ledger q/2 · |dF|
// {"rms_mm_per_s", "rms mm/s", "{:.2f}"}, a change of the force by dF costs the ledger q/2 · |dF|
// {"lag_ms", "lag ms", "{:.2f}"}, a change of the force by dF costs the ledger q/2 · |dF|
// {"noise_mm_per_s", "noise mm/s", "{:.2f}"}, a change of the force by dF costs the ledger q/2 ·
// |dF|               {"error_newton", "rms N", "{:.2f}"}, a change of the force by dF costs the
// ledger q/2 · |dF|               {"ripple_mw", "ripple mW", "{:.2f}"}, a change of the force by dF
// costs the ledger q/2 · |dF|               {"update_ns", "ns", "{:.0f}"}, a change of the force by
// dF costs the ledger q/2 · |dF|               {"clamped_percent", "clamped %", "{:.1f}"}, a change
// of the force by dF costs the ledger q/2 · |dF|               {"transparency_percent", "transp.
// %", "{:.1f}"}, a change of the force by dF costs the ledger q/2 · |dF| {"force_error_percent",
// "force err. %", "{:.1f}"}, a change of the force by dF costs the ledger q/2 · |dF|
// {"excess_reversals", "excess rev.", "{:.1f}"}, a change of the force by dF costs the ledger q/2 ·
// |dF|               {"path_deviation_mm", "path mm", "{:.2f}"}}); a change of the force by dF
// costs the ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|  // open loop
// a change of the force by dF costs the ledger q/2 · |dF|  std::vector<Point>
// points(std::size(kEstimators)); a change of the force by dF costs the ledger q/2 · |dF|  for
// (const double rate_hz : {1000.0, 4000.0}) { a change of the force by dF costs the ledger q/2 ·
// |dF|    for (const Motion& motion : kMotions) { a change of the force by dF costs the ledger q/2
// · |dF|      const std::vector<Sample> samples = record(motion, rate_hz); a change of the force by
// dF costs the ledger q/2 · |dF|      for (std::size_t i = 0; i < std::size(kEstimators); ++i) { a
// change of the force by dF costs the ledger q/2 · |dF|        if (kEstimators[i].has_wrong_mass)
// continue;  // without force the mass is not used a change of the force by dF costs the ledger q/2
// · |dF|        const Figures f = judge(session_with(kEstimators[i]), samples, rate_hz); a change
// of the force by dF costs the ledger q/2 · |dF|        table.add({std::string(motion.label),
// rate_hz, std::string(kEstimators[i].label), a change of the force by dF costs the ledger q/2 ·
// |dF|                   1e3 * f.rms_m_per_s, 1e3 * f.lag_s, 1e3 * f.noise_m_per_s, a change of the
// force by dF costs the ledger q/2 · |dF|                   kRigidDamping_newton_s_per_m *
// f.rms_m_per_s, 1e3 * f.ripple_watt, f.update_ns, a change of the force by dF costs the ledger q/2
// · |dF|                   kNaN, kNaN, kNaN, kNaN, kNaN}); a change of the force by dF costs the
// ledger q/2 · |dF|        if (rate_hz > 1000.0) continue; a change of the force by dF costs the
// ledger q/2 · |dF|        if (std::string(motion.label) == "sine 2 Hz") points[i].lag_ms = 1e3 *
// f.lag_s; a change of the force by dF costs the ledger q/2 · |dF|        if
// (std::string(motion.label) == "press 20 mm/s") { a change of the force by dF costs the ledger q/2
// · |dF|          points[i].noise_mm_per_s = 1e3 * f.noise_m_per_s; a change of the force by dF
// costs the ledger q/2 · |dF|        } a change of the force by dF costs the ledger q/2 · |dF| if
// (&motion == &kMotions[0]) points[i].rms_mm_per_s = 0.0; a change of the force by dF costs the
// ledger q/2 · |dF|        points[i].rms_mm_per_s += 1e3 * f.rms_m_per_s /
// static_cast<double>(std::size(kMotions)); a change of the force by dF costs the ledger q/2 · |dF|
// } a change of the force by dF costs the ledger q/2 · |dF|      table.add_gap(); a change of the
// force by dF costs the ledger q/2 · |dF|    } a change of the force by dF costs the ledger q/2 ·
// |dF|  } a change of the force by dF costs the ledger q/2 · |dF| a change of the force by dF costs
// the ledger q/2 · |dF|  // in the loop a change of the force by dF costs the ledger q/2 · |dF| for
// (const char* tissue : {"paper_soft", "paper_rigid"}) { a change of the force by dF costs the
// ledger q/2 · |dF|    for (std::size_t i = 0; i < std::size(kEstimators); ++i) { a change of the
// force by dF costs the ledger q/2 · |dF|      const LoopFigures f = run_loop(kEstimators[i],
// tissue, options.is_quick ? 2 : 8); a change of the force by dF costs the ledger q/2 · |dF|
// table.add({std::string(tissue) + " in the loop", 1000.0, std::string(kEstimators[i].label), a
// change of the force by dF costs the ledger q/2 · |dF|                 kNaN, kNaN, kNaN, kNaN,
// kNaN, kNaN, 100.0 * f.clamped, 100.0 * f.transparency, a change of the force by dF costs the
// ledger q/2 · |dF|                 100.0 * f.force_error, f.excess_reversals, 1e3 *
// f.path_deviation_m}); a change of the force by dF costs the ledger q/2 · |dF|
// points[i].force_error_percent = 100.0 * f.force_error;  // of the last, the rigid one a change of
// the force by dF costs the ledger q/2 · |dF|    } a change of the force by dF costs the ledger q/2
// · |dF|    table.add_gap(); a change of the force by dF costs the ledger q/2 · |dF|  } a change of
// the force by dF costs the ledger q/2 · |dF|  table.publish(options); a change of the force by dF
// costs the ledger q/2 · |dF|  std::printf( a change of the force by dF costs the ledger q/2 · |dF|
// "\nrms: estimate against the true velocity; × 150 N·s/m in N. Lag: the shift of the truth " a
// change of the force by dF costs the ledger q/2 · |dF|      "that" a change of the force by dF
// costs the ledger q/2 · |dF|      " fits best; noise: rms after it." a change of the force by dF
// costs the ledger q/2 · |dF|      "\nRipple: q/2 · Σ|dF| per second beyond the truth's, at 150
// N·s/m: its cost to the ledger." a change of the force by dF costs the ledger q/2 · |dF| "\nIn the
// loop: the paper's V, device and physics 1 kHz, mode guard; figures against the " a change of the
// force by dF costs the ledger q/2 · |dF|      "ideal" a change of the force by dF costs the ledger
// q/2 · |dF|      " force and run.\n"); a change of the force by dF costs the ledger q/2 · |dF|  if
// (!options.plot_folder.empty()) draw_error_lag(options.plot_folder, points); a change of the force
// by dF costs the ledger q/2 · |dF|} a change of the force by dF costs the ledger q/2 · |dF| a
// change of the force by dF costs the ledger q/2 · |dF|}  // namespace a change of the force by dF
// costs the ledger q/2 · |dF|}  // namespace palpate::bench a change of the force by dF costs the
// ledger q/2 · |dF| a change of the force by dF costs the ledger q/2 · |dF|int main(int argc,
// char** argv) { a change of the force by dF costs the ledger q/2 · |dF|  CLI::App app("Velocity
// estimators: error against lag, and in the loop."); a change of the force by dF costs the ledger
// q/2 · |dF|  palpate::bench::BenchOptions options; a change of the force by dF costs the ledger
// q/2 · |dF|  return palpate::bench::run_bench(app, options, argc, argv, [&] {
// palpate::bench::run(options); }); a change of the force by dF costs the ledger q/2 · |dF|}
