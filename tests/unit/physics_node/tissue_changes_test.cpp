// SPDX-License-Identifier: Apache-2.0
// A viewer changes the material of a tissue: what is accepted, and that force, description and
// displayed scene follow.
#include "physics_node/tissue_changes.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "common/core/memory_link.h"
#include "physics_node/display/scene_display.h"
#include "physics_node/physics_node.h"
#include "physics_node/scene_engine.h"
#include "tests/support/alloc_guard.h"

namespace palpate::physics {
namespace {

using namespace std::chrono_literals;

// A floor below z = 0, and a ball without material.
SceneConfig floor_and_ghost() {
  return {.tissues = {{.name = "floor",
                       .geometry = HalfSpaceGeometry{},
                       .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0}},
                      {.name = "ghost",
                       .geometry = SphereGeometry{.center_m = {1, 0, 0}, .radius_m = 0.01},
                       .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 0.0}}}};
}

TissueChange change_of(std::uint32_t tissue, double k, double b) {
  TissueChange change;
  change.tissue = tissue;
  change.stiffness_newton_per_m = k;
  change.damping_newton_s_per_m = b;
  return change;
}

class NoTicks final : public TickSink<PhysicsTick> {
 public:
  void keep(const PhysicsTick& tick) noexcept override { newest = tick; }
  PhysicsTick newest;
};

TEST(TissueChanges, RefusesAndCountsTissuesThatCannotBeChanged) {
  ManualClock clock;
  MemoryLink<TissueChange> link(clock);
  TissueChanges changes(floor_and_ghost(), link);
  link.send(change_of(0, 800.0, 2.0));
  link.send(change_of(1, 800.0, 2.0));  // has no material
  link.send(change_of(2, 800.0, 2.0));  // does not exist

  std::vector<std::uint32_t> accepted;
  changes.receive([&](const TissueChange& change) { accepted.push_back(change.tissue); });

  EXPECT_EQ(accepted, std::vector<std::uint32_t>{0});
  TissueChange next;
  ASSERT_TRUE(changes.next(next));
  EXPECT_EQ(next.stiffness_newton_per_m, 800.0);
  EXPECT_FALSE(changes.next(next));
  PhysicsCounters counters;
  changes.count_into(counters);
  EXPECT_EQ(counters.tissue_changes, 1u);
  EXPECT_EQ(counters.tissue_changes_refused, 2u);
}

TEST(TissueChanges, OnlyWhatCanBeAblatedIsRestored) {
  ManualClock clock;
  MemoryLink<TissueChange> link(clock);
  SceneConfig scene = floor_and_ghost();
  scene.tissues.push_back(
      {.name = "body", .geometry = SphereGeometry{}, .material = ElasticMaterial{}});
  TissueChanges without_electrode(scene, link);
  scene.electrode = ElectrodeConfig{};
  TissueChanges changes(scene, link);
  TissueChange change;
  change.restores = true;
  std::vector<std::uint32_t> accepted;
  const auto note = [&](const TissueChange& one) { accepted.push_back(one.tissue); };
  for (change.tissue = 0; change.tissue < 4; ++change.tissue) link.send(change);
  without_electrode.receive(note);
  EXPECT_TRUE(accepted.empty());
  for (change.tissue = 0; change.tissue < 4; ++change.tissue) link.send(change);
  link.send(change_of(2, 800.0, 2.0));  // its stiffness is not to be changed
  changes.receive(note);
  EXPECT_EQ(accepted, std::vector<std::uint32_t>{2});
  TissueChange next;
  ASSERT_TRUE(changes.next(next));
  EXPECT_TRUE(next.restores);
}

// 10 mm deep: 5 N at 500 N/m, 8 N at 800 N/m; with 3 N·s/m at 0.1 m/s inward 0.3 N more.
TEST(TissueChanges, TheForceFollowsFromTheNextStepOnWithoutAllocation) {
  Scene scene(floor_and_ghost());
  TissueMemory memory = scene.new_memory();
  const Vector3 place(0, 0, -0.01);
  const Vector3 inward(0, 0, -0.1);
  EXPECT_NEAR(scene.step(memory, place, inward, 0.0).force_on_tool_newton.z(), 5.0, 1e-12);

  const test::AllocGuard guard;
  scene.set_material(0, 800.0, 3.0);
  const double after_newton = scene.step(memory, place, inward, 0.001).force_on_tool_newton.z();
  EXPECT_EQ(guard.count(), 0u);
  EXPECT_NEAR(after_newton, 8.3, 1e-12);
}

TEST(TissueChanges, AChangedTissueIsDescribedAnewAndRecorded) {
  ManualClock clock;
  MemoryLink<ToolMotion> motions{clock};
  MemoryLink<Interaction> interactions{clock};
  Inbox<ToolMotion> inbox{motions, clock};
  NoTicks ticks;
  const auto scene = std::make_shared<Scene>(floor_and_ghost(), 0.05);
  SceneEngine engine(scene, 1000.0, InteractionUse::kLocal);
  PhysicsNode node(engine, {}, InteractionUse::kLocal, clock, inbox, interactions, ticks, 7);
  ToolMotion motion;
  motion.header.session_id = 5;
  motion.device_session_id = 9;
  motion.receipts.store_id = 3;
  motion.tool_position_world_m = {0, 0, -0.01};
  // what the last of 20 steps carries, each message acknowledged
  const auto described = [&] {
    Interaction interaction;
    std::vector<TissueDescription> all;
    for (int i = 0; i < 20; ++i) {
      clock.advance(10ms);
      motions.send(motion);
      ++motion.header.sequence;
      ++motion.device_sequence;
      node.step({.scheduled_at = clock.now(), .now = clock.now()});
      TimePoint at;
      EXPECT_TRUE(interactions.receive(interaction, at));
      const auto& surface = interaction.surface;
      if (surface.has_description && surface.description.tissue == 0) {
        all.push_back(surface.description);  // of the floor
      }
      if (interaction.surface.number > 0) {
        motion.receipts.newest = interaction.surface.number;
        motion.receipts.received = ~std::uint64_t{0};
      }
    }
    return all;
  };
  const std::vector<TissueDescription> before = described();
  ASSERT_FALSE(before.empty());
  EXPECT_EQ(before.back().material.stiffness_newton_per_m, 500.0);
  EXPECT_TRUE(described().empty()) << "what is acknowledged is not sent again";
  EXPECT_NEAR(ticks.newest.penetration_m, 0.01, 1e-12);
  EXPECT_NEAR(ticks.newest.stiffness_newton_per_m, 500.0, 1e-9);

  scene->set_material(0, 800.0, 0.0);
  engine.note_changed(0);

  const std::vector<TissueDescription> after = described();
  ASSERT_FALSE(after.empty());
  EXPECT_EQ(after.back().material.stiffness_newton_per_m, 800.0);
  EXPECT_EQ(after.back().slot, before.back().slot);
  EXPECT_GT(after.back().version, before.back().version);
  EXPECT_NEAR(ticks.newest.stiffness_newton_per_m, 800.0, 1e-9);
}

template <class T>
class AllOf final : public Sender<T> {
 public:
  SendResult send(const T& message) noexcept override {
    messages.push_back(message);
    return SendResult::kSent;
  }
  std::vector<T> messages;
};

TEST(TissueChanges, TheSceneIsSentWithANewRevisionAtMostFiveTimesASecond) {
  Session session;
  session.scene = floor_and_ghost();
  session.viewer.has_control = true;
  AllOf<SceneState> scenes;
  AllOf<MeshFrame> meshes;
  SceneDisplay display(session, 7, scenes, meshes);
  const Watchers watchers{
      .scene_subscriptions = 1, .mesh_subscriptions = 1, .has_mesh_watcher = true};
  PhysicsTick deep;
  deep.tool_position_world_m = {0, 0, -0.01};
  TimePoint now{1s};
  display.publish(watchers, {&deep, 1}, now);
  ASSERT_EQ(scenes.messages.size(), 1u);
  EXPECT_TRUE(scenes.messages[0].accepts_changes);

  for (int i = 0; i < 50; ++i) {  // a slider, for 1 s
    display.set_material(0, 600.0 + i, 3.0);
    display.publish(watchers, {&deep, 1}, now += 20ms);
  }
  display.publish(watchers, {&deep, 1}, now += 200ms);

  EXPECT_GE(scenes.messages.size(), 5u);
  EXPECT_LE(scenes.messages.size(), 8u);
  const SceneState& last = scenes.messages.back();
  EXPECT_EQ(last.revision, scenes.messages.size());
  EXPECT_EQ(last.tissues[0].stiffness_newton_per_m, 649.0);
  EXPECT_EQ(last.tissues[0].damping_newton_s_per_m, 3.0);
  // a new revision starts at rest: its frames hold all that is dented
  ASSERT_FALSE(meshes.messages.empty());
  EXPECT_EQ(meshes.messages.back().scene_revision, last.revision);
  EXPECT_FALSE(meshes.messages.back().vertices_m.empty());
}

}  // namespace
}  // namespace palpate::physics
