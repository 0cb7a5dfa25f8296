// SPDX-License-Identifier: Apache-2.0
// The echo as mofc_node follows it: what is booked, what is skipped, and what is a gap.
#include "mofc_node/device_echo.h"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

namespace palpate::mofc {
namespace {

using namespace std::chrono_literals;

/// Of the force (newton, 0, 0).
struct EchoStretch {
  int from_ms;
  int until_ms;
  double newton = 0.0;
  bool has_position = true;
};

DeviceState echo_at(int reading_ms, const std::vector<EchoStretch>& stretches) {
  const auto at = [](int ms) { return TimePoint(std::chrono::milliseconds(ms)); };
  DeviceState state;
  state.header.sampled_at = at(reading_ms);
  for (const EchoStretch& stretch : stretches) {
    state.applied[state.applied_count++] = {
        .force_on_hand_newton = {stretch.newton, 0, 0},
        .from = at(stretch.from_ms),
        .until = at(stretch.until_ms),
        .hand_position_at_end_m = {0.001 * stretch.until_ms, 0, 0},
        .has_position_at_end = stretch.has_position};
  }
  return state;
}

TEST(DeviceEcho, TheFirstStateContinuesNothing) {
  DeviceEcho echo;
  const DeviceEcho::Report report = echo.take(echo_at(5, {}));
  EXPECT_FALSE(report.has_gap);
  EXPECT_TRUE(report.applied.empty());
  EXPECT_EQ(report.since_previous, Duration::zero());
  EXPECT_EQ(report.mean_force_newton, Vector3::Zero());
}

TEST(DeviceEcho, GivesEachStretchToTheControllerAndTheirMean) {
  DeviceEcho echo;
  static_cast<void>(echo.take(echo_at(5, {})));
  const DeviceEcho::Report report = echo.take(echo_at(9, {{5, 6, 1.0, false}, {6, 9, 2.0}}));
  EXPECT_FALSE(report.has_gap);
  EXPECT_EQ(report.since_previous, 4ms);
  ASSERT_EQ(report.applied.size(), 2u);
  EXPECT_DOUBLE_EQ(report.applied[0].duration_s, 0.001);
  EXPECT_EQ(report.applied[0].force_on_hand_newton, Vector3(1, 0, 0));
  EXPECT_FALSE(report.applied[0].has_position_at_end);
  EXPECT_DOUBLE_EQ(report.applied[1].duration_s, 0.003);
  EXPECT_EQ(report.applied[1].hand_position_at_end_m, Vector3(0.001 * 9, 0, 0));
  EXPECT_TRUE(report.applied[1].has_position_at_end);
  EXPECT_NEAR(report.mean_force_newton.x(), 1.75, 1e-12);
}

TEST(DeviceEcho, SkipsWhatIsBooked) {
  DeviceEcho echo;
  static_cast<void>(echo.take(echo_at(5, {})));
  static_cast<void>(echo.take(echo_at(6, {{5, 6, 1.0}})));
  const DeviceEcho::Report report = echo.take(echo_at(7, {{5, 6, 1.0}, {6, 7, 2.0}}));
  EXPECT_FALSE(report.has_gap);
  ASSERT_EQ(report.applied.size(), 1u);
  EXPECT_NEAR(report.mean_force_newton.x(), 2.0, 1e-12);
}

TEST(DeviceEcho, AStretchThatIsMissingIsAGapAndTheNextEchoContinues) {
  DeviceEcho echo;
  static_cast<void>(echo.take(echo_at(5, {})));
  EXPECT_TRUE(echo.take(echo_at(8, {{6, 8}})).has_gap) << "the first";
  EXPECT_FALSE(echo.take(echo_at(9, {{8, 9}})).has_gap);
  EXPECT_TRUE(echo.take(echo_at(13, {{9, 10}, {11, 13}})).has_gap) << "one between";
  EXPECT_TRUE(echo.take(echo_at(15, {{14, 15}, {15, 15}})).has_gap) << "the first of two";
}

TEST(DeviceEcho, AnEchoThatEndsBeforeItsReadingIsAGapThatNothingContinues) {
  DeviceEcho echo;
  static_cast<void>(echo.take(echo_at(5, {})));
  EXPECT_TRUE(echo.take(echo_at(8, {{5, 7}})).has_gap);
  EXPECT_TRUE(echo.take(echo_at(9, {{8, 9}})).has_gap);
  EXPECT_FALSE(echo.take(echo_at(10, {{9, 10}})).has_gap);
}

TEST(DeviceEcho, AFirstEchoThatEndsBeforeItsReadingIsContinuedByNothing) {
  DeviceEcho echo;
  EXPECT_FALSE(echo.take(echo_at(8, {{5, 7}})).has_gap) << "there was nothing before";
  EXPECT_TRUE(echo.take(echo_at(9, {{8, 9}})).has_gap);
}

TEST(DeviceEcho, AFirstEchoThatEndsAtItsReadingIsContinued) {
  DeviceEcho echo;
  EXPECT_FALSE(echo.take(echo_at(8, {{5, 8}})).has_gap);
  EXPECT_FALSE(echo.take(echo_at(9, {{8, 9}})).has_gap);
}

TEST(DeviceEcho, NothingBetweenTwoReadingsIsAGapUnlessTheirStampsAreEqual) {
  DeviceEcho echo;
  static_cast<void>(echo.take(echo_at(5, {})));
  EXPECT_FALSE(echo.take(echo_at(5, {})).has_gap);
  EXPECT_TRUE(echo.take(echo_at(6, {})).has_gap);
  EXPECT_TRUE(echo.take(echo_at(7, {{6, 7}})).has_gap) << "after it nothing is known";
}

TEST(DeviceEcho, AnotherSessionContinuesNothing) {
  DeviceEcho echo;
  static_cast<void>(echo.take(echo_at(5, {})));
  static_cast<void>(echo.take(echo_at(6, {{5, 6}})));
  echo.answered({1, 0, 0});
  echo.reset();
  const DeviceEcho::Report report = echo.take(echo_at(3, {{2, 3, 1.0}}));
  EXPECT_FALSE(report.has_gap);
  EXPECT_EQ(report.since_previous, Duration::zero());
  EXPECT_EQ(report.applied.size(), 1u) << "on another clock";
  EXPECT_EQ(echo.rendered().integrals().judged_s, 0.0);
}

// 2 N requested for the reading at 6 ms: 1 N for 2 ms of it, then 2 N for 1 ms.
TEST(DeviceEcho, ComparesTheForceThatActsWithWhatWasRequestedForAsLongAsItActs) {
  DeviceEcho echo;
  static_cast<void>(echo.take(echo_at(5, {})));
  static_cast<void>(echo.take(echo_at(6, {{5, 6, 3.0}})));
  EXPECT_EQ(echo.rendered().integrals().judged_s, 0.0) << "nothing was requested";
  echo.answered({2, 0, 0});
  static_cast<void>(echo.take(echo_at(6, {})));
  EXPECT_EQ(echo.rendered().integrals().judged_s, 0.0) << "nothing has acted";
  static_cast<void>(echo.take(echo_at(8, {{6, 8, 1.0}})));
  EXPECT_DOUBLE_EQ(echo.rendered().integrals().judged_s, 2e-3);
  EXPECT_DOUBLE_EQ(echo.rendered().transparency(), 0.5);
  static_cast<void>(echo.take(echo_at(9, {{8, 8, 9.0}, {8, 9, 2.0}})));
  EXPECT_DOUBLE_EQ(echo.rendered().transparency(), 2.0 / 3.0);
}

// 1 N acts at the reading at 6 ms; the 3 N that were requested for it act from 7 ms on.
TEST(DeviceEcho, ARequestStandsFromTheChangeOfTheForce) {
  DeviceEcho echo;
  DeviceState state = echo_at(5, {});
  static_cast<void>(echo.take(state));
  echo.answered({1, 0, 0});
  state = echo_at(6, {{5, 6, 1.0}});
  state.acting_force_on_hand_newton = {1, 0, 0};
  static_cast<void>(echo.take(state));
  echo.answered({3, 0, 0});
  static_cast<void>(echo.take(echo_at(8, {{6, 7, 1.0}, {7, 8, 3.0}})));
  EXPECT_DOUBLE_EQ(echo.rendered().integrals().judged_s, 3e-3);
  EXPECT_DOUBLE_EQ(echo.rendered().transparency(), 1.0);
}

}  // namespace
}  // namespace palpate::mofc
