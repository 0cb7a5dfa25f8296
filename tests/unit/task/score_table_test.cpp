// SPDX-License-Identifier: Apache-2.0
// Many runs as one table; sensitivity and specificity.
#include "common/task/score_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>

#include "common/telemetry/csv_writer.h"

namespace palpate {
namespace {

using ::testing::ContainsRegex;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

NamedScore run_of(const std::string& name, const std::vector<TargetScore::Outcome>& outcomes,
                  std::size_t false_alarms) {
  NamedScore one{.run = name,
                 .score = {.kind = TaskState::Kind::kPalpation, .end = TaskScore::End::kStopped}};
  one.score.area_m2 = 0.01;
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
  NamedScore cut = run_of("cut.mcap", {kMissed}, 0);
  cut.score.is_cut = true;
  runs.push_back(cut);
  return runs;
}

TEST(ScoreTable, SensitivityAndSpecificityOverASetOfRuns) {
  const DetectionFigures figures = detection_of(class_of_runs());
  EXPECT_EQ(figures.runs, 4U);  // neither the one that did not start nor the cut one
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
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 7);
  EXPECT_THAT(csv, HasSubstr("\n\"a/two, again.mcap\",palpation,stopped,0,2,1,1,0,0,0,,"));
  EXPECT_THAT(csv, HasSubstr("\ncut.mcap,palpation,stopped,1,1,0,0,1,0,"));
}

TEST(ScoreTable, ARunThatBreaksOffSaysSoAndOneThatIsNotJudgedHasNoFinds) {
  using enum TargetScore::Outcome;
  std::vector<NamedScore> runs{run_of("seen.mcap", {kFound}, 0), run_of("unseen.mcap", {kFound}, 3),
                               run_of("cut.mcap", {kMissed}, 0),
                               run_of("blind.mcap", {kMissed}, 2)};
  runs[1].score.ticks = 80;
  runs[1].score.missing_ticks = 20;
  runs[2].score.is_cut = true;
  runs[3].score.area_m2 = kNotKnown;  // the surface was not received
  const std::string text = table_text(runs);
  EXPECT_THAT(text, ContainsRegex("seen.mcap +1/1 +0 +0 "));
  EXPECT_THAT(text, ContainsRegex("unseen.mcap +– +– +– .*not_judged"));
  EXPECT_THAT(text, ContainsRegex("blind.mcap +– +– +– .*not_judged"));
  EXPECT_THAT(text, ContainsRegex("cut.mcap .*breaks off"));
  EXPECT_EQ(detection_of(runs).runs, 1U);
  EXPECT_THAT(regions_csv(runs), HasSubstr("\nunseen.mcap,lump,not_judged,"));
  const nlohmann::ordered_json json = table_json(runs)["runs"];
  EXPECT_EQ(json["seen.mcap"]["found"], 1);
  for (const char* const run : {"unseen.mcap", "blind.mcap"}) {
    EXPECT_TRUE(json[run]["found"].is_null()) << run;
    EXPECT_TRUE(json[run]["false_alarms"].is_null()) << run;
    EXPECT_EQ(json[run]["targets"][0]["outcome"], "not_judged") << run;
  }
}

TEST(ScoreTable, RunsOfOneFileNameAreToldApartByTheirFolders) {
  const auto named = [](const std::vector<std::string>& runs) {
    std::vector<NamedScore> scores;
    for (const std::string& run : runs) scores.push_back({.run = run, .score = {}});
    return short_names(scores);
  };
  EXPECT_THAT(named({"a/x.mcap", "b/y.mcap"}), ElementsAre("x.mcap", "y.mcap"));
  EXPECT_THAT(named({"s/S1/trial_1/run.mcap", "s/S1/trial_2/run.mcap", "s/S2/trial_1/run.mcap"}),
              ElementsAre("S1/trial_1/run.mcap", "S1/trial_2/run.mcap", "S2/trial_1/run.mcap"));
  EXPECT_THAT(named({"run.mcap", "a/run.mcap"}), ElementsAre("run.mcap", "a/run.mcap"));
  EXPECT_THAT(named({"a/run.mcap", "a/run.mcap"}), ElementsAre("run.mcap", "run.mcap"));
}

/// Commas of each line; those in quotes are none.
std::set<std::ptrdiff_t> commas_of(const std::string& csv) {
  std::set<std::ptrdiff_t> counts;
  std::ptrdiff_t commas = 0;
  bool is_quoted = false;
  for (const char c : csv) {
    if (c == '"') is_quoted = !is_quoted;
    if (c == ',' && !is_quoted) ++commas;
    if (c == '\n') counts.insert(std::exchange(commas, 0));
  }
  return counts;
}

// What a task of another kind does not have is empty in its row, not 0.
TEST(ScoreTable, EveryRowHasEveryColumn) {
  std::vector<NamedScore> runs = class_of_runs();
  NamedScore& needle = runs.emplace_back();
  needle.run = "needle.mcap";
  needle.score.kind = TaskState::Kind::kNeedle;
  needle.score.needle.emplace().layers = {{.name = "skin"}, {.name = "dura", .is_spared = true}};
  NamedScore& traction = runs.emplace_back();
  traction.run = "traction.mcap";
  traction.score.kind = TaskState::Kind::kTraction;
  traction.score.traction.emplace().grips = 3;
  const std::string csv = table_csv(runs);
  EXPECT_THAT(commas_of(csv), SizeIs(1)) << csv;
  EXPECT_THAT(csv, HasSubstr("\nneedle.mcap,needle,not_started,0,,,,,0,"));
  EXPECT_THAT(csv, HasSubstr("\ntraction.mcap,traction,not_started,0,,,,,,"));

  const std::string regions = regions_csv(runs);
  EXPECT_THAT(commas_of(regions), SizeIs(1)) << regions;
  EXPECT_THAT(regions, HasSubstr("\na/one.mcap,lump,found,"));
  EXPECT_THAT(regions, HasSubstr("\na/one.mcap,elsewhere,"));
  EXPECT_THAT(regions, HasSubstr("\nneedle.mcap,dura,spared,"));
}

// A spreadsheet takes a cell that begins with = + - @ for a formula, also one in quotes.
TEST(ScoreTable, NoNameIsAFormula) {
  for (const char* const name :
       {"=1+1", "+cmd|' /C calc'!A0", "-1+1", "@SUM(1)", "=HYPERLINK(\"http://x\",\"y\")"}) {
    const std::string cell = csv_cell(name);
    const std::size_t begin = cell.starts_with('"') ? 1 : 0;
    EXPECT_EQ(cell[begin], '\'') << cell;
    NamedScore run = run_of(name, {}, 0);
    run.score.smoothness = -14.9;
    const std::string csv = table_csv({run});
    EXPECT_THAT(csv, HasSubstr("\n" + cell + ","));
    EXPECT_THAT(csv, HasSubstr(",-14.9,"));
  }
  for (const char* const plain : {"-0.5", "+3e-3", "-14", "a=b", "", "\xEF\xBF\xBD"}) {
    EXPECT_EQ(csv_cell(plain), plain);
  }
}

TEST(ScoreTable, ComparedRunsStandBesideEachOther) {
  const std::string text = compared_text(class_of_runs());
  EXPECT_THAT(text, ContainsRegex("false alarms +1 +0 "));
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
