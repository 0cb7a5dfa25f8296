// SPDX-License-Identifier: Apache-2.0
// The whole system on virtual time: device, clamp and physics, hop by hop.
#include "deploy/lockstep/lockstep.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/null_sink.h>

#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "common/link/scene_sender.h"
#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "common/session/session_file.h"
#include "common/telemetry/telemetry_publisher.h"
#include "deploy/lockstep/loopback.h"
#include "physics_node/display/scene_display.h"
#include "tests/support/machine/places.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/feed/telemetry_mirror.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

/// A hand that rests 5 mm inside a 400 N/m block, device and physics at 1 kHz, everything exact.
constexpr const char* kPressing = R"(
name: "pressing"
device { monitor: off simulated { position_resolution_m: 0 } profile { position_resolution_m: 0 } start_ramp_ms: 0 }
hand { stiffness_newton_per_m: 400 hold { position_m { z: -0.005 } } }
mofc { controller: none }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } } }
)";

Session parsed(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return parse_session(text, "test.txtpb", overrides, test::source_dir());
}

Session shipped(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return load_session(test::source_dir() + "/deploy/sessions/" + name + ".txtpb", overrides);
}

struct Recording {
  std::vector<TickRow> rows;
  std::vector<IdealState> ideal;
  DeviceCounters device;
  MofcCounters mofc;

  [[nodiscard]] const TickRow& last() const { return rows.back(); }
  [[nodiscard]] double mean_force_newton() const {
    double sum = 0.0;
    for (const TickRow& row : rows) sum += row.device.force_on_hand_newton.norm();
    return sum / static_cast<double>(rows.size());
  }
};

Recording run(const Session& session, Duration length, const LockstepOptions& options = {}) {
  Recording result;
  Lockstep lockstep(session, options, [&](const TickRow& row, const IdealState& ideal) {
    result.rows.push_back(row);
    result.ideal.push_back(ideal);
  });
  lockstep.run_until(length);
  result.device = lockstep.device_counters();
  result.mofc = lockstep.mofc_counters();
  return result;
}

/// Every double of a run, bit by bit.
std::vector<std::uint64_t> bits_of(const Recording& run) {
  std::vector<std::uint64_t> bits;
  const auto add = [&](double value) { bits.push_back(std::bit_cast<std::uint64_t>(value)); };
  for (const TickRow& row : run.rows) {
    for (int i = 0; i < 3; ++i) {
      add(row.device.true_tool_position_world_m[i]);
      add(row.device.measured_hand_position_m[i]);
      add(row.device.force_on_hand_newton[i]);
      add(row.mofc ? row.mofc->requested_force_on_hand_newton[i] : -1.0);
      add(row.mofc ? row.mofc->f_max_newton[i] : -1.0);
    }
    add(row.device.true_energy_joule);
    add(row.mofc ? row.mofc->ledger_energy_joule : -1.0);
    bits.push_back(static_cast<std::uint64_t>(row.device.switched_at.time_since_epoch().count()));
  }
  return bits;
}

TEST(Lockstep, AContactPropagatesFromTheHandToTheTissueAndBack) {
  const Recording touch = run(parsed(kPressing), 1s);

  ASSERT_EQ(touch.rows.size(), 1000u);
  ASSERT_TRUE(touch.last().mofc.has_value());
  EXPECT_EQ(touch.last().mofc->state, MofcState::kContact);
  // tissue and hand have the same stiffness and share the 5 mm: 2.5 mm · 400 N/m = 1 N, up to the
  // 0.1 N of stiction
  EXPECT_NEAR(touch.last().device.force_on_hand_newton.z(), 1.0, 0.06);
  EXPECT_EQ(touch.device.answered_ticks, 1000u);
}

// Physics steps the motion read at tick k at the same instant; its force acts at tick k + 1.
TEST(Lockstep, TheForceIsOneTickOld) {
  const Recording touch = run(parsed(kPressing), 100ms);

  EXPECT_EQ(touch.rows.front().mofc->state, MofcState::kNoPhysics);
  for (std::size_t k = 1; k < touch.rows.size(); ++k) {
    EXPECT_EQ(touch.rows[k].mofc->force_age, Duration(1ms));
    EXPECT_EQ(touch.rows[k].mofc->device_sequence, touch.rows[k].device.sequence);
  }
}

TEST(Lockstep, TicksBeginAsLateAsConfigured) {
  const LockstepOptions options{.device_lateness = [] { return Duration(300us); }};
  const Recording touch = run(parsed(kPressing), 100ms, options);

  ASSERT_EQ(touch.rows.size(), 100u);
  for (std::size_t k = 0; k < touch.rows.size(); ++k) {
    EXPECT_EQ(touch.rows[k].device.sampled_at, TimePoint(k * 1ms + 300us));
  }
}

TEST(Lockstep, AHostilePhysicsReplacesTheInteractions) {
  const LockstepOptions options{.tamper_with_interaction = [](Interaction& said) {
    said.force_on_tool_newton = {2, 0, 0};
    said.listed_count = 0;
    said.contact_count = 1;
    said.surface.store_id = 0;
  }};
  const Recording touch = run(parsed(kPressing), 100ms, options);

  EXPECT_EQ(touch.last().device.force_on_hand_newton, Vector3(2, 0, 0));
}

// Without the clamp the same lies give the hand millijoules.
TEST(Lockstep, ALyingComplianceGivesTheHandNothing) {
  const Recording clamped =
      run(shipped("hostile_elastic", {"adversary.physics=lying_compliance"}), 500ms);
  const Recording unlimited = run(
      shipped("hostile_elastic",
              {"adversary.physics=lying_compliance", "mofc.controller=none", "device.monitor=off"}),
      500ms);

  EXPECT_GE(clamped.last().device.minimum_true_energy_joule, -1e-6);
  EXPECT_LT(unlimited.last().device.minimum_true_energy_joule, -1e-3);
  EXPECT_EQ(clamped.mofc.interaction.rejected, 0U);
}

// Kelvin–Voigt at exact positions: fe(k) is the law at the position measured at k − 1.
TEST(Lockstep, AHeldForceIsTheTissuesLawAtThePositionItAnswers) {
  const Recording touch = run(parsed(kPressing, {"mofc.interaction=held"}), 200ms);

  for (std::size_t k = 1; k < touch.rows.size(); ++k) {
    const double depth = -touch.rows[k - 1].device.measured_tool_position_world_m.z();
    EXPECT_NEAR(touch.rows[k].mofc->requested_force_on_hand_newton.z(),
                400.0 * std::max(0.0, depth), 1e-12);
  }
}

// The model is evaluated at the position just measured, however old it is: physics at 50 Hz, 50 ms
// away. Held, the force is up to 120 ms behind.
TEST(Lockstep, AForceFromTheLocalModelIsTheTissuesLawAtThePresentPosition) {
  const std::vector<std::string> far{"physics.rate_hz=50", "faults.tool_motion.delay_ms=50",
                                     "faults.interaction.delay_ms=50",
                                     // evaluates the contact at the position that was read
                                     "mofc.velocity_estimator.difference={}"};
  const auto largest_error_newton = [&](const char* use) {
    std::vector<std::string> overrides = far;
    overrides.push_back(std::string("mofc.interaction=") + use);
    const Recording touch = run(parsed(kPressing, overrides), 400ms);
    double largest = 0.0;
    for (std::size_t k = 150; k < touch.rows.size(); ++k) {  // since the first answer
      const double depth = -touch.rows[k].device.measured_tool_position_world_m.z();
      const double error =
          touch.rows[k].mofc->requested_force_on_hand_newton.z() - 400.0 * std::max(0.0, depth);
      largest = std::max(largest, std::abs(error));
    }
    return largest;
  };

  EXPECT_LT(largest_error_newton("local"), 1e-9);
  EXPECT_GT(largest_error_newton("held"), 0.1);
}

TEST(Lockstep, TheSameSeedGivesTheSameBits) {
  const Session session =
      shipped("default", {"faults.interaction.loss_ratio=0.2", "faults.interaction.jitter_ms=3"});

  EXPECT_EQ(bits_of(run(session, 2s)), bits_of(run(session, 2s)));
}

TEST(Lockstep, AnotherSeedGivesAnotherRun) {
  const std::vector<std::string> faults{"faults.force_command.loss_ratio=0.2", "seed=1"};
  const std::vector<std::string> other{"faults.force_command.loss_ratio=0.2", "seed=2"};

  EXPECT_NE(bits_of(run(shipped("default", faults), 2s)),
            bits_of(run(shipped("default", other), 2s)));
}

class LockstepSessions : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Shipped, LockstepSessions,
                         testing::Values("default", "paper_soft", "paper_rigid", "paper_mixed"),
                         [](const auto& tested) { return std::string(tested.param); });

TEST_P(LockstepSessions, MemoryAndInprocLinksGiveTheSameBits) {
  const Session session = shipped(GetParam(), {"faults.interaction.loss_ratio=0.05"});
  const Duration length = session.side().device.rate_hz > 100.0 ? Duration(1500ms) : Duration(16s);

  const Recording memory = run(session, length, {.links = LockstepLinks::kMemory});
  const Recording inproc = run(session, length, {.links = LockstepLinks::kInproc});

  EXPECT_EQ(bits_of(memory), bits_of(inproc));
  EXPECT_GT(memory.mofc.contact_ticks, 0u);
}

// --- viewers ------------------------------------------------------------------------------------

/// Hop 5 as in the nodes, with viewers connected to its sockets; the last of several never reads.
class Audience {
 public:
  Audience(const Session& session, std::size_t viewers)
      : display_(session, kLockstepPhysics, physics_out_, physics_out_) {
    for (std::size_t i = 0; i < viewers; ++i) {
      Viewer& viewer = *viewers_.emplace_back(std::make_unique<Viewer>(context_, clock_));
      viewer.mirror.on_row = [&viewer](const TickRow&) { ++viewer.rows; };
      viewer.subscriber.subscribe<SceneState>();
      viewer.subscriber.subscribe<MeshFrame>();
      viewer.subscriber.wait_until(clock_.now());  // its sockets learn whom they are connected to
    }
  }

  void listen_to(LockstepOptions& options) {
    options.on_device_tick = [this](const DeviceTick& tick) { device_.ticks.keep(tick); };
    options.on_mofc_tick = [this](const MofcTick& tick) { mofc_.ticks.keep(tick); };
    options.on_physics_tick = [this](const PhysicsTick& tick) { physics_.ticks.keep(tick); };
  }
  void show(const Lockstep& lockstep, TimePoint now) {
    clock_.sleep_until(now);
    device_.publish(lockstep.device_counters());
    mofc_.publish(lockstep.mofc_counters());
    physics_.publish(lockstep.physics_counters());
    const std::optional<PhysicsTick>& newest = physics_.publisher.newest();
    display_.publish({.scene_subscriptions = physics_out_.subscriptions<SceneState>(),
                      .mesh_subscriptions = physics_out_.subscriptions<MeshFrame>(),
                      .has_mesh_watcher = physics_out_.has_subscriber<MeshFrame>()},
                     newest ? std::span(&*newest, 1) : std::span<const PhysicsTick>{}, now);
    for (std::size_t i = 0; i < viewers_.size() - 1; ++i) viewers_[i]->read(now);
  }

  /// Of the first viewer.
  [[nodiscard]] std::size_t rows() const { return viewers_[0]->rows; }
  [[nodiscard]] std::size_t frames() const { return viewers_[0]->frames; }

 private:
  template <class Record, class Counters>
  struct Node {
    Node(const Clock& clock, Sender<TelemetryBatch<Record, Counters>>& out, std::uint64_t id)
        : publisher(id, clock, ticks, counters, out, log) {}
    void publish(const Counters& newest) {
      counters.store(newest);
      publisher.pump();
    }
    spdlog::logger log{"node", std::make_shared<spdlog::sinks::null_sink_st>()};
    RingSink<Record> ticks;
    Snapshot<Counters> counters;
    TelemetryPublisher<Record, Counters> publisher;
  };
  struct Viewer {
    Viewer(ZmqContext& context, const Clock& clock)
        : subscriber(context, clock,
                     {connect_to("inproc://device_telemetry", "test"),
                      connect_to("inproc://mofc_telemetry", "test"),
                      connect_to("inproc://physics_telemetry", "test")}) {}
    void read(TimePoint now) {
      TimePoint received_at;
      while (subscriber.receive(message, received_at)) {
        if (const auto* whole = std::get_if<SceneState>(&message)) {
          scene.take(*whole);
        } else if (const auto* frame = std::get_if<MeshFrame>(&message)) {
          frames += scene.take(*frame) ? 1U : 0U;
        } else {
          std::visit(
              [&](const auto& batch) {
                if constexpr (requires { mirror.take(batch, now); }) mirror.take(batch, now);
              },
              message);
        }
      }
    }
    TelemetrySubscriber subscriber;
    TelemetryMessage message;
    viewer::TelemetryMirror mirror;
    viewer::SceneMirror scene;
    std::size_t rows = 0;
    std::size_t frames = 0;
  };

  ManualClock clock_;
  ZmqContext context_;
  ZmqSender<DeviceBatch> device_out_{context_, bind_to("inproc://device_telemetry", "test")};
  ZmqSender<MofcBatch> mofc_out_{context_, bind_to("inproc://mofc_telemetry", "test")};
  SceneSender physics_out_{context_, bind_to("inproc://physics_telemetry", "test")};
  Node<DeviceTick, DeviceCounters> device_{clock_, device_out_, kLockstepDevice};
  Node<MofcTick, MofcCounters> mofc_{clock_, mofc_out_, kLockstepMofc};
  Node<PhysicsTick, PhysicsCounters> physics_{clock_, physics_out_, kLockstepPhysics};
  physics::SceneDisplay display_;
  std::vector<std::unique_ptr<Viewer>> viewers_;
};

TEST(Lockstep, EightViewersOfWhichOneIsStalledDoNotChangeABit) {
  for (const LockstepLinks links : {LockstepLinks::kMemory, LockstepLinks::kInproc}) {
    const Session session = shipped("default");
    const Recording alone = run(session, 2s, {.links = links});

    LockstepOptions options{.links = links};
    Audience audience(session, 8);
    audience.listen_to(options);
    Recording watched;
    Lockstep lockstep(session, options,
                      [&](const TickRow& row, const IdealState&) { watched.rows.push_back(row); });
    for (Duration end = kPublishInterval; end <= 2s; end += kPublishInterval) {
      lockstep.run_until(end);
      audience.show(lockstep, TimePoint(end));
    }

    EXPECT_EQ(bits_of(watched), bits_of(alone));
    // the viewers received all but the ticks whose other half may still come, and a pressed tissue
    EXPECT_GE(audience.rows(), 1500u);
    EXPECT_GE(audience.frames(), 10u);
  }
}

TEST(Lockstep, TheIdealIsComputedOnlyOnRequest) {
  const Recording plain = run(parsed(kPressing), 20ms);
  const Recording with = run(parsed(kPressing), 20ms, {.has_ideal = true});

  EXPECT_FALSE(plain.last().ideal_force_on_hand_newton.allFinite());
  EXPECT_FALSE(plain.ideal.back().tool_position_world_m.allFinite());
  EXPECT_TRUE(with.last().ideal_force_on_hand_newton.allFinite());
  EXPECT_TRUE(with.ideal.back().tool_position_world_m.allFinite());
  EXPECT_EQ(bits_of(plain), bits_of(with)) << "computing it changes nothing";
}

// At rest the ideal force is the law at the true position: 400 N/m times the true depth.
TEST(Lockstep, TheIdealForceIsTheContinuousTissueAtTheTruePosition) {
  const Recording touch = run(parsed(kPressing), 1s, {.has_ideal = true});

  const double depth = -touch.last().device.true_tool_position_world_m.z();
  EXPECT_NEAR(touch.last().ideal_force_on_hand_newton.z(), 400.0 * depth, 1e-12);
  EXPECT_TRUE(touch.last().is_truly_in_contact.value());
}

TEST(Lockstep, ATissueTwiceAsStiffGivesTheComputedForce) {
  const Recording soft = run(parsed(kPressing), 1s);
  const Recording stiff =
      run(parsed(kPressing, {"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=800"}), 1s);

  // series of springs: 5 mm · 400·800/1200 = 1.333 N instead of 1 N, ± stiction
  EXPECT_NEAR(stiff.last().device.force_on_hand_newton.z(), 4.0 / 3.0, 0.1);
  EXPECT_GT(stiff.last().device.force_on_hand_newton.z(),
            soft.last().device.force_on_hand_newton.z() + 0.2);
}

TEST(Lockstep, SilenceFromPhysicsLeavesTheDeviceLimp) {
  const Session session = parsed(kPressing, {"faults.interaction.outage={from_s: 0.3 until_s: 10}",
                                             "mofc.fade_ms=50", "mofc.still_after_ms=0"});
  const Recording touch = run(session, 600ms);

  // silent from 300 ms, stale 150 ms after the last arrival, faded 50 ms later
  const auto force_at = [&](std::size_t k) {
    return touch.rows[k].device.force_on_hand_newton.norm();
  };
  EXPECT_GT(force_at(290), 0.5);
  EXPECT_GT(force_at(449), 0.5);  // until then the local model counts
  for (std::size_t k = 451; k < 510; ++k) EXPECT_LE(force_at(k), force_at(450) + 1e-12) << k;
  EXPECT_EQ(force_at(510), 0.0);
  EXPECT_EQ(touch.last().mofc->state, MofcState::kNoPhysics);
}

TEST(Lockstep, TheAgeOfTheForceIsTheDelayOfThePhysics) {
  const Recording touch = run(parsed(kPressing, {"faults.interaction.delay_ms=20"}), 200ms);

  EXPECT_EQ(touch.last().mofc->force_age, Duration(20ms));
}

// An answer that takes 300 µs acts from 300 µs after the reading on.
TEST(Lockstep, ADelayedAnswerSwitchesTheForceWhenItArrives) {
  const Recording touch = run(parsed(kPressing, {"faults.force_command.delay_ms=0.3"}), 200ms);

  EXPECT_EQ(touch.last().device.switched_at - touch.last().device.sampled_at, Duration(300us));
  EXPECT_EQ(touch.device.answered_ticks, 200u);
}

// Half of the answers come after the 0.5 ms for which the full force is granted.
TEST(Lockstep, AnAnswerThatComesLateActsWhereTheCreditPaysForTheWait) {
  const auto touch = [](const std::string& reply_us) {
    return run(parsed(kPressing, {"faults.force_command={delay_ms: 0.2 jitter_ms: 0.59}",
                                  "mofc.controller=mofc", "device.reply_us=" + reply_us}),
               1s);
  };
  const Recording late = touch("800");
  const Recording early = touch("500");

  EXPECT_GT(late.device.answered_ticks, early.device.answered_ticks + 200);
  EXPECT_GT(late.mean_force_newton(), early.mean_force_newton());
  EXPECT_GE(late.last().device.minimum_true_energy_joule, -1e-6);
}

TEST(Lockstep, AnAnswerAfterTheDeadlineIsDropped) {
  const Recording touch = run(parsed(kPressing, {"faults.force_command.delay_ms=0.81"}), 200ms);

  EXPECT_EQ(touch.device.answered_ticks, 0u);
  EXPECT_EQ(touch.device.max_force_newton, 0.0);
}

// Answers lost from 300 ms on: the force acts until its lease (at most 10 ms) ends, then at most
// f_co, then limp.
TEST(Lockstep, WithoutAnswersTheDeviceGoesFromLeaseToFallbackToLimp) {
  const Session session =
      parsed(kPressing, {"faults.force_command.outage={from_s: 0.3 until_s: 10}",
                         "device.limp_after_ms=20", "device.fade_ms=50"});
  const Recording touch = run(session, 400ms);

  const double f_co = session.side().device.profile.coulomb_newton;
  EXPECT_GT(touch.rows[299].device.force_on_hand_newton.norm(), 0.5);
  EXPECT_EQ(touch.rows[300].device.guard, GuardState::kLeased);
  EXPECT_EQ(touch.rows[312].device.guard, GuardState::kFallback);
  for (std::size_t k = 310; k < 400; ++k) {
    EXPECT_LE(touch.rows[k].device.force_on_hand_newton.norm(), f_co + 1e-12) << k;
  }
  EXPECT_EQ(touch.last().device.guard, GuardState::kLimp);
  EXPECT_EQ(touch.last().device.force_on_hand_newton.norm(), 0.0);
}

// The clutch is held from 0.2 to 0.4 s while the hand moves 1 cm/s·…: the tool rests, nothing acts.
TEST(Lockstep, WhileClutchedTheToolRestsAndNothingIsRendered) {
  const Session session = parsed(
      kPressing,
      {"device.workspace.clutch_button=0", "hand.press={button: 0 from_s: 0.2 until_s: 0.4}",
       "hand.sinusoid={center_m { z: -0.005 } amplitude_m { x: 0.02 } frequency_hz { x: 1 }}"});
  const Recording touch = run(session, 600ms);

  const Vector3 held = touch.rows[210].device.measured_tool_position_world_m;
  for (std::size_t k = 210; k < 399; ++k) {
    EXPECT_EQ(touch.rows[k].device.force_on_hand_newton.norm(), 0.0) << k;
    EXPECT_NEAR((touch.rows[k].device.measured_tool_position_world_m - held).norm(), 0.0, 1e-12);
  }
  EXPECT_GT((touch.rows[399].device.measured_hand_position_m -
             touch.rows[210].device.measured_hand_position_m)
                .norm(),
            1e-3);
  EXPECT_GT(touch.last().device.force_on_hand_newton.norm(), 0.1) << "rendered again after release";
}

// scale 2, force ratio 0.5: 2.5 mm of hand would be 5 mm of tool
TEST(Lockstep, TheWorkspaceScalesMotionAndForce) {
  const Recording touch =
      run(parsed(kPressing, {"device.workspace.scale_ratio=2", "device.workspace.force_ratio=0.5"}),
          1s);
  const DeviceTick& tick = touch.last().device;

  EXPECT_NEAR(tick.measured_tool_position_world_m.z(), 2.0 * tick.measured_hand_position_m.z(),
              1e-12);
  EXPECT_NEAR(touch.last().mofc->requested_force_on_hand_newton.z(),
              0.5 * 400.0 * -tick.measured_tool_position_world_m.z(), 1e-4);
}

// --- the paper's experiments: the figures the README claims -----------------------------------

RunReport paper(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return run_loopback(shipped(name, overrides), {.seconds = 17.0});
}

TEST(PaperExperiments, RigidTissueIsUnstableWithoutTheControllerAndAtMostHalfAsUnstableWithIt) {
  const RunReport without = paper("paper_rigid", {"mofc.controller=none"});
  const RunReport one_way =
      paper("paper_rigid", {"mofc.controller=none", "scene.tissue[0].kelvin_voigt.adhesive=false"});
  const RunReport with = paper("paper_rigid");
  const RunReport vector = paper("paper_rigid", {"mofc.mode=vector"});

  EXPECT_GE(without.statistics.excess_reversals(), 10u);
  EXPECT_LT(one_way.statistics.excess_reversals(), without.statistics.excess_reversals());
  EXPECT_LE(2 * with.statistics.excess_reversals(), without.statistics.excess_reversals());
  EXPECT_LE(2 * vector.statistics.excess_reversals(), without.statistics.excess_reversals());
}

TEST(PaperExperiments, SoftTissueIsNotClamped) {
  for (const char* mode : {"mofc.mode=paper", "mofc.mode=vector"}) {
    const RunReport with = paper("paper_soft", {mode});

    const Vector3 transparency = with.statistics.transparency();
    for (int axis = 0; axis < 3; ++axis) EXPECT_GE(transparency[axis], 0.97) << mode << axis;
    EXPECT_LE(with.statistics.excess_reversals(), 2u) << mode;
  }
}

TEST(PaperExperiments, VectorModeNeverGivesTheHandEnergyAndNoControllerDoes) {
  double least_without = 0.0;
  for (const char* name : {"paper_soft", "paper_rigid", "paper_mixed"}) {
    for (const char* free_s : {"0", "2", "14"}) {
      const std::string free = std::string("hand.v.free_motion_s=") + free_s;

      const RunReport with = paper(name, {"mofc.mode=vector", free});
      EXPECT_GE(with.statistics.minimum_true_energy_joule(), -1e-6) << name << " " << free_s;

      const RunReport without = paper(name, {"mofc.controller=none", free});
      least_without = std::min(least_without, without.statistics.minimum_true_energy_joule());
    }
  }
  EXPECT_LT(least_without, -1e-4) << "the test must be able to fail";
}

}  // namespace
}  // namespace palpate
