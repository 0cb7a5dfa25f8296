// SPDX-License-Identifier: Apache-2.0
// Hops 2 and 3 thinned by their deadbands, in lockstep: the messages saved, the error added, and
// that the silence of a deadband is distinguished from that of dead physics.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/support/parameter_words.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

constexpr double kStiffness_newton_per_m = 400.0;

/// A hand that presses to and fro, 2.5 mm deep on average, in a block of 400 N/m; device and
/// physics at 1 kHz, encoder 0.055 mm.
constexpr const char* kPressing = R"(
name: "pressing"
device { monitor: off simulated {} start_ramp_ms: 0 }
hand { stiffness_newton_per_m: 400 }
mofc { controller: none interaction: held }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } } }
)";
constexpr const char* kResting = "hand.hold={position_m { z: -0.005 }}";
constexpr const char* kMoving =
    "hand.sinusoid={center_m { z: -0.005 } amplitude_m { x: 0.01 z: 0.006 } "
    "frequency_hz { x: 0.3 z: 0.7 }}";
constexpr const char* kThinMotion = "mofc.motion_deadband={}";
constexpr const char* kThinInteraction = "physics.interaction_deadband={}";

struct Recording {
  std::vector<TickRow> rows;
  MofcCounters mofc;
  PhysicsCounters physics;
};

Recording record(const std::vector<std::string>& overrides, Duration length) {
  Recording result;
  Lockstep lockstep(parse_session(kPressing, "test.txtpb", overrides), {},
                    [&](const TickRow& row, const IdealState&) { result.rows.push_back(row); });
  lockstep.run_until(length);
  result.mofc = lockstep.mofc_counters();
  result.physics = lockstep.physics_counters();
  return result;
}

/// The law of the block, at the position that was measured.
double law_newton(const TickRow& row) {
  return kStiffness_newton_per_m * std::max(0.0, -row.device.measured_tool_position_world_m.z());
}

// Physics steps the motion read at tick k at the same instant; its force is requested at tick k
// + 1.
TEST(Deadband, TheErrorOfTheForceIsAtMostTheRatioOrTheFloorAtEveryPhysicsStep) {
  for (const double ratio : {0.02, 0.05, 0.2}) {
    const Recording thinned = record(
        {kMoving, kThinInteraction, "physics.interaction_deadband.ratio=" + std::to_string(ratio)},
        5s);
    double worst = 0.0;
    for (std::size_t k = 1; k < thinned.rows.size(); ++k) {
      const double F = law_newton(thinned.rows[k - 1]);
      const double error = std::abs(thinned.rows[k].mofc->requested_force_on_hand_newton.z() - F);
      ASSERT_LE(error, std::max(ratio * F, 0.05) + 1e-12) << "tick " << k;
      worst = std::max(worst, error);
    }
    EXPECT_GT(worst, 0.03) << "there is something to save";
  }
}

// A contact model describes a spring completely: the force of mofc_node stays right without another
// message, so the deadband of hop 3 leaves only the keep-alive, 50 messages/s of 1000, and the
// force is always the law at the present position: at the one that was read, with an estimator that
// has no other.
TEST(Deadband, AContactModelThatStaysRightNeedsNoMessage) {
  const Recording thinned = record({kMoving, kThinInteraction, "mofc.interaction=local",
                                    "mofc.velocity_estimator.difference={}"},
                                   5s);

  for (std::size_t k = 100; k < thinned.rows.size(); ++k) {
    ASSERT_NEAR(thinned.rows[k].mofc->requested_force_on_hand_newton.z(),
                law_newton(thinned.rows[k]), 1e-9)
        << "tick " << k;
  }
  EXPECT_LE(thinned.mofc.interaction.accepted, 252u);
  EXPECT_EQ(thinned.mofc.stale_ticks, 0u);
}

// The tool position that physics has is wrong by at most floor_m: 400 N/m · 0.1 mm = 0.04 N more.
TEST(Deadband, AThinnedMotionAddsNoMoreThanItsFloorTimesTheStiffness) {
  const Recording thinned = record({kMoving, kThinMotion, kThinInteraction}, 5s);
  for (std::size_t k = 1; k < thinned.rows.size(); ++k) {
    const double F = law_newton(thinned.rows[k - 1]);
    const double motion_newton = kStiffness_newton_per_m * 1e-4;
    ASSERT_NEAR(thinned.rows[k].mofc->requested_force_on_hand_newton.z(), F,
                std::max(0.05 * (F + motion_newton), 0.05) + motion_newton + 1e-12)
        << "tick " << k;
  }
}

// Every message is either sent or counted as suppressed: one per tick and step, less the first step
// or so; what was sent arrived, and no gap in the sequence counts as loss.
TEST(Deadband, SavesMostMessagesAndCountsThem) {
  const Recording thinned = record({kMoving, kThinMotion, kThinInteraction}, 5s);

  EXPECT_EQ(thinned.mofc.motions_suppressed + thinned.physics.tool_motion.accepted, 5000u);
  EXPECT_NEAR(static_cast<double>(thinned.physics.interactions_suppressed +
                                  thinned.mofc.interaction.accepted),
              5000.0, 1.0);
  EXPECT_EQ(thinned.mofc.interaction.skipped, 0u);
  EXPECT_EQ(thinned.physics.tool_motion.skipped, 0u);
  EXPECT_GT(thinned.mofc.motions_suppressed, 2000u);
  EXPECT_GT(thinned.physics.interactions_suppressed, 4000u);
}

TEST(Deadband, OffByDefaultSuppressesNothing) {
  const Recording plain = record({kMoving}, 1s);

  EXPECT_EQ(plain.mofc.motions_suppressed, 0u);
  EXPECT_EQ(plain.physics.interactions_suppressed, 0u);
  EXPECT_EQ(plain.physics.tool_motion.accepted, 1000u);
}

TEST(Deadband, ContactBeginsAndEndsInTheNextTick) {
  const Recording thinned = record({kMoving, kThinInteraction}, 5s);
  int changes = 0;
  for (std::size_t k = 1; k < thinned.rows.size(); ++k) {
    const bool touches = law_newton(thinned.rows[k - 1]) > 0.0;
    ASSERT_EQ(thinned.rows[k].mofc->is_in_contact, touches) << "tick " << k;
    if (touches != (law_newton(thinned.rows[k]) > 0.0)) ++changes;
  }
  EXPECT_GT(changes, 4);
}

// Both keep-alives are 20 ms: 50 motions/s and nothing else, and the force never fades.
TEST(Deadband, ARestingHandIsKeptAliveAndKeepsItsForce) {
  const Recording thinned = record({kResting, kThinMotion, kThinInteraction}, 4s);

  EXPECT_EQ(thinned.mofc.stale_ticks, 0u);
  // the first 1 s is the hand coming to rest
  EXPECT_LT(thinned.physics.tool_motion.accepted, 150u + 200u);
  EXPECT_LT(thinned.mofc.interaction.accepted, 150u + 200u);
  EXPECT_GT(thinned.mofc.interaction.accepted, 190u);
  EXPECT_EQ(thinned.rows.back().mofc->state, MofcState::kContact);
  EXPECT_NEAR(thinned.rows.back().device.force_on_hand_newton.z(), 1.0, 0.12);
}

// A motion up to 20 ms old is answered by an Interaction up to 20 ms old: the silence is in the
// age.
TEST(Deadband, TheAgeOfTheForceCountsTheSilence) {
  const Recording thinned = record({kResting, kThinMotion, kThinInteraction}, 4s);
  Duration oldest{};
  for (std::size_t k = 2000; k < thinned.rows.size(); ++k) {
    oldest = std::max(oldest, thinned.rows[k].mofc->force_age);
  }
  EXPECT_GE(oldest, Duration(20ms));
  EXPECT_LE(oldest, Duration(42ms));
}

/// A fault from 1 s on, and the silence after which the force fades.
struct Death {
  const char* fault;
  int silence_ms;
};
void PrintTo(const Death& death, std::ostream* out) { *out << death.fault; }

// stale_after is 150 + 3 · (20 + 20) = 270 ms, the fade 50 ms; the tissue is described and at rest,
// so that it stays for still_after, unless physics sends without stepping. The last new answer came
// at most 41 ms before the fault, and at most 41 ms after its beginning: messages under way and the
// first message of a freeze still count as new.
class DeadbandDeath : public testing::TestWithParam<Death> {};
INSTANTIATE_TEST_SUITE_P(
    Faults, DeadbandDeath,
    testing::Values(Death{"faults.interaction.outage={from_s: 1 until_s: 9}", 600},
                    Death{"faults.interaction.freeze={from_s: 1 until_s: 9}", 270},
                    Death{"faults.tool_motion.outage={from_s: 1 until_s: 9}", 600},
                    Death{"faults.tool_motion.freeze={from_s: 1 until_s: 9}", 600}),
    test::parameter_words<Death>);

TEST_P(DeadbandDeath, RealSilenceIsDetectedWhetherTheHandRestsOrMoves) {
  const auto& [fault, silence_ms] = GetParam();
  const auto silence = static_cast<std::size_t>(silence_ms);
  for (const char* hand : {kResting, kMoving}) {
    const Recording dead =
        record({hand, kThinMotion, kThinInteraction, fault, "mofc.still_after_ms=600"}, 2000ms);

    const auto state_at = [&](std::size_t k) { return dead.rows[k].mofc->state; };
    EXPECT_NE(state_at(1000 - 41 + silence), MofcState::kFading)
        << hand << ": silence of the deadband";
    const MofcState declared = state_at(1000 + 41 + silence + 1);
    EXPECT_TRUE(declared == MofcState::kFading || declared == MofcState::kNoPhysics) << hand;
    for (std::size_t k = 1000 + 41 + silence + 51; k < dead.rows.size(); ++k) {
      ASSERT_EQ(state_at(k), MofcState::kNoPhysics) << hand << " tick " << k;
      ASSERT_EQ(dead.rows[k].device.force_on_hand_newton.norm(), 0.0) << hand << " tick " << k;
    }
  }
}

// Each hop loses a fifth: two keep-alives in a row and more must be lost before the force fades.
TEST(Deadband, LossIsRarelyTreatedAsSilence) {
  const Recording lossy =
      record({kResting, kThinMotion, kThinInteraction, "faults.interaction.loss_ratio=0.2",
              "faults.tool_motion.loss_ratio=0.2"},
             60s);
  EXPECT_LT(lossy.mofc.stale_ticks, 60'000u / 100);
}

}  // namespace
}  // namespace palpate
