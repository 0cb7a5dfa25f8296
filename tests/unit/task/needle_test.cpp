// SPDX-License-Identifier: Apache-2.0
// A needle in three layers, pushed by a tip that moves as a test says: what geometry and the law of
// the layers give is expected within 1 %.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numbers>

#include "common/task/score_table.h"
#include "tests/unit/task/task_support.h"

namespace palpate::test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Reached = NeedleScore::Outcome;

constexpr ToolShape kNeedle{.tip_radius_m = 0.0007, .shaft_length_m = 0.1, .shaft_radius_m = 7e-4};
constexpr double kSpeed_m_per_s = 0.005;
constexpr double kStart_m = -0.005;  // depth of the foremost point of the tip

NeedleLayer layer(const std::string& name, double top_m, double bottom_m, double stiffness,
                  double puncture_newton, bool is_spared = false) {
  return {.name = name,
          .geometry = BoxGeometry{{0, 0, -0.5 * (top_m + bottom_m)}, {0.1, 0.1, bottom_m - top_m}},
          .material = {.stiffness_newton_per_m = stiffness,
                       .friction_stiffness_newton_per_m = stiffness,
                       .puncture_newton = puncture_newton,
                       .cutting_newton = 0.25 * puncture_newton},
          .is_spared = is_spared};
}

/// Skin from 0 to 4 mm gives way at 1 mm, the ligament from 4 to 10 mm at 1 mm, the dura from 14 to
/// 15 mm at 0.5 mm.
TaskConfig epidural() {
  TaskConfig task;
  task.mark_button = 0;
  task.kind = NeedleTask{
      .layers = {layer("skin", 0.0, 0.004, 1000, 1.0), layer("ligament", 0.004, 0.010, 2000, 2.0),
                 layer("dura", 0.014, 0.015, 1000, 0.5, true)},
      .membrane = 1};
  return task;
}

/// Its foremost point is that deep.
Tip needle_at(double depth_m, double newton = 1.0) {
  return {.at_m = {0.0, 0.0, kNeedle.tip_radius_m - depth_m}, .newton = newton};
}

TaskScore pushed(const TaskConfig& task, double end_s,
                 const std::function<Tip(double t_s)>& tip_at) {
  TaskEvaluator evaluator(task, kNeedle);
  run(evaluator, end_s, tip_at);
  evaluator.finish();
  EXPECT_TRUE(evaluator.score().needle.has_value());
  return evaluator.score();
}

double depth_m(double t_s, double end_m) {
  return std::min(kStart_m + kSpeed_m_per_s * t_s, end_m);
}

/// With even speed to a depth, and there for a second.
TaskScore pushed_to(double end_m, const TaskConfig& task = epidural()) {
  return pushed(task, (end_m - kStart_m) / kSpeed_m_per_s + 1.0,
                [&](double t_s) { return needle_at(depth_m(t_s, end_m)); });
}

TEST(Needle, DepthPathTimeAndOvershootFollowFromGeometry) {
  const TaskScore score = pushed_to(0.013);
  const NeedleScore& needle = *score.needle;
  EXPECT_EQ(needle.outcome(), Reached::kThrough);
  EXPECT_NEAR(needle.overshoot_m / 0.003, 1.0, 0.01);
  EXPECT_NEAR(needle.end_behind_m / 0.003, 1.0, 0.01);
  EXPECT_NEAR(needle.depth_most_m / 0.013, 1.0, 0.01);
  EXPECT_NEAR(needle.sideways_m, 0.0, 1e-9);
  EXPECT_NEAR(score.path_m / 0.018, 1.0, 0.01);
  // skin gives way at 1 N / (1000 N/m) of depth, the ligament at 4 mm + 2 N / (2000 N/m)
  ASSERT_THAT(needle.layers, SizeIs(3));
  EXPECT_NEAR(needle.layers[0].punctured_after_s / 1.2, 1.0, 0.01);
  EXPECT_NEAR(needle.layers[0].puncture_depth_m / 0.001, 1.0, 0.01);
  EXPECT_NEAR(needle.layers[1].punctured_after_s / 2.0, 1.0, 0.01);
  EXPECT_NEAR(needle.layers[1].puncture_depth_m / 0.005, 1.0, 0.01);
  EXPECT_EQ(needle.layers[2].punctures, 0U);
  EXPECT_THAT(findings_of(score),
              Contains("You got through ligament. The tip went 3.0 mm behind ligament."));
}

TEST(Needle, WhatIsToBeSparedIsNamedIfItIsPunctured) {
  EXPECT_EQ(pushed_to(0.0144).needle->outcome(), Reached::kThrough);  // the dura yields, and holds
  const TaskScore score = pushed_to(0.0146);
  EXPECT_EQ(score.needle->outcome(), Reached::kInjury);
  EXPECT_EQ(score.needle->layers[2].punctures, 1U);
  EXPECT_NEAR(score.needle->overshoot_m / 0.0046, 1.0, 0.01);
  EXPECT_THAT(findings_of(score), Contains("You punctured dura, which was to be spared."));
}

TEST(Needle, StopsTooSoonAreToldApart) {
  const TaskScore before = pushed_to(0.0049);
  EXPECT_EQ(before.needle->outcome(), Reached::kNotThrough);
  EXPECT_TRUE(std::isnan(before.needle->overshoot_m));
  EXPECT_THAT(findings_of(before), Contains("You did not get through ligament."));
  const TaskScore inside = pushed_to(0.0095);
  EXPECT_EQ(inside.needle->outcome(), Reached::kInside);
  EXPECT_EQ(inside.needle->overshoot_m, 0.0);
}

TEST(Needle, MoreThanTheAllowedOvershootIsTooFar) {
  TaskConfig task = epidural();
  std::get<NeedleTask>(task.kind).most_overshoot_m = 0.002;
  EXPECT_EQ(pushed_to(0.0119, task).needle->outcome(), Reached::kThrough);
  const TaskScore score = pushed_to(0.0121, task);
  EXPECT_EQ(score.needle->outcome(), Reached::kTooFar);
  EXPECT_THAT(findings_of(score), Contains(HasSubstr("2.0 mm are allowed")));
}

// The ligament gives way after 2.0 s; the button is pressed after 1.5, 2.3 and 3.0 s.
TEST(Needle, AMarkSaysThatTheResistanceIsLost) {
  const TaskScore score = pushed(epidural(), 4.0, [](double t_s) {
    Tip tip = needle_at(depth_m(t_s, 0.012));
    for (const double at_s : {1.5, 2.3, 3.0}) {
      if (t_s >= at_s && t_s < at_s + 0.1) tip.buttons = 1;
    }
    return tip;
  });
  ASSERT_THAT(score.marks, SizeIs(3));
  EXPECT_EQ(score.marks[0].outcome, MarkScore::Outcome::kFalseAlarm);
  EXPECT_EQ(score.marks[1].outcome, MarkScore::Outcome::kFind);
  EXPECT_EQ(score.marks[1].target, "ligament");
  EXPECT_EQ(score.marks[2].outcome, MarkScore::Outcome::kRepeated);
  EXPECT_NEAR(score.needle->told_after_s / 0.3, 1.0, 0.01);
  EXPECT_THAT(findings_of(score), Contains("1 mark was set before the resistance was lost."));
  EXPECT_THAT(findings_of(pushed_to(0.012)), Contains("You did not mark the loss of resistance."));
}

// 10° off the line: sideways by tan 10° of the depth.
TEST(Needle, ASlantedWayGoesSideways) {
  const double slope = std::tan(10.0 / 180.0 * std::numbers::pi);
  const TaskScore score = pushed(epidural(), 4.0, [&](double t_s) {
    Tip tip = needle_at(depth_m(t_s, 0.012));
    tip.at_m.x() = slope * depth_m(t_s, 0.012);
    return tip;
  });
  EXPECT_NEAR(score.needle->sideways_m / (slope * 0.012), 1.0, 0.01);
  EXPECT_NEAR(score.needle->depth_most_m / 0.012, 1.0, 0.01);
}

// 0.8 N in the skin, 1.7 N in the ligament, 0.3 N behind it.
TEST(Needle, EachLayerHasTheForcesOfTheTipInIt) {
  const TaskScore score = pushed(epidural(), 4.0, [](double t_s) {
    const double at_m = depth_m(t_s, 0.013);
    return needle_at(at_m, at_m < 0.0 ? 0.0 : at_m < 0.004 ? 0.8 : at_m < 0.010 ? 1.7 : 0.3);
  });
  const auto& layers = score.needle->layers;
  EXPECT_NEAR(layers[0].force.median_newton, 0.8, 0.01);
  EXPECT_NEAR(layers[0].force.touch_s / 0.8, 1.0, 0.01);  // 4 mm at 5 mm/s
  EXPECT_NEAR(layers[1].force.most_newton, 1.7, 1e-9);
  // until the rear of the tip has left it
  EXPECT_NEAR(layers[1].force.touch_s / ((0.006 + 2.0 * kNeedle.tip_radius_m) / kSpeed_m_per_s),
              1.0, 0.01);
  EXPECT_NEAR(layers[0].puncture_newton, 0.8, 1e-9);
  EXPECT_TRUE(std::isnan(layers[2].force.most_newton));
}

// In to 12 mm, out to 20 mm before the skin, in again: while the shaft is in a layer it stays open.
TEST(Needle, ALayerHealsOnceTheNeedleHasLeftIt) {
  const auto punctures = [](double out_m) {
    return pushed(epidural(), 9.0,
                  [&](double t_s) {
                    const double at_m = t_s < 4.0   ? depth_m(t_s, 0.012)
                                        : t_s < 5.0 ? out_m
                                                    : std::max(out_m, depth_m(t_s - 5.0, 0.012));
                    return needle_at(at_m);
                  })
        .needle->layers[1]
        .punctures;
  };
  EXPECT_EQ(punctures(0.002), 2U);  // out of the ligament, in the skin
  EXPECT_EQ(punctures(0.006), 1U);
}

TEST(Needle, PuncturesBeforeTheStartCountAsWay) {
  TaskConfig task = epidural();
  task.is_started_by_person = true;
  TaskEvaluator evaluator(task, kNeedle);
  const auto tip_at = [](double t_s) { return needle_at(depth_m(t_s, 0.012)); };
  run(evaluator, 1.5, tip_at);
  evaluator.take({marker(1, 1499, Marker::Kind::kTaskStart)});
  run(evaluator, 4.0, tip_at, 1500);
  EXPECT_EQ(evaluator.state().phase, TaskState::Phase::kRunning);
  EXPECT_EQ(evaluator.state().kind, TaskState::Kind::kNeedle);
  EXPECT_THAT(evaluator.state().figures, IsEmpty());
  evaluator.finish();
  const NeedleScore& needle = *evaluator.score().needle;
  EXPECT_EQ(needle.layers[0].punctures, 0U);
  EXPECT_EQ(needle.layers[1].punctures, 1U);
  EXPECT_NEAR(needle.layers[1].punctured_after_s / 0.5, 1.0, 0.01);
}

// The ligament is made half as stiff: it gives way at 2 mm.
TEST(Needle, AChangeOfATissueIsKnown) {
  TaskConfig task = epidural();
  auto& layers = std::get<NeedleTask>(task.kind).layers;
  SceneState scene;
  for (std::uint32_t i = 0; i < layers.size(); ++i) {
    layers[i].tissue = i;
    scene.tissues.push_back({.name = layers[i].name,
                             .mesh = {},
                             .vertex_stiffness_newton_per_m = {},
                             .stiffness_newton_per_m = layers[i].material.stiffness_newton_per_m});
  }
  scene.tissues[1].stiffness_newton_per_m = 1000.0;
  TaskEvaluator evaluator(task, kNeedle);
  evaluator.take(scene);
  run(evaluator, 4.0, [](double t_s) { return needle_at(depth_m(t_s, 0.012)); });
  evaluator.finish();
  EXPECT_NEAR(evaluator.score().needle->layers[1].puncture_depth_m / 0.006, 1.0, 0.01);
}

TEST(Needle, JsonAndTableHaveItsFigures) {
  const TaskScore score = pushed_to(0.013);
  const auto json = score_json(score);
  EXPECT_EQ(json["kind"], "needle");
  EXPECT_EQ(json["outcome"], "through");
  EXPECT_EQ(json["membrane"], "ligament");
  EXPECT_NEAR(json["overshoot_m"].get<double>(), 0.003, 3e-5);
  EXPECT_EQ(json["layers"][2]["punctures"], 0);
  EXPECT_TRUE(json["layers"][2]["puncture_depth_m"].is_null());
  EXPECT_FALSE(json.contains("coverage_ratio"));
  const std::vector<NamedScore> runs{{.run = "a.mcap", .score = score},
                                     {.run = "b.mcap", .score = pushed_to(0.0146)}};
  EXPECT_THAT(table_text(runs), HasSubstr("through, 3.0 mm behind"));
  const std::string csv = table_csv(runs);
  EXPECT_THAT(csv, HasSubstr(",outcome,punctured_after_s,"));
  EXPECT_THAT(csv, HasSubstr(",injury,2"));
  EXPECT_EQ(detection_of(runs).runs, 0U);  // nothing was searched
}

}  // namespace
}  // namespace palpate::test
