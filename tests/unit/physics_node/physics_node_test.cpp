// SPDX-License-Identifier: Apache-2.0
#include "physics_node/physics_node.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/core/memory_link.h"
#include "physics_node/scene_engine.h"
#include "tests/support/alloc_guard.h"

namespace palpate::physics {
namespace {

using namespace std::chrono_literals;

constexpr std::uint64_t kPhysicsSession = 77;

class TickList final : public TickSink<PhysicsTick> {
 public:
  TickList() { ticks.reserve(100000); }
  void keep(const PhysicsTick& tick) noexcept override { ticks.push_back(tick); }
  std::vector<PhysicsTick> ticks;
};

// Moves on by 7 µs whenever it is read, as if something had been computed meanwhile.
class BusyClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override { return now_ += 7us; }
  void sleep_until(TimePoint deadline) override { now_ = deadline; }

 private:
  mutable TimePoint now_ = time_at(1.0);
};

// A floor of 500 N/m below z = 0, and a sphere too far to matter.
SceneConfig floor_and_far_sphere() {
  return {.tip_radius_m = 0.0,
          .tissues = {{.name = "floor",
                       .geometry = HalfSpaceGeometry{},
                       .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0}},
                      {.name = "far",
                       .geometry = SphereGeometry{.center_m = {5, 5, 5}, .radius_m = 0.01},
                       .material = KelvinVoigtMaterial{}}}};
}

struct Bench {
  explicit Bench(const SceneConfig& scene = floor_and_far_sphere(),
                 const std::optional<InteractionDeadband>& deadband = {},
                 InteractionUse use = InteractionUse::kHeld)
      : engine(scene, {}, use),
        node(engine, {.interaction_deadband = deadband}, use, clock, inbox, interactions, ticks,
             kPhysicsSession) {}
  explicit Bench(std::shared_ptr<const Scene> scene)
      : engine(std::move(scene), PhysicsConfig{}.rate_hz, InteractionUse::kHeld),
        node(engine, {}, InteractionUse::kHeld, clock, inbox, interactions, ticks,
             kPhysicsSession) {}

  void send_motion(double z_m, std::uint64_t mofc_session = 5, bool wants_torque = false) {
    ToolMotion motion;
    motion.header = {.session_id = mofc_session, .sequence = next_sequence++};
    motion.device_session_id = 9;
    motion.device_sequence = 1000 + motion.header.sequence;
    motion.device_sampled_at = time_at(0.001 * static_cast<double>(motion.header.sequence));
    motion.tool_position_world_m = {0.1, 0.2, z_m};
    motion.tool_orientation_world = Quaternion(0.6, 0.8, 0.0, 0.0);
    motion.wants_torque = wants_torque;
    motions.send(motion);
  }
  void step() {
    const TimePoint now = clock.now();
    node.step({.index = next_index++, .scheduled_at = now, .now = now});
  }
  std::vector<Interaction> received() {
    std::vector<Interaction> all;
    Interaction interaction;
    TimePoint at;
    while (interactions.receive(interaction, at)) all.push_back(interaction);
    return all;
  }

  ManualClock clock;
  MemoryLink<ToolMotion> motions{clock};
  MemoryLink<Interaction> interactions{clock};
  Inbox<ToolMotion> inbox{motions, clock};
  TickList ticks;
  SceneEngine engine;
  PhysicsNode node;
  std::uint64_t next_sequence = 0;
  std::uint64_t next_index = 0;
};

TEST(PhysicsNode, SendsNothingBeforeTheFirstMotion) {
  Bench bench;

  bench.step();

  EXPECT_TRUE(bench.received().empty());
  EXPECT_TRUE(bench.ticks.ticks.empty());
  EXPECT_FALSE(bench.node.has_new_motion());
  EXPECT_EQ(bench.node.counters().loop.ticks, 1U);
}

// Others get the message that they got before there was torque.
TEST(PhysicsNode, SaysWhereContactsActToAReceiverThatRendersTorque) {
  SceneConfig scene = floor_and_far_sphere();
  scene.tip_radius_m = 0.004;
  Bench bench(scene);
  bench.send_motion(-0.01);
  bench.step();
  bench.send_motion(-0.01, 5, true);
  bench.step();

  const std::vector<Interaction> received = bench.received();
  ASSERT_EQ(received.size(), 2U);
  ASSERT_EQ(received[1].contact_count, 1U);
  EXPECT_EQ(received[0].contacts[0].arm_m, Vector3(0, 0, 0));
  EXPECT_LT((received[1].contacts[0].arm_m - Vector3(0, 0, 0.01)).norm(), 1e-12);
}

// 10 mm deep at 500 N/m: 5 N, 0.025 J.
TEST(PhysicsNode, AnswersAMotionWithTheForceAndItsStamps) {
  Bench bench;
  bench.clock.advance(3s);
  bench.send_motion(-0.01);

  bench.step();

  const std::vector<Interaction> received = bench.received();
  ASSERT_EQ(received.size(), 1U);
  const Interaction& interaction = received[0];
  EXPECT_EQ(interaction.header.session_id, kPhysicsSession);
  EXPECT_EQ(interaction.header.sequence, 0U);
  EXPECT_EQ(interaction.header.sampled_at, time_at(3.0));
  EXPECT_EQ(interaction.device_session_id, 9U);
  EXPECT_EQ(interaction.device_sequence, 1000U);
  EXPECT_EQ(interaction.device_sampled_at, time_at(0.0));
  EXPECT_EQ(interaction.tool_position_world_m, Vector3(0.1, 0.2, -0.01));
  EXPECT_EQ(interaction.tool_orientation_world.coeffs(), Quaternion(0.6, 0.8, 0.0, 0.0).coeffs());
  EXPECT_LT((interaction.force_on_tool_newton - Vector3(0, 0, 5)).norm(), 1e-12);
  EXPECT_NEAR(interaction.stored_energy_joule, 0.025, 1e-15);
  ASSERT_EQ(interaction.contact_count, 1U);
  EXPECT_NEAR(interaction.contacts[0].penetration_m, 0.01, 1e-15);
}

// Tissue with a history, which only its own tool may notice.
TEST(PhysicsNode, ComputesInASharedSceneTheSameForceAsAlone) {
  SceneConfig config = floor_and_far_sphere();
  std::get<KelvinVoigtMaterial>(config.tissues[0].material).relaxing_stiffness_newton_per_m = 300.0;
  const auto scene = std::make_shared<const Scene>(config);
  Bench left(scene);
  Bench right(scene);
  Bench left_alone(config);
  Bench right_alone(config);

  for (int i = 0; i < 200; ++i) {
    const double depth_m = 1e-4 * i;
    for (Bench* bench : {&left, &left_alone}) bench->send_motion(-depth_m);
    for (Bench* bench : {&right, &right_alone}) bench->send_motion(-0.02 + depth_m);
    for (Bench* bench : {&left, &right, &left_alone, &right_alone}) {
      bench->clock.advance(1ms);
      bench->step();
    }
  }

  const auto forces = [](const Bench& bench) {
    std::vector<double> forces_newton;
    for (const PhysicsTick& tick : bench.ticks.ticks) {
      forces_newton.push_back(tick.force_on_tool_newton.z());
    }
    return forces_newton;
  };
  EXPECT_EQ(forces(left), forces(left_alone));
  EXPECT_EQ(forces(right), forces(right_alone));
  EXPECT_NE(forces(left), forces(right));
  EXPECT_GT(forces(left).back(), 9.0);  // 19.9 mm at 500 N/m and more
}

TEST(PhysicsNode, AnswersTheNewestMotionOnly) {
  Bench bench;
  bench.send_motion(-0.01);
  bench.send_motion(-0.02);

  bench.step();

  const std::vector<Interaction> received = bench.received();
  ASSERT_EQ(received.size(), 1U);
  EXPECT_EQ(received[0].device_sequence, 1001U);
  EXPECT_NEAR(received[0].force_on_tool_newton.z(), 10.0, 1e-12);
}

TEST(PhysicsNode, RepeatsTheForceUnderAFreshHeaderWithoutANewMotion) {
  Bench bench;
  bench.send_motion(-0.01);
  bench.step();
  bench.clock.advance(1ms);

  bench.step();

  const std::vector<Interaction> received = bench.received();
  ASSERT_EQ(received.size(), 2U);
  EXPECT_EQ(received[1].header.sequence, 1U);
  EXPECT_EQ(received[1].header.sampled_at, time_at(0.001));
  EXPECT_EQ(received[1].device_sequence, received[0].device_sequence);
  EXPECT_EQ(received[1].force_on_tool_newton, received[0].force_on_tool_newton);
}

TEST(PhysicsNode, KnowsWhetherAMotionHasNotBeenUsed) {
  Bench bench;
  bench.send_motion(-0.01);

  EXPECT_TRUE(bench.node.has_new_motion());
  EXPECT_TRUE(bench.node.has_new_motion()) << "asking does not answer";
  bench.step();
  EXPECT_FALSE(bench.node.has_new_motion());
  bench.send_motion(-0.01);
  EXPECT_TRUE(bench.node.has_new_motion());
}

TEST(PhysicsNode, FollowsARestartedMofcAtOnce) {
  Bench bench;
  for (int i = 0; i < 5; ++i) bench.send_motion(-0.01, 5);
  bench.step();
  bench.next_sequence = 0;
  bench.send_motion(-0.02, 6);

  EXPECT_TRUE(bench.node.has_new_motion());
  bench.step();

  const std::vector<Interaction> received = bench.received();
  EXPECT_EQ(received.back().device_sequence, 1000U);
  EXPECT_NEAR(received.back().force_on_tool_newton.z(), 10.0, 1e-12);
  EXPECT_EQ(bench.node.counters().tool_motion.sessions, 2U);
}

TEST(PhysicsNode, ContinuesWhenTheLinkDropsMessages) {
  Bench bench;
  bench.send_motion(-0.01);

  for (int i = 0; i < 1000; ++i) bench.step();  // the link holds 256

  EXPECT_EQ(bench.received().size(), 256U);
  EXPECT_EQ(bench.ticks.ticks.size(), 1000U);
  EXPECT_EQ(bench.ticks.ticks.back().sequence, 999U);
}

TEST(PhysicsNode, CountsStepsContactsSkippedTissuesAndTicks) {
  Bench bench;
  bench.send_motion(0.01);
  bench.step();  // above the floor
  bench.send_motion(-0.01);
  bench.step();
  bench.next_index += 3;  // three appointments missed
  const TimePoint now = bench.clock.now();
  bench.node.step({.index = bench.next_index, .scheduled_at = now, .now = now + 250us});

  const PhysicsCounters& counters = bench.node.counters();
  EXPECT_EQ(counters.loop.ticks, 3U);
  EXPECT_EQ(counters.loop.skipped_ticks, 3U);
  EXPECT_EQ(counters.loop.worst_lateness, Duration(250us));
  EXPECT_EQ(counters.contact_steps, 2U);
  EXPECT_EQ(counters.tissues_skipped, 3U);  // the far sphere, at every step
  EXPECT_EQ(counters.tissues_visited, 3U);  // the floor
  EXPECT_EQ(counters.octree_cells_visited, 0U);
  EXPECT_EQ(counters.tool_motion.accepted, 2U);
}

TEST(PhysicsNode, LeavesARecordOfEveryStep) {
  Bench bench;
  bench.clock.advance(2s);
  bench.send_motion(-0.01);

  bench.step();

  ASSERT_EQ(bench.ticks.ticks.size(), 1U);
  const PhysicsTick& tick = bench.ticks.ticks[0];
  EXPECT_EQ(tick.sequence, 0U);
  EXPECT_EQ(tick.stepped_at, time_at(2.0));
  EXPECT_EQ(tick.device_sequence, 1000U);
  EXPECT_EQ(tick.tool_position_world_m, Vector3(0.1, 0.2, -0.01));
  EXPECT_NEAR(tick.force_on_tool_newton.z(), 5.0, 1e-12);
  EXPECT_NEAR(tick.stored_energy_joule, 0.025, 1e-15);
  EXPECT_EQ(tick.contact_count, 1U);
}

// The clock moves by 7 µs per reading: the inbox does not read it, the step does once, at its end.
TEST(PhysicsNode, TakesItsComputeTimeFromTheClockHandedIn) {
  Bench bench;
  BusyClock busy;
  PhysicsNode node(bench.engine, {}, InteractionUse::kHeld, busy, bench.inbox, bench.interactions,
                   bench.ticks, 1);
  bench.send_motion(-0.01);

  const TimePoint now = busy.now();
  node.step({.index = 0, .scheduled_at = now, .now = now});

  EXPECT_EQ(bench.ticks.ticks.at(0).compute_time, Duration(7us));
  EXPECT_EQ(node.counters().worst_compute_time, Duration(7us));
}

// --- deadband of hop 3: 10 % or 0.05 N, at least every 20 ms ---------------------------------

const InteractionDeadband kTenPercent{.ratio = 0.1, .floor_newton = 0.05, .keep_alive = 20ms};

TEST(PhysicsNodeDeadband, SendsWhatDiffersByMoreThanItsShare) {
  Bench bench(floor_and_far_sphere(), kTenPercent);
  for (const double depth_mm : {10.0, 10.9, 11.1, 11.2, 12.5}) {
    bench.send_motion(-1e-3 * depth_mm);
    bench.step();
  }

  // 5 N; 5.45 (off by 8 % of it) is kept; 5.55 (off by 9.9 %) is kept; 5.6 (10.7 %) is sent; 6.25
  // (10.4 %) is sent
  const std::vector<Interaction> received = bench.received();
  ASSERT_EQ(received.size(), 3U);
  EXPECT_NEAR(received[1].force_on_tool_newton.z(), 5.6, 1e-12);
  EXPECT_NEAR(received[2].force_on_tool_newton.z(), 6.25, 1e-12);
  EXPECT_EQ(received[2].header.sequence, 2U) << "nothing looks lost";
  EXPECT_EQ(bench.node.counters().interactions_suppressed, 2U);
  // the record is complete
  ASSERT_EQ(bench.ticks.ticks.size(), 5U);
  EXPECT_EQ(bench.ticks.ticks[4].sequence, 4U);
}

// 500 N/m: 0.1 mm is 0.05 N
TEST(PhysicsNodeDeadband, NeverSendsWhatDiffersByLessThanTheFloor) {
  Bench bench(floor_and_far_sphere(), kTenPercent);
  for (const double depth_mm : {0.1, 0.19}) {
    bench.send_motion(-1e-3 * depth_mm);
    bench.step();
  }
  EXPECT_EQ(bench.received().size(), 1U) << "off by 0.045 N, 47 % of it";
  bench.send_motion(-0.21e-3);
  bench.step();
  EXPECT_EQ(bench.received().size(), 1U) << "off by 0.055 N";
}

TEST(PhysicsNodeDeadband, SendsTheBeginningAndTheEndOfAContact) {
  Bench bench(floor_and_far_sphere(), kTenPercent);
  for (const double z_m : {1e-3, 1e-6, -1e-6, -2e-6, 1e-6}) {
    bench.send_motion(z_m);
    bench.step();
  }
  const std::vector<Interaction> received = bench.received();
  ASSERT_EQ(received.size(), 3U);
  EXPECT_EQ(received[1].contact_count, 1U);
  EXPECT_EQ(received[2].contact_count, 0U);
}

TEST(PhysicsNodeDeadband, SendsAfterTheKeepAlive) {
  Bench bench(floor_and_far_sphere(), kTenPercent);
  bench.send_motion(-0.01);
  for (int k = 0; k <= 40; ++k) {
    bench.step();
    bench.clock.advance(1ms);
  }
  const std::vector<Interaction> received = bench.received();
  ASSERT_EQ(received.size(), 3U);
  EXPECT_EQ(received[1].header.sampled_at, TimePoint(20ms));
  EXPECT_EQ(received[2].header.sampled_at, TimePoint(40ms));
}

TEST(PhysicsNodeDeadband, ARestartedMofcIsAnsweredAtOnce) {
  Bench bench(floor_and_far_sphere(), kTenPercent);
  bench.send_motion(-0.01, 5);
  bench.step();
  bench.next_sequence = 0;
  bench.send_motion(-0.01, 6);
  bench.step();
  EXPECT_EQ(bench.received().size(), 2U);
}

// the link holds 256 messages; a dropped one is sent again in the next step
TEST(PhysicsNodeDeadband, WhatTheLinkDroppedDoesNotCountAsSent) {
  Bench bench(floor_and_far_sphere(), kTenPercent);
  for (int i = 0; i < 256; ++i) bench.interactions.send(Interaction{});
  bench.send_motion(-0.01);
  bench.step();
  static_cast<void>(bench.received());
  bench.step();
  EXPECT_EQ(bench.received().size(), 1U);
  EXPECT_EQ(bench.node.counters().interactions_suppressed, 0U);
}

TEST(PhysicsNode, StepDoesNotAllocate) {
  Bench bench;
  bench.send_motion(-0.01);
  for (int i = 0; i < 256; ++i) bench.step();  // the link grows to its capacity
  static_cast<void>(bench.received());
  bench.send_motion(-0.02);

  const test::AllocGuard guard;
  for (int i = 0; i < 100; ++i) {
    bench.step();
    static_cast<void>(bench.node.has_new_motion());
  }

  EXPECT_EQ(guard.count(), 0U);
}

TEST(AllocGuard, SeesAnAllocation) {
  const test::AllocGuard guard;

  const auto owner = std::make_unique<std::vector<int>>(100);

  EXPECT_EQ(guard.count(), 2U);
}

static_assert(noexcept(std::declval<PhysicsNode&>().step(std::declval<const Tick&>())));

}  // namespace
}  // namespace palpate::physics
