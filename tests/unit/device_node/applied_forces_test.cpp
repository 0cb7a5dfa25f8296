// SPDX-License-Identifier: Apache-2.0
// What acted from when to when, on any clock.
#include "device_node/applied_forces.h"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

const Vector3 kHalfNewton(0.5, 0, 0);
const Vector3 kHere(0.01, 0.02, 0.03);
const Vector3 kThere(0.04, 0.05, 0.06);

TimePoint at_ms(int ms) { return TimePoint(std::chrono::milliseconds(ms)); }

DeviceState reported(const AppliedForces& applied, TimePoint reading) {
  DeviceState state;
  state.header.sampled_at = reading;
  applied.report_in(state);
  return state;
}

void expect_stretch(const AppliedForce& stretch, const Vector3& force_newton, int from_ms,
                    int until_ms, bool has_position) {
  EXPECT_EQ(stretch.force_on_hand_newton, force_newton);
  EXPECT_EQ(stretch.from, at_ms(from_ms));
  EXPECT_EQ(stretch.until, at_ms(until_ms));
  EXPECT_EQ(stretch.has_position_at_end, has_position);
}

// The lease ends at 3 ms, the next reading is at 9 ms: nobody knows what acted until then.
TEST(AppliedForces, WithoutAWatchdogAForceThatOutlivedItsLeaseBeginsTheEchoAnew) {
  AppliedForces applied(false);
  applied.begin(at_ms(0));
  applied.switched(at_ms(1), kHere, kHalfNewton, 2ms);
  EXPECT_FALSE(applied.has_run_out(at_ms(9)));
  applied.read(at_ms(9), kThere);
  applied.acts_on(Vector3::Zero());
  EXPECT_EQ(reported(applied, at_ms(9)).applied_count, 0u);
  EXPECT_EQ(reported(applied, at_ms(9)).acting_force_on_hand_newton, Vector3(0, 0, 0));
  applied.read(at_ms(10), kThere);
  const DeviceState state = reported(applied, at_ms(10));
  ASSERT_EQ(state.applied_count, 1u);
  expect_stretch(state.applied[0], Vector3::Zero(), 9, 10, true);
}

TEST(AppliedForces, WithoutAWatchdogAForceIsWhatTheReadingSaysOfIt) {
  AppliedForces applied(false);
  applied.begin(at_ms(0));
  applied.switched(at_ms(1), kHere, kHalfNewton, 5ms);
  applied.read(at_ms(2), kHere);
  applied.acts_on(kHalfNewton);
  applied.read(at_ms(6), kThere);  // within the lease
  const DeviceState state = reported(applied, at_ms(6));
  ASSERT_EQ(state.applied_count, 3u);
  expect_stretch(state.applied[2], kHalfNewton, 2, 6, true);

  applied.read(at_ms(7), kThere);  // after it
  EXPECT_EQ(reported(applied, at_ms(7)).applied_count, 0u);
}

TEST(AppliedForces, WithoutAWatchdogAReleaseWithinTheLeaseEndsTheForceAndALaterOneBeginsAnew) {
  AppliedForces applied(false);
  applied.begin(at_ms(0));
  applied.switched(at_ms(1), kHere, kHalfNewton, 5ms);
  AppliedForces late = applied;
  applied.released(at_ms(4));
  const DeviceState state = reported(applied, at_ms(4));
  ASSERT_EQ(state.applied_count, 2u);
  expect_stretch(state.applied[1], kHalfNewton, 1, 4, false);

  late.released(at_ms(20));
  EXPECT_EQ(reported(late, at_ms(20)).applied_count, 0u);
  EXPECT_EQ(reported(late, at_ms(20)).acting_force_on_hand_newton, Vector3(0, 0, 0));
}

TEST(AppliedForces, BeginWithTheFirstReading) {
  AppliedForces applied;
  EXPECT_FALSE(applied.has_begun());
  EXPECT_EQ(reported(applied, at_ms(0)).applied_count, 0u);
  applied.begin(at_ms(5));
  EXPECT_TRUE(applied.has_begun());
  applied.read(at_ms(5), kHere);
  EXPECT_EQ(reported(applied, at_ms(5)).applied_count, 0u);
  applied.read(at_ms(6), kHere);
  const DeviceState state = reported(applied, at_ms(6));
  ASSERT_EQ(state.applied_count, 1u);
  expect_stretch(state.applied[0], Vector3::Zero(), 5, 6, true);
}

TEST(AppliedForces, ASwitchEndsAStretchWithItsPosition) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  applied.switched(at_ms(1), kHere, kHalfNewton, 5ms);
  applied.read(at_ms(3), kThere);
  applied.read(at_ms(3), kThere);  // nothing between two readings at one instant
  const DeviceState state = reported(applied, at_ms(3));
  ASSERT_EQ(state.applied_count, 2u);
  expect_stretch(state.applied[0], Vector3::Zero(), 0, 1, true);
  EXPECT_EQ(state.applied[0].hand_position_at_end_m, kHere);
  expect_stretch(state.applied[1], kHalfNewton, 1, 3, true);
  EXPECT_EQ(state.applied[1].hand_position_at_end_m, kThere);
  EXPECT_EQ(state.acting_force_on_hand_newton, kHalfNewton);
  EXPECT_EQ(state.acting_until, at_ms(6));
  EXPECT_EQ(reported(applied, at_ms(7)).acting_until, at_ms(7)) << "not before the reading";
}

TEST(AppliedForces, ALeaseThatIsOverEndsTheForceUnread) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  EXPECT_FALSE(applied.has_run_out(at_ms(9))) << "no force";
  EXPECT_EQ(applied.lease_end(), TimePoint::max());
  applied.switched(at_ms(0), kHere, kHalfNewton, 2ms);
  EXPECT_EQ(applied.lease_end(), at_ms(2));
  EXPECT_FALSE(applied.has_run_out(at_ms(2)));
  EXPECT_TRUE(applied.has_run_out(at_ms(3)));
  applied.read(at_ms(3), kThere);
  EXPECT_EQ(applied.lease_end(), TimePoint::max());
  const DeviceState state = reported(applied, at_ms(3));
  ASSERT_EQ(state.applied_count, 2u);
  expect_stretch(state.applied[0], kHalfNewton, 0, 2, false);
  expect_stretch(state.applied[1], Vector3::Zero(), 2, 3, true);
  EXPECT_EQ(state.acting_force_on_hand_newton, Vector3::Zero());
}

TEST(AppliedForces, ALatchedPositionEndsTheForceAsRead) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  applied.switched(at_ms(0), kHere, kHalfNewton, 2ms);
  applied.ran_out(kThere);
  EXPECT_FALSE(applied.has_run_out(at_ms(3)));
  const DeviceState state = reported(applied, at_ms(3));
  ASSERT_EQ(state.applied_count, 1u);
  expect_stretch(state.applied[0], kHalfNewton, 0, 2, true);
  EXPECT_EQ(state.applied[0].hand_position_at_end_m, kThere);
}

TEST(AppliedForces, AReadingFromThePastChangesNothing) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  applied.read(at_ms(2), kHere);
  applied.read(at_ms(1), kThere);
  const DeviceState state = reported(applied, at_ms(2));
  ASSERT_EQ(state.applied_count, 1u);
  EXPECT_EQ(state.applied[0].hand_position_at_end_m, kHere);
}

TEST(AppliedForces, AReleaseEndsTheForceUnread) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  applied.released(at_ms(1));
  EXPECT_EQ(reported(applied, at_ms(1)).applied_count, 0u) << "there was no force to end";
  applied.switched(at_ms(2), kHere, kHalfNewton, 5ms);
  applied.released(at_ms(3));
  DeviceState state = reported(applied, at_ms(3));
  ASSERT_EQ(state.applied_count, 2u);
  expect_stretch(state.applied[1], kHalfNewton, 2, 3, false);
  EXPECT_EQ(state.acting_force_on_hand_newton, Vector3::Zero());

  applied.switched(at_ms(4), kHere, kHalfNewton, 2ms);
  applied.released(at_ms(9));
  state = reported(applied, at_ms(9));
  ASSERT_EQ(state.applied_count, 4u);
  expect_stretch(state.applied[3], kHalfNewton, 4, 6, false);
}

TEST(AppliedForces, AreReportedUntilTheyAreAcknowledged) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  for (const int ms : {1, 2, 3}) applied.read(at_ms(ms), kHere);
  applied.acknowledged(at_ms(0));
  EXPECT_EQ(reported(applied, at_ms(3)).applied_count, 3u);
  applied.acknowledged(at_ms(2));
  const DeviceState state = reported(applied, at_ms(3));
  ASSERT_EQ(state.applied_count, 1u);
  expect_stretch(state.applied[0], Vector3::Zero(), 2, 3, true);
  applied.acknowledged(at_ms(3));
  EXPECT_EQ(reported(applied, at_ms(3)).applied_count, 0u);
}

// For a record that follows one at 2 ms: the lease that ended by itself at 4 ms is an end of its
// own.
TEST(AppliedForces, TellARecordWhatActedSinceTheOneBefore) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  applied.switched(at_ms(1), kHere, kHalfNewton, 3ms);
  applied.read(at_ms(2), kHere);
  applied.read(at_ms(7), kThere);

  DeviceTick tick;
  applied.report_in(tick, at_ms(2), at_ms(7));
  ASSERT_EQ(tick.acted_count, 2u);
  expect_stretch(tick.acted[0], kHalfNewton, 2, 4, false);
  expect_stretch(tick.acted[1], Vector3::Zero(), 4, 7, true);
  EXPECT_EQ(tick.acted[1].hand_position_at_end_m, kThere);

  // without a reading, as of a fault
  DeviceTick later;
  applied.report_in(later, at_ms(7), at_ms(9));
  ASSERT_EQ(later.acted_count, 1u);
  expect_stretch(later.acted[0], Vector3::Zero(), 7, 9, false);
}

TEST(AppliedForces, TellARecordTheNewestEight) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  for (int ms = 1; ms <= 10; ++ms) applied.switched(at_ms(ms), kHere, ms * kHalfNewton, 5ms);
  DeviceTick tick;
  applied.report_in(tick, at_ms(0), at_ms(10));
  ASSERT_EQ(tick.acted_count, kMaxActedForces);
  expect_stretch(tick.acted[0], 2.0 * kHalfNewton, 2, 3, true);
  expect_stretch(tick.acted[7], 9.0 * kHalfNewton, 9, 10, true);
}

TEST(AppliedForces, KeepTheNewest64) {
  AppliedForces applied;
  applied.begin(at_ms(0));
  for (int ms = 1; ms <= 64; ++ms) applied.read(at_ms(ms), kHere);
  EXPECT_EQ(reported(applied, at_ms(64)).applied[0].from, at_ms(0));
  applied.read(at_ms(65), kHere);
  const DeviceState state = reported(applied, at_ms(65));
  ASSERT_EQ(state.applied_count, kMaxAppliedForces);
  EXPECT_EQ(state.applied[0].from, at_ms(1));
  EXPECT_EQ(state.applied[63].until, at_ms(65));
}

}  // namespace
}  // namespace palpate::device
