// SPDX-License-Identifier: Apache-2.0
// Each driver over its wire, before an emulator whose motors and encoders are wrong from the start:
// the check that enables a device refuses it, and what stands still in the run is noticed.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "device_node/simulation/hand.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/machine/machine.h"
#include "tests/support/wired/hostile_commands.h"
#include "tests/support/wired/wired_on_bench.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;
using device::WireFault;

class Opened final : public WiredOnBench {
 public:
  using WiredOnBench::WiredOnBench;
  [[nodiscard]] bool read(device::DeviceSample& sample) noexcept override {
    ++reads;
    if (!WiredOnBench::read(sample)) return false;
    sample.buttons = buttons;
    return true;
  }
  int reads = 0;
  std::uint32_t buttons = 0;
};

DeviceConfig checked_config() {
  DeviceConfig config = device_config();
  config.profile.position_resolution_m = 1e-4;
  config.monitor = {.is_on = true, .v_max_m_per_s = 0.5};
  config.accepts_no_motor_watchdog = true;
  config.skips_motor_check = false;
  return config;
}

HandConfig firm(const PathConfig& path) {
  return {.mass_kg = 0.1,
          .stiffness_newton_per_m = 2000.0,
          .damping_newton_s_per_m = 40.0,
          .path = path};
}

class WiredVices : public testing::TestWithParam<WiredDriver> {
 protected:
  static WiredSpec spec(const DeviceConfig& config, const HandConfig& hand, WireFault fault,
                        double from_s = 1e-4) {
    WiredSpec spec{.side = {}, .driver = GetParam(), .faults = {}};
    spec.side.device = config;
    spec.side.hand = hand;
    // its own encoders round
    spec.side.simulated.position_resolution_m = GetParam() == WiredDriver::kHaply ? 1e-4 : 0.0;
    if (fault != WireFault::kNone) {
      spec.faults = {{.kind = fault, .from_s = from_s, .length_s = 60.0}};
    }
    return spec;
  }
  /// Enabled, or why not.
  static FaultReason enabling(const HandConfig& hand, WireFault fault, double* gain = nullptr) {
    const DeviceConfig config = checked_config();
    DeviceNodeBench<Opened> bench(config, spec(config, hand, fault));
    bench.answer_with(Vector3(0, 0, 3));
    for (int i = 0; i < 100; ++i) bench.tick();
    EXPECT_EQ(bench.node.counters().max_force_newton, 0.0) << "nobody has acknowledged it";
    bench.node.acknowledge();
    EXPECT_EQ(bench.node.phase(), DevicePhase::kChecking);
    for (int i = 0; i < 20'000 && bench.node.phase() == DevicePhase::kChecking; ++i) bench.tick();
    EXPECT_LE(bench.node.counters().max_force_newton, 0.4 + 1e-9) << "f_co + 0.3 N";
    if (gain != nullptr) *gain = bench.node.counters().checked_motor_gain;
    if (bench.node.phase() == DevicePhase::kFaulted) {
      bench.tick();
      EXPECT_TRUE(bench.ticks.back().force_on_hand_newton.isZero(0.0));
      return bench.node.counters().last_fault;
    }
    EXPECT_EQ(bench.node.phase(), DevicePhase::kEnabled);
    return FaultReason::kNone;
  }
};

TEST_P(WiredVices, MotorsThatDoWhatTheyAreToldAreEnabled) {
  EXPECT_EQ(enabling(firm(HoldPath{}), WireFault::kNone), FaultReason::kNone);
  double gain = 0.0;
  EXPECT_EQ(enabling(device::nobody(), WireFault::kNone, &gain), FaultReason::kNone);
  EXPECT_NEAR(gain, 1.0, 0.25);
  EXPECT_EQ(enabling(firm(SinusoidPath{.amplitude_m = Vector3(0.008, 0, 0.008),
                                       .frequency_hz = Vector3(0.05, 0, 0.7)}),
                     WireFault::kNone),
            FaultReason::kNone);
}

TEST_P(WiredVices, AReversedSignIsRefused) {
  EXPECT_EQ(enabling(firm(HoldPath{}), WireFault::kReversed), FaultReason::kMotorsWrongWay);
  EXPECT_EQ(enabling(device::nobody(), WireFault::kReversed), FaultReason::kMotorsWrongWay);
}

TEST_P(WiredVices, MotorsTwiceAsStrongAreNamedWhereNobodyHoldsThem) {
  EXPECT_EQ(enabling(device::nobody(), WireFault::kStrong), FaultReason::kMotorsTooStrong);
}

TEST_P(WiredVices, PositionsThatStandStillAreRefused) {
  EXPECT_EQ(enabling(firm(HoldPath{}), WireFault::kStuck), FaultReason::kPositionFrozen);
}

/// The hand draws from a force that the frozen positions leave where it is.
TEST_P(WiredVices, PositionsThatStandStillInTheRunEndTheForce) {
  DeviceConfig config = checked_config();
  config.skips_motor_check = true;
  const HandConfig hand = firm(
      SinusoidPath{.amplitude_m = Vector3(0.01, 0, 0.01), .frequency_hz = Vector3(0.4, 0, 0.7)});
  WiredSpec of = spec(config, hand, WireFault::kStuck, 1.0);
  of.faults.front().length_s = 0.9;
  DeviceNodeBench<Opened> bench(config, of);
  bench.node.acknowledge();
  bench.answer_with(Vector3(0, 0, 1.0));
  while (bench.clock.now() < TimePoint(1s)) bench.tick();
  ASSERT_GT(bench.node.counters().max_force_newton, 0.5);
  for (int i = 0; i < 260; ++i) bench.tick();
  EXPECT_TRUE(bench.ticks.back().force_on_hand_newton.isZero(0.0));
  EXPECT_GT(bench.node.counters().frozen_ticks, 0U);
  EXPECT_EQ(bench.node.counters().device_faults, 0U);
  for (int i = 0; i < 500; ++i) bench.tick();
  EXPECT_TRUE(bench.ticks.back().force_on_hand_newton.isZero(0.0)) << "until a reading differs";
  while (bench.clock.now() < TimePoint(2s)) bench.tick();  // one that is elsewhere
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kPositionFrozen);
}

TEST_P(WiredVices, ThePushNeedsTheDeadManButtonAndBeginsAnewWithIt) {
  DeviceConfig config = checked_config();
  config.dead_man_button = 0;
  DeviceNodeBench<Opened> bench(config, spec(config, firm(HoldPath{}), WireFault::kNone));
  const auto pushes = [&](std::uint32_t buttons, int ticks) {
    bench.device.buttons = buttons;
    double newton = 0.0;
    for (int i = 0; i < ticks; ++i) {
      bench.tick();
      newton = std::max(newton, bench.ticks.back().force_on_hand_newton.norm());
    }
    return newton;
  };
  bench.answer_with(Vector3(0, 0, 3));
  EXPECT_EQ(pushes(0, 100), 0.0);
  bench.node.acknowledge({.phase = DevicePhase::kCalibrated, .device_faults = 0});  // at a page
  EXPECT_EQ(bench.node.counters().page_acknowledgements, 1U);
  EXPECT_EQ(pushes(0, 1000), 0.0) << "acknowledged, but nobody holds the button";
  EXPECT_GT(pushes(1, 1000), 0.3);
  EXPECT_EQ(pushes(0, 1000), 0.0) << "let go: no push, from that tick on";
  EXPECT_LE(pushes(1, 1000), 0.4 + 1e-9);
  EXPECT_EQ(bench.node.phase(), DevicePhase::kChecking) << "from the first axis again";
  static_cast<void>(pushes(1, 4000));
  EXPECT_EQ(bench.node.phase(), DevicePhase::kEnabled);
}

/// What the push gives a hand is in no account: force follows at once, and gives none.
TEST_P(WiredVices, TheAccountsBeginAsItIsEnabled) {
  const HandConfig hand = {.mass_kg = 0.15,
                           .stiffness_newton_per_m = 1000.0,
                           .damping_newton_s_per_m = 6.0,
                           .path = SinusoidPath{.amplitude_m = Vector3(0.008, 0, 0.008),
                                                .frequency_hz = Vector3(0.05, 0, 0.7)}};
  const DeviceConfig config = checked_config();
  DeviceNodeBench<Opened> bench(config, spec(config, hand, WireFault::kNone));
  HostileCommands commands(3, 3.3);
  std::optional<double> before_joule;  // as the accounts begin
  double most_unbooked_joule = 0.0;
  int states_in_check = 0;
  bench.on_state = [&](const DeviceState& state) {
    const double true_joule = bench.device.true_state().energy_joule;
    if (bench.node.phase() == DevicePhase::kChecking) ++states_in_check;
    if (bench.node.phase() == DevicePhase::kEnabled) {
      if (!before_joule) {
        EXPECT_EQ(bench.node.monitor_joule(), 0.0) << "a debt";
        before_joule = true_joule;
      }
      most_unbooked_joule =
          std::max(most_unbooked_joule, bench.node.monitor_joule() - (true_joule - *before_joule));
    }
    bench.send_answer(state.header.session_id, state.header.sequence,
                      commands.next(state.hand_position_m));
  };
  for (int i = 0; i < 100; ++i) bench.tick();
  bench.node.acknowledge();
  for (int i = 0; i < 20'000 && bench.node.phase() != DevicePhase::kEnabled; ++i) bench.tick();
  ASSERT_EQ(bench.node.phase(), DevicePhase::kEnabled);
  EXPECT_EQ(states_in_check, 0);
  double newton = 0.0;
  double least_joule = 0.0;
  for (int i = 0; i < 5000; ++i) {
    bench.tick();
    if (i < 2000) newton = std::max(newton, bench.ticks.back().force_on_hand_newton.norm());
    if (before_joule) {
      least_joule = std::min(least_joule, bench.device.true_state().energy_joule - *before_joule);
    }
  }
  // the encoder steps of the others leave so slow a hand no credit
  if (GetParam() == WiredDriver::kHaply || GetParam() == WiredDriver::kHapi) {
    EXPECT_GT(newton, 0.4) << "above f_co";
  }
  ASSERT_TRUE(before_joule);
  EXPECT_GE(least_joule, -1e-6);
  EXPECT_LE(most_unbooked_joule, 1e-6);
}

/// With hostile commands, before a hand that may draw from each.
struct Scenario {
  explicit Scenario(const WiredSpec& spec) : bench(spec.side.device, spec), commands(3, 3.3) {
    bench.on_state = [this](const DeviceState& state) {
      const device::TrueState truth = bench.device.true_state();
      most_unbooked_joule =
          std::max(most_unbooked_joule, bench.node.monitor_joule() - truth.energy_joule);
      bench.send_answer(state.header.session_id, state.header.sequence,
                        commands.next(state.hand_position_m));
    };
  }
  /// @return  the largest force of these ticks [N]
  double run_until(Duration end) {
    double newton = 0.0;
    while (bench.clock.now() < TimePoint(end)) {
      bench.tick();
      newton = std::max(newton, bench.ticks.back().force_on_hand_newton.norm());
    }
    return newton;
  }
  void expect_no_energy_was_given() const {
    EXPECT_GE(bench.device.true_state().minimum_energy_joule, -1e-6);
    EXPECT_LE(most_unbooked_joule, 1e-6);
  }

  DeviceNodeBench<WiredOnBench> bench;
  HostileCommands commands;
  double most_unbooked_joule = 0.0;
};

class WiredScenarios : public WiredVices {
 protected:
  static WiredSpec hostile(WireFault fault, double from_s, double length_s) {
    DeviceConfig config = checked_config();
    config.skips_motor_check = true;
    WiredSpec of =
        spec(config, firm(HostilePath{.radius_m = 0.012, .v_max_m_per_s = 0.25}), fault, from_s);
    of.faults.front().length_s = length_s;
    return of;
  }
};

// The last state of the grip says that its button is held.
TEST_P(WiredScenarios, AGripThatVanishesWithItsButtonHeldEndsTheForce) {
  if (GetParam() != WiredDriver::kHaply) GTEST_SKIP() << "has no grip of its own";
  for (const auto kind : {WireFault::kGripGone, WireFault::kGripOff, WireFault::kGripFrozen}) {
    SCOPED_TRACE(static_cast<int>(kind));
    WiredSpec of = hostile(kind, 2.0, 1.0);
    of.side.device.dead_man_button = 1;
    of.side.hand.presses = {{.button = 1, .from_s = 0.1, .until_s = 4.0},
                            {.button = 1, .from_s = 4.5, .until_s = 9.0}};
    Scenario run(of);
    run.bench.node.acknowledge();
    EXPECT_GT(run.run_until(2s), 0.3) << "above f_co";
    static_cast<void>(run.run_until(kind == WireFault::kGripFrozen ? 2251ms : 2001ms));
    EXPECT_EQ(run.run_until(4499ms), 0.0) << "from that tick on, until it is let go and pressed";
    EXPECT_GT(run.run_until(5500ms), 0.0);
    EXPECT_EQ(run.bench.node.counters().device_faults, 0U);
    run.expect_no_energy_was_given();
  }
}

// The board comes back with its counters at 0, and with the torque that it was last told, or none.
TEST_P(WiredScenarios, AfterAPowerCycleThereIsNoForceUntilItIsCalibratedAndAcknowledged) {
  if (GetParam() != WiredDriver::kHapi && GetParam() != WiredDriver::kWooden) {
    GTEST_SKIP() << "says itself that it has lost its calibration";
  }
  WiredSpec of = hostile(WireFault::kPowerCycle, 2.0, 0.1);
  of.limit = test::patience(50ms);  // a board that is not set up is silent
  Scenario run(of);
  run.bench.node.acknowledge();
  EXPECT_GT(run.run_until(2s), 0.3);
  static_cast<void>(run.run_until(2001ms));
  EXPECT_TRUE(run.bench.node.has_fault());
  const auto newton_of_ticks = [&] {
    double newton = 0.0;
    for (int i = 0; i < 3; ++i) {
      run.bench.clock.advance(600ms);
      run.bench.tick();
      newton = std::max(newton, run.bench.ticks.back().force_on_hand_newton.norm());
    }
    return newton;
  };
  EXPECT_EQ(newton_of_ticks(), 0.0);
  // the connection, the calibration, the force: one signal each
  run.bench.node.acknowledge();
  EXPECT_NE(run.bench.node.phase(), DevicePhase::kEnabled);
  EXPECT_EQ(newton_of_ticks(), 0.0);
  run.bench.node.acknowledge();
  EXPECT_NE(run.bench.node.phase(), DevicePhase::kEnabled);
  EXPECT_EQ(newton_of_ticks(), 0.0);
  run.bench.node.acknowledge();
  if (GetParam() == WiredDriver::kHapi) {  // the emulated person holds it at home
    EXPECT_EQ(run.bench.node.phase(), DevicePhase::kEnabled);
    EXPECT_GT(run.run_until(run.bench.clock.now().time_since_epoch() + 1s), 0.0);
  } else {  // nobody holds it at the calibration position
    EXPECT_NE(run.bench.node.phase(), DevicePhase::kEnabled);
    EXPECT_EQ(newton_of_ticks(), 0.0);
  }
  run.expect_no_energy_was_given();
}

/// Set-ups of a hAPI board, which are messages of type 1.
struct SetUpCount final : device::WireTap {
  int count = 0;
  void transferred(TimePoint /*at*/, bool is_sent,
                   std::span<const std::byte> bytes) noexcept override {
    if (is_sent && !bytes.empty() && bytes.front() == std::byte{1}) ++count;
  }
};

// The set-up makes the place where the handle is its home: nobody holds it there yet.
TEST_P(WiredScenarios, TheSignalThatResetsAFaultDoesNotCalibrate) {
  if (GetParam() != WiredDriver::kHapi) GTEST_SKIP() << "has no set-up that moves its origin";
  for (const auto kind : {WireFault::kPowerCycle, WireFault::kSilent}) {
    SCOPED_TRACE(static_cast<int>(kind));
    WiredSpec of = hostile(kind, 2.0, 0.1);
    of.faults.push_back({.kind = WireFault::kSetUpAnywhere, .from_s = 2.0, .length_s = 60.0});
    of.limit = test::patience(50ms);
    Scenario run(of);
    SetUpCount set_ups;
    run.bench.device.tap(&set_ups);
    const auto acknowledge = [&] {
      run.bench.node.acknowledge();
      run.bench.clock.advance(600ms);
      run.bench.tick();
      return run.bench.node.phase();
    };
    run.bench.node.acknowledge();
    EXPECT_GT(run.run_until(2s), 0.3);
    static_cast<void>(run.run_until(2001ms));
    ASSERT_TRUE(run.bench.node.has_fault());
    run.bench.clock.advance(600ms);
    run.bench.tick();
    EXPECT_EQ(acknowledge(), DevicePhase::kConnected) << "whose prompt names the home position";
    EXPECT_EQ(set_ups.count, 0);
    EXPECT_EQ(acknowledge(), DevicePhase::kCalibrated);
    EXPECT_EQ(set_ups.count, 1);
    EXPECT_EQ(acknowledge(), DevicePhase::kEnabled);
    EXPECT_EQ(set_ups.count, 1);
    run.bench.device.tap(nullptr);
  }
}

TEST_P(WiredScenarios, ADeviceThatCanLoseItsCalibrationSaysWhatAPersonDoes) {
  EXPECT_NE(DeviceNodeBench<WiredOnBench>(checked_config(), hostile(WireFault::kStuck, 60.0, 1.0))
                .device.specification()
                .calibration,
            "");
}

// Beyond the claim: what the motors drew until the release was confirmed is a debt.
TEST_P(WiredScenarios, AReleaseThatFailsIsSaidAndBooked) {
  WiredSpec of = hostile(WireFault::kSilent, 2.0, 0.5);
  of.faults.push_back({.kind = WireFault::kNoWatchdog, .from_s = 1e-4, .length_s = 60.0});
  of.limit = test::patience(50ms);
  Scenario run(of);
  run.bench.node.acknowledge();
  EXPECT_GT(run.run_until(2s), 0.3);
  static_cast<void>(run.run_until(2005ms));
  EXPECT_TRUE(run.bench.node.counters().is_release_unconfirmed);
  run.bench.node.acknowledge();
  if (GetParam() == WiredDriver::kHapi) {
    EXPECT_EQ(run.bench.node.phase(), DevicePhase::kConnected) << "without a set-up it is silent";
  } else {
    EXPECT_EQ(run.bench.node.phase(), DevicePhase::kFaulted) << "no reset before it is confirmed";
  }
  run.bench.clock.advance(600ms);
  static_cast<void>(run.run_until(2700ms));
  EXPECT_FALSE(run.bench.node.counters().is_release_unconfirmed);
  EXPECT_LE(run.most_unbooked_joule, 1e-6);
}

std::string name_of(const testing::TestParamInfo<WiredDriver>& info) {
  constexpr const char* kNames[] = {"Haply", "Hapi", "Falcon", "Wooden"};
  return kNames[static_cast<int>(info.param)];
}
INSTANTIATE_TEST_SUITE_P(Each, WiredVices,
                         testing::Values(WiredDriver::kHaply, WiredDriver::kHapi,
                                         WiredDriver::kFalcon, WiredDriver::kWooden),
                         name_of);

INSTANTIATE_TEST_SUITE_P(Each, WiredScenarios,
                         testing::Values(WiredDriver::kHaply, WiredDriver::kHapi,
                                         WiredDriver::kFalcon, WiredDriver::kWooden),
                         name_of);

}  // namespace
}  // namespace palpate::test
