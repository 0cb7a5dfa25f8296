// SPDX-License-Identifier: Apache-2.0
// The joints of a wrist on the device's side: kinematics, plant, echo.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "device_node/applied_forces.h"
#include "device_node/simulation/simulated_device.h"
#include "device_node/simulation/wrist_kinematics.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

// The same small turn, by the axes and by the orientation.
TEST(WristKinematics, TheAxesAreWhatTheJointsTurnTheToolAbout) {
  const Vector3 angle_rad(0.3, -0.7, 1.1);
  const Matrix3 axes = axes_of_wrist(angle_rad);
  constexpr double kTurn_rad = 1e-6;
  for (int joint = 0; joint < 3; ++joint) {
    Vector3 turned_rad = angle_rad;
    turned_rad[joint] += kTurn_rad;
    const Quaternion turn =
        orientation_of_wrist(turned_rad) * orientation_of_wrist(angle_rad).conjugate();
    EXPECT_NEAR((2.0 * turn.vec() / kTurn_rad - axes.col(joint)).norm(), 0.0, 1e-6) << joint;
  }
}

/// 1e-4 kg m² on each joint, no friction, exact encoders, held by nobody.
SimulatedDeviceConfig turning(double coulomb_newton_m = 0.0) {
  SimulatedDeviceConfig device;
  device.wrist = {.inertia_kg_m2 = 1e-4,
                  .viscous_newton_m_s_per_rad = 0.0,
                  .coulomb_newton_m = coulomb_newton_m,
                  .angle_resolution_rad = 0.0,
                  .peak_torque_newton_m = 0.05};
  return device;
}

struct TurningBench {
  explicit TurningBench(const SimulatedDeviceConfig& config) : device(config, nobody(), clock, 1) {}

  DeviceSample apply(const Vector3& torque_newton_m, Duration lease) {
    DeviceSample at_switch;
    device.set_wrist_torque(torque_newton_m);
    EXPECT_TRUE(device.apply(Vector3::Zero(), lease, at_switch));
    return at_switch;
  }
  WristState read_after(Duration d) {
    clock.advance(d);
    DeviceSample sample;
    EXPECT_TRUE(device.read(sample));
    return *sample.wrist;
  }

  ManualClock clock;
  SimulatedDevice device;
};

// 0.01 N·m on 1e-4 kg m² for 5 ms: ω = 0.5 rad/s, θ = ω t/2.
TEST(SimulatedWrist, TurnsAsItsInertiaSays) {
  TurningBench bench(turning());
  bench.apply({0.0, 0.01, 0.0}, 20ms);
  const WristState wrist = bench.read_after(5ms);
  EXPECT_NEAR(wrist.pose.angle_rad.y(), 0.5 * 0.5 * 0.005, 1e-12);
  EXPECT_EQ(wrist.pose.angle_rad.x(), 0.0);
  EXPECT_NEAR(bench.device.true_state().wrist->velocity_rad_per_s.y(), 0.5, 1e-12);
  // the motors' work is what the hand has not paid
  EXPECT_NEAR(bench.device.true_state().energy_joule, -0.01 * 0.00125, 1e-12);
  EXPECT_NEAR(bench.device.true_state().minimum_energy_joule, -0.01 * 0.00125, 1e-12);
}

TEST(SimulatedWrist, TheWatchdogEndsTheTorqueWithItsLease) {
  TurningBench bench(turning());
  bench.apply({0.01, 0.0, 0.0}, 2ms);
  const WristState wrist = bench.read_after(10ms);
  EXPECT_EQ(wrist.acting_torque_newton_m, Vector3(0, 0, 0));
  EXPECT_NEAR(bench.device.true_state().wrist->velocity_rad_per_s.x(), 100.0 * 0.002, 1e-12);
}

TEST(SimulatedWrist, FrictionHoldsWhatIsBelowIt) {
  TurningBench bench(turning(0.005));
  bench.apply({0.0049, -0.0049, 0.006}, 20ms);
  const WristState wrist = bench.read_after(5ms);
  EXPECT_EQ(wrist.pose.angle_rad.x(), 0.0);
  EXPECT_EQ(wrist.pose.angle_rad.y(), 0.0);
  EXPECT_GT(wrist.pose.angle_rad.z(), 0.0);
}

TEST(SimulatedWrist, LimitsEachJointAndForgetsATorqueThatIsNotGivenAgain) {
  TurningBench bench(turning());
  const DeviceSample limited = bench.apply({0.2, -0.2, 0.01}, 2ms);
  EXPECT_EQ(limited.wrist->acting_torque_newton_m, Vector3(0.05, -0.05, 0.01));
  DeviceSample at_switch;
  ASSERT_TRUE(bench.device.apply(Vector3::Zero(), 2ms, at_switch));
  EXPECT_EQ(at_switch.wrist->acting_torque_newton_m, Vector3(0, 0, 0));
  bench.device.set_wrist_torque(Vector3::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(bench.device.apply(Vector3::Zero(), 2ms, at_switch));
}

// --- the echo -----------------------------------------------------------------------------------

// A torque acts for 2 ms from 1 ms on, without a force; the reading is at 5 ms.
TEST(AppliedForcesOfAWrist, ATorqueAloneIsReportedUntilItsLeaseEnds) {
  const auto at_ms = [](int ms) { return TimePoint(std::chrono::milliseconds(ms)); };
  AppliedForces applied;
  applied.begin(at_ms(0));
  WristState wrist;
  wrist.pose.angle_rad = {0.1, 0.2, 0.3};
  wrist.acting_torque_newton_m = {0.0, 0.01, 0.0};
  applied.switched(at_ms(1), Vector3::Zero(), Vector3::Zero(), 2ms, wrist);
  EXPECT_EQ(applied.lease_end(), at_ms(3));
  EXPECT_EQ(applied.acting_newton_m(at_ms(2)), Vector3(0.0, 0.01, 0.0));
  EXPECT_TRUE(applied.has_run_out(at_ms(5)));
  wrist.pose.angle_rad = {0.1, 0.25, 0.3};
  applied.read(at_ms(5), Vector3::Zero(), wrist);

  DeviceState state;
  state.header.sampled_at = at_ms(5);
  state.wrist = wrist;
  applied.report_in(state);
  ASSERT_EQ(state.applied_count, 3u);
  EXPECT_EQ(state.applied[0].wrist_angle_at_end_rad, Vector3(0.1, 0.2, 0.3));
  EXPECT_EQ(state.applied[1].wrist_torque_newton_m, Vector3(0.0, 0.01, 0.0));
  EXPECT_EQ(state.applied[1].until, at_ms(3));
  EXPECT_FALSE(state.applied[1].has_position_at_end);
  EXPECT_EQ(state.applied[2].wrist_torque_newton_m, Vector3(0, 0, 0));
  EXPECT_EQ(state.applied[2].wrist_angle_at_end_rad, Vector3(0.1, 0.25, 0.3));
  EXPECT_EQ(state.wrist->acting_torque_newton_m, Vector3(0, 0, 0));
}

}  // namespace
}  // namespace palpate::device
