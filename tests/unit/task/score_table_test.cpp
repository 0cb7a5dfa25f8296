// SPDX-License-Identifier: Apache-2.0
// Many runs as one table; sensitivity and specificity.
#include "common/task/score_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace palpate {
namespace {

using ::testing::HasSubstr;

NamedScore run_of(const std::string& name, const std::vector<TargetScore::Outcome>& outcomes,
                  std::size_t false_alarms) {
  NamedScore one{.run = name,
                 .score = {.kind = TaskState::Kind::kPalpation, .end = TaskScore::End::kStopped}};
  for (const auto outcome : outcomes) {
    one.score.targets.push_back({.name = "lump", .outcome = outcome});
  }
  one.score.marks.resize(false_alarms);
  return one;
}

std::vector<NamedScore> class_of_runs() {
  using enum TargetScore::Outcome;
  std::vector<NamedScore> runs{run_of("a/one.mcap", {kFound, kMissed}, 1),
                               run_of("a/two, again.mcap", {kFound, kGuessed}, 0),
                               run_of("clean.mcap", {}, 0), run_of("clean_2.mcap", {}, 2)};
  NamedScore idle = run_of("idle.mcap", {kMissed}, 0);
  idle.score.end = TaskScore::End::kNotStarted;
  runs.push_back(idle);
  return runs;
}

TEST(ScoreTable, SensitivityAndSpecificityOverASetOfRuns) {
  const DetectionFigures figures = detection_of(class_of_runs());
  EXPECT_EQ(figures.runs, 4U);  // the one that did not start does not count
  EXPECT_EQ(figures.sensitivity.hits, 2U);
  EXPECT_EQ(figures.sensitivity.cases, 4U);
  EXPECT_EQ(figures.specificity.hits, 1U);
  EXPECT_EQ(figures.specificity.cases, 2U);
  EXPECT_EQ(figures.false_alarms, 3U);
}

// Wilson's interval of 2 of 4 at 95 %: 0.1500 … 0.8500; of 10 of 10 0.7225 … 1.
TEST(ScoreTable, TheIntervalIsWilsons) {
  EXPECT_NEAR((CountedShare{2, 4}).low(), 0.1500, 1e-4);
  EXPECT_NEAR((CountedShare{2, 4}).high(), 0.8500, 1e-4);
  EXPECT_NEAR((CountedShare{10, 10}).low(), 0.7225, 1e-4);
  EXPECT_NEAR((CountedShare{10, 10}).high(), 1.0, 1e-12);
  EXPECT_TRUE(std::isnan(CountedShare{}.ratio()));
}

TEST(ScoreTable, TextHasALineForEachRunAndCsvARow) {
  const std::string text = table_text(class_of_runs());
  EXPECT_THAT(text, HasSubstr("one.mcap"));
  EXPECT_THAT(text, HasSubstr("2 of 4, 50 % (95 % interval 15 … 85 %)"));
  const std::string csv = table_csv(class_of_runs());
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 6);
  EXPECT_THAT(csv, HasSubstr("\n\"a/two, again.mcap\",palpation,2,1,1,0,0,0,,"));
  const std::string head = csv.substr(0, csv.find('\n'));
  const std::string row =
      csv.substr(head.size() + 1, csv.find('\n', head.size() + 1) - head.size());
  EXPECT_EQ(std::count(head.begin(), head.end(), ','), std::count(row.begin(), row.end(), ','));
}

TEST(ScoreTable, ComparedRunsStandBesideEachOther) {
  const std::string text = compared_text(class_of_runs());
  EXPECT_THAT(text, HasSubstr("false alarms          1                                   0"));
  EXPECT_THAT(text, HasSubstr("clean.mcap"));
}

TEST(ScoreTable, JsonHoldsEachRunAndTheDetection) {
  const auto json = table_json(class_of_runs());
  EXPECT_EQ(json["runs"]["clean_2.mcap"]["false_alarms"], 2);
  EXPECT_EQ(json["detection"]["sensitivity"]["cases"], 4);
  EXPECT_TRUE(json["runs"]["clean.mcap"]["coverage_ratio"].is_null());
}

}  // namespace
}  // namespace palpate
