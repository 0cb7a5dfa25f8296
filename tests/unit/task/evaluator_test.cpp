// SPDX-License-Identifier: Apache-2.0
// What counts as found, and that the score is the same however ticks, marks and surface arrive.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/unit/task/task_support.h"

namespace palpate::test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Outcome = TargetScore::Outcome;

constexpr double kMark_s = 2.0;

/// Presses over the lump with a force, and marks it by button 1 after 2 s.
TaskScore press_and_mark(double newton, double x_m = 0.02) {
  TaskConfig task = search({lump()});
  task.mark_button = 1;
  return score_of(task, 4.0, [&](double t_s) {
    Tip tip = pressed(x_m, 0.0, 0.003, newton);
    tip.buttons = t_s >= kMark_s && t_s < kMark_s + 0.2 ? 2U : 0U;
    return tip;
  });
}

TEST(TaskEvaluator, AMarkOverALesionThatCanBeFeltIsAFind) {
  const TaskScore score = press_and_mark(2.5, 0.025);
  ASSERT_THAT(score.marks, SizeIs(1));
  EXPECT_EQ(score.marks[0].outcome, MarkScore::Outcome::kFind);
  EXPECT_EQ(score.marks[0].origin, "button");
  EXPECT_EQ(score.targets[0].outcome, Outcome::kFound);
  EXPECT_NEAR(score.targets[0].found_after_s, kMark_s, 0.002);
  EXPECT_NEAR(score.targets[0].mark_distance_m, 0.005, 1e-4);
  EXPECT_THAT(findings_of(score), Contains("Found 1 of 1."));
}

TEST(TaskEvaluator, AHandThatPressesTooLightlyMissesTheDeepLesionAndIsToldSo) {
  const TaskScore score = score_of(search({lump()}), 4.0, [](double t_s) {
    return pressed(0.05 * (0.5 * t_s - 1.0) + 0.02, 0.0, 0.002, 0.8);
  });
  EXPECT_EQ(score.targets[0].outcome, Outcome::kMissed);
  EXPECT_THAT(
      findings_of(score),
      Contains("lump: missed. You pressed too lightly: at most 0.8 N over it, and it can be "
               "felt from 2.0 N on."));
}

TEST(TaskEvaluator, AMarkWithoutAPressThatCanFeelItIsAGuess) {
  const TaskScore score = press_and_mark(1.9);
  EXPECT_EQ(score.marks[0].outcome, MarkScore::Outcome::kGuess);
  EXPECT_EQ(score.targets[0].outcome, Outcome::kGuessed);
  EXPECT_EQ(score.count(MarkScore::Outcome::kFalseAlarm), 0U);
  EXPECT_THAT(findings_of(score),
              Contains(HasSubstr("guessed: before the mark you had pressed over it with at most "
                                 "1.9 N")));
}

// Two of them above each other: the second mark is for the second one.
TEST(TaskEvaluator, OfLesionsThatOverlapEachIsFoundByAMarkOfItsOwn) {
  TaskConfig task = search({lump(), lump()});
  task.mark_button = 1;
  const TaskScore score = score_of(task, 6.0, [](double t_s) {
    Tip tip = pressed(0.02, 0.0, 0.003, 2.5);
    tip.buttons = std::fmod(t_s, kMark_s) > kMark_s - 0.2 && t_s < 5.0 ? 2U : 0U;
    return tip;
  });
  ASSERT_THAT(score.marks, SizeIs(2));
  EXPECT_EQ(score.marks[1].outcome, MarkScore::Outcome::kFind);
  EXPECT_THAT(findings_of(score), Contains("Found 2 of 2."));
}

TEST(TaskEvaluator, ALesionThatCanBeFeltComesBeforeANearerOneThatCannot) {
  auto deep = lump();
  deep.palpable_newton = 5.0;
  TaskConfig task = search({deep, lump()});
  task.mark_button = 1;
  const TaskScore score = score_of(task, 4.0, [](double t_s) {
    Tip tip = pressed(0.02, 0.0, 0.003, 2.5);
    tip.buttons = t_s >= kMark_s && t_s < kMark_s + 0.2 ? 2U : 0U;
    return tip;
  });
  EXPECT_EQ(score.marks[0].outcome, MarkScore::Outcome::kFind);
  EXPECT_EQ(score.targets[0].outcome, Outcome::kMissed);
  EXPECT_EQ(score.targets[1].outcome, Outcome::kFound);
}

TEST(TaskEvaluator, MissedLesionsAreToldApart) {
  const auto finding = [](double newton, double x_m) {
    return findings_of(
        score_of(search({lump()}), 1.0, [&](double) { return pressed(x_m, 0, 0.002, newton); }))[1];
  };
  EXPECT_EQ(finding(1.0, -0.03), "lump: missed. You never touched the place above it.");
  EXPECT_EQ(finding(2.5, 0.02),
            "lump: missed. You pressed over it with up to 2.5 N, which is enough to feel it, and "
            "did not mark it.");
}

TEST(TaskEvaluator, AMarkElsewhereIsAFalseAlarmAndOneAfterAFindIsRepeated) {
  EXPECT_EQ(press_and_mark(2.5, 0.0).marks[0].outcome, MarkScore::Outcome::kFalseAlarm);
  // on the edge of the tolerance: 8 + 10 mm
  EXPECT_EQ(press_and_mark(2.5, 0.02 - 0.0175).targets[0].outcome, Outcome::kGuessed);
  TaskConfig task = search({lump()});
  task.mark_button = 0;
  const TaskScore score = score_of(task, 4.0, [](double t_s) {
    Tip tip = pressed(0.02, 0.0, 0.003, 2.5);
    tip.buttons = std::fmod(t_s, 1.0) > 0.5 ? 1U : 0U;
    return tip;
  });
  ASSERT_THAT(score.marks, SizeIs(4));
  EXPECT_EQ(score.marks[0].outcome, MarkScore::Outcome::kFind);
  EXPECT_EQ(score.marks[1].outcome, MarkScore::Outcome::kRepeated);
  EXPECT_EQ(score.count(Outcome::kFound), 1U);
}

TEST(TaskEvaluator, AMarkIsWhereTheTipHasTouchedLastWithinThreeSeconds) {
  const auto outcome = [](double lift_s) {
    TaskConfig task = search({lump()});
    task.mark_button = 0;
    return score_of(task, 1.0 + lift_s + 0.1,
                    [&](double t_s) {
                      Tip tip = t_s < 1.0 ? pressed(0.02, 0, 0.003, 2.5) : Tip{};
                      tip.buttons = t_s >= 1.0 + lift_s ? 1U : 0U;
                      return tip;
                    })
        .marks.at(0)
        .outcome;
  };
  EXPECT_EQ(outcome(2.9), MarkScore::Outcome::kFind);
  EXPECT_EQ(outcome(3.1), MarkScore::Outcome::kFalseAlarm);
}

Tip over_lump(double t_s) { return pressed(t_s < 2.0 ? 0.02 : -0.03, 0.0, 0.003, 2.5); }

// The mark was set in tick 1500, over the lump; it arrives before it, with it, or half a second
// later, when the tip is elsewhere.
TEST(TaskEvaluator, AMarkOfAKeyIsAtItsTickWheneverItArrives) {
  for (const std::uint64_t arrives : {std::uint64_t{0}, std::uint64_t{1500}, std::uint64_t{2400}}) {
    TaskEvaluator evaluator(search({lump()}), kTool);
    evaluator.take(plane_scene());
    run(evaluator, static_cast<double>(arrives) / kRate_hz, over_lump);
    evaluator.take({marker(5, 1500)});
    evaluator.take({marker(5, 1500)});  // RunState is repeated
    run(evaluator, 4.0, over_lump, arrives);
    evaluator.finish();
    ASSERT_THAT(evaluator.score().marks, SizeIs(1)) << arrives;
    EXPECT_EQ(evaluator.score().targets[0].outcome, Outcome::kFound) << arrives;
    EXPECT_NEAR(evaluator.score().marks[0].t_s, 1.5, 1e-9) << arrives;
  }
}

TEST(TaskEvaluator, TheSurfaceMayArriveLate) {
  TaskScore scores[2];
  for (const bool is_late : {false, true}) {
    TaskEvaluator evaluator(search({lump()}), kTool);
    if (!is_late) evaluator.take(plane_scene());
    run(evaluator, 3.0, over_lump);
    if (is_late) evaluator.take(plane_scene());
    run(evaluator, 5.0, over_lump, 3000);
    evaluator.finish();
    scores[is_late ? 1 : 0] = evaluator.score();
  }
  EXPECT_EQ(score_json(scores[0]), score_json(scores[1]));
  EXPECT_GT(scores[0].coverage_ratio, 0.01);
}

TEST(TaskEvaluator, WithoutASurfaceASearchIsNotJudged) {
  TaskEvaluator evaluator(search({lump()}), kTool);
  run(evaluator, 20.0, over_lump);
  EXPECT_GT(evaluator.state().elapsed_s, 19.0);
  evaluator.finish();
  EXPECT_TRUE(std::isnan(evaluator.score().coverage_ratio));
  EXPECT_NEAR(evaluator.score().force.median_newton, 2.5, 0.01);
  EXPECT_FALSE(evaluator.score().is_judged());
  EXPECT_THAT(findings_of(evaluator.score()),
              ElementsAre("The surface of the tissue was not received: the search is not judged."));
}

TEST(TaskEvaluator, AnAreaThatMeetsNoSurfaceIsToldApart) {
  TaskConfig task = search({lump()});
  std::get<PalpationTask>(task.kind).area = SphereGeometry{Vector3(0, 0, 1), 0.01};
  const TaskScore score = score_of(task, 3.0, over_lump);
  EXPECT_TRUE(std::isnan(score.coverage_ratio));
  EXPECT_THAT(findings_of(score), Contains(HasSubstr("meets no surface")));
}

TEST(TaskEvaluator, APersonStartsAndStopsIt) {
  TaskConfig task = search({lump()});
  task.is_started_by_person = true;
  TaskEvaluator evaluator(task, kTool);
  evaluator.take(plane_scene());
  run(evaluator, 2.0, over_lump);
  EXPECT_EQ(evaluator.state().phase, TaskState::Phase::kWaiting);
  std::vector<Marker> markers{marker(1, 999, Marker::Kind::kNote),
                              marker(2, 1999, Marker::Kind::kTaskStart)};
  evaluator.take(markers);
  run(evaluator, 4.0, over_lump, 2000);
  EXPECT_EQ(evaluator.state().phase, TaskState::Phase::kRunning);
  EXPECT_NEAR(evaluator.state().elapsed_s, 2.0, 0.01);
  markers.push_back(marker(3, 3499, Marker::Kind::kNote));
  markers.push_back(marker(4, 3999, Marker::Kind::kTaskStop));
  evaluator.take(markers);
  EXPECT_FALSE(evaluator.has_ended());  // no tick after the stop yet
  run(evaluator, 4.001, over_lump, 4000);
  EXPECT_TRUE(evaluator.has_ended());  // at once, not after the second for late marks
  const TaskScore& score = evaluator.score();
  EXPECT_EQ(score.end, TaskScore::End::kStopped);
  EXPECT_EQ(score.ticks, 2000U);
  EXPECT_THAT(score.marks, SizeIs(1));  // that of before the start is none
  run(evaluator, 5.0, over_lump, 4001);
  evaluator.finish();
  EXPECT_EQ(evaluator.score().ticks, 2000U);
}

TEST(TaskEvaluator, ATaskThatNobodyStartsHasNoScore) {
  TaskConfig task = search({lump()});
  task.is_started_by_person = true;
  const TaskScore score = score_of(task, 3.0, over_lump);
  EXPECT_EQ(score.end, TaskScore::End::kNotStarted);
  EXPECT_THAT(figures_of(score), IsEmpty());
  EXPECT_THAT(findings_of(score), SizeIs(1));
}

TEST(TaskEvaluator, TheTimeIsUpAtTheLimit) {
  TaskConfig task = search();
  task.time_s = 2.0;
  const TaskScore score = score_of(task, 5.0, over_lump);
  EXPECT_EQ(score.end, TaskScore::End::kTimeUp);
  EXPECT_EQ(score.time_s, 2.0);
  EXPECT_EQ(score.ticks, 2000U);
}

TEST(TaskEvaluator, BeforeTheEndTheStateTellsNothingOfTheScore) {
  TaskConfig task = search({lump()});
  task.briefing = "Find it.";
  task.time_s = 3.0;
  TaskEvaluator evaluator(task, kTool);
  evaluator.take(plane_scene());
  run(evaluator, 2.5, over_lump);
  evaluator.take({marker(1, 2400)});
  const TaskState state = evaluator.state();
  EXPECT_EQ(state.briefing, "Find it.");
  EXPECT_EQ(state.marks, 1U);
  EXPECT_THAT(state.findings, IsEmpty());
  EXPECT_THAT(state.figures, IsEmpty());
  run(evaluator, 5.0, over_lump, 2500);
  EXPECT_THAT(evaluator.state().findings, Not(IsEmpty()));
}

TEST(TaskEvaluator, MissingTicksAreCountedAndSaid) {
  TaskEvaluator evaluator(search(), kTool);
  evaluator.take(plane_scene());
  for (std::uint64_t i = 0; i < 4000; ++i) {
    if (i < 1000 || i >= 1400) evaluator.take(row_of(i, pressed(0, 0, 0.002, 1.0)));
  }
  evaluator.finish();
  EXPECT_EQ(evaluator.score().missing_ticks, 400U);
  EXPECT_NEAR(evaluator.score().missing_ratio(), 0.1, 1e-12);
  EXPECT_NEAR(evaluator.score().force.touch_s, 3.6, 0.01);
  EXPECT_THAT(findings_of(evaluator.score())[0],
              HasSubstr("10.0 % of the measurements are missing"));
  // the device has counted from 0, and the first tick that was seen is 500
  TaskEvaluator late(search(), kTool);
  late.take(plane_scene());
  run(late, 2.0, over_lump, 500);
  late.finish();
  EXPECT_EQ(late.score().missing_ticks, 500U);
  EXPECT_NEAR(late.score().time_s, 2.0, 0.002);
}

// A viewer that was started again during the task: markers are repeated, ticks are not.
TEST(TaskEvaluator, WhoComesLateKnowsWhenTheTaskBegan) {
  TaskConfig task = search({lump()});
  task.is_started_by_person = true;
  TaskEvaluator evaluator(task, kTool);
  evaluator.take(plane_scene());
  const std::vector<Marker> markers{marker(2, 999, Marker::Kind::kTaskStart), marker(3, 3000),
                                    marker(4, 6000)};
  evaluator.take(markers);
  run(
      evaluator, 8.0, [](double) { return Tip{}; }, 5000);
  EXPECT_NEAR(evaluator.state().elapsed_s, 7.0, 0.01);
  evaluator.finish();
  const TaskScore& score = evaluator.score();
  EXPECT_NEAR(score.time_s, 7.0, 0.002);
  EXPECT_EQ(score.ticks, 3000U);
  EXPECT_EQ(score.missing_ticks, 4000U);
  ASSERT_THAT(score.marks, SizeIs(2));  // what the hand did before them is not known
  EXPECT_EQ(score.marks[0].outcome, MarkScore::Outcome::kNotSeen);
  EXPECT_NEAR(score.marks[0].t_s, 2.0, 0.002);
  EXPECT_EQ(score.marks[1].outcome, MarkScore::Outcome::kNotSeen);
  EXPECT_THAT(findings_of(score)[0], HasSubstr("57.1 % of the measurements are missing"));
  EXPECT_THAT(findings_of(score),
              Contains("2 marks are not judged: the measurements before them are missing."));
}

TEST(TaskEvaluator, WhoComesAfterTheEndKnowsThatTheTimeIsUp) {
  TaskConfig task = search();
  task.is_started_by_person = true;
  task.time_s = 2.0;
  TaskEvaluator evaluator(task, kTool);
  evaluator.take(plane_scene());
  evaluator.take({marker(2, 999, Marker::Kind::kTaskStart)});
  run(evaluator, 9.0, over_lump, 6000);
  EXPECT_TRUE(evaluator.has_ended());
  EXPECT_EQ(evaluator.score().end, TaskScore::End::kTimeUp);
  EXPECT_EQ(evaluator.score().time_s, 2.0);
  EXPECT_EQ(evaluator.score().missing_ticks, 2000U);
  EXPECT_EQ(evaluator.score().missing_ratio(), 1.0);

  TaskEvaluator stopped(task, kTool);
  stopped.take(plane_scene());
  stopped.take(
      {marker(2, 999, Marker::Kind::kTaskStart), marker(3, 2499, Marker::Kind::kTaskStop)});
  run(stopped, 9.0, over_lump, 6000);
  EXPECT_EQ(stopped.score().end, TaskScore::End::kStopped);
  EXPECT_NEAR(stopped.score().time_s, 1.5, 1e-9);
  EXPECT_EQ(stopped.score().missing_ticks, 1500U);
}

TEST(TaskEvaluator, AMarkInAGapIsNotJudgedAndOneWithoutATouchIsAFalseAlarm) {
  for (const bool has_gap : {true, false}) {
    TaskEvaluator evaluator(search({lump()}), kTool);
    evaluator.take(plane_scene());
    evaluator.take({marker(2, 3000)});
    for (std::uint64_t i = 0; i < 6000; ++i) {
      if (!has_gap || i < 2500 || i >= 3500) evaluator.take(row_of(i, Tip{}));
    }
    evaluator.finish();
    ASSERT_THAT(evaluator.score().marks, SizeIs(1));
    EXPECT_EQ(evaluator.score().marks[0].outcome,
              has_gap ? MarkScore::Outcome::kNotSeen : MarkScore::Outcome::kFalseAlarm);
  }
}

TEST(TaskEvaluator, ARecordingThatBreaksOffIsAPartOfTheTask) {
  for (const double limit_s : {2.0, 5.0}) {
    TaskConfig task = search({lump()});
    task.time_s = limit_s;
    TaskEvaluator evaluator(task, kTool);
    evaluator.take(plane_scene());
    run(evaluator, 4.0, over_lump);
    evaluator.finish(true);
    const bool is_part = limit_s > 4.0;
    EXPECT_EQ(evaluator.score().is_cut, is_part);
    EXPECT_EQ(score_json(evaluator.score())["is_cut"], is_part);
    EXPECT_EQ(findings_of(evaluator.score())[0].starts_with("The recording breaks off 4.0 s"),
              is_part);
  }
}

TEST(TaskEvaluator, ADeviceThatIsStartedAgainIsSaid) {
  TaskEvaluator evaluator(search(), kTool);
  evaluator.take(plane_scene());
  run(evaluator, 2.0, over_lump);
  for (std::uint64_t i = 2000; i < 4000; ++i) evaluator.take(row_of(i, over_lump(0.0), 78));
  evaluator.finish();
  EXPECT_EQ(evaluator.score().device_restarts, 1U);
  EXPECT_EQ(evaluator.score().ticks, 4000U);
}

TEST(TaskEvaluator, InAReplayOnlyTheNumbersOfTicksCount) {
  TaskEvaluator evaluator(search({lump()}), kTool, {.ignores_sessions = true});
  evaluator.take(plane_scene());
  evaluator.take({marker(5, 1500, Marker::Kind::kNote, 12345)});
  run(evaluator, 4.0, over_lump);
  evaluator.finish();
  EXPECT_EQ(evaluator.score().targets[0].outcome, Outcome::kFound);
}

}  // namespace
}  // namespace palpate::test
