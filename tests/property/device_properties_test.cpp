// SPDX-License-Identifier: Apache-2.0
// Laws of the device's side over seeded random misses, stalls, leases, failures and hands.
// PALPATE_SEEDS=10 in the environment tries ten times as many seeds.
#include <gtest/gtest.h>

#include <chrono>
#include <vector>

#include "common/core/random.h"
#include "device_node/force_guard.h"
#include "device_node/simulation/simulated_device.h"
#include "tests/property/seeds.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/guarded_motors.h"
#include "tests/support/scripted_device.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using test::device_config;
using test::DeviceNodeBench;
using test::ScriptedDevice;
using test::seeds;

Duration random_duration(Random& random, Duration longest) {
  return Duration(
      static_cast<std::int64_t>(random.below(static_cast<std::uint64_t>(longest.count()) + 1)));
}

DeviceConfig random_config(Random& random) {
  DeviceConfig config = device_config();
  config.lease = 1ms + random_duration(random, 2ms);
  config.longest_lease = config.lease + random_duration(random, 10ms);
  config.limp_after = random_duration(random, 30ms);
  config.fade = 1ms + random_duration(random, 20ms);
  config.start_ramp = random.chance(0.5) ? random_duration(random, 20ms) : Duration{};
  config.slew_newton_per_s = random.chance(0.5) ? random.uniform(10, 5000) : 0.0;
  config.peak_force_newton = random.uniform(0.05, 4.0);
  config.profile.coulomb_newton = random.uniform(0.0, 0.3);
  return config;
}

TEST(ForceGuardLaws, NeverPushesHarderThanItsCommandOrItsPeakAndNeverHarderWithSilence) {
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const DeviceConfig config = random_config(random);
    test::GuardedMotors guard(config, 3.3);
    const double peak_newton = std::min(config.peak_force_newton, 3.3);
    TimePoint now = time_at(10.0);
    double allowed_newton = 0.0;
    TimePoint answered_at{};

    for (int i = 0; i < 500; ++i) {
      now += random_duration(random, random.chance(0.02) ? Duration(100ms) : Duration(1500us));
      if (random.chance(0.3)) {
        ForceCommand command;
        command.force_on_hand_newton = random.uniform(0.0, 5.0) * random.direction();
        command.valid_for = random_duration(random, 15ms);
        const GuardedForce out = guard.answered(command, now);
        allowed_newton = std::min(command.force_on_hand_newton.norm(), peak_newton);
        ASSERT_LE(out.force_on_hand_newton.norm(), allowed_newton + 1e-12);
        ASSERT_LE(out.lease, std::min(command.valid_for, config.longest_lease));
        // direction kept
        ASSERT_LT(out.force_on_hand_newton.cross(command.force_on_hand_newton).norm(), 1e-12);
        ASSERT_GE(out.force_on_hand_newton.dot(command.force_on_hand_newton), 0.0);
        allowed_newton = out.force_on_hand_newton.norm();
        answered_at = now;
      } else {
        const GuardedForce out = guard.missed(now, now + random_duration(random, 2ms));
        ASSERT_LE(out.force_on_hand_newton.norm(), allowed_newton + 1e-15);
        if (now - answered_at >= config.longest_lease) {
          ASSERT_LE(out.force_on_hand_newton.norm(), config.profile.coulomb_newton + 1e-15);
        }
        if (now - answered_at >= config.longest_lease + config.limp_after + config.fade) {
          ASSERT_EQ(out.force_on_hand_newton.norm(), 0.0);
        }
        allowed_newton = out.force_on_hand_newton.norm();
      }
    }
  }
}

// One tick may reverse the force, or let it go; it adds no more than slew · period to what acts
// along it, so a jump is at most what acts and that. Whatever is commanded. A fallback may bring
// back what friction absorbs.
TEST(ForceGuardLaws, AJumpIsAtMostWhatActsAndTheSlewOfOnePeriod) {
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    DeviceConfig config = random_config(random);
    config.slew_newton_per_s = random.uniform(10, 5000);
    ForceGuard guard(config, 3.3);
    const double most_newton = config.slew_newton_per_s / config.rate_hz;
    TimePoint now = time_at(10.0);
    Vector3 acting_newton = Vector3::Zero();
    TimePoint acting_until{};

    for (int i = 0; i < 500; ++i) {
      now += random_duration(random, random.chance(0.02) ? Duration(100ms) : Duration(1500us));
      if (now >= acting_until) acting_newton.setZero();
      ForceCommand command;
      command.force_on_hand_newton = random.uniform(0.0, 50.0) * random.direction();
      command.valid_for = random_duration(random, 15ms);
      const bool is_answered = random.chance(0.7);
      const GuardedForce out = is_answered ? guard.answered(command, now, acting_newton)
                                           : guard.missed(now, now + random_duration(random, 2ms));
      const double growth_newton =
          is_answered ? most_newton : std::max(most_newton, config.profile.coulomb_newton);
      const Vector3& force = out.force_on_hand_newton;
      if (out.is_switch) {
        const double along_newton =
            force.norm() > 0.0 ? std::max(0.0, acting_newton.dot(force.normalized())) : 0.0;
        ASSERT_LE(force.norm(), along_newton + growth_newton + 1e-12);
        ASSERT_LE((force - acting_newton).norm(), acting_newton.norm() + growth_newton + 1e-12);
        acting_newton = force;
        acting_until = now + out.lease;
      }
    }
  }
}

/// One tick under adverse conditions: late, missing and short-lived answers, a stopped process.
template <class Bench>
void random_tick(Bench& bench, Random& random) {
  bench.reply_delay = random_duration(random, 600us);
  bench.answer_with(random.uniform(0.0, 3.0) * random.direction(), random_duration(random, 15ms));
  if (random.chance(0.2)) bench.on_state = nullptr;
  if (random.chance(0.05)) bench.stall_in_wait = random_duration(random, 12ms);
  if (random.chance(0.05)) bench.clock.advance(random_duration(random, 12ms));
  bench.tick();
}

TEST(EchoLaws, TheEchoHasNoGapAndEqualsTheForceOfTheMotors) {
  for (const std::uint64_t seed : seeds(40)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    DeviceNodeBench<ScriptedDevice> bench(random_config(random));

    // preempted on the way to the switch, and before a late answer is withdrawn
    const auto stall = [&] {
      if (random.chance(0.1)) bench.clock.advance(random_duration(random, 2ms));
    };
    bench.device.before_switch = bench.device.before_release = stall;

    for (int i = 0; i < 500; ++i) {
      bench.device.fails_to_read = random.chance(0.01);
      bench.device.fails_to_apply = random.chance(0.01);
      random_tick(bench, random);
      if (bench.node.has_fault() && random.chance(0.3)) bench.node.acknowledge();
      if (random.chance(0.01)) static_cast<void>(bench.node.stop());
    }

    ASSERT_GT(bench.states.size(), 300u);
    ASSERT_GT(bench.node.counters().late_switches, 5u);
    for (std::size_t i = 1; i < bench.states.size(); ++i) {
      const DeviceState& state = bench.states[i];
      ASSERT_LE(state.applied_count, kMaxAppliedForces);
      ASSERT_EQ(bench.device.motor_force_newton(state.header.sampled_at),
                state.acting_until > state.header.sampled_at ? state.acting_force_on_hand_newton
                                                             : Vector3(Vector3::Zero()));
      // after a fault the echo begins anew
      if (state.applied_count == 0) continue;
      TimePoint reached = state.applied[0].from;
      ASSERT_LE(reached, bench.states[i - 1].header.sampled_at);
      for (std::uint32_t k = 0; k < state.applied_count; ++k) {
        const AppliedForce& segment = state.applied[k];
        ASSERT_EQ(segment.from, reached);
        ASSERT_GT(segment.until, segment.from);
        // at its first, a middle and its last instant
        for (const TimePoint t : {segment.from, segment.from + (segment.until - segment.from) / 2,
                                  segment.until - Duration(1)}) {
          ASSERT_EQ(bench.device.motor_force_newton(t), segment.force_on_hand_newton);
        }
        if (segment.has_position_at_end) {
          ASSERT_EQ(segment.hand_position_at_end_m.x(), seconds_of(segment.until));
        }
        reached = segment.until;
      }
      ASSERT_EQ(reached, state.header.sampled_at);
      if (state.applied_count > 0) {
        ASSERT_TRUE(state.applied[state.applied_count - 1].has_position_at_end);
      }
    }
  }
}

/// Lower bound of the energy absorbed, from the echo alone (docs/theory.md §2.2, and §2.5 where a
/// force ended at an unknown position). Exact encoder.
class EchoLedger {
 public:
  void take(const DeviceState& state) {
    for (std::uint32_t k = 0; k < state.applied_count; ++k) {
      const AppliedForce& segment = state.applied[k];
      if (segment.until <= known_until_) continue;  // reported again
      if (!segment.has_position_at_end) {
        first_ = segment;
        has_first_ = true;
        continue;
      }
      const Vector3 d = segment.hand_position_at_end_m - position_m_;
      const Vector3 f2 = -segment.force_on_hand_newton;
      const Vector3 f1 = has_first_ ? Vector3(-first_.force_on_hand_newton) : f2;
      const double T = to_seconds(segment.until - (has_first_ ? first_.from : segment.from));
      energy_joule_ += 0.1 * d.squaredNorm() / T + 0.1 * d.norm() + std::min(f1.dot(d), f2.dot(d)) -
                       T * (f1 - f2).squaredNorm() / (16 * 0.1);
      position_m_ = segment.hand_position_at_end_m;
      has_first_ = false;
    }
    if (state.applied_count == 0) position_m_ = state.hand_position_m;
    known_until_ = state.header.sampled_at;
  }
  [[nodiscard]] double energy_joule() const { return energy_joule_; }

 private:
  Vector3 position_m_ = Vector3::Zero();
  TimePoint known_until_ = TimePoint::min();
  AppliedForce first_;
  bool has_first_ = false;
  double energy_joule_ = 0.0;
};

TEST(EchoLaws, ALedgerKeptOnTheEchoAloneNeverExceedsTheTrueEnergy) {
  for (const std::uint64_t seed : seeds(40)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    DeviceConfig config = random_config(random);
    SimulatedDeviceConfig simulated;
    simulated.position_resolution_m = 0.0;
    HandConfig hand{.path = HostilePath{}};
    hand.damping_newton_s_per_m = random.uniform(3, 30);
    DeviceNodeBench<SimulatedDevice> bench(config, simulated, hand, seed);
    EchoLedger ledger;

    for (int i = 0; i < 500; ++i) {
      random_tick(bench, random);
      ledger.take(bench.states.back());
      ASSERT_LE(ledger.energy_joule(), bench.ticks.back().true_energy_joule + 1e-12);
    }
  }
}

TEST(DeviceLaws, WithoutRenderedForceTheHandOnlyLosesEnergy) {
  for (const std::uint64_t seed : seeds(20)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    ManualClock clock;
    HostilePath path;
    path.v_max_m_per_s = Random(seed).uniform(0.05, 2.0);
    SimulatedDevice device({}, {.path = path}, clock, seed);
    double previous_joule = 0.0;

    for (int i = 0; i < 500; ++i) {
      clock.advance(1ms);
      DeviceSample sample;
      ASSERT_TRUE(device.read(sample));
      ASSERT_GE(device.true_state().energy_joule, previous_joule);
      previous_joule = device.true_state().energy_joule;
    }
    ASSERT_GT(previous_joule, 0.0);
  }
}

// Friction absorbs |F| ≤ f_co for any motion of the hand; the fallback relies on it.
TEST(DeviceLaws, AForceUpToCoulombFrictionNeverGivesEnergy) {
  for (const std::uint64_t seed : seeds(20)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    ManualClock clock;
    SimulatedDevice device({}, {.path = HostilePath{}}, clock, seed);

    for (int i = 0; i < 500; ++i) {
      clock.advance(random_duration(random, 3ms));
      DeviceSample sample;
      ASSERT_TRUE(device.apply(0.1 * random.direction(), 3ms, sample));
    }
    ASSERT_GE(device.true_state().minimum_energy_joule, -1e-12);
  }
}

}  // namespace
}  // namespace palpate::device
