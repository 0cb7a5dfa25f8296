// SPDX-License-Identifier: Apache-2.0
#include "tests/support/wired/viced_runs.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "common/core/random.h"
#include "device_node/drivers/held_torque.h"
#include "device_node/drivers/wire_device.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/wired/hostile_commands.h"
#include "tests/support/wired/shared_clock.h"

namespace palpate::test {
namespace {

using device::DeviceSample;
using device::Transfer;

constexpr double kPeakNewton = 3.3;
constexpr Duration kPastStep = 100us;  // of Hardware: how much older than its latency a position is

struct ArmParts {
  const VicedRun& run;
  const SimulatedDeviceConfig& simulated;
  const HandConfig& hand;
  std::uint64_t seed = 0;
};

/// The arm stays a fifth away from where it is singular.
Vector3 half_extent(const VicedRun& run) {
  return Vector3::Constant(std::min(0.05, 0.8 / std::abs(run.turning_per_m)));
}

/// 20 mm to each side on x, with 0.4 m/s: 0.2 s there and back.
RecordedPath to_and_fro() {
  RecordedPath path;
  path.loops = true;
  for (const auto& [t_s, x_m] : {std::pair{0.0, -0.02}, {0.1, 0.02}, {0.2, -0.02}}) {
    path.samples.push_back({t_s, Vector3(x_m, 0.0, 0.0)});
  }
  return path;
}

/// Each axis is a motor whose angle is θ = x + κx²/2: its force is τ (1 + κx).
template <Books books>
class VicedArm final : public device::WireDevice, public device::TrueStateSource {
 public:
  VicedArm(const Clock& clock, const ArmParts& parts)
      : WireDevice({.peak_force_newton = kPeakNewton, .continuous_force_newton = kPeakNewton},
                   clock),
        wakeful_(clock),
        hardware_(parts.simulated, parts.hand, wakeful_, parts.seed),
        random_(parts.seed + 2),
        turning_per_m_(parts.run.turning_per_m),
        count_newton_(parts.run.count_newton),
        tells_turned_(parts.run.tells_turned) {
    hardware_.set(parts.run.vices);
    const Vector3 half_extent_m = half_extent(parts.run);
    // gains are 1 ± this within the workspace
    const double most = std::abs(turning_per_m_) * half_extent_m.x();
    set_specification(
        {.model_name = "arm with vices",
         .workspace_half_extent_m = half_extent_m,
         .peak_force_newton = kPeakNewton,
         .continuous_force_newton = kPeakNewton,
         .position_resolution_m = parts.simulated.position_resolution_m,
         .button_count = 1,
         .has_motor_watchdog = books == Books::kSimple,
         .held_force_ratio = parts.run.bounds_held_currents ? (1.0 + most) / (1.0 - most) : 1.0,
         .turning_per_m = parts.run.bounds_held_currents
                              ? std::sqrt(3.0) * std::abs(turning_per_m_) / (1.0 - most)
                              : 0.0});
    set_calibrated();
  }

  /// Messages get lost from now on.
  void lose(const VicedRun& run) {
    drops_per_message_ = run.drops_per_message;
    failed_releases_ = run.failed_releases;
  }
  /// The dead-man button, or the grip that has it.
  void hold(bool is_held) { is_held_ = is_held; }
  /// The machine sleeps, the hardware does not.
  void sleep(Duration duration) { wakeful_.slept(duration); }
  [[nodiscard]] device::TrueState true_state() const noexcept override {
    return hardware_.true_state();
  }
  [[nodiscard]] Vector3 motor_newton() const { return hardware_.force_newton(); }

 private:
  void connect(Duration /*within*/) override {}
  [[nodiscard]] bool is_connected() const noexcept override { return true; }
  void disconnect() noexcept override {}
  [[nodiscard]] bool knows_its_calibration() override { return true; }

  [[nodiscard]] Vector3 gain(const Vector3& hand_m) const {
    return Vector3::Ones() + turning_per_m_ * hand_m;
  }
  Transfer exchange(const Vector3& force_newton, DeviceSample& sample) noexcept override {
    const bool is_dropped = random_.chance(drops_per_message_);
    if (is_dropped && random_.chance(0.5)) return Transfer::kTimeout;
    const Vector3 gain_now = gain(angles_of_m_);
    Vector3 torque = force_newton.cwiseQuotient(gain_now);
    Vector3 made_newton = force_newton;
    if (count_newton_ > 0.0) {
      Vector3 counts = torque / count_newton_;
      const Matrix3 newton_per_count = count_newton_ * gain_now.asDiagonal();
      if (books == Books::kTrue) {
        made_newton = device::round_counts(counts, newton_per_count, allowed_newton());
      } else {
        counts = counts.array().round();
        made_newton = newton_per_count * counts;
      }
      torque = count_newton_ * counts;
    }
    const DeviceSample answer = turning_per_m_ == 0.0
                                    ? hardware_.switch_to(made_newton)
                                    : hardware_.switch_to([this, torque](const Vector3& hand_m) {
                                        return Vector3(torque.cwiseProduct(gain(hand_m)));
                                      });
    if (is_dropped) return Transfer::kTimeout;
    sample.hand_position_m = angles_of_m_ = answer.hand_position_m;
    sample.buttons = is_held_ ? 1 : 0;
    sample.applied_force_newton = books == Books::kTrue ? made_newton : force_newton;
    if (books == Books::kTrue && turning_per_m_ != 0.0) {
      const Vector3 angles =
          angles_of_m_ + 0.5 * turning_per_m_ * angles_of_m_.cwiseProduct(angles_of_m_);
      held_.answered(torque, angles, Matrix3(gain(angles_of_m_).cwiseInverse().asDiagonal()),
                     sample);
      if (!tells_turned_) sample.turned_newton.setZero();
    }
    return Transfer::kDone;
  }
  Transfer release_once() noexcept override {
    if (random_.chance(failed_releases_)) return Transfer::kTimeout;
    static_cast<void>(hardware_.switch_to(Vector3(Vector3::Zero())));
    held_.forget();
    return Transfer::kDone;
  }

  WakefulClock wakeful_;
  device::Hardware hardware_;
  Random random_;
  double drops_per_message_ = 0.0;
  double failed_releases_ = 0.0;
  const double turning_per_m_;
  const double count_newton_;
  const bool tells_turned_;
  bool is_held_ = true;
  Vector3 angles_of_m_ = Vector3::Zero();
  device::HeldTorque held_;
};

template <Books books>
VicedResult run_books(const VicedRun& run, std::uint64_t seed) {
  Random random(seed);
  DeviceConfig config = device_config();
  config.longest_lease = 10ms;
  config.peak_force_newton = kPeakNewton;
  config.profile = {.viscous_newton_s_per_m = run.viscous_newton_s_per_m,
                    .coulomb_newton = run.coulomb_newton,
                    .position_resolution_m = run.resolution_m};
  config.monitor = {.is_on = true, .v_max_m_per_s = 0.5};
  config.accepts_no_motor_watchdog = run.is_accepted;
  if (run.has_dead_man_button) config.dead_man_button = 0;
  if (books == Books::kTrue && run.vices.sensing + run.vices.actuation > Duration::zero()) {
    config.latency = run.vices.sensing + run.vices.actuation + kPastStep;
  }
  const SimulatedDeviceConfig simulated{.viscous_newton_s_per_m = run.viscous_newton_s_per_m,
                                        .coulomb_newton = run.coulomb_newton,
                                        .position_resolution_m = run.resolution_m,
                                        .peak_force_newton = 10.0 * kPeakNewton};
  // firm, so that it stays below v_max whatever pushes it
  HandConfig hand{.mass_kg = random.uniform(0.02, 0.3),
                  .stiffness_newton_per_m = random.uniform(800.0, 4000.0),
                  .damping_newton_s_per_m = random.uniform(30.0, 80.0)};
  hand.path = HostilePath{.radius_m = random.uniform(0.005, 0.8 * half_extent(run).x()),
                          .v_max_m_per_s = random.uniform(0.05, 0.3)};
  if (run.steady_newton != 0.0) {
    hand = {.mass_kg = 0.03, .stiffness_newton_per_m = 2e4, .damping_newton_s_per_m = 120.0};
    hand.path = to_and_fro();
  }
  DeviceNodeBench<VicedArm<books>> bench(
      config, ArmParts{.run = run, .simulated = simulated, .hand = hand, .seed = seed});
  bench.device.lose(run);
  bench.reply_delay = from_seconds(random.uniform(0.0, 5e-4));
  bench.node.acknowledge();
  bench.node.acknowledge();

  VicedResult result{.most_unbooked_joule = -std::numeric_limits<double>::infinity()};
  HostileCommands commands(seed + 1, kPeakNewton);
  std::uint64_t silent_ticks = 0;
  bench.on_state = [&](const DeviceState& state) {
    const device::TrueState truth = bench.device.true_state();
    result.most_unbooked_joule =
        std::max(result.most_unbooked_joule, bench.node.monitor_joule() - truth.energy_joule);
    result.top_speed_m_per_s =
        std::max(result.top_speed_m_per_s, truth.hand_velocity_m_per_s.norm());
    const double share = std::clamp(2.0 * (to_seconds(bench.clock.now().time_since_epoch()) - 10.0),
                                    0.0, 1.0);  // within half a second
    const Vector3 command = run.steady_newton != 0.0 ? Vector3(share * run.steady_newton, 0.0, 0.0)
                                                     : commands.next(state.hand_position_m);
    if (random.chance(run.silences_per_tick)) silent_ticks = random.below(100);
    if (silent_ticks > 0) {
      --silent_ticks;
    } else if (run.steady_newton != 0.0 || random.chance(0.98)) {
      if (run.has_short_leases) bench.begins_within = from_seconds(random.uniform(0.0, 1e-3));
      bench.send_answer(state.header.session_id, state.header.sequence, command,
                        run.has_short_leases ? from_seconds(random.uniform(1e-5, 10e-3)) : 1h);
    }
  };
  const TimePoint end = TimePoint(from_seconds(run.seconds));
  bool is_held = true;
  bool has_stalled = false;
  while (bench.clock.now() < end) {
    if (run.has_dead_man_button && random.chance(is_held ? 0.005 : 0.02)) {
      is_held = !is_held;
      bench.device.hold(is_held);
    }
    // a person comes, finds out why, and acknowledges
    if (bench.node.has_fault() && random.chance(run.acknowledgements_per_tick)) {
      bench.node.acknowledge();
    }
    if (run.sleeps_per_tick > 0.0 && random.chance(run.sleeps_per_tick)) {
      const Duration slept = from_seconds(random.uniform() * to_seconds(run.longest_sleep));
      bench.device.sleep(slept);
      bench.node.suspended(slept);
    }
    if (run.steady_newton != 0.0) {
      // once, from a turn of the hand on
      if (!has_stalled && bench.clock.now() > TimePoint(11s) &&
          bench.device.true_state().hand_position_m.x() < -0.0195) {
        bench.clock.advance(run.longest_stall);
        has_stalled = true;
      }
    } else if (run.stalls_per_tick > 0.0 && random.chance(run.stalls_per_tick)) {
      bench.clock.advance(from_seconds(random.uniform() * to_seconds(run.longest_stall)));
    }
    bench.tick();
    // kilobytes each, and nobody reads them again
    bench.states.clear();
    bench.ticks.clear();
    ++result.ticks;
    const double newton = bench.device.motor_newton().norm();
    result.mean_force_newton += newton;
    const double true_joule = bench.device.true_state().energy_joule;
    result.most_true_joule = std::max(result.most_true_joule, true_joule);
    result.deepest_fall_joule =
        std::max(result.deepest_fall_joule, result.most_true_joule - true_joule);
    result.largest_force_newton = std::max(result.largest_force_newton, newton);
    if (newton > 1.01 * run.coulomb_newton) ++result.ticks_beyond_friction;
  }
  result.mean_force_newton /= static_cast<double>(result.ticks);
  result.least_true_joule = bench.device.true_state().minimum_energy_joule;
  result.fallback_ticks = bench.node.counters().fallback_ticks;
  result.faults = bench.node.counters().device_faults;
  return result;
}

}  // namespace

VicedResult run_with_vices(const VicedRun& run, Books books, std::uint64_t seed) {
  return books == Books::kTrue ? run_books<Books::kTrue>(run, seed)
                               : run_books<Books::kSimple>(run, seed);
}

VicedRun random_run_within_the_claim(std::uint64_t seed) {
  Random random(seed);
  VicedRun run;
  constexpr Duration kWatchdogs[] = {20ms, 100ms, 500ms, 24h};
  run.vices.watchdog = kWatchdogs[random.below(4)];
  if (random.chance(0.6)) {
    run.vices.sensing = from_seconds(random.uniform(0.0, 2e-3));
    run.vices.actuation = from_seconds(random.uniform(0.0, 2e-3));
    run.vices.has_jitter = random.chance(0.5);
  }
  if (random.chance(0.5)) run.turning_per_m = random.uniform(-21.0, 21.0);
  if (random.chance(0.5)) run.count_newton = random.uniform(1e-3, 0.1);
  run.coulomb_newton = random.chance(0.1) ? 0.0 : random.uniform(0.02, 0.26);
  run.viscous_newton_s_per_m = random.chance(0.1) ? 0.0 : random.uniform(0.02, 0.3);
  run.resolution_m = random.chance(0.2) ? 0.0 : random.uniform(5e-6, 2e-4);
  if (random.chance(0.3)) run.drops_per_message = random.uniform(1e-4, 3e-3);
  run.has_dead_man_button = random.chance(0.3);
  if (random.chance(0.5)) run.silences_per_tick = random.uniform(1e-3, 2e-2);
  run.has_short_leases = random.chance(0.5);
  return run;
}

VicedRun random_run_with_stalls(std::uint64_t seed) {
  VicedRun run = random_run_within_the_claim(seed);
  Random random(seed + 7);
  run.stalls_per_tick = random.uniform(0.001, 0.05);
  run.longest_stall = from_seconds(random.uniform(1e-3, 60e-3));
  if (random.chance(0.3)) run.failed_releases = random.uniform(0.0, 0.9);
  if (random.chance(0.3)) {
    run.sleeps_per_tick = random.uniform(1e-4, 2e-3);
    run.longest_sleep = from_seconds(random.uniform(0.01, 2.0));
  }
  return run;
}

}  // namespace palpate::test
