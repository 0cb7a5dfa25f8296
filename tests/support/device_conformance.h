// device_conformance.h — what every driver must do. To run a driver through it, write a fixture and
//
//   INSTANTIATE_TYPED_TEST_SUITE_P(MyDriver, DeviceConformance, MyDriverUnderTest);
//
// A fixture is default-constructible and offers
//
//   HapticDevice& device();                     opened, limp, held by nobody or by a still hand
//   const Clock& clock();                       the one the device stamps with
//   void pass(Duration);                        returns after that time on that clock
//   Duration stamp_tolerance();                 a transfer's time; zero on a clock that stands
//   std::optional<Vector3> motor_force();       what the motors do now [N], D, as a current sensor
//                                               or a simulation sees it; nullopt: not observable
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <optional>

#include "common/core/clock.h"
#include "device_node/device.h"
#include "tests/support/alloc_guard.h"

namespace palpate::test {

using namespace std::chrono_literals;

template <class Fixture>
class DeviceConformance : public testing::Test {
 protected:
  device::HapticDevice& device() { return fixture_.device(); }

  /// A third of the continuous force: no driver has a reason to limit it.
  Vector3 gentle_force_newton() {
    return Vector3(2, -1, 2) / 3.0 * (device().specification().continuous_force_newton / 3.0);
  }
  bool apply(const Vector3& force_on_hand_newton, Duration lease) {
    device::DeviceSample at_switch;
    return device().apply(force_on_hand_newton, lease, at_switch);
  }
  void expect_stamped_now(const device::DeviceSample& sample, TimePoint before) {
    EXPECT_GE(sample.sampled_at, before - fixture_.stamp_tolerance());
    EXPECT_LE(sample.sampled_at, fixture_.clock().now());
  }
  /// Ends the test where the motors cannot be observed.
  /// @param asked_newton  of which the motors give what their axes can
  void expect_motor_force(const Vector3& asked_newton) {
    const Vector3 expected_newton = device().specification().force_axes * asked_newton;
    const std::optional<Vector3> force = fixture_.motor_force();
    if (!force) GTEST_SKIP() << "motor force cannot be observed";
    EXPECT_LT((*force - expected_newton).norm(), 0.02 * (expected_newton.norm() + 0.1));
  }

  Fixture fixture_;
};
TYPED_TEST_SUITE_P(DeviceConformance);

TYPED_TEST_P(DeviceConformance, SpecificationIsFilledIn) {
  const device::DeviceSpecification& s = this->device().specification();

  EXPECT_FALSE(s.model_name.empty());
  EXPECT_GT(s.workspace_half_extent_m.minCoeff(), 0.0);
  EXPECT_GT(s.continuous_force_newton, 0.0);
  EXPECT_GE(s.peak_force_newton, s.continuous_force_newton);
  EXPECT_GE(s.position_resolution_m, 0.0);
  EXPECT_LE(s.button_count, 32u);
}

TYPED_TEST_P(DeviceConformance, AReadingIsFiniteAndStampedWhenItWasTaken) {
  const TimePoint before = this->fixture_.clock().now();

  device::DeviceSample sample;
  ASSERT_TRUE(this->device().read(sample));

  EXPECT_TRUE(sample.hand_position_m.allFinite());
  EXPECT_NEAR(sample.orientation.norm(), 1.0, 1e-6);
  this->expect_stamped_now(sample, before);
}

TYPED_TEST_P(DeviceConformance, ButtonsItDoesNotHaveAreNeverPressed) {
  device::DeviceSample sample;
  ASSERT_TRUE(this->device().read(sample));

  const std::uint32_t count = this->device().specification().button_count;
  EXPECT_EQ(count < 32 ? sample.buttons >> count : 0u, 0u);
}

TYPED_TEST_P(DeviceConformance, StampsNeverGoBack) {
  TimePoint previous = this->fixture_.clock().now() - this->fixture_.stamp_tolerance();
  for (int i = 0; i < 20; ++i) {
    device::DeviceSample reading;
    device::DeviceSample at_switch;
    ASSERT_TRUE(this->device().read(reading));
    ASSERT_TRUE(this->device().apply(Vector3::Zero(), 1ms, at_switch));

    EXPECT_GE(reading.sampled_at, previous);
    EXPECT_GE(at_switch.sampled_at, reading.sampled_at);
    previous = at_switch.sampled_at;
    this->fixture_.pass(100us);
  }
}

TYPED_TEST_P(DeviceConformance, ASwitchLatchesAReading) {
  const TimePoint before = this->fixture_.clock().now();

  device::DeviceSample at_switch;
  ASSERT_TRUE(this->device().apply(this->gentle_force_newton(), 1ms, at_switch));

  EXPECT_TRUE(at_switch.hand_position_m.allFinite());
  this->expect_stamped_now(at_switch, before);
}

TYPED_TEST_P(DeviceConformance, ASwitchNamesTheForceThatActs) {
  const device::DeviceSpecification& s = this->device().specification();
  device::DeviceSample at_switch;
  const Vector3 strongest_newton = Vector3(0.6, 0, -0.8) * s.peak_force_newton;
  ASSERT_TRUE(this->device().apply(5.0 * strongest_newton, 20ms, at_switch));
  EXPECT_LT((at_switch.applied_force_newton - s.force_axes * strongest_newton).norm(),
            0.02 * s.peak_force_newton);

  ASSERT_TRUE(this->device().apply(this->gentle_force_newton(), Duration(-1), at_switch));
  EXPECT_EQ(at_switch.applied_force_newton, Vector3(0, 0, 0));
}

TYPED_TEST_P(DeviceConformance, IsLimpBeforeTheFirstForce) {
  this->expect_motor_force(Vector3::Zero());
}

TYPED_TEST_P(DeviceConformance, AForceActsWhileItsLeaseRuns) {
  ASSERT_TRUE(this->apply(this->gentle_force_newton(), 20ms));
  this->fixture_.pass(5ms);

  this->expect_motor_force(this->gentle_force_newton());
}

TYPED_TEST_P(DeviceConformance, AForceEndsByItselfWithItsLease) {
  if (!this->device().specification().has_motor_watchdog) {
    GTEST_SKIP() << "no motor-side watchdog: the guarantee is not available";
  }
  ASSERT_TRUE(this->apply(this->gentle_force_newton(), 5ms));
  this->fixture_.pass(6ms);

  this->expect_motor_force(Vector3::Zero());
}

TYPED_TEST_P(DeviceConformance, ALatchedPositionIsThatOfTheEndOfTheForceAndGivenOnce) {
  device::DeviceSample at_switch;
  ASSERT_TRUE(this->device().apply(this->gentle_force_newton(), 5ms, at_switch));
  this->fixture_.pass(20ms);
  device::DeviceSample sample;
  ASSERT_TRUE(this->device().read(sample));

  device::DeviceSample latched;
  const bool has_latch = this->device().specification().has_position_latch;
  ASSERT_EQ(this->device().take_latched(latched), has_latch);
  EXPECT_FALSE(this->device().take_latched(latched));
  if (!has_latch) return;
  EXPECT_TRUE(latched.hand_position_m.allFinite());
  EXPECT_GE(latched.sampled_at, at_switch.sampled_at);
  EXPECT_LE(latched.sampled_at, at_switch.sampled_at + 5ms + this->fixture_.stamp_tolerance());
}

TYPED_TEST_P(DeviceConformance, ANewForceRenewsTheLease) {
  ASSERT_TRUE(this->apply(this->gentle_force_newton(), 10ms));
  this->fixture_.pass(6ms);
  ASSERT_TRUE(this->apply(this->gentle_force_newton(), 10ms));
  this->fixture_.pass(6ms);

  this->expect_motor_force(this->gentle_force_newton());
}

TYPED_TEST_P(DeviceConformance, ALeaseOfNothingIsNoForce) {
  ASSERT_TRUE(this->apply(this->gentle_force_newton(), 20ms));
  ASSERT_TRUE(this->apply(this->gentle_force_newton(), Duration(-1)));

  this->expect_motor_force(Vector3::Zero());
}

TYPED_TEST_P(DeviceConformance, ForceIsCutAtThePeakAndKeepsItsDirection) {
  const double peak_newton = this->device().specification().peak_force_newton;
  ASSERT_TRUE(this->apply(Vector3(3, 0, -4) * peak_newton, 20ms));

  this->expect_motor_force(Vector3(0.6, 0, -0.8) * peak_newton);
}

TYPED_TEST_P(DeviceConformance, ReleaseIsLimpAtOnceAndALaterForceActsAgain) {
  ASSERT_TRUE(this->apply(this->gentle_force_newton(), 20ms));
  this->device().release();
  this->expect_motor_force(Vector3::Zero());

  ASSERT_TRUE(this->apply(this->gentle_force_newton(), 20ms));
  this->expect_motor_force(this->gentle_force_newton());
}

TYPED_TEST_P(DeviceConformance, ANonFiniteForceIsRefusedAndLeavesTheMotorsLimp) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    ASSERT_TRUE(this->apply(this->gentle_force_newton(), 20ms));
    EXPECT_FALSE(this->apply(Vector3(0, bad, 0), 20ms));
    this->expect_motor_force(Vector3::Zero());
  }
}

TYPED_TEST_P(DeviceConformance, ReadingAndWritingDoNotAllocate) {
  device::DeviceSample sample;
  const Vector3 force_newton = this->gentle_force_newton();
  bool is_ok = true;

  const AllocGuard guard;
  for (int i = 0; i < 10; ++i) {
    is_ok = this->device().read(sample) && is_ok;
    is_ok = this->device().apply(force_newton, 2ms, sample) && is_ok;
    this->fixture_.pass(1ms);
  }
  this->device().release();

  EXPECT_EQ(guard.count(), 0u);
  EXPECT_TRUE(is_ok);
}

REGISTER_TYPED_TEST_SUITE_P(
    DeviceConformance, SpecificationIsFilledIn, AReadingIsFiniteAndStampedWhenItWasTaken,
    ButtonsItDoesNotHaveAreNeverPressed, StampsNeverGoBack, ASwitchLatchesAReading,
    ASwitchNamesTheForceThatActs, IsLimpBeforeTheFirstForce, AForceActsWhileItsLeaseRuns,
    AForceEndsByItselfWithItsLease, ALatchedPositionIsThatOfTheEndOfTheForceAndGivenOnce,
    ANewForceRenewsTheLease, ALeaseOfNothingIsNoForce, ForceIsCutAtThePeakAndKeepsItsDirection,
    ReleaseIsLimpAtOnceAndALaterForceActsAgain, ANonFiniteForceIsRefusedAndLeavesTheMotorsLimp,
    ReadingAndWritingDoNotAllocate);

}  // namespace palpate::test
