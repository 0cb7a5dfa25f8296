// SPDX-License-Identifier: Apache-2.0
// What the motors of a wrist may do.
#include <gtest/gtest.h>

#include <chrono>
#include <limits>

#include "device_node/force_guard.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

const TimePoint kBegin = time_at(100.0);

/// Leases of 2 ms, fallback for 20 ms, fade of 50 ms; f_co 0.002 and peak 0.1 N·m.
DeviceConfig guarded_wrist() {
  DeviceConfig config;
  config.lease = 2ms;
  config.limp_after = 20ms;
  config.fade = 50ms;
  config.wrist = {.coulomb_newton_m = 0.002, .peak_torque_newton_m = 0.1};
  return config;
}
ForceCommand wrist_command(const Vector3& newton_m) {
  ForceCommand command;
  command.wrist_torque_newton_m = newton_m;
  command.valid_for = 2ms;
  return command;
}

TEST(ForceGuardOfAWrist, LimitsEachJointToItsPeak) {
  ForceGuard guard(guarded_wrist(), 3.3);
  const Vector3 acting(0.1, -0.1, 0.01);
  static_cast<void>(guard.answered(wrist_command(acting), kBegin, Vector3::Zero(), acting));
  const GuardedForce out =
      guard.answered(wrist_command({0.5, -0.5, 0.01}), kBegin + 1ms, Vector3::Zero(), acting);
  EXPECT_EQ(out.wrist_torque_newton_m, Vector3(0.1, -0.1, 0.01));
  EXPECT_TRUE(out.is_limited);
}

// From zero to the peak in 2 ms: half of it in one.
TEST(ForceGuardOfAWrist, LetsATorqueGrowBySlewAndDropAtOnce) {
  ForceGuard guard(guarded_wrist(), 3.3);
  static_cast<void>(guard.answered(wrist_command(Vector3::Zero()), kBegin, Vector3::Zero()));
  const GuardedForce grown =
      guard.answered(wrist_command({0.1, 0, 0}), kBegin + 1ms, Vector3::Zero());
  EXPECT_NEAR(grown.wrist_torque_newton_m.x(), 0.05, 1e-12);
  const GuardedForce dropped =
      guard.answered(wrist_command({0.01, 0, 0}), kBegin + 2ms, Vector3::Zero(), {0.05, 0, 0});
  EXPECT_EQ(dropped.wrist_torque_newton_m.x(), 0.01);
  const GuardedForce turned =
      guard.answered(wrist_command({-0.1, 0, 0}), kBegin + 3ms, Vector3::Zero(), {0.05, 0, 0});
  EXPECT_NEAR(turned.wrist_torque_newton_m.x(), -0.05, 1e-12);
}

TEST(ForceGuardOfAWrist, FallsBackToFrictionAndFades) {
  ForceGuard guard(guarded_wrist(), 3.3);
  const Vector3 acting(0.05, -0.05, 0.001);
  static_cast<void>(guard.answered(wrist_command(acting), kBegin, Vector3::Zero(), acting));
  EXPECT_EQ(guard.missed(kBegin + 1ms, kBegin + 2ms).wrist_torque_newton_m, acting);
  EXPECT_EQ(guard.missed(kBegin + 3ms, kBegin + 4ms).wrist_torque_newton_m,
            Vector3(0.002, -0.002, 0.001));
  const GuardedForce fading = guard.missed(kBegin + 45ms, kBegin + 46ms);
  EXPECT_EQ(fading.state, GuardState::kFading);
  EXPECT_NEAR(fading.wrist_torque_newton_m.x(), 0.001, 1e-12);
  EXPECT_EQ(guard.missed(kBegin + 70ms, kBegin + 71ms).wrist_torque_newton_m, Vector3(0, 0, 0));
}

TEST(ForceGuardOfAWrist, TakesATorqueThatIsNoNumberForNoForceEither) {
  ForceGuard guard(guarded_wrist(), 3.3);
  ForceCommand command = wrist_command(Vector3::Constant(std::numeric_limits<double>::infinity()));
  command.force_on_hand_newton = {1, 0, 0};
  const GuardedForce out = guard.answered(command, kBegin, Vector3::Zero());
  EXPECT_EQ(out.force_on_hand_newton, Vector3(0, 0, 0));
  EXPECT_EQ(out.wrist_torque_newton_m, Vector3(0, 0, 0));
  EXPECT_EQ(guard.non_finite_commands(), 1u);
}

// The limit grows from zero over 100 ms; a push before the first answer is no beginning.
TEST(ForceGuardOfAWrist, StartsLimp) {
  DeviceConfig config = guarded_wrist();
  config.start_ramp = 100ms;
  ForceGuard guard(config, 3.3);
  const Vector3 wanted(0.05, -0.01, 0.0);
  const GuardedForce first = guard.answered(wrist_command(wanted), kBegin, Vector3::Zero(), wanted);
  EXPECT_EQ(first.wrist_torque_newton_m, Vector3(0, 0, 0));
  Vector3 acting = Vector3::Zero();
  for (int ms = 1; ms <= 50; ++ms) {
    acting = guard.answered(wrist_command(wanted), kBegin + ms * 1ms, Vector3::Zero(), acting)
                 .wrist_torque_newton_m;
  }
  EXPECT_NEAR((acting - 0.5 * wanted).norm(), 0.0, 1e-12);
}

TEST(ForceGuardOfAWrist, KeepsWhatTheMonitorHasLeft) {
  ForceGuard guard(guarded_wrist(), 3.3);
  const Vector3 acting(0.05, 0.0, 0.0);
  GuardedForce less = guard.answered(wrist_command(acting), kBegin, Vector3::Zero(), acting);
  static_cast<void>(guard.answered(wrist_command(acting), kBegin + 1ms, Vector3::Zero(), acting));
  less.wrist_torque_newton_m = {0.01, 0.0, 0.0};
  guard.reduced(less);
  EXPECT_EQ(guard.missed(kBegin + 2ms, kBegin + 3ms).wrist_torque_newton_m.x(), 0.01);
}

TEST(ForceGuardOfAWrist, ForgetsAnAnswerThatBeganTooLate) {
  ForceGuard guard(guarded_wrist(), 3.3);
  const Vector3 acting(0.05, 0.0, 0.0);
  static_cast<void>(guard.answered(wrist_command(acting), kBegin, Vector3::Zero(), acting));
  guard.withdraw_answer();
  EXPECT_EQ(guard.missed(kBegin + 5ms, kBegin + 6ms).wrist_torque_newton_m, Vector3(0, 0, 0));
}

// However long ago the last answer was, a torque grows by what one period allows.
TEST(ForceGuardOfAWrist, GrowsByOnePeriodAtMost) {
  ForceGuard guard(guarded_wrist(), 3.3);
  static_cast<void>(guard.answered(wrist_command(Vector3::Zero()), kBegin, Vector3::Zero()));
  const GuardedForce out =
      guard.answered(wrist_command({0.1, 0, -0.1}), kBegin + 1500us, Vector3::Zero());
  EXPECT_NEAR((out.wrist_torque_newton_m - Vector3(0.05, 0, -0.05)).norm(), 0.0, 1e-12);
  EXPECT_TRUE(out.is_limited);
  const GuardedForce free =
      guard.answered(wrist_command({0.01, 0, 0}), kBegin + 2500us, Vector3::Zero());
  EXPECT_FALSE(free.is_limited);
}

}  // namespace
}  // namespace palpate::device
