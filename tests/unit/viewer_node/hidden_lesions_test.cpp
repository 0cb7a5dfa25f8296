// SPDX-License-Identifier: Apache-2.0
// Nothing that leaves viewer_node tells where lesions are before the task has ended.
#include "viewer_node/task/hidden_lesions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "common/link/codec/viewer_codec.h"
#include "common/session/session_file.h"
#include "viewer_node/task/task_view.h"

namespace palpate::viewer {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr const char* kSession = R"(
  name: "x"
  scene {
    tool { tip_radius_m: 0.006 }
    tissue {
      name: "block"
      half_space {}
      kelvin_voigt {
        stiffness_newton_per_m: 400
        inclusion { center_m { x: 0.0123 z: -0.01 } radius_m: 0.005 stiffness_newton_per_m: 1500 }
      }
    }
  }
  task { palpation { tissue: "block" target { name: "secret" lesion: 0 } } }
)";

/// As physics_node sends it: the tissue of the session, then the surface of a part.
SceneState whole_scene() {
  SceneState scene;
  scene.header.session_id = 7;
  scene.revision = 1;
  scene.session_name = "x";
  scene.session_text = "secret 0.0123";
  scene.controller = "mofc guard";
  scene.device_rate_hz = scene.physics_rate_hz = 1000.0;
  scene.peak_force_newton = 3.0;
  for (const char* name : {"block", "block, part 1"}) {
    scene.tissues.push_back(
        {.name = name,
         .mesh = {.vertices_m = {0, 0, 0, 1, 0, 0, 0, 1, 0}, .triangles = {0, 1, 2}},
         .vertex_stiffness_newton_per_m = {400, 400, 1500}});
  }
  return scene;
}

MeshFrame frame_of(std::uint32_t tissue) {
  return {.header = {.session_id = 7},
          .scene_revision = 1,
          .tissue = tissue,
          .vertices_m = {0, 0, 0.1F},
          .vertex_strain = {0.3F}};
}

class Hidden : public testing::Test {
 protected:
  /// What passes, decoded again from its payload.
  template <class T>
  std::optional<T> passed(const T& message) {
    return decoded<T>(hidden_.pass(TelemetryMessage(message), {}));
  }
  template <class T>
  std::optional<T> decoded(const std::optional<HiddenLesions::Passed>& passed) {
    if (!passed) return std::nullopt;
    payload_.assign(reinterpret_cast<const char*>(passed->payload.data()), passed->payload.size());
    const std::string frame = static_cast<char>(kKindOf<T>) + payload_;
    T again;
    EXPECT_EQ(Codec<T>().decode(std::as_bytes(std::span(frame)), again), DecodeError::kNone);
    // those who take the message see the same as those who take the bytes
    Codec<T> codec;
    EXPECT_EQ(payload_of(codec, std::get<T>(*passed->message)), payload_);
    return again;
  }

  Session session_ = parse_session(kSession, "x.txtpb");
  HiddenLesions hidden_{session_};
  std::string payload_;
};

TEST_F(Hidden, BeforeTheEndASceneHasNeitherTextNorPartsNorStiffnessOfPlaces) {
  const auto scene = passed(whole_scene());
  ASSERT_TRUE(scene);
  EXPECT_THAT(scene->session_text, IsEmpty());
  ASSERT_THAT(scene->tissues, SizeIs(1));
  EXPECT_EQ(scene->tissues[0].name, "block");
  EXPECT_THAT(scene->tissues[0].mesh.vertices_m, SizeIs(9));
  EXPECT_THAT(scene->tissues[0].vertex_stiffness_newton_per_m, IsEmpty());
  EXPECT_THAT(payload_, Not(HasSubstr("secret")));
  EXPECT_THAT(payload_, Not(HasSubstr("part")));
}

TEST_F(Hidden, BeforeTheEndNoFrameOfAPartPassesAndNoStrain) {
  const auto scene = passed(whole_scene());
  EXPECT_FALSE(passed(frame_of(1)));
  const auto frame = passed(frame_of(0));
  ASSERT_TRUE(frame);
  EXPECT_THAT(frame->vertex_strain, IsEmpty());
  EXPECT_THAT(frame->vertices_m, SizeIs(3));
  EXPECT_EQ(frame->scene_revision, scene->revision);
}

TEST_F(Hidden, AfterTheEndTheWholeSceneIsANewOne) {
  const auto before = passed(whole_scene());
  EXPECT_TRUE(hidden_.is_hiding());
  const auto scene = decoded<SceneState>(hidden_.reveal());
  ASSERT_TRUE(scene);
  EXPECT_FALSE(hidden_.is_hiding());
  EXPECT_NE(scene->revision, before->revision);
  EXPECT_THAT(scene->tissues, SizeIs(2));
  EXPECT_EQ(scene->session_text, "secret 0.0123");
  EXPECT_THAT(scene->tissues[0].vertex_stiffness_newton_per_m, SizeIs(3));
  const auto frame = passed(frame_of(1));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->scene_revision, scene->revision);
  EXPECT_THAT(frame->vertex_strain, SizeIs(1));
  EXPECT_FALSE(hidden_.reveal());  // once
  EXPECT_EQ(passed(whole_scene())->revision, scene->revision);
}

TEST_F(Hidden, WithoutASearchEverythingPassesAsItIs) {
  session_.task->kind = FreeTask{};
  HiddenLesions nothing(session_);
  EXPECT_FALSE(nothing.is_hiding());
  const TelemetryMessage message = whole_scene();
  const std::string payload = "bytes";
  const auto passed = nothing.pass(message, std::as_bytes(std::span(payload)));
  ASSERT_TRUE(passed);
  EXPECT_EQ(passed->message, &message);
  EXPECT_EQ(passed->payload.data(), std::as_bytes(std::span(payload)).data());
}

TEST_F(Hidden, OfTheLayersOfANeedleOnlyTheOutermostIsSeenBeforeTheEnd) {
  session_.scene.tissues.resize(3);
  session_.task->kind = NeedleTask{
      .layers = {{.tissue = 0, .name = "skin"}, {.tissue = 2, .name = "flavum"}}, .membrane = 1};
  hidden_ = HiddenLesions(session_);
  SceneState whole = whole_scene();
  whole.tissues.push_back(whole.tissues[0]);
  whole.tissues[2].name = "flavum";
  const auto scene = passed(whole);
  ASSERT_TRUE(scene);
  ASSERT_THAT(scene->tissues, SizeIs(3));
  EXPECT_THAT(scene->tissues[0].mesh.vertices_m, SizeIs(9));
  EXPECT_THAT(scene->tissues[1].mesh.vertices_m, SizeIs(9));  // no layer
  EXPECT_THAT(scene->tissues[2].mesh.vertices_m, IsEmpty());
  EXPECT_THAT(scene->tissues[2].mesh.triangles, IsEmpty());
  EXPECT_THAT(scene->session_text, IsEmpty());
  EXPECT_TRUE(passed(frame_of(0)));
  EXPECT_FALSE(passed(frame_of(2)));
  const auto after = decoded<SceneState>(hidden_.reveal());
  ASSERT_TRUE(after);
  EXPECT_THAT(after->tissues[2].mesh.vertices_m, SizeIs(9));
  EXPECT_TRUE(passed(frame_of(2)));
}

TEST_F(Hidden, OnlyTheEndOfTheTaskOrAReplayReveals) {
  TaskView view(session_);
  RunState run;
  view.take(run);
  EXPECT_FALSE(view.may_reveal());
  run.replay = ReplayState{.file = {}, .length_s = 10.0};
  view.take(run);
  EXPECT_TRUE(view.may_reveal());

  session_.task->is_started_by_person = true;
  TaskView live(session_);
  TickRow row;
  row.device_session_id = 5;
  const auto tick = [&](std::uint64_t sequence) {
    row.device.sequence = sequence;
    row.device.sampled_at = TimePoint(from_seconds(1e-3 * static_cast<double>(sequence)));
    live.take(row);
  };
  live.take(TelemetryMessage(whole_scene()));
  RunState state;
  for (std::uint64_t i = 1; i < 100; ++i) tick(i);
  EXPECT_EQ(live.state().phase, TaskState::Phase::kWaiting);
  state.markers.push_back({.at_ns = 1,
                           .kind = Marker::Kind::kTaskStart,
                           .device_session_id = 5,
                           .device_sequence = 99});
  live.take(state);
  for (std::uint64_t i = 100; i < 3000; ++i) tick(i);
  EXPECT_EQ(live.state().phase, TaskState::Phase::kRunning);
  EXPECT_FALSE(live.may_reveal());
  state.markers.push_back({.at_ns = 2,
                           .kind = Marker::Kind::kTaskStop,
                           .device_session_id = 5,
                           .device_sequence = 2999});
  live.take(state);
  tick(3000);
  EXPECT_TRUE(live.may_reveal());
  EXPECT_EQ(live.score().ticks, 2900U);
}

}  // namespace
}  // namespace palpate::viewer
