// SPDX-License-Identifier: Apache-2.0
// Poses of a device beyond our control: which count, and in which axes.
#include "deploy/ros/device/pose_gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "common/core/check.h"

namespace palpate::ros {
namespace {

using namespace std::chrono_literals;
constexpr double kTiny = 1e-12;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const TimePoint kStart{10s};

DevicePose pose_at(std::int64_t stamp_ns, std::uint64_t source = 1) {
  return {.source = source,
          .stamp_ns = stamp_ns,
          .frame = "base",
          .position_m = {0.1, 0.2, 0.3},
          .orientation = Quaternion::Identity()};
}

TEST(DeviceAxes, TurnPositionsOrientationsAndForces) {
  // an arm whose x points away from the person and y to the left
  PoseGate gate(
      {.device_from_base = DeviceAxes::rotation_of("-y x z"), .center_m = Vector3(0.1, 0.1, 0.1)},
      "");
  DevicePose pose = pose_at(1);
  const Quaternion about_x(Eigen::AngleAxisd(0.5, Vector3::UnitX()));
  pose.orientation = about_x;
  ASSERT_EQ(gate.judge(pose, kStart), PoseRefusal::kNone);
  EXPECT_TRUE(pose.position_m.isApprox(Vector3(-0.1, 0.0, 0.2), kTiny)) << pose.position_m;
  // the handle's own x axis, there and here
  EXPECT_TRUE((pose.orientation * Vector3::UnitX()).isApprox(Vector3::UnitY(), kTiny));
  // away from the person
  EXPECT_TRUE(gate.in_base(Vector3::UnitY()).isApprox(Vector3::UnitX(), kTiny));
  EXPECT_EQ(gate.frame(), "base");
}

TEST(DeviceAxes, OtherThanARightHandedFrameAreRefusedWithAnExample) {
  for (const char* const text :
       {"", "x y", "x y z z", "x x z", "y x z", "x y -z", "1 2 3", "x,y,z", "--x y z", "X Y Z"}) {
    try {
      static_cast<void>(DeviceAxes::rotation_of(text));
      FAIL() << text;
    } catch (const SetupError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("such as \"-y x z\"")) << text;
    }
  }
  EXPECT_EQ(DeviceAxes::rotation_of("x y z"), Matrix3::Identity());
}

TEST(PoseGate, RefusesWhatIsNoPoseOfThatArm) {
  PoseGate gate({}, "");
  DevicePose first = pose_at(100);
  ASSERT_EQ(gate.judge(first, kStart), PoseRefusal::kNone);
  const auto judged = [&](const auto& change) {
    DevicePose pose = pose_at(200);
    change(pose);
    return gate.judge(pose, kStart + 1ms);
  };
  EXPECT_EQ(judged([](DevicePose& p) { p.stamp_ns = 100; }), PoseRefusal::kNotNewer);
  EXPECT_EQ(judged([](DevicePose& p) { p.stamp_ns = 99; }), PoseRefusal::kNotNewer);
  EXPECT_EQ(judged([](DevicePose& p) { p.frame = "camera"; }), PoseRefusal::kOtherFrame);
  EXPECT_EQ(judged([](DevicePose& p) { p.position_m.y() = kNaN; }), PoseRefusal::kNoPose);
  EXPECT_EQ(judged([](DevicePose& p) { p.orientation.coeffs().setZero(); }), PoseRefusal::kNoPose);
  EXPECT_EQ(judged([](DevicePose& p) { p.orientation.w() = kNaN; }), PoseRefusal::kNoPose);
  EXPECT_EQ(judged([](DevicePose& p) { p.is_known_type = false; }), PoseRefusal::kUnknownType);
  EXPECT_EQ(judged([](DevicePose& p) { p.source = 2; }), PoseRefusal::kOtherSource);
  EXPECT_EQ(judged([](DevicePose&) {}), PoseRefusal::kNone) << "none of them counted";
}

TEST(PoseGate, AnotherArmMayFollowOnceTheFirstIsSilent) {
  PoseGate gate({}, "");
  DevicePose first = pose_at(100, 1);
  ASSERT_EQ(gate.judge(first, kStart), PoseRefusal::kNone);
  DevicePose early = pose_at(1, 2);
  EXPECT_EQ(gate.judge(early, kStart + 999ms), PoseRefusal::kOtherSource);
  DevicePose late = pose_at(1, 2);
  late.frame = "base of the other";
  EXPECT_EQ(gate.judge(late, kStart + 1s), PoseRefusal::kNone) << "its own clock may be behind";
}

TEST(PoseGate, TheFrameThatIsNamedCounts) {
  PoseGate gate({}, "base");
  DevicePose other = pose_at(1);
  other.frame = "";
  EXPECT_EQ(gate.judge(other, kStart), PoseRefusal::kOtherFrame);
  DevicePose pose = pose_at(2);
  EXPECT_EQ(gate.judge(pose, kStart), PoseRefusal::kNone);
}

}  // namespace
}  // namespace palpate::ros
