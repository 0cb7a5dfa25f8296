// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/physics/wrench_gate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>

namespace palpate::ros {
namespace {

using namespace std::chrono_literals;

constexpr std::int64_t kMillisecond_ns = 1'000'000;
constexpr std::int64_t kBegin_ns = 1'000'000'000;
constexpr std::uint64_t kSource = 7;

/// Poses that go down by 1 mm each millisecond, pose i with the stamp kBegin_ns + i ms.
class Gate : public testing::Test {
 protected:
  void send_poses(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i, ++poses_) {
      ToolMotion motion;
      motion.device_sequence = poses_;
      motion.tool_position_world_m = {0.0, 0.0, -0.001 * static_cast<double>(poses_)};
      // a quarter turn about y: the tool's x is −z of the world
      motion.tool_orientation_world =
          Quaternion(Eigen::AngleAxisd(std::acos(0.0), Vector3::UnitY()));
      gate_.sent(motion, stamp_of(poses_));
    }
  }
  static std::int64_t stamp_of(std::uint64_t pose) {
    return kBegin_ns + static_cast<std::int64_t>(pose) * kMillisecond_ns;
  }
  /// As if it came at the newest pose.
  WrenchRefusal judge(const Wrench& wrench, Duration later = 0ms) {
    return gate_.judge(wrench, time_at(100.0) + later, stamp_of(poses_) + later.count(), taken_);
  }
  static Wrench wrench_at(std::int64_t stamp_ns, double newton = 1.0) {
    return {.source = kSource,
            .stamp_ns = stamp_ns,
            .frame = "world",
            .force_newton = {0.0, 0.0, newton}};
  }

  WrenchGate gate_{WrenchSettings{}};
  std::uint64_t poses_ = 0;
  TakenForce taken_;
};

TEST_F(Gate, AnAnswerWithTheStampOfAPoseAnswersThatPose) {
  send_poses(20);

  ASSERT_EQ(judge(wrench_at(stamp_of(5))), WrenchRefusal::kNone);

  EXPECT_EQ(taken_.answers.device_sequence, 5U);
  EXPECT_EQ(taken_.answers.position_m.z(), -0.005);
  EXPECT_EQ(taken_.age, 15ms);
}

TEST_F(Gate, AForceWithAClockOfItsOwnCountsForTheNewestPose) {
  send_poses(20);

  ASSERT_EQ(judge(wrench_at(42)), WrenchRefusal::kNone);

  EXPECT_EQ(taken_.answers.device_sequence, 19U);
  EXPECT_FALSE(taken_.age.has_value());
}

TEST_F(Gate, WhatIsRepeatedOrOutOfOrderIsRefused) {
  send_poses(20);
  ASSERT_EQ(judge(wrench_at(stamp_of(10))), WrenchRefusal::kNone);

  EXPECT_EQ(judge(wrench_at(stamp_of(10))), WrenchRefusal::kNotNewer);
  EXPECT_EQ(judge(wrench_at(stamp_of(9))), WrenchRefusal::kNotNewer);
  EXPECT_EQ(judge(wrench_at(stamp_of(10)), 1h), WrenchRefusal::kNotNewer);
  EXPECT_EQ(judge(wrench_at(stamp_of(9)), 2h), WrenchRefusal::kNotNewer);
  EXPECT_EQ(judge(wrench_at(stamp_of(11))), WrenchRefusal::kNone);
}

TEST_F(Gate, WhatAnswersAnOldPoseIsRefused) {
  send_poses(1000);

  EXPECT_EQ(judge(wrench_at(stamp_of(799))), WrenchRefusal::kTooLate);
  EXPECT_EQ(judge(wrench_at(stamp_of(800))), WrenchRefusal::kNone);
}

// The ring has forgotten it, or it was never sent: a source that names poses names none.
TEST_F(Gate, WhatAnswersNoPoseIsRefusedOfASourceThatNamesPoses) {
  send_poses(2000);
  ASSERT_EQ(judge(wrench_at(stamp_of(1990))), WrenchRefusal::kNone);

  EXPECT_EQ(judge(wrench_at(stamp_of(1990) + 1)), WrenchRefusal::kUnknownPose);
  EXPECT_EQ(judge(wrench_at(stamp_of(5000))), WrenchRefusal::kUnknownPose);
  EXPECT_EQ(judge(wrench_at(kBegin_ns - 1)), WrenchRefusal::kUnknownPose);
  EXPECT_EQ(judge(wrench_at(stamp_of(500))), WrenchRefusal::kTooLate);  // forgotten
  EXPECT_EQ(judge(wrench_at(stamp_of(1991))), WrenchRefusal::kNone);
}

// As of a stray message, or of a second publisher behind one server.
TEST_F(Gate, AnAnswerToAPoseCountsWhateverOtherStampsCameBefore) {
  send_poses(2000);
  ASSERT_EQ(judge(wrench_at(stamp_of(1'000'000))), WrenchRefusal::kNone);

  EXPECT_EQ(judge(wrench_at(stamp_of(1990))), WrenchRefusal::kNone);
  EXPECT_EQ(judge(wrench_at(stamp_of(1'000'001))), WrenchRefusal::kUnknownPose);
  EXPECT_EQ(judge(wrench_at(stamp_of(1990))), WrenchRefusal::kNotNewer);
}

TEST_F(Gate, ASourceIsBehindWhereItsAnswersTakeMuchLongerThanTheShortest) {
  send_poses(10);
  EXPECT_FALSE(gate_.is_behind(stamp_of(1000)));                   // it has named none
  ASSERT_EQ(judge(wrench_at(stamp_of(5))), WrenchRefusal::kNone);  // after 5 ms
  EXPECT_FALSE(gate_.is_behind(stamp_of(5 + 60)));
  EXPECT_TRUE(gate_.is_behind(stamp_of(5 + 61)));

  send_poses(2000);
  EXPECT_EQ(judge(wrench_at(stamp_of(500))), WrenchRefusal::kTooLate);  // it catches up
  EXPECT_FALSE(gate_.is_behind(stamp_of(500 + 60)));
  EXPECT_TRUE(gate_.is_behind(stamp_of(2010)));
  ASSERT_EQ(judge(wrench_at(stamp_of(2000))), WrenchRefusal::kNone);
  EXPECT_FALSE(gate_.is_behind(stamp_of(2010)));
}

TEST_F(Gate, AClockThatWasSetBackCountsAfterASecondInWhichNothingCame) {
  send_poses(20);
  ASSERT_EQ(judge(wrench_at(1000)), WrenchRefusal::kNone);

  EXPECT_EQ(judge(wrench_at(10), 999ms), WrenchRefusal::kNotNewer);
  EXPECT_EQ(judge(wrench_at(11), 1998ms), WrenchRefusal::kNotNewer);    // it was not silent
  EXPECT_EQ(judge(wrench_at(1000), 2998ms), WrenchRefusal::kNotNewer);  // repeated
  EXPECT_EQ(judge(wrench_at(12), 3998ms), WrenchRefusal::kNone);
  EXPECT_EQ(judge(wrench_at(13), 3999ms), WrenchRefusal::kNone);
}

TEST_F(Gate, NothingCountsBeforeAPoseWasSent) {
  EXPECT_EQ(judge(wrench_at(42)), WrenchRefusal::kUnknownPose);
}

TEST_F(Gate, NumbersThatAreNoForceAreRefused) {
  send_poses(20);
  for (const double newton :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(judge(wrench_at(stamp_of(10), newton)), WrenchRefusal::kNotFinite);
  }
  EXPECT_EQ(judge(wrench_at(stamp_of(10), 100.1)), WrenchRefusal::kTooLarge);
  EXPECT_EQ(judge(wrench_at(stamp_of(10), 1e300)), WrenchRefusal::kTooLarge);
  // what was refused is not the last one
  EXPECT_EQ(judge(wrench_at(stamp_of(10), 99.9)), WrenchRefusal::kNone);
}

TEST_F(Gate, AForceInTheToolsFrameTurnsWithTheToolAndInAnotherIsRefused) {
  send_poses(20);
  Wrench wrench = wrench_at(stamp_of(10));
  wrench.frame = "ft_sensor";
  EXPECT_EQ(judge(wrench), WrenchRefusal::kUnknownFrame);
  wrench.frame = "";
  EXPECT_EQ(judge(wrench), WrenchRefusal::kUnknownFrame);

  wrench.frame = "tool";
  wrench.force_newton = {2.0, 0.0, 0.0};
  ASSERT_EQ(judge(wrench), WrenchRefusal::kNone);

  EXPECT_LT((taken_.force_on_tool_newton - Vector3(0.0, 0.0, -2.0)).norm(), 1e-12);
}

TEST_F(Gate, AForceOnTheTissueIsNegated) {
  gate_ = WrenchGate({.is_on_tissue = true});
  send_poses(20);

  ASSERT_EQ(judge(wrench_at(stamp_of(10))), WrenchRefusal::kNone);

  EXPECT_EQ(taken_.force_on_tool_newton.z(), -1.0);
}

TEST_F(Gate, OneSourceIsHeardUntilItIsSilentForASecond) {
  send_poses(20);
  ASSERT_EQ(judge(wrench_at(stamp_of(10))), WrenchRefusal::kNone);
  Wrench other = wrench_at(stamp_of(11));
  other.source = kSource + 1;

  EXPECT_EQ(judge(other, 999ms), WrenchRefusal::kOtherSource);
  other.stamp_ns = 42;  // a clock of its own, which is behind
  EXPECT_EQ(judge(other, 1000ms), WrenchRefusal::kNone);
  EXPECT_EQ(judge(wrench_at(stamp_of(12)), 1001ms), WrenchRefusal::kOtherSource);
}

// A stranger whose messages do not count does not take the place of the source.
TEST_F(Gate, WhatIsRefusedDoesNotMakeASource) {
  send_poses(20);
  Wrench bad = wrench_at(stamp_of(10), 1e6);
  bad.source = kSource + 1;
  EXPECT_EQ(judge(bad), WrenchRefusal::kTooLarge);
  Wrench unknown = wrench_at(stamp_of(10));
  unknown.source = kSource + 2;
  unknown.is_known_type = false;
  EXPECT_EQ(judge(unknown), WrenchRefusal::kUnknownType);

  EXPECT_FALSE(gate_.taken_at().has_value());
  EXPECT_EQ(judge(wrench_at(stamp_of(10))), WrenchRefusal::kNone);
}

TEST(WrenchRefusals, EachIsExplainedInWordsOfItsOwn) {
  std::set<std::string> texts;
  for (std::size_t i = 0; i < kWrenchRefusals; ++i) {
    const std::string text = explain(static_cast<WrenchRefusal>(i));
    EXPECT_FALSE(text.empty()) << i;
    texts.insert(text);
  }
  EXPECT_EQ(texts.size(), kWrenchRefusals);
}

}  // namespace
}  // namespace palpate::ros
