// SPDX-License-Identifier: Apache-2.0
// Limits of single tissues: known answers of a hand that presses on two planes, one after the
// other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "common/task/score_table.h"
#include "tests/unit/task/task_support.h"

namespace palpate::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kBeside_m = 0.12;  // of the middles of the planes

/// plane_scene() and the same plane beside it.
SceneState two_planes() {
  SceneState scene = plane_scene();
  TissueSurface beside = scene.tissues[0];
  for (std::size_t i = 0; i < beside.mesh.vertices_m.size(); i += 3) {
    beside.mesh.vertices_m[i] += static_cast<float>(kBeside_m);
  }
  scene.tissues.push_back(std::move(beside));
  return scene;
}

TaskConfig limited() {
  TaskConfig task;
  task.tissue_limits = {
      {.tissue = 0, .name = "liver", .most_force_newton = 2.0, .most_damage_newton_s = 0.5},
      {.tissue = 1, .name = "colon", .most_force_newton = 1.0}};
  return task;
}

/// A second in the air, one with 3 N on the first plane, one with 1.5 N on the second.
Tip press_both(double t_s) {
  if (t_s < 1.0) return {};
  return t_s < 2.0 ? pressed(0.01, 0.0, 0.012, 3.0) : pressed(kBeside_m, 0.02, 0.001, 1.5);
}

TaskScore score_with(const TaskConfig& task, const SceneState& scene,
                     const std::function<Tip(double)>& tip_at) {
  TaskEvaluator evaluator(task, kTool);
  evaluator.take(scene);
  run(evaluator, 3.0, tip_at);
  evaluator.finish();
  return evaluator.score();
}

TEST(TissueDamage, IsThatOfTheTissueThatIsTouched) {
  const TaskScore score = score_with(limited(), two_planes(), press_both);

  ASSERT_EQ(score.tissues.size(), 2U);
  const TissueDamage& liver = score.tissues[0];
  EXPECT_NEAR(liver.damage_newton_s, 1.0, 0.01);
  EXPECT_NEAR(liver.overshoot_newton, 1.0, 1e-9);
  EXPECT_NEAR(liver.beyond_s, 1.0, 0.01);
  EXPECT_NEAR(liver.force.median_newton, 3.0, 0.01);
  EXPECT_TRUE(liver.is_damaged());
  const TissueDamage& colon = score.tissues[1];
  EXPECT_NEAR(colon.damage_newton_s, 0.5, 0.01);
  EXPECT_NEAR(colon.force.touch_s, 1.0, 0.01);
  EXPECT_FALSE(colon.is_damaged());  // it has no limit of this kind
  EXPECT_THAT(findings_of(score.tissues),
              ElementsAre("You damaged liver: 1 N·s beyond 2 N; 0.5 N·s are allowed.",
                          "You pressed too hard on colon: up to 1.5 N, 0.5 N beyond its limit, for "
                          "1 s."));
  EXPECT_EQ(score_json(score)["tissues"][0]["is_damaged"], true);
}

TEST(TissueDamage, NothingIsFoundBelowTheLimitBesideTheTissueOrInTheAir) {
  for (const auto& tip : {pressed(0.01, 0.0, 0.002, 1.9),       // below the limit
                          pressed(0.01, 0.0, -0.001, 5.0),      // of something else: not touched
                          pressed(0.01, 0.057, 0.006, 5.0)}) {  // beside its edge
    const TaskScore score = score_with(limited(), two_planes(), [&](double) { return tip; });
    EXPECT_EQ(score.tissues[0].damage_newton_s, 0.0) << tip.at_m.transpose();
    EXPECT_THAT(findings_of(score.tissues), IsEmpty());
  }
}

TEST(TissueDamage, WithoutASurfaceItIsNotKnown) {
  const TaskScore score = score_with(limited(), plane_scene(), press_both);
  EXPECT_TRUE(score.tissues[0].is_damaged());
  EXPECT_FALSE(score.tissues[1].is_seen);
  EXPECT_THAT(findings_of(score.tissues)[1], HasSubstr("colon is not known"));
}

TEST(TissueDamage, IsARowOfTheTableOfRegions) {
  const std::string csv =
      regions_csv({{.run = "one.mcap", .score = score_with(limited(), two_planes(), press_both)}});
  EXPECT_THAT(csv, HasSubstr("\none.mcap,liver,damaged,"));
  EXPECT_THAT(csv, HasSubstr("\none.mcap,colon,beyond,"));
  std::set<std::ptrdiff_t> commas;
  for (std::size_t at = 0, end = 0; (end = csv.find('\n', at)) != std::string::npos; at = end + 1) {
    commas.insert(std::count(csv.begin() + static_cast<std::ptrdiff_t>(at),
                             csv.begin() + static_cast<std::ptrdiff_t>(end), ','));
  }
  EXPECT_EQ(commas.size(), 1U) << csv;
}

}  // namespace
}  // namespace palpate::test
