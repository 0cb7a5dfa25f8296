// SPDX-License-Identifier: Apache-2.0
// The tool as drawn by general-purpose viewers, from Foxglove messages.
#include "common/link/codec/viewer_codec.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <gtest/gtest.h>

#include "foxglove/foxglove_subset.pb.h"

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
