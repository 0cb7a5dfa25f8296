// SPDX-License-Identifier: Apache-2.0
// What viewers receive of the scene; without viewers nothing is sent or computed.
#include "physics_node/display/scene_display.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "physics_node/display/display.h"
#include "physics_node/files/ply.h"
#include "tests/support/machine/places.h"
#include "tests/support/sampled_clouds.h"
#include "tests/support/temp_folder.h"

namespace palpate::physics {
namespace {

using namespace std::chrono_literals;
using testing::IsEmpty;
using testing::SizeIs;

template <class T>
class Kept final : public Sender<T> {
 public:
  SendResult send(const T& message) noexcept override {
    messages.push_back(message);
    return result;
  }
  SendResult result = SendResult::kSent;
  std::vector<T> messages;
};

class SceneDisplayTest : public testing::Test {
 protected:
  SceneDisplayTest() {
    session_.name = "probe";
    session_.text = "name: \"probe\"";
    session_.side().device.rate_hz = 500;
    session_.scene.tip_radius_m = 0.003;
    session_.scene.shaft_length_m = 0.1;
    session_.scene.shaft_radius_m = 0.002;
    session_.side().hand.pointer = PointerConfig{};
    // two blocks side by side, tops at z = 0; the second is 1 m away. τ = 2/200 = 10 ms
    const KelvinVoigtMaterial soft{.stiffness_newton_per_m = 200, .damping_newton_s_per_m = 2};
    for (const double x : {0.0, 1.0}) {
      session_.scene.tissues.push_back({.name = "block at " + std::to_string(static_cast<int>(x)),
                                        .geometry = BoxGeometry{.center_m = Vector3(x, 0, -0.02),
                                                                .size_m = Vector3(0.1, 0.1, 0.04)},
                                        .material = soft});
    }
    display_.emplace(session_, 77, scenes_, meshes_);
  }

  /// The tip `depth_m` deep in the first block, `later` than before.
  void publish(double depth_m, Duration later = 20ms) {
    now_ += later;
    PhysicsTick tick;
    tick.device_sequence = 9;
    tick.tool_position_world_m = Vector3(0, 0, 0.003 - depth_m);
    display_->publish(watchers_, {&tick, 1}, now_);
  }
  [[nodiscard]] PhysicsCounters counters() const {
    PhysicsCounters counters;
    display_->count_into(counters);
    return counters;
  }
  void watch_mesh() {
    ++watchers_.mesh_subscriptions;
    watchers_.has_mesh_watcher = true;
  }

  Session session_;
  Kept<SceneState> scenes_;
  Kept<MeshFrame> meshes_;
  std::optional<SceneDisplay> display_;
  Watchers watchers_;
  TimePoint now_{1s};
};

TEST_F(SceneDisplayTest, TellsWhatTheToolReachesWhereThatIsKnown) {
  WorkspaceConfig& workspace = session_.side().device.workspace;
  workspace.scale_ratio = 2.0;
  workspace.offset_m = Vector3(0.01, 0.0, 0.03);
  const std::optional<ReachBox> reach = scene_of(session_, 1).reach;
  ASSERT_TRUE(reach.has_value());
  EXPECT_EQ(reach->center_m, Vector3(0.01, 0.0, 0.03));
  EXPECT_EQ(reach->half_extent_m, 2.0 * kSimulatedHalfExtent_m);

  FalconConfig falcon;
  falcon.workspace_half_extent_m = Vector3::Constant(0.03);
  session_.side().driver = falcon;
  EXPECT_EQ(scene_of(session_, 1).reach->half_extent_m, Vector3::Constant(0.06));
  session_.side().driver = PluginConfig{};
  EXPECT_FALSE(scene_of(session_, 1).reach.has_value());
  session_.side().driver = std::monostate{};
  workspace.clutch_button = 0;
  EXPECT_FALSE(scene_of(session_, 1).reach.has_value());
}

TEST_F(SceneDisplayTest, SendsNothingWithoutSubscribers) {
  for (int i = 0; i < 10; ++i) publish(2e-3);
  EXPECT_THAT(scenes_.messages, IsEmpty());
  EXPECT_THAT(meshes_.messages, IsEmpty());
}

// 2 s of 20 ms: 60 times a frame is due, and at the beginning.
TEST_F(SceneDisplayTest, CountsFramesSkippedWithoutSubscribers) {
  for (int i = 0; i < 100; ++i) publish(2e-3);
  EXPECT_NEAR(static_cast<double>(counters().meshes_skipped), 60.0, 1.0);
  EXPECT_EQ(counters().mesh_frames, 0u);
}

TEST_F(SceneDisplayTest, CountsFramesMadeForSubscribers) {
  watch_mesh();
  for (int i = 0; i < 100; ++i) publish(1e-3 + 5e-5 * i);
  EXPECT_EQ(counters().mesh_frames, meshes_.messages.size());
  EXPECT_GT(counters().mesh_frames, 0u);
  EXPECT_EQ(counters().meshes_skipped, 0u);

  // without subscribers frames are skipped
  const std::uint64_t made = counters().mesh_frames;
  watchers_.has_mesh_watcher = false;
  for (int i = 0; i < 100; ++i) publish(2e-3);
  EXPECT_EQ(counters().mesh_frames, made);
  EXPECT_NEAR(static_cast<double>(counters().meshes_skipped), 60.0, 1.0);
}

TEST_F(SceneDisplayTest, SkipsNothingBeforeThereIsAnyMotion) {
  for (int i = 0; i < 10; ++i) display_->publish(watchers_, {}, now_ += 40ms);
  EXPECT_EQ(counters().meshes_skipped, 0u);
}

TEST_F(SceneDisplayTest, SendsTheCompleteSceneOncePerSubscription) {
  watchers_.scene_subscriptions = 1;
  for (int i = 0; i < 3; ++i) publish(0.0);
  ASSERT_THAT(scenes_.messages, SizeIs(1));
  const SceneState& scene = scenes_.messages[0];
  EXPECT_EQ(scene.header.session_id, 77u);
  EXPECT_EQ(scene.revision, 1u);
  EXPECT_EQ(scene.session_name, "probe");
  EXPECT_EQ(scene.session_text, "name: \"probe\"");
  EXPECT_EQ(scene.controller, "mofc guard");
  EXPECT_EQ(scene.device_rate_hz, 500.0);
  EXPECT_EQ(scene.tip_radius_m, 0.003);
  EXPECT_EQ(scene.shaft_length_m, 0.1);
  EXPECT_EQ(scene.shaft_radius_m, 0.002);
  EXPECT_TRUE(scene.pointer.has_value());
  ASSERT_THAT(scene.tissues, SizeIs(2));
  EXPECT_EQ(scene.tissues[1].name, "block at 1");
  EXPECT_EQ(scene.tissues[1].shape, TissueShape::kBox);
  EXPECT_EQ(scene.tissues[1].stiffness_newton_per_m, 200.0);
  EXPECT_EQ(scene.tissues[1].damping_newton_s_per_m, 2.0);
  EXPECT_FALSE(scene.tissues[1].mesh.triangles.empty());

  watchers_.scene_subscriptions = 2;
  publish(0.0);
  ASSERT_THAT(scenes_.messages, SizeIs(2));
  EXPECT_EQ(scenes_.messages[1].header.sequence, 1u);
  EXPECT_EQ(scenes_.messages[1].revision, 1u);
}

// So that viewers that have the scene can ignore the repetition for a newcomer.
TEST_F(SceneDisplayTest, RepeatsTheSameSceneUnderTheSameRevision) {
  watch_mesh();
  for (std::uint64_t subscriptions = 1; subscriptions <= 3; ++subscriptions) {
    watchers_.scene_subscriptions = subscriptions;
    for (int i = 0; i < 5; ++i) publish(2e-3);  // dented in between
  }
  ASSERT_THAT(scenes_.messages, SizeIs(3));
  const SceneState& first = scenes_.messages[0];
  for (const SceneState& again : scenes_.messages) {
    EXPECT_EQ(again.header.session_id, first.header.session_id);
    EXPECT_EQ(again.revision, first.revision);
    ASSERT_EQ(again.tissues.size(), first.tissues.size());
    for (std::size_t i = 0; i < first.tissues.size(); ++i) {
      EXPECT_EQ(again.tissues[i].mesh.vertices_m, first.tissues[i].mesh.vertices_m);
      EXPECT_EQ(again.tissues[i].mesh.triangles, first.tissues[i].mesh.triangles);
    }
  }
  for (const MeshFrame& frame : meshes_.messages) EXPECT_EQ(frame.scene_revision, first.revision);
  EXPECT_FALSE(meshes_.messages.empty());
}

// Spheres of 10 mm: edges of 1 mm take four divisions of an icosahedron, 2562 vertices; 300 000 /
// 200 allow 642 each, 300 000 / 10 000 twelve. 12 bytes a vertex and each of its two triangles: 36.
TEST_F(SceneDisplayTest, DrawsManyTissuesLessFinelyThanOne) {
  for (const std::size_t count : {std::size_t{1}, std::size_t{200}, std::size_t{10'000}}) {
    Session session = session_;
    session.scene.tissues.assign(count, session_.scene.tissues[0]);
    for (TissueConfig& tissue : session.scene.tissues) tissue.geometry = SphereGeometry{};
    SceneDisplay display(session, 1, scenes_, meshes_);
    display.publish({.scene_subscriptions = 1}, {}, now_);
    ASSERT_EQ(scenes_.messages.back().tissues.size(), count);
    const std::size_t each = scenes_.messages.back().tissues[0].mesh.vertex_count();
    EXPECT_EQ(each, count == 1 ? 2562u : count == 200 ? 642u : 12u);
    EXPECT_LT(36 * each * count, std::size_t{12} << 20);
  }
}

TEST_F(SceneDisplayTest, ReportsThatTheLinkDroppedTheScene) {
  watchers_.scene_subscriptions = 1;
  publish(0.0);
  EXPECT_FALSE(display_->is_too_large());

  scenes_.result = SendResult::kDropped;
  watchers_.scene_subscriptions = 2;
  publish(0.0);
  EXPECT_TRUE(display_->is_too_large());
}

// Two tips 60 mm apart, each 2 mm deep, in one block: dents as each makes alone.
TEST_F(SceneDisplayTest, DentsOfAllToolsAreInOneMesh) {
  const auto dented = [this](const std::vector<double>& tips_x_m) {
    std::vector<PhysicsTick> ticks(tips_x_m.size());
    for (std::size_t i = 0; i < ticks.size(); ++i) {
      ticks[i].tool_position_world_m = Vector3(tips_x_m[i], 0, 0.001);
    }
    meshes_.messages.clear();
    watch_mesh();
    now_ += 1s;  // what was before has relaxed
    display_->publish(watchers_, ticks, now_);
    std::pair<int, int> left_and_right;
    for (const MeshFrame& frame : meshes_.messages) {
      for (std::size_t v = 0; v < frame.vertices_m.size(); v += 3) {
        const bool is_deep = frame.vertices_m[v + 2] < -1e-3F && frame.vertices_m[v + 2] > -3e-3F;
        if (is_deep) ++(frame.vertices_m[v] < 0.0F ? left_and_right.first : left_and_right.second);
      }
    }
    return left_and_right;
  };

  const auto left = dented({-0.03});
  const auto right = dented({0.03});
  const auto both = dented({-0.03, 0.03});

  EXPECT_GT(left.first, 0);
  EXPECT_EQ(left.second, 0);
  EXPECT_GT(right.second, 0);
  EXPECT_EQ(both, std::pair(left.first, right.second));
}

TEST_F(SceneDisplayTest, SendsFramesOnlyOfTissueThatMoves) {
  watch_mesh();
  publish(-1e-3);
  EXPECT_THAT(meshes_.messages, IsEmpty());

  publish(2e-3, 40ms);
  ASSERT_THAT(meshes_.messages, SizeIs(1));
  const MeshFrame& frame = meshes_.messages[0];
  EXPECT_EQ(frame.header.session_id, 77u);
  EXPECT_EQ(frame.header.sampled_at, now_);
  EXPECT_EQ(frame.scene_revision, 1u);
  EXPECT_EQ(frame.tissue, 0u);
  EXPECT_EQ(frame.displacement_world_m, Vector3(0, 0, 0));
  EXPECT_EQ(frame.device_sequence, 9u);

  // held still: nothing moves
  publish(2e-3, 40ms);
  EXPECT_THAT(meshes_.messages, SizeIs(1));
  // let go: 10 ms later a bit is left, 1 s later nothing
  publish(-1e-3, 40ms);
  publish(-1e-3, 1s);
  const std::size_t frames = meshes_.messages.size();
  EXPECT_EQ(frames, 3u);
  publish(-1e-3, 1s);
  EXPECT_THAT(meshes_.messages, SizeIs(frames));
}

TEST_F(SceneDisplayTest, SendsAtMostThirtyFramesPerSecond) {
  watch_mesh();
  // 2 s of 20 ms, the tip deeper each time
  for (int i = 0; i < 100; ++i) publish(1e-3 + 5e-5 * i);
  EXPECT_LE(meshes_.messages.size(), 61u);
  EXPECT_GE(meshes_.messages.size(), 50u);
}

TEST_F(SceneDisplayTest, SendsAHeldDentToALateViewer) {
  watch_mesh();
  publish(2e-3);
  publish(2e-3, 40ms);
  ASSERT_THAT(meshes_.messages, SizeIs(1));

  watch_mesh();
  publish(2e-3, 1ms);

  ASSERT_THAT(meshes_.messages, SizeIs(2));
  EXPECT_EQ(meshes_.messages[1].vertices_m, meshes_.messages[0].vertices_m);
}

// --- tissue with a motion of its own ------------------------------------------------------------

/// The first block oscillates by 5 mm along z at 0.25 Hz.
class MovingTissue : public SceneDisplayTest {
 protected:
  MovingTissue() {
    session_.scene.tissues[0].motion = {.amplitude_m = Vector3(0, 0, 5e-3), .frequency_hz = 0.25};
    display_.emplace(session_, 77, scenes_, meshes_);
  }
  /// @param at_s  of the step; at 1 s the tissue is 5 mm up, at 3 s 5 mm down
  void step(double at_s, double tip_z_m, Duration later = 40ms) {
    now_ += later;
    const PhysicsTick tick{.stepped_at = TimePoint(from_seconds(at_s)),
                           .tool_position_world_m = Vector3(0, 0, tip_z_m)};
    display_->publish(watchers_, {&tick, 1}, now_);
  }
  static float lowest_top_m(const MeshFrame& frame) {
    float lowest_m = 1.0F;
    for (std::size_t i = 2; i < frame.vertices_m.size(); i += 3) {
      if (frame.vertices_m[i] > -0.01F) lowest_m = std::min(lowest_m, frame.vertices_m[i]);
    }
    return lowest_m;
  }
};

TEST_F(MovingTissue, IsSentAsADisplacementWithoutVertices) {
  watch_mesh();
  step(1.0, 0.1);
  step(3.0, 0.1);

  ASSERT_THAT(meshes_.messages, SizeIs(2));  // the other block rests
  for (const MeshFrame& frame : meshes_.messages) {
    EXPECT_EQ(frame.tissue, 0u);
    EXPECT_THAT(frame.vertices_m, IsEmpty());
  }
  EXPECT_NEAR((meshes_.messages[0].displacement_world_m - Vector3(0, 0, 5e-3)).norm(), 0, 1e-12);
  EXPECT_NEAR((meshes_.messages[1].displacement_world_m + Vector3(0, 0, 5e-3)).norm(), 0, 1e-12);
  EXPECT_EQ(counters().mesh_frames, 2u);
}

TEST_F(MovingTissue, IsSentAtMostThirtyTimesPerSecond) {
  watch_mesh();
  for (int i = 0; i < 100; ++i) step(0.02 * i, 0.1, 20ms);
  EXPECT_NEAR(static_cast<double>(meshes_.messages.size()), 60.0, 1.0);
}

TEST_F(MovingTissue, IsNotSentWithoutAViewer) {
  for (int i = 0; i < 100; ++i) step(0.02 * i, 0.1, 20ms);
  EXPECT_THAT(meshes_.messages, IsEmpty());
}

TEST_F(MovingTissue, IsSentToALateViewerAtOnce) {
  watch_mesh();
  step(1.0, 0.1);
  watch_mesh();
  step(1.0, 0.1, 1ms);
  ASSERT_THAT(meshes_.messages, SizeIs(2));
  EXPECT_NEAR(meshes_.messages[1].displacement_world_m.z(), 5e-3, 1e-12);
}

// The tip's lowest point at z = 3 mm: 2 mm deep in a top at 5 mm, 8 mm above one at −5 mm. The
// same tip at −7 mm is 2 mm deep there: the same dent, as vertices do not have the motion in them.
TEST_F(MovingTissue, IsDentedWhereItIs) {
  watch_mesh();
  step(1.0, 0.1);
  step(1.0, 6e-3);
  step(3.0, 6e-3, 1s);  // τ = 10 ms: what was pressed has come back
  step(3.0, -4e-3);

  ASSERT_THAT(meshes_.messages, SizeIs(4));
  const std::vector<float>& up_m = meshes_.messages[1].vertices_m;
  const std::vector<float>& down_m = meshes_.messages[3].vertices_m;
  EXPECT_NEAR(lowest_top_m(meshes_.messages[1]), -2e-3F, 5e-4F);  // of the nearest vertex
  EXPECT_EQ(lowest_top_m(meshes_.messages[2]), 0.0F);
  ASSERT_EQ(up_m.size(), down_m.size());
  for (std::size_t i = 0; i < up_m.size(); ++i) EXPECT_NEAR(down_m[i], up_m[i], 1e-7F);
}

// 30 move: 12 at a time, so all of them within three times.
TEST_F(MovingTissue, IsSentInTurnWhereManyMove) {
  session_.scene.tissues.assign(30, session_.scene.tissues[0]);
  display_.emplace(session_, 77, scenes_, meshes_);
  watch_mesh();
  std::set<std::uint32_t> sent;
  for (int i = 0; i < 3; ++i) {
    meshes_.messages.clear();
    step(0.04 * i, 0.1);
    EXPECT_THAT(meshes_.messages, SizeIs(12));
    for (const MeshFrame& frame : meshes_.messages) sent.insert(frame.tissue);
  }
  EXPECT_THAT(sent, SizeIs(30));
}

TEST_F(MovingTissue, MovesEvenIfItIsNeverDented) {
  session_.scene.tissues[0].material = KelvinVoigtMaterial{.stiffness_newton_per_m = 0};
  watch_mesh();
  step(1.0, 6e-3);
  ASSERT_THAT(meshes_.messages, SizeIs(1));
  EXPECT_THAT(meshes_.messages[0].vertices_m, IsEmpty());
  EXPECT_NEAR(meshes_.messages[0].displacement_world_m.z(), 5e-3, 1e-12);
}

TEST_F(SceneDisplayTest, ForgetsDentsThatNobodyWatched) {
  watch_mesh();
  publish(2e-3);
  watchers_.has_mesh_watcher = false;
  publish(2e-3);
  publish(-1e-3);

  watch_mesh();
  publish(-1e-3);

  EXPECT_THAT(meshes_.messages, SizeIs(1));  // the one from before: there is no dent now
}

TEST_F(SceneDisplayTest, SendsNoFrameBeforeTheFirstMotion) {
  watch_mesh();
  watchers_.scene_subscriptions = 1;
  display_->publish(watchers_, {}, now_);
  EXPECT_THAT(scenes_.messages, SizeIs(1));
  EXPECT_THAT(meshes_.messages, IsEmpty());
}

// A ball of 40 mm whose top is at z = 0, three times as stiff as its material everywhere.
TEST_F(SceneDisplayTest, ShowsTissueFromAFileAndItsDent) {
  const test::TempFolder folder;
  Random random(1);
  PointCloud cloud =
      test::sampled(test::sphere_shape(0.02), 1e-3, 0.0, true, test::Sampling::kEven, random);
  cloud.stiffness_ratios.assign(cloud.points_m.size(), 3.0);
  session_.scene.tissues[0].geometry =
      FileGeometry{.kind = FileGeometry::Kind::kPointCloud,
                   .file = folder.write("ball.ply", ply_text(cloud)),
                   .stiffness_property = "stiffness_ratio",
                   .position_m = Vector3(0, 0, -0.02)};
  display_.emplace(session_, 77, scenes_, meshes_);
  watchers_.scene_subscriptions = 1;
  watch_mesh();
  publish(2e-3);
  publish(2e-3, 40ms);

  ASSERT_THAT(scenes_.messages, SizeIs(1));
  const TissueSurface& ball = scenes_.messages[0].tissues[0];
  EXPECT_EQ(ball.shape, TissueShape::kPointCloud);
  EXPECT_FALSE(ball.mesh.triangles.empty());
  ASSERT_EQ(ball.vertex_stiffness_newton_per_m.size(), ball.mesh.vertex_count());
  EXPECT_NEAR(ball.vertex_stiffness_newton_per_m[0], 3.0F * 200.0F, 0.01F);

  // the deepest vertex under the tip: pressed 2 mm below the top of the ball, at z = 0
  ASSERT_THAT(meshes_.messages, SizeIs(1));
  EXPECT_EQ(meshes_.messages[0].tissue, 0u);
  double nearest_m = 1.0;
  double height_m = 1.0;
  for (std::size_t i = 0; i < meshes_.messages[0].vertices_m.size(); i += 3) {
    const float* v = &meshes_.messages[0].vertices_m[i];
    if (v[2] < -0.02F || std::hypot(v[0], v[1]) > nearest_m) continue;
    nearest_m = std::hypot(v[0], v[1]);
    height_m = v[2];
  }
  EXPECT_NEAR(height_m, -2e-3, 3e-4);
}

TEST_F(SceneDisplayTest, LeavesTissueWithoutForceFlat) {
  session_.scene.tissues[0].material = KelvinVoigtMaterial{.stiffness_newton_per_m = 0};
  watch_mesh();
  publish(2e-3);
  EXPECT_THAT(meshes_.messages, IsEmpty());
}

// 100 × 100 × 50 mm of 15 kPa with a ball of 150 kPa in it.
TEST_F(SceneDisplayTest, ShowsTheStiffnessOfAnElasticBodyAndItsParts) {
  ElasticMaterial material{.young_pa = 15e3, .poisson_ratio = 0.45};
  material.is_linear = true;
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0499}}};
  const Vector3 ball_m(0, 0, -0.016);
  material.parts = {{.where = SphereGeometry{.center_m = ball_m, .radius_m = 0.0095},
                     .young_pa = 150e3,
                     .poisson_ratio = 0.45,
                     .density_kg_per_m3 = 1000.0}};
  session_.scene.tissues[0] = {
      .name = "body",
      .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                               .file = test::source_dir() + "/deploy/sessions/block.msh"},
      .material = material};
  const auto elastic = ElasticTissues::of(session_.scene, 1, ElasticPace::kVirtual);
  display_.emplace(session_, 77, scenes_, meshes_, elastic);
  ++watchers_.scene_subscriptions;
  watch_mesh();
  publish(-0.01);

  // the other tissue keeps its index
  ASSERT_THAT(scenes_.messages, SizeIs(1));
  const auto& tissues = scenes_.messages[0].tissues;
  ASSERT_THAT(tissues, SizeIs(3));
  EXPECT_EQ(tissues[1].name, "block at 1");
  EXPECT_EQ(tissues[2].name, "body, part 1");
  // dF/dδ of Hertz's F = 4/3 E/(1 − ν²) √R δ^1.5 at 1 mm
  const double soft = 2.0 * 15e3 / (1.0 - 0.45 * 0.45) * std::sqrt(0.003 * 0.001);
  const auto& ball = tissues[2];
  ASSERT_THAT(tissues[0].vertex_stiffness_newton_per_m, SizeIs(tissues[0].mesh.vertex_count()));
  ASSERT_THAT(ball.vertex_stiffness_newton_per_m, SizeIs(ball.mesh.vertex_count()));
  for (const float k : tissues[0].vertex_stiffness_newton_per_m) EXPECT_NEAR(k, soft, 1e-3);
  for (const float k : ball.vertex_stiffness_newton_per_m) EXPECT_NEAR(k, 10.0 * soft, 1e-2);

  // a closed surface about the ball: its divergence is its volume
  double volume_m3 = 0.0;
  const auto corner_m = [&](std::size_t i) {
    const float* at = &ball.mesh.vertices_m[std::size_t{3} * ball.mesh.triangles[i]];
    return Vector3(at[0], at[1], at[2]);
  };
  for (std::size_t t = 0; t < ball.mesh.triangles.size(); t += 3) {
    volume_m3 += corner_m(t).dot(corner_m(t + 1).cross(corner_m(t + 2))) / 6.0;
    EXPECT_LT((corner_m(t) - ball_m).norm(), 0.02);
  }
  EXPECT_NEAR(volume_m3, 4.0 / 3.0 * 3.14159 * std::pow(0.0095, 3), 0.3 * volume_m3);

  // pressed 8 mm deep above the ball, both move
  for (int tick = 0; tick < 400; ++tick) {
    SceneForce force;
    elastic->step(0, Vector3(0, 0, 0.003 - 2e-5 * tick), 1e-3 * tick, 0.05, force);
    if (tick % 33 == 0) publish(-0.01, 33ms);
  }
  std::map<std::uint32_t, const MeshFrame*> newest;
  for (const MeshFrame& frame : meshes_.messages) newest[frame.tissue] = &frame;
  for (const std::uint32_t tissue : {0U, 2U}) {
    ASSERT_TRUE(newest.contains(tissue));
    const auto& rest_m = tissues[tissue].mesh.vertices_m;
    const auto& now_m = newest[tissue]->vertices_m;
    ASSERT_THAT(now_m, SizeIs(rest_m.size()));
    EXPECT_THAT(newest[tissue]->vertex_strain, SizeIs(rest_m.size() / 3));
    float lowered_m = 0.0F;
    for (std::size_t i = 2; i < rest_m.size(); i += 3) {
      lowered_m = std::max(lowered_m, rest_m[i] - now_m[i]);
    }
    EXPECT_GT(lowered_m, 1e-3F) << tissue;
    EXPECT_LT(lowered_m, 0.012F) << tissue;
  }
}

// Frames are of the newest mesh, and who comes late gets that.
TEST_F(SceneDisplayTest, SendsTheSurfaceOfAnAblatedBodyAsANewRevision) {
  ElasticMaterial material{.young_pa = 15e3, .poisson_ratio = 0.45};
  material.is_linear = true;
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0499}}};
  session_.scene.tissues[0] = {
      .name = "body",
      .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                               .file = test::source_dir() + "/deploy/sessions/block.msh"},
      .material = material};
  session_.scene.electrode = ElectrodeConfig{.reach_m = 0.012, .energy_joule_per_kg = 2e3};
  const auto elastic = ElasticTissues::of(session_.scene, 1, ElasticPace::kVirtual);
  display_.emplace(session_, 77, scenes_, meshes_, elastic);
  ++watchers_.scene_subscriptions;
  watch_mesh();
  publish(-0.01);
  for (int tick = 0; tick < 1500; ++tick) {
    SceneForce force;
    const double z_m = std::max(0.001, 0.003 - 2e-5 * tick);
    elastic->step(0, Vector3(0, 0, z_m), 1e-3 * tick, 0.05, force, {}, tick > 200 && tick < 800);
    if (tick % 33 == 0) publish(-0.01, 33ms);
  }
  PhysicsCounters counters;
  elastic->count_into(counters);
  ASSERT_GT(counters.elastic_elements_removed, 0U);

  ASSERT_GT(scenes_.messages.size(), 1U);
  EXPECT_LE(scenes_.messages.size(), 1U + 1500U / 200U + 1U) << "at most 5 Hz";
  const SceneState& newest = scenes_.messages.back();
  EXPECT_EQ(newest.revision, scenes_.messages.size());
  const ElasticBody& body = *elastic->tissues()[0]->ablation().present().body();
  EXPECT_THAT(newest.tissues[0].mesh.vertices_m, SizeIs(3 * body.surface_nodes.size()));
  EXPECT_EQ(newest.tissues[1].name, "block at 1");
  const MeshFrame& frame = meshes_.messages.back();
  EXPECT_EQ(frame.scene_revision, newest.revision);
  EXPECT_THAT(frame.vertices_m, SizeIs(newest.tissues[0].mesh.vertices_m.size()));
  // each is of the mesh of its revision
  for (const MeshFrame& one : meshes_.messages) {
    if (one.tissue != 0) continue;
    ASSERT_LE(one.scene_revision, newest.revision);
    EXPECT_EQ(one.vertices_m.size(),
              scenes_.messages[one.scene_revision - 1].tissues[0].mesh.vertices_m.size());
  }

  ++watchers_.scene_subscriptions;
  publish(-0.01, 33ms);
  EXPECT_EQ(scenes_.messages.back().revision, newest.revision);
  EXPECT_EQ(scenes_.messages.back().tissues[0].mesh.triangles, newest.tissues[0].mesh.triangles);

  elastic->restore(0);
  for (int tick = 1500; tick < 1800; ++tick) {
    SceneForce force;
    elastic->step(0, Vector3(0, 0, 0.003), 1e-3 * tick, 0.05, force);
    if (tick % 33 == 0) publish(-0.01, 33ms);
  }
  EXPECT_EQ(scenes_.messages.back().tissues[0].mesh.vertices_m,
            scenes_.messages.front().tissues[0].mesh.vertices_m);
}

}  // namespace
}  // namespace palpate::physics
