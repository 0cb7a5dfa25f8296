// SPDX-License-Identifier: Apache-2.0
// The scene kept for viewers that come later.
#include "viewer_node/feed/scene_mirror.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace palpate::viewer {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

SceneState scene(std::uint64_t session_id = 1) {
  SceneState scene;
  scene.header.session_id = session_id;
  scene.revision = 1;
  scene.tissues.resize(2);
  for (TissueSurface& tissue : scene.tissues) tissue.mesh.vertices_m = {0, 0, 0, 1, 1, 1, 2, 2, 2};
  return scene;
}
MeshFrame frame(std::uint32_t tissue, std::uint32_t first, std::vector<float> vertices_m,
                std::uint64_t session_id = 1) {
  MeshFrame frame;
  frame.header.session_id = session_id;
  frame.scene_revision = 1;
  frame.tissue = tissue;
  frame.first_vertex = first;
  frame.vertices_m = std::move(vertices_m);
  return frame;
}

// physics_node sends its scene again whenever another viewer subscribes to it.
TEST(SceneMirror, IgnoresASceneThatIsKnown) {
  SceneMirror mirror;
  EXPECT_TRUE(mirror.take(scene()));
  ASSERT_TRUE(mirror.take(frame(0, 1, {1, 1, 9})));

  SceneState again = scene();
  again.header.sequence = 7;
  EXPECT_FALSE(mirror.take(again));
  EXPECT_THAT(mirror.whole_frames(), SizeIs(1));

  SceneState revised = scene();
  revised.revision = 2;
  EXPECT_TRUE(mirror.take(revised));
  EXPECT_THAT(mirror.whole_frames(), IsEmpty());
  EXPECT_TRUE(mirror.take(scene(2)));  // of a restarted physics_node
}

TEST(SceneMirror, PutsRangesTogether) {
  SceneMirror mirror;
  mirror.take(scene());
  EXPECT_TRUE(mirror.take(frame(1, 1, {1, 1, 9})));
  EXPECT_TRUE(mirror.take(frame(1, 2, {2, 2, 8})));

  const auto frames = mirror.whole_frames();
  ASSERT_THAT(frames, SizeIs(1));
  EXPECT_EQ(frames[0].tissue, 1u);
  EXPECT_EQ(frames[0].first_vertex, 0u);
  EXPECT_THAT(frames[0].vertices_m, ElementsAre(0, 0, 0, 1, 1, 9, 2, 2, 8));
  EXPECT_THAT(mirror.vertices_m(1), ElementsAre(0, 0, 0, 1, 1, 9, 2, 2, 8));
  EXPECT_THAT(mirror.vertices_m(0), ElementsAre(0, 0, 0, 1, 1, 1, 2, 2, 2));
}

TEST(SceneMirror, PutsTissueWhereItIs) {
  SceneMirror mirror;
  mirror.take(scene());
  const auto displaced = [](std::vector<float> vertices_m, const Vector3& by_m) {
    MeshFrame moved = frame(1, 1, std::move(vertices_m));
    moved.displacement_world_m = by_m;
    return moved;
  };

  // only moved: its vertices need not travel again
  ASSERT_TRUE(mirror.take(displaced({}, Vector3(0, 0, 0.5))));
  ASSERT_THAT(mirror.whole_frames(), SizeIs(1));
  EXPECT_THAT(mirror.whole_frames()[0].vertices_m, IsEmpty());
  EXPECT_EQ(mirror.whole_frames()[0].displacement_world_m, Vector3(0, 0, 0.5));
  EXPECT_THAT(mirror.vertices_m(1), ElementsAre(0, 0, 0.5, 1, 1, 1.5, 2, 2, 2.5));

  // dented, then moved on with its dent
  ASSERT_TRUE(mirror.take(displaced({1, 1, 9}, Vector3(0, 0, 0.5))));
  ASSERT_TRUE(mirror.take(displaced({}, Vector3(-1, 0, 0))));
  ASSERT_THAT(mirror.whole_frames(), SizeIs(1));
  EXPECT_THAT(mirror.whole_frames()[0].vertices_m, ElementsAre(0, 0, 0, 1, 1, 9, 2, 2, 2));
  EXPECT_EQ(mirror.whole_frames()[0].displacement_world_m, Vector3(-1, 0, 0));
  EXPECT_THAT(mirror.vertices_m(1), ElementsAre(-1, 0, 0, 0, 1, 9, 1, 2, 2));
  EXPECT_THAT(mirror.vertices_m(0), ElementsAre(0, 0, 0, 1, 1, 1, 2, 2, 2));
}

TEST(SceneMirror, RefusesFramesThatFitNoScene) {
  SceneMirror mirror;
  EXPECT_FALSE(mirror.take(frame(0, 0, {})));
  mirror.take(scene());
  EXPECT_FALSE(mirror.take(frame(0, 0, {0, 0, 1}, 2)));  // of another physics_node
  EXPECT_FALSE(mirror.take(frame(2, 0, {0, 0, 1})));     // of a tissue that is not there
  EXPECT_FALSE(mirror.take(frame(0, 3, {0, 0, 1})));     // beyond the last vertex
  EXPECT_FALSE(mirror.take(frame(0, 2, {0, 0, 1, 0, 0, 1})));
  EXPECT_FALSE(mirror.take(frame(0, 4'294'967'295U, {})));
  MeshFrame other = frame(0, 0, {0, 0, 1});
  other.scene_revision = 2;
  EXPECT_FALSE(mirror.take(other));
  EXPECT_THAT(mirror.whole_frames(), IsEmpty());
  EXPECT_TRUE(mirror.take(frame(0, 3, {})));
}

TEST(SceneMirror, ForgetsMotionWithTheSceneItBelongedTo) {
  SceneMirror mirror;
  mirror.take(scene());
  ASSERT_TRUE(mirror.take(frame(0, 0, {0, 0, 1})));
  mirror.take(scene());  // the same again, for somebody else
  EXPECT_THAT(mirror.whole_frames(), SizeIs(1));

  mirror.take(scene(2));
  EXPECT_THAT(mirror.whole_frames(), IsEmpty());
  ASSERT_TRUE(mirror.take(frame(0, 0, {0, 0, 1}, 2)));
  mirror.forget_motion();
  EXPECT_THAT(mirror.whole_frames(), IsEmpty());
  EXPECT_THAT(mirror.vertices_m(0), ElementsAre(0, 0, 0, 1, 1, 1, 2, 2, 2));
}

}  // namespace
}  // namespace palpate::viewer
