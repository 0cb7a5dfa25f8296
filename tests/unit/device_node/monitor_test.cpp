// The monitor of the energy on its own, and in the tick. Friction 0.1 N·s/m and 0.1 N, exact
// encoder, v_max 0.5 m/s: D(F) = (F − 0.15 N) 0.5 m/s for F ≥ 0.2 N.
#include <gtest/gtest.h>

#include <chrono>

#include "common/core/check.h"
#include "device_node/hands_off_check.h"
#include "device_node/monitor/assumption_watch.h"
#include "device_node/monitor/force_monitor.h"
#include "device_node/simulation/simulated_device.h"
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

/// After 10 mm of free motion at 0.1 m/s: 0.1 N · 10 mm + 0.1 N·s/m · 0.1 m/s · 10 mm = 1.1 mJ.
class MonitorWith1100MicroJoule : public testing::Test {
 protected:
  MonitorWith1100MicroJoule() { move(100); }
  /// @param ticks  1 ms each, +x
  void move(int ticks) {
    for (int i = 0; i <= ticks; ++i) {
      if (i > 0) {
        now_ += 1ms;
        hand_m_.x() += 1e-4;
      }
      monitor_.read(now_, hand_m_);
    }
  }
  ForceMonitor monitor_{monitored_config()};
  TimePoint now_{};
  Vector3 hand_m_ = Vector3::Zero();
};

TEST_F(MonitorWith1100MicroJoule, PassesWhatTheEnergyCoversUnchanged) {
  EXPECT_NEAR(monitor_.joule(), 1.1e-3, 1e-12);
  // 1 N: 0.425 W, 2.58 ms
  const auto covered = monitor_.cover({0, 1, 0}, 2500us);
  EXPECT_FALSE(covered.is_reduced);
  EXPECT_EQ(covered.force_on_hand_newton, Vector3(0, 1, 0));
  EXPECT_EQ(covered.lease, 2500us);
}

TEST_F(MonitorWith1100MicroJoule, ShortensALeaseThatIsTooLong) {
  const auto covered = monitor_.cover({0, 1, 0}, 10ms);
  EXPECT_TRUE(covered.is_reduced);
  EXPECT_EQ(covered.force_on_hand_newton, Vector3(0, 1, 0));
  EXPECT_NEAR(to_seconds(covered.lease), 1.1e-3 / 0.425, 1e-8);
}

// 1.1 mJ over the 2 ms of every command: 0.55 W, 1.25 N.
TEST_F(MonitorWith1100MicroJoule, ReducesAForceThatIsTooLarge) {
  const auto covered = monitor_.cover({0, 0, -20}, 10ms);
  EXPECT_TRUE(covered.is_reduced);
  EXPECT_EQ(covered.lease, 2ms);
  EXPECT_NEAR((covered.force_on_hand_newton - Vector3(0, 0, -1.25)).norm(), 0.0, 1e-9);
}

TEST_F(MonitorWith1100MicroJoule, PaysNothingTwiceInATick) {
  EXPECT_FALSE(monitor_.cover({0, 1, 0}, 2500us).is_reduced);
  const auto again = monitor_.cover({0, 1, 0}, 2500us);
  EXPECT_TRUE(again.is_reduced);
  EXPECT_LT(again.force_on_hand_newton.norm(), 0.4);
}

// 1 N may act for 0.5 ms more, until the answer's deadline: 0.2125 mJ.
TEST_F(MonitorWith1100MicroJoule, ReservesWhatTheActingForceMayStillDraw) {
  monitor_.switched(now_, hand_m_, {0, 1, 0}, 2ms);
  move(0);
  const auto covered = monitor_.cover({0, 0, -20}, 2ms);
  EXPECT_NEAR(covered.force_on_hand_newton.norm(), 0.15 + (1.1e-3 - 0.2125e-3) / 2e-3 / 0.5, 1e-9);
}

TEST_F(MonitorWith1100MicroJoule, ForgetsItsCreditButNoDebtWhenItDoesNotKnowWhatHappened) {
  monitor_.lost();
  move(0);
  EXPECT_EQ(monitor_.joule(), 0.0);

  // 1 N along 10 mm draws 10 mJ, less friction
  monitor_.switched(now_, hand_m_, {1, 0, 0}, 1h);
  move(100);
  const double debt = monitor_.joule();
  EXPECT_LT(debt, -8e-3);
  monitor_.lost();
  move(0);
  EXPECT_NEAR(monitor_.joule(), debt, 1e-15);
}

TEST_F(MonitorWith1100MicroJoule, CountsFromWhereTheClampDoes) {
  monitor_.count_since(now_ - 50ms);
  EXPECT_NEAR(monitor_.joule(), 0.55e-3, 1e-12);
  // once for each claim
  move(10);
  monitor_.count_since(now_ - 60ms);
  EXPECT_NEAR(monitor_.joule(), 0.66e-3, 1e-12);
}

// A clamp that hears nothing for 0.3 s counts from a reading that is older still.
TEST_F(MonitorWith1100MicroJoule, CountsFromALongPastReading) {
  move(400);
  monitor_.count_since(now_ - 450ms);
  EXPECT_NEAR(monitor_.joule(), 4.95e-3, 1e-11);
}

TEST_F(MonitorWith1100MicroJoule, KeepsItsCountThroughAForceThatNeedsCredit) {
  monitor_.switched(now_, hand_m_, {1, 0, 0}, 1h);
  move(100);
  const double debt = monitor_.joule();
  monitor_.count_since(now_ - 150ms);
  EXPECT_EQ(monitor_.joule(), debt);
  monitor_.count_since(now_ - 50ms);
  EXPECT_EQ(monitor_.joule(), debt);
}

TEST(Monitor, LetsTheFrictionsOwnForcePassWithoutCredit) {
  ForceMonitor monitor{monitored_config()};
  monitor.read(TimePoint(1ms), Vector3::Zero());
  EXPECT_FALSE(monitor.cover({0.1, 0, 0}, 1h).is_reduced);
  EXPECT_TRUE(monitor.cover({0.11, 0, 0}, 1h).is_reduced);
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

TEST(MonitoredTick, DoesNotAllocate) {
  DeviceNodeBench<SimulatedDevice> bench(monitored_config(), SimulatedDeviceConfig{},
                                         HandConfig{.path = HostilePath{}}, 1);
  bench.answer_with(Vector3(3, 0, 0));

  EXPECT_EQ(bench.allocations_of_ticks(), 0u);
  EXPECT_GT(bench.node.counters().monitor_reductions, 100u);
}

static_assert(noexcept(std::declval<ForceMonitor&>().read(std::declval<TimePoint>(),
                                                          std::declval<const Vector3&>())));
static_assert(noexcept(std::declval<ForceMonitor&>().cover(std::declval<const Vector3&>(),
                                                           Duration{})));
static_assert(noexcept(std::declval<ForceMonitor&>().count_since(std::declval<TimePoint>())));

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
  EXPECT_FALSE(checked({}).is_lowered);
  EXPECT_EQ(checked({}).profile.coulomb_newton, 0.1);
  // and does not raise one that claims less
  const CheckedProfile modest = checked({.viscous_newton_s_per_m = 0.05, .coulomb_newton = 0.02});
  EXPECT_FALSE(modest.is_lowered);
  EXPECT_EQ(modest.profile.viscous_newton_s_per_m, 0.05);
  EXPECT_EQ(modest.profile.coulomb_newton, 0.02);
}

TEST(HandsOffCheck, BelievesTheTrueProfileOfAnyDeviceUpToAHundredGrams) {
  for (const double mass_kg : {0.02, 0.1}) {
    for (const double q_m : {0.0, 110e-6}) {
      for (const double f_d : {0.03, 0.3}) {
        for (const double f_co : {0.03, 0.3}) {
          SCOPED_TRACE(testing::Message()
                       << mass_kg << " kg, " << q_m << " m, " << f_d << ", " << f_co);
          EXPECT_FALSE(checked({.viscous_newton_s_per_m = f_d,
                                .coulomb_newton = f_co,
                                .position_resolution_m = q_m},
                               {.mass_kg = mass_kg,
                                .viscous_newton_s_per_m = f_d,
                                .coulomb_newton = f_co,
                                .position_resolution_m = q_m})
                           .is_lowered);
        }
      }
    }
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
