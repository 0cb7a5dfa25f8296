// SPDX-License-Identifier: Apache-2.0
// The tool as drawn by general-purpose viewers, from Foxglove messages.
#include "common/link/codec/viewer_codec.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <string>

#include "foxglove/foxglove_subset.pb.h"
#include "palpate/v1/viewer.pb.h"

namespace palpate {
namespace {

template <class Xyz>
Vector3 vector(const Xyz& v) {
  return {v.x(), v.y(), v.z()};
}

/// A tool at (0.1, 0, 0), rotated by 90° about y: its +z points along x.
DeviceTick lying() {
  DeviceTick tick;
  tick.measured_tool_position_world_m = Vector3(0.1, 0, 0);
  tick.measured_tool_orientation_world =
      Quaternion::FromTwoVectors(Vector3::UnitZ(), Vector3::UnitX());
  return tick;
}

foxglove::SceneEntity drawn(const DeviceTick& tick, const SceneState& scene) {
  foxglove::SceneUpdate update;
  EXPECT_TRUE(update.ParseFromString(encode_tool(7, tick, scene, Vector3::Zero())));
  EXPECT_EQ(update.entities_size(), 1);
  return update.entities(0);
}

TEST(FoxgloveTool, IsASphereIfThereIsNoShaft) {
  SceneState scene;
  scene.tip_radius_m = 0.003;
  const auto entity = drawn(lying(), scene);

  EXPECT_EQ(entity.cylinders_size(), 0);
  ASSERT_EQ(entity.spheres_size(), 1);
  EXPECT_EQ(vector(entity.spheres(0).pose().position()), Vector3(0.1, 0, 0));
  EXPECT_EQ(entity.spheres(0).size().x(), 0.006);
}

// 40 mm along x from 0.1: its middle at 0.12, its end at 0.14.
TEST(FoxgloveTool, HasItsShaftAlongItsZAxis) {
  SceneState scene;
  scene.shaft_length_m = 0.04;
  scene.shaft_radius_m = 0.002;
  const auto entity = drawn(lying(), scene);

  ASSERT_EQ(entity.cylinders_size(), 1);
  const foxglove::CylinderPrimitive& shaft = entity.cylinders(0);
  EXPECT_LT((vector(shaft.pose().position()) - Vector3(0.12, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(vector(shaft.size()), Vector3(0.004, 0.004, 0.04));
  const auto& q = shaft.pose().orientation();
  EXPECT_LT((Quaternion(q.w(), q.x(), q.y(), q.z()) * Vector3::UnitZ() - Vector3::UnitX()).norm(),
            1e-15);
  ASSERT_EQ(entity.spheres_size(), 2);
  EXPECT_LT((vector(entity.spheres(1).pose().position()) - Vector3(0.14, 0, 0)).norm(), 1e-15);
  EXPECT_EQ(entity.spheres(1).size().x(), 0.004);
}

TEST(FoxgloveTool, RotatesItsFrame) {
  foxglove::FrameTransforms transforms;
  ASSERT_TRUE(transforms.ParseFromString(encode_transforms(7, "tool", lying())));
  ASSERT_EQ(transforms.transforms_size(), 1);
  const auto& q = transforms.transforms(0).rotation();
  EXPECT_LT((Quaternion(q.w(), q.x(), q.y(), q.z()) * Vector3::UnitZ() - Vector3::UnitX()).norm(),
            1e-15);
}

TEST(Health, TellsOfEachSideWhatAPageShowsWithoutItsTelemetry) {
  ViewerHealth health;
  health.sides.push_back({.name = "left"});  // not heard yet
  health.sides.push_back({.name = "right",
                          .device_session_id = 7,
                          .phase = DevicePhase::kFaulted,
                          .device_faults = 2,
                          .last_fault = FaultReason::kMotorsDiffer,
                          .device = lying(),
                          .requested_force_newton = Vector3(0, 0, 2),
                          .hand_holder = 3,
                          .pointer = PointerConfig{.reach_m = 0.05},
                          .workspace_scale_ratio = 1.5});
  health.sides[1].device->guard = GuardState::kFault;
  health.sides[1].device->force_on_hand_newton = Vector3(0, 0, 1);

  v1::Health wire;
  ASSERT_TRUE(wire.ParseFromString(encode_health(health)));

  ASSERT_EQ(wire.sides_size(), 2);
  EXPECT_FALSE(wire.sides(0).has_tool_position_world_m());
  EXPECT_FALSE(wire.sides(0).has_requested_force_on_hand_newton());
  EXPECT_FALSE(wire.sides(0).has_pointer());
  const v1::Health::Side& side = wire.sides(1);
  EXPECT_EQ(side.name(), "right");
  EXPECT_EQ(side.device_session_id(), 7u);
  EXPECT_EQ(side.phase(), static_cast<std::uint32_t>(DevicePhase::kFaulted));
  EXPECT_EQ(side.device_faults(), 2u);
  EXPECT_EQ(side.last_fault(), static_cast<std::uint32_t>(FaultReason::kMotorsDiffer));
  EXPECT_EQ(side.guard(), static_cast<std::uint32_t>(GuardState::kFault));
  EXPECT_EQ(vector(side.tool_position_world_m()), Vector3(0.1, 0, 0));
  const auto& q = side.tool_orientation_world();
  EXPECT_LT((Quaternion(q.w(), q.x(), q.y(), q.z()) * Vector3::UnitZ() - Vector3::UnitX()).norm(),
            1e-15);
  EXPECT_EQ(vector(side.force_on_hand_newton()), Vector3(0, 0, 1));
  EXPECT_EQ(vector(side.requested_force_on_hand_newton()), Vector3(0, 0, 2));
  EXPECT_EQ(side.hand_holder(), 3u);
  EXPECT_EQ(side.pointer().reach_m(), 0.05);
  EXPECT_EQ(side.workspace_scale_ratio(), 1.5);
}

TEST(TaskMapMessage, HasAByteAndThreeFloatsOfEachPlace) {
  v1::TaskMap wire;
  ASSERT_TRUE(wire.ParseFromString(encode_task_map(
      {.places_m = {{0.5F, 0, -0.25F}, {1, 2, 3}},
       .is_searched = {1, 0},
       .lesions = {{.name = "lump", .center_m = {1, 2, 3}, .radius_m = 0.5, .is_found = true}},
       .slot_s = 0.2,
       .most_newton = {1.5F, 0.0F},
       .marks_s = {0.3},
       .limit_newton = 4.0})));
  std::array<float, 6> places{};
  ASSERT_EQ(wire.places_m().size(), sizeof(places));
  std::memcpy(places.data(), wire.places_m().data(), sizeof(places));
  EXPECT_EQ(places, (std::array<float, 6>{0.5F, 0, -0.25F, 1, 2, 3}));
  EXPECT_EQ(wire.is_searched(), std::string("\1\0", 2));
  ASSERT_EQ(wire.lesions_size(), 1);
  EXPECT_EQ(wire.lesions(0).center_m().z(), 3.0);
  EXPECT_TRUE(wire.lesions(0).is_found());
  EXPECT_EQ(wire.most_newton(0), 1.5F);
  EXPECT_EQ(wire.marks_s(0), 0.3);
}

// A page encodes a HandTarget with the schema that it has from /scene_state.
TEST(Schema, OfTheSceneIncludesTheMessagesThatAPageSends) {
  google::protobuf::FileDescriptorSet set;
  ASSERT_TRUE(set.ParseFromString(schema_of("palpate.v1.SceneState")));

  google::protobuf::DescriptorPool pool;
  for (const auto& file : set.file()) ASSERT_NE(pool.BuildFile(file), nullptr) << file.name();

  for (const char* sent : {"HandTarget", "TissueChange", "Acknowledgement"}) {
    EXPECT_NE(pool.FindMessageTypeByName(std::string("palpate.v1.") + sent), nullptr) << sent;
  }
}

}  // namespace
}  // namespace palpate
