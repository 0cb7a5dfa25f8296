// SPDX-License-Identifier: Apache-2.0
// The monitor of the energy in the tick, the assumptions that are watched, and the check of the
// friction. Friction 0.1 N·s/m and 0.1 N, exact encoder, v_max 0.5 m/s: D(F) = (F − 0.15 N) 0.5 m/s
// for F ≥ 0.2 N.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <limits>

#include "common/core/check.h"
#include "device_node/identification/hands_off_check.h"
#include "device_node/monitor/assumption_watch.h"
#include "device_node/monitor/force_monitor.h"
#include "device_node/simulation/simulated_device.h"
#include "tests/property/seeds.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/scripted_device.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using test::DeviceNodeBench;
using test::ScriptedDevice;

DeviceConfig monitored_config() {
  DeviceConfig config = test::device_config();
  config.monitor.is_on = true;
  config.profile.position_resolution_m = 0.0;
  config.longest_lease = 10ms;
  config.start_ramp = {};
  return config;
}

// --- in the tick ----------------------------------------------------------------------------

TEST(MonitoredTick, ACommandWithoutEnergyIsReducedAndCounted) {
  DeviceNodeBench<ScriptedDevice> bench(monitored_config());
  bench.device.position_m = Vector3::Zero();
  bench.answer_with(Vector3(3, 0, 0));
  for (int i = 0; i < 5; ++i) bench.tick();

  const DeviceCounters counters = bench.node.counters();
  EXPECT_FALSE(counters.is_monitor_off);
  EXPECT_EQ(counters.monitor_reductions, 5u);
  EXPECT_TRUE(bench.ticks.back().is_monitor_reduced);
  EXPECT_EQ(bench.ticks.back().guard, GuardState::kAnswered);
  EXPECT_NEAR(bench.ticks.back().force_on_hand_newton.norm(), 0.1, 1e-3);
  // and reported to the clamp as it acted
  EXPECT_NEAR(bench.states.back().acting_force_on_hand_newton.norm(), 0.1, 1e-3);
}

/// As it is told to the clamp, after 1 mm in 1 ms against 0.1 N·s/m and 0.1 N.
double told_joule(const DeviceConfig& config) {
  DeviceNodeBench<ScriptedDevice> bench(config);
  bench.answer_with(Vector3::Zero());
  bench.device.position_m = Vector3::Zero();
  bench.tick();
  bench.device.position_m = Vector3(1e-3, 0, 0);
  bench.tick();
  return bench.states.back().monitor_energy_joule;
}

TEST(MonitoredTick, AStateSaysWhatTheMonitorCounts) {
  DeviceConfig config = monitored_config();
  EXPECT_NEAR(told_joule(config), 0.2e-3, 1e-12);
  config.monitor.is_on = false;
  EXPECT_EQ(told_joule(config), std::numeric_limits<double>::infinity());
}

TEST(MonitoredTick, WithoutTheMonitorTheSameCommandPasses) {
  DeviceConfig config = monitored_config();
  config.monitor.is_on = false;
  DeviceNodeBench<ScriptedDevice> bench(config);
  bench.answer_with(Vector3(3, 0, 0));
  for (int i = 0; i < 5; ++i) bench.tick();

  EXPECT_TRUE(bench.node.counters().is_monitor_off);
  EXPECT_EQ(bench.node.counters().monitor_reductions, 0u);
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton, Vector3(3, 0, 0));
}

// The reduced lease, not the commanded one, decides when the fallback begins.
TEST(MonitoredTick, AShorterLeaseEndsWhenItSays) {
  DeviceNodeBench<ScriptedDevice> bench(monitored_config());
  bench.answer_with(Vector3::Zero());
  for (int i = 0; i < 100; ++i) {
    bench.device.position_m = Vector3(1e-4 * (i + 1), 0, 0);
    bench.tick();
  }
  bench.answer_with(Vector3(0, 1, 0));  // covered for 2.6 ms of the 10 ms
  bench.tick();
  EXPECT_EQ(bench.node.counters().monitor_reductions, 1u);
  bench.on_state = nullptr;
  bench.tick();
  EXPECT_EQ(bench.ticks.back().guard, GuardState::kLeased);
  bench.tick();
  EXPECT_EQ(bench.ticks.back().guard, GuardState::kFallback);
}

// 1.1 mJ pay for 0.3 N, 0.075 W, for 10 ms; after a fault nothing does.
TEST(MonitoredTick, AFaultTakesTheCredit) {
  for (const bool has_fault : {false, true}) {
    DeviceNodeBench<ScriptedDevice> bench(monitored_config());
    bench.answer_with(Vector3::Zero());
    for (int i = 0; i < 100; ++i) {
      bench.device.position_m = Vector3(1e-4 * (i + 1), 0, 0);
      bench.tick();
    }
    bench.device.fails_to_read = has_fault;
    bench.tick();
    bench.device.fails_to_read = false;
    bench.node.acknowledge();
    bench.answer_with(Vector3(0, 0.3, 0));
    bench.tick();
    EXPECT_EQ(bench.node.counters().monitor_reductions, has_fault ? 1u : 0u);
  }
}

// 1.1 mJ, of which the hand draws 19 mW along a force of 0.3 N.
TEST(MonitoredTick, AForceThatActedIsBooked) {
  DeviceNodeBench<ScriptedDevice> bench(monitored_config());
  bench.answer_with(Vector3::Zero());
  const auto move = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      bench.device.position_m =
          bench.device.position_m.value_or(Vector3::Zero()) + Vector3(1e-4, 0, 0);
      bench.tick();
    }
  };
  move(100);
  bench.answer_with(Vector3(0.3, 0, 0), 3ms);
  move(10);
  EXPECT_EQ(bench.node.counters().monitor_reductions, 0u);
  EXPECT_EQ(bench.states.back().acting_force_on_hand_newton, Vector3(0.3, 0, 0));
  move(90);
  EXPECT_GT(bench.node.counters().monitor_reductions, 10u);
}

// The scripted hand moves at 1 m/s, v_max is 0.5 m/s.
TEST(MonitoredTick, CountsTheReadingsOfATooFastHand) {
  DeviceNodeBench<ScriptedDevice> bench(monitored_config());
  bench.answer_with(Vector3::Zero());
  for (int i = 0; i < 5; ++i) bench.tick();
  EXPECT_EQ(bench.node.counters().too_fast_readings, 4u);
}

TEST(MonitoredTick, DoesNotAllocate) {
  DeviceNodeBench<SimulatedDevice> bench(monitored_config(), SimulatedDeviceConfig{},
                                         HandConfig{.path = HostilePath{}}, 1);
  bench.answer_with(Vector3(3, 0, 0));

  EXPECT_EQ(bench.allocations_of_ticks(), 0u);
  EXPECT_GT(bench.node.counters().monitor_reductions, 100u);
}

static_assert(noexcept(std::declval<ForceMonitor&>().read(std::declval<TimePoint>(),
                                                          std::declval<const Vector3&>(),
                                                          std::declval<const ReadingDetails&>())));
static_assert(noexcept(std::declval<ForceMonitor&>().cover(std::declval<const Vector3&>(),
                                                           Duration{})));

TEST(Unmonitored, ARealDeviceIsRefusedUnlessUnsafeIsGiven) {
  DeviceConfig config = monitored_config();
  DeviceSpecification real{.model_name = "arm"};
  DeviceSpecification simulated{.model_name = "simulated", .is_simulated = true};
  EXPECT_NO_THROW(refuse_unmonitored(config, real, false));
  config.monitor.is_on = false;
  EXPECT_NO_THROW(refuse_unmonitored(config, simulated, false));
  EXPECT_NO_THROW(refuse_unmonitored(config, real, true));
  EXPECT_THROW(refuse_unmonitored(config, real, false), SetupError);
}

// A force up to f_co needs no acceptance and no check: it must be what friction can absorb.
TEST(UnlikelyFriction, OfMoreThanAQuarterOfThePeakForceIsRefused) {
  DeviceConfig config = monitored_config();
  const DeviceSpecification arm{.model_name = "arm", .peak_force_newton = 4.0};
  const DeviceSpecification simulated{
      .model_name = "simulated", .peak_force_newton = 4.0, .is_simulated = true};
  config.profile.coulomb_newton = 1.0;
  EXPECT_NO_THROW(refuse_unlikely_friction(config, arm));
  config.profile.coulomb_newton = 1.01;
  EXPECT_NO_THROW(refuse_unlikely_friction(config, simulated));
  EXPECT_THAT([&] { refuse_unlikely_friction(config, arm); },
              testing::ThrowsMessage<SetupError>(
                  testing::AllOf(testing::HasSubstr("device.profile.coulomb_newton: 1.01 N"),
                                 testing::HasSubstr("palpate identify"))));
}

TEST(UnlikelyFriction, OfAJointIsJudgedByItsWeakestMotor) {
  DeviceConfig config = monitored_config();
  config.profile.coulomb_newton = 0.1;
  const DeviceSpecification arm{
      .model_name = "arm", .peak_force_newton = 4.0, .peak_torque_newton_m = {0.1, 0.04, 0.2}};
  config.wrist = {.coulomb_newton_m = 0.01};
  EXPECT_NO_THROW(refuse_unlikely_friction(config, arm));
  config.wrist->coulomb_newton_m = 0.0101;
  EXPECT_THAT([&] { refuse_unlikely_friction(config, arm); },
              testing::ThrowsMessage<SetupError>(
                  testing::HasSubstr("device.wrist.coulomb_newton_m: 0.0101 N·m")));
}

TEST(FinerResolution, ThanTheStepsOfTheEncodersIsRefused) {
  DeviceConfig config = monitored_config();
  DeviceSpecification arm{.model_name = "arm", .position_resolution_m = 113.7e-6};
  config.profile.position_resolution_m = 113.7e-6;
  EXPECT_NO_THROW(refuse_finer_resolution(config, arm));
  config.profile.position_resolution_m = 110e-6;
  EXPECT_THAT([&] { refuse_finer_resolution(config, arm); },
              testing::ThrowsMessage<SetupError>(testing::AllOf(
                  testing::HasSubstr("device.profile.position_resolution_m: 110 µm"),
                  testing::HasSubstr("up to 113.7 µm"), testing::HasSubstr("give 114e-6"))));
  arm.is_simulated = true;
  EXPECT_NO_THROW(refuse_finer_resolution(config, arm));
}

TEST(DeadMan, AButtonThatTheDeviceDoesNotHaveIsRefused) {
  DeviceConfig config = monitored_config();
  const DeviceSpecification device{.model_name = "arm", .button_count = 2};
  EXPECT_NO_THROW(refuse_missing_button(config, device));
  config.dead_man_button = 1;
  EXPECT_NO_THROW(refuse_missing_button(config, device));
  config.dead_man_button = 2;
  EXPECT_THROW(refuse_missing_button(config, device), SetupError);
}

// --- assumptions ----------------------------------------------------------------------------

TEST(AssumptionWatch, CountsReadingsThatOnlyATooFastHandCanHaveMade) {
  DeviceConfig config;
  config.profile.position_resolution_m = 1e-4;
  AssumptionWatch watch(config);
  const double step_m = 0.5 * 1e-3 + std::sqrt(3.0) * 1e-4;  // v_max for 1 ms, and the encoder
  watch.moved({0.999 * step_m, 0, 0}, 1ms);
  EXPECT_EQ(watch.too_fast_readings(), 0u);
  watch.moved({1.001 * step_m, 0, 0}, 1ms);
  EXPECT_EQ(watch.too_fast_readings(), 1u);
}

TEST(AssumptionWatch, AHandAtVMaxIsNotTooFast) {
  DeviceConfig config;
  config.profile.position_resolution_m = 0.0;
  AssumptionWatch watch(config);
  watch.moved({config.monitor.v_max_m_per_s * to_seconds(1ms), 0, 0}, 1ms);
  EXPECT_EQ(watch.too_fast_readings(), 0u);
}

/// After `count` changes of each of these lengths in turn; the profile says 1 µm.
std::uint64_t coarse_after(int count, std::initializer_list<double> changes_m) {
  DeviceConfig config;
  config.profile.position_resolution_m = 1e-6;
  AssumptionWatch watch(config);
  for (int i = 0; i < count; ++i) {
    for (const double change_m : changes_m) watch.moved({0, change_m, 0}, 1ms);
  }
  return watch.coarse_readings();
}

TEST(AssumptionWatch, CountsTheSmallestChangeOnceItHasOccurred100Times) {
  EXPECT_EQ(coarse_after(100, {1e-4}), 0u);
  EXPECT_EQ(coarse_after(101, {1e-4}), 1u);
  EXPECT_EQ(coarse_after(150, {1.5e-4, 1e-4}), 50u);
  // changes within 1e-6 of each other are the same
  EXPECT_EQ(coarse_after(100, {1e-4, (1.0 - 0.8e-6) * 1e-4}), 100u);
  EXPECT_EQ(coarse_after(100, {1e-4, (1.0 + 0.8e-6) * 1e-4}), 100u);
  EXPECT_EQ(coarse_after(100, {1e-4, (1.0 + 1.2e-6) * 1e-4}), 0u);
  EXPECT_EQ(coarse_after(60, {1e-4, (1.0 - 1.2e-6) * 1e-4}), 0u);
}

/// Readings of a slow sinusoid of 10 mm by an encoder of this step.
std::uint64_t coarse_readings(double profile_m, double encoder_m) {
  DeviceConfig config;
  config.profile.position_resolution_m = profile_m;
  AssumptionWatch watch(config);
  double before = 0.0;
  for (int i = 1; i <= 20'000; ++i) {
    const double x = 0.01 * std::sin(1e-3 * i);
    const double reading = encoder_m > 0.0 ? encoder_m * std::round(x / encoder_m) : x;
    watch.moved({reading - before, 0, 0}, 1ms);
    before = reading;
  }
  return watch.coarse_readings();
}

TEST(AssumptionWatch, CountsStepsOfAnEncoderCoarserThanTheProfile) {
  EXPECT_GT(coarse_readings(55e-6, 110e-6), 100u);
  EXPECT_GT(coarse_readings(0.0, 55e-6), 100u);
  EXPECT_EQ(coarse_readings(55e-6, 55e-6), 0u);
  EXPECT_EQ(coarse_readings(55e-6, 20e-6), 0u);
  EXPECT_EQ(coarse_readings(55e-6, 0.0), 0u);
  EXPECT_EQ(coarse_readings(0.0, 0.0), 0u);
}

/// Checked against a simulated device of 0.1 N·s/m and 0.1 N that nobody holds.
CheckedProfile checked(const DeviceProfile& profile, const SimulatedDeviceConfig& simulated = {}) {
  ManualClock clock;
  SimulatedDevice device(simulated, nobody(), clock, 1);
  return check_hands_off(device, clock, profile);
}

TEST(HandsOffCheck, LeavesAProfileThatHolds) {
  const CheckedProfile same = checked({});
  EXPECT_FALSE(same.is_lowered);
  EXPECT_EQ(same.profile.coulomb_newton, 0.1);
  // and does not raise one that claims less
  const CheckedProfile modest = checked({.viscous_newton_s_per_m = 0.05, .coulomb_newton = 0.02});
  EXPECT_FALSE(modest.is_lowered);
  EXPECT_EQ(modest.profile.viscous_newton_s_per_m, 0.05);
  EXPECT_EQ(modest.profile.coulomb_newton, 0.02);
}

TEST(HandsOffCheck, BelievesTheTrueProfileOfAnyDeviceUpToAHundredGrams) {
  // each of four quantities small or large
  for (std::uint64_t corner = 0; corner < 16; corner += test::kIsSanitized ? 9 : 1) {
    const double mass_kg = (corner & 1) != 0 ? 0.1 : 0.02;
    const double q_m = (corner & 2) != 0 ? 110e-6 : 0.0;
    const double f_d = (corner & 4) != 0 ? 0.3 : 0.03;
    const double f_co = (corner & 8) != 0 ? 0.3 : 0.03;
    SCOPED_TRACE(testing::Message() << mass_kg << " kg, " << q_m << " m, " << f_d << ", " << f_co);
    EXPECT_FALSE(
        checked(
            {.viscous_newton_s_per_m = f_d, .coulomb_newton = f_co, .position_resolution_m = q_m},
            {.mass_kg = mass_kg,
             .viscous_newton_s_per_m = f_d,
             .coulomb_newton = f_co,
             .position_resolution_m = q_m})
            .is_lowered);
  }
}

TEST(HandsOffCheck, LowersWhatTheDeviceContradictsToALowerBound) {
  const CheckedProfile both = checked({.viscous_newton_s_per_m = 0.2, .coulomb_newton = 0.5});
  EXPECT_LE(both.profile.viscous_newton_s_per_m, 0.1);
  EXPECT_GT(both.profile.viscous_newton_s_per_m, 0.05);
  EXPECT_LE(both.profile.coulomb_newton, 0.1);
  EXPECT_GT(both.profile.coulomb_newton, 0.08);
  EXPECT_NEAR(both.ratio, 0.105 / 0.51, 0.01);

  const CheckedProfile axes =
      checked({.coulomb_newton = 0.05,
               .per_axis = FrictionPerAxis{.viscous_newton_s_per_m = {0.05, 0.05, 0.05},
                                           .coulomb_newton = {0.05, 0.3, 0.05}}});
  EXPECT_EQ(axes.profile.per_axis->coulomb_newton.x(), 0.05);
  EXPECT_LE(axes.profile.per_axis->coulomb_newton.y(), 0.1);
  EXPECT_LT(axes.ratio, 0.4);
}

}  // namespace
}  // namespace palpate::device
