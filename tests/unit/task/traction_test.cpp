// SPDX-License-Identifier: Apache-2.0
// Tissue that a tip takes hold of and brings to a place as a test says: what geometry gives is
// expected within 1 %.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/task/score_table.h"
#include "tests/unit/task/task_support.h"

namespace palpate::test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using Ending = TractionScore::Outcome;

constexpr double kTarget_m = 0.03;
constexpr double kStiffness_newton_per_m = 100.0;

TaskConfig retract() {
  TaskConfig task;
  task.most_force_newton = 2.5;
  task.kind = TractionTask{.target_m = {0, 0, kTarget_m}, .tolerance_m = 0.002, .hold_s = 3.0};
  return task;
}

/// Takes hold at z = 0 after 1 s, rises with 10 mm/s to a height, and pulls like a spring.
struct Lift {
  double to_m = kTarget_m;
  double open_s = 1e9;  // the jaws

  [[nodiscard]] Tip operator()(double t_s) const {
    const double z_m = std::clamp(0.01 * (t_s - 1.0), 0.0, to_m);
    const bool holds = t_s >= 1.0 && t_s < open_s;
    return {.at_m = {0, 0, z_m},
            .newton = holds ? kStiffness_newton_per_m * z_m : 0.0,
            .grip = holds ? GripState::kHolds : GripState::kNone};
  }
};

TaskScore scored(double end_s, const std::function<Tip(double t_s)>& tip_at,
                 const TaskConfig& task = retract()) {
  TaskEvaluator evaluator(task, kTool);
  run(evaluator, end_s, tip_at);
  evaluator.finish();
  EXPECT_TRUE(evaluator.score().traction.has_value());
  return evaluator.score();
}

// At 28 mm after 1 + 2.8 s, held there for 3 s after 6.8 s.
TEST(TractionTask, TimesWayAndForcesFollowFromGeometry) {
  const TaskScore score = scored(9.0, Lift());
  const TractionScore& traction = *score.traction;
  EXPECT_EQ(traction.outcome(), Ending::kDone);
  EXPECT_NEAR(traction.held_after_s, 1.0, 0.01);
  EXPECT_NEAR(traction.reached_after_s / 3.8, 1.0, 0.01);
  EXPECT_NEAR(traction.done_after_s / 6.8, 1.0, 0.01);
  EXPECT_NEAR(traction.longest_s / 5.2, 1.0, 0.01);
  EXPECT_NEAR(traction.within_ratio(), 1.0, 1e-9);
  EXPECT_NEAR(traction.retraction_m / 0.03, 1.0, 0.01);
  EXPECT_NEAR(score.path_m / 0.03, 1.0, 0.01);
  // 8 s of holding, of which 3 s rise evenly to 3 N: the median is that of 5 s at 3 N
  EXPECT_NEAR(traction.force.touch_s / 8.0, 1.0, 0.01);
  EXPECT_NEAR(traction.force.median_newton / 3.0, 1.0, 0.01);
  EXPECT_NEAR(traction.force.most_newton / 3.0, 1.0, 0.01);
  // beyond 2.5 N from 3.5 s on: 0.5 s rising to 0.5 N, then 5 s of it
  EXPECT_NEAR(score.overshoot_newton / 0.5, 1.0, 0.01);
  EXPECT_NEAR(score.beyond_s / 5.5, 1.0, 0.01);
  EXPECT_NEAR(score.damage_newton_s / (0.125 + 2.5), 1.0, 0.01);
  EXPECT_THAT(findings_of(score),
              Contains("You held the tissue at the target for 5.2 s, as asked."));
  EXPECT_THAT(findings_of(score), Contains(HasSubstr("You pulled too hard: up to 3.0 N")));
}

// There from 3.8 s on, away from 5 to 6 s, then until 8 s: 1.2 s and 2 s of 4.2 s.
TEST(TractionTask, ABreakBeginsTheTimeAnew) {
  const TaskScore score = scored(8.0, [](double t_s) {
    Tip tip = Lift()(t_s);
    if (t_s >= 5.0 && t_s < 6.0) tip.at_m.x() = 0.01;
    return tip;
  });
  EXPECT_EQ(score.traction->outcome(), Ending::kTooShort);
  EXPECT_NEAR(score.traction->longest_s / 2.0, 1.0, 0.01);
  EXPECT_NEAR(score.traction->within_ratio() / (3.2 / 4.2), 1.0, 0.01);
  EXPECT_THAT(findings_of(score),
              Contains(HasSubstr("for 2.0 s without a break; 3.0 s are asked")));
}

TEST(TractionTask, WhatIsNotHeldOrNotReachedIsSaid) {
  const TaskScore empty = scored(6.0, [](double t_s) {
    Tip tip = Lift()(t_s);
    tip.grip = GripState::kNone;
    return tip;
  });
  EXPECT_EQ(empty.traction->outcome(), Ending::kNotHeld);
  EXPECT_THAT(findings_of(empty), Contains("You did not take hold of the tissue."));
  EXPECT_TRUE(std::isnan(empty.traction->retraction_m));

  const TaskScore low = scored(6.0, Lift{.to_m = 0.0279});
  EXPECT_EQ(low.traction->outcome(), Ending::kNotReached);
  EXPECT_TRUE(std::isnan(low.traction->within_ratio()));
  // jaws that open end the hold
  EXPECT_EQ(scored(9.0, Lift{.open_s = 6.7}).traction->outcome(), Ending::kTooShort);
  EXPECT_EQ(scored(9.0, Lift{.open_s = 6.9}).traction->outcome(), Ending::kDone);
}

/// From a time on the jaws do this.
std::function<Tip(double)> with_grip(double from_s, GripState grip) {
  return [=](double t_s) {
    Tip tip = Lift()(t_s);
    if (t_s >= from_s) tip.grip = grip;
    return tip;
  };
}

TEST(TractionTask, TearsAndSlipsAreCountedOnceEach) {
  const TaskScore torn = scored(9.0, with_grip(3.0, GripState::kTorn));
  EXPECT_EQ(torn.traction->outcome(), Ending::kTorn);
  EXPECT_EQ(torn.traction->tears, 1U);
  EXPECT_NEAR(torn.traction->torn_after_s / 3.0, 1.0, 0.01);
  EXPECT_THAT(findings_of(torn),
              Contains("You tore the tissue after 3.0 s: you pulled with up to 2.00 N."));
  // torn after the time was held is torn
  EXPECT_EQ(scored(9.0, with_grip(8.0, GripState::kTorn)).traction->outcome(), Ending::kTorn);

  const TaskScore lost = scored(9.0, with_grip(3.0, GripState::kSlipped));
  EXPECT_EQ(lost.traction->outcome(), Ending::kLost);
  EXPECT_EQ(lost.traction->slipped_out, 1U);

  const TaskScore slipping = scored(9.0, [](double t_s) {
    Tip tip = Lift()(t_s);
    if ((t_s >= 2.0 && t_s < 2.2) || (t_s >= 4.0 && t_s < 4.1)) tip.grip = GripState::kSlips;
    return tip;
  });
  EXPECT_EQ(slipping.traction->outcome(), Ending::kDone);
  EXPECT_EQ(slipping.traction->slips, 2U);
  EXPECT_EQ(slipping.traction->grips, 1U);
  EXPECT_THAT(findings_of(slipping), Contains("It slipped 2 times."));

  // what sticks for a moment slips on
  const TaskScore jerky = scored(9.0, [](double t_s) {
    Tip tip = Lift()(t_s);
    if (t_s >= 2.0 && t_s < 2.5 && std::fmod(t_s, 0.05) < 0.03) tip.grip = GripState::kSlips;
    return tip;
  });
  EXPECT_EQ(jerky.traction->slips, 1U);
}

TEST(TractionTask, WhatWasTornBeforeTheStartIsNotOfTheTask) {
  TaskConfig task = retract();
  task.is_started_by_person = true;
  TaskEvaluator evaluator(task, kTool);
  const auto tip_at = with_grip(0.5, GripState::kTorn);
  run(evaluator, 2.0, tip_at);
  evaluator.take({marker(1, 1999, Marker::Kind::kTaskStart)});
  run(evaluator, 4.0, tip_at, 2000);
  evaluator.finish();
  EXPECT_EQ(evaluator.score().traction->outcome(), Ending::kNotHeld);
  EXPECT_EQ(evaluator.score().traction->tears, 0U);
}

TEST(TractionTask, MissingAnswersOfMofcNodeAreSaid) {
  const TaskScore score = scored(9.0, [](double t_s) {
    Tip tip = Lift()(t_s);
    // before the first answer nothing is known to be missing
    if (t_s < 0.1 || (t_s >= 5.0 && t_s < 5.5)) tip.grip.reset();
    return tip;
  });
  EXPECT_NEAR(static_cast<double>(score.traction->unknown_ticks), 500.0, 1.0);
  EXPECT_EQ(score.traction->outcome(), Ending::kDone);
  EXPECT_THAT(findings_of(score), Contains(HasSubstr("is not known for 500 measurements")));
}

TEST(TractionTask, APageGetsTheTargetAndHowFarItIs) {
  TaskEvaluator evaluator(retract(), kTool);
  ASSERT_TRUE(evaluator.state().traction.has_value());
  EXPECT_EQ(evaluator.state().traction->target_m, Vector3(0, 0, kTarget_m));
  run(evaluator, 6.0, Lift());
  const TaskState state = evaluator.state();
  EXPECT_EQ(state.kind, TaskState::Kind::kTraction);
  EXPECT_TRUE(state.traction->is_holding);
  EXPECT_TRUE(state.traction->is_at_target);
  EXPECT_NEAR(state.traction->held_s, 2.2, 0.01);  // at 28 mm after 3.8 s
}

// Marks may arrive a second late, so that much is judged later; what the page says is of the newest
// tick.
TEST(TractionTask, APageIsToldOfTheNewestTick) {
  constexpr double kTick_s = 1.0 / kRate_hz;
  TaskEvaluator evaluator(retract(), kTool);
  auto after = [&, next = std::uint64_t{0}](double t_s) mutable {
    run(evaluator, t_s, Lift{.open_s = 7.0}, next);
    next = static_cast<std::uint64_t>(std::lround(t_s * kRate_hz));
    return *evaluator.state().traction;
  };
  EXPECT_FALSE(after(1.0).is_holding);
  EXPECT_TRUE(after(1.0 + kTick_s).is_holding);
  EXPECT_FALSE(after(3.79).is_at_target);
  EXPECT_TRUE(after(3.81).is_at_target);
  EXPECT_LT(after(6.78).held_s, 3.0);
  EXPECT_GE(after(6.82).held_s, 3.0);
  EXPECT_TRUE(after(7.0).is_at_target);
  const auto opened = after(7.0 + kTick_s);
  EXPECT_FALSE(opened.is_holding || opened.is_at_target);
  EXPECT_NEAR(opened.held_s, 3.2, 0.02);
  // it changes nothing of the score
  run(evaluator, 9.0, Lift{.open_s = 7.0}, 7001);
  evaluator.finish();
  EXPECT_NEAR(evaluator.score().traction->longest_s / 3.2, 1.0, 0.01);
}

TEST(TractionTask, BeforeTheStartNoTimeIsHeld) {
  TaskConfig task = retract();
  task.is_started_by_person = true;
  TaskEvaluator evaluator(task, kTool);
  run(evaluator, 6.0, Lift());
  const TaskState state = evaluator.state();
  EXPECT_TRUE(state.traction->is_at_target);
  EXPECT_EQ(state.traction->held_s, 0.0);
}

TEST(TractionTask, ItsFiguresAreInJsonAndCsv) {
  const TaskScore score = scored(9.0, Lift());
  const nlohmann::ordered_json json = score_json(score);
  EXPECT_EQ(json["kind"], "traction");
  EXPECT_EQ(json["outcome"], "done");
  EXPECT_NEAR(json["done_after_s"].get<double>() / 6.8, 1.0, 0.01);
  EXPECT_EQ(json["tears"], 0);
  const std::string csv = table_csv({{"a", score}});
  EXPECT_THAT(csv, HasSubstr(",done,"));
  EXPECT_THAT(csv, HasSubstr("held_after_s,reached_after_s,done_after_s,torn_after_s,longest_s,"
                             "within_ratio,retraction_m,grips,tears,slips,slipped_out,"
                             "force_held_p95_n,unknown_grip_ticks\n"));
}

}  // namespace
}  // namespace palpate::test
