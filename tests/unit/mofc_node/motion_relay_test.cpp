// SPDX-License-Identifier: Apache-2.0
// What hop 2 says of a tool that turns.
#include "mofc_node/motion_relay.h"

#include <gtest/gtest.h>

#include "common/core/memory_link.h"

namespace palpate::mofc {
namespace {

using namespace std::chrono_literals;

class RelayOfAWrist : public testing::Test {
 protected:
  static ClampedDevice with_wrist() {
    ClampedDevice device;
    device.wrist.emplace();
    device.wrist->angle_resolution_rad = 0.0;
    return device;
  }

  /// The motion of the next millisecond.
  ToolMotion turn_to(const Vector3& angle_rad, const Matrix3& axes) {
    clock_.advance(1ms);
    DeviceState state;
    state.header = {1, sequence_++, clock_.now()};
    state.wrist = WristState{.pose = {.angle_rad = angle_rad, .axes = axes}};
    relay_.update(state, Vector3::Zero());
    relay_.send();
    ToolMotion motion;
    TimePoint at;
    while (out_.receive(motion, at)) {
    }
    return motion;
  }

  ManualClock clock_;
  MemoryLink<ToolMotion> out_{clock_};
  MotionRelay relay_{MofcConfig{}, with_wrist(), clock_, out_, 7};
  std::uint64_t sequence_ = 0;
};

// Joint 2 turns about z of D here, backwards.
TEST_F(RelayOfAWrist, TellsTheAngularVelocityAboutTheAxesAsTheyStand) {
  Matrix3 axes;
  axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  ToolMotion motion;
  for (int i = 0; i < 40; ++i) motion = turn_to({0.5, -0.3e-3 * i, 0.1}, axes);
  EXPECT_NEAR((motion.tool_angular_velocity_world_rad_per_s - Vector3(0, 0, -0.3)).norm(), 0, 1e-9);
  EXPECT_TRUE(motion.wants_torque);
  EXPECT_NEAR((motion.tool_velocity_world().at({0.1, 0, 0}) - Vector3(0, -0.03, 0)).norm(), 0,
              1e-9);
}

// An encoder that jumps must not make a message that physics_node refuses.
TEST_F(RelayOfAWrist, StaysInTheRangeOfTheWireWhateverTheEncodersSay) {
  turn_to(Vector3::Zero(), Matrix3::Identity());
  const ToolMotion motion = turn_to({900.0, -900.0, 900.0}, Matrix3::Identity());
  EXPECT_NEAR(motion.tool_angular_velocity_world_rad_per_s.norm(), 1000.0, 1e-9);
}

TEST_F(RelayOfAWrist, StartsAnewWithTheDevice) {
  turn_to(Vector3::Zero(), Matrix3::Identity());
  turn_to({0.001, 0, 0}, Matrix3::Identity());
  relay_.reset();
  EXPECT_TRUE(
      turn_to({0.5, 0, 0}, Matrix3::Identity()).tool_angular_velocity_world_rad_per_s.isZero(0.0));
}

}  // namespace
}  // namespace palpate::mofc
