// SPDX-License-Identifier: Apache-2.0
// Plans, balanced orders, staircases and what a folder keeps: against counts and formulas.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <utility>

#include "common/core/check.h"
#include "common/core/random.h"
#include "deploy/study/folder.h"
#include "deploy/study/key.h"
#include "deploy/study/order.h"
#include "deploy/study/plan.h"
#include "deploy/study/staircase.h"
#include "deploy/study/study_report.h"
#include "tests/support/temp_folder.h"

namespace palpate::study {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

Plan plan_of(std::size_t conditions, std::uint64_t repeats = 1) {
  Plan plan;
  plan.name = "trial";
  for (std::size_t i = 0; i < conditions; ++i) {
    plan.conditions.push_back({.name = "condition " + std::to_string(i), .overrides = {}});
  }
  plan.repeats = repeats;
  return plan;
}

TEST(BalancedSquare, HasEachConditionAtEachPlaceAndAfterEachOtherEquallyOften) {
  for (std::size_t n = 1; n <= 9; ++n) {
    const auto square = balanced_square(n);
    const std::size_t share = square.size() / n;
    EXPECT_EQ(share, n % 2 == 0 || n == 1 ? 1U : 2U);
    std::map<std::pair<std::size_t, std::size_t>, std::size_t> at;     // place, condition
    std::map<std::pair<std::size_t, std::size_t>, std::size_t> after;  // pairs
    for (const auto& row : square) {
      EXPECT_EQ(std::set<std::size_t>(row.begin(), row.end()).size(), n);
      for (std::size_t i = 0; i < n; ++i) ++at[{i, row[i]}];
      for (std::size_t i = 1; i < n; ++i) ++after[{row[i - 1], row[i]}];
    }
    EXPECT_THAT(at, SizeIs(n * n));
    EXPECT_THAT(at, Each(testing::Field(&decltype(at)::value_type::second, share))) << n;
    EXPECT_THAT(after, SizeIs(n * (n - 1)));
    EXPECT_THAT(after, Each(testing::Field(&decltype(after)::value_type::second, share))) << n;
  }
}

TEST(Order, ParticipantsTakeTheRowsInTurn) {
  const Plan plan = plan_of(4);
  EXPECT_EQ(order_of(plan, 1), balanced_square(4)[0]);
  EXPECT_EQ(order_of(plan, 6), balanced_square(4)[1]);
}

// Of 24 ways to deal out four codes one is missing after 1000 draws with probability 24 ·
// (23/24)^1000 < 1e-17; 26 are the same twice with 1/26!.
TEST(Key, CodesAreDealtAnewEachTime) {
  std::set<std::vector<std::string>> dealt;
  for (int i = 0; i < 1000; ++i) {
    const auto codes = dealt_codes(4);
    EXPECT_EQ(std::set<std::string>(codes.begin(), codes.end()),
              (std::set<std::string>{"A", "B", "C", "D"}));
    dealt.insert(codes);
  }
  EXPECT_THAT(dealt, SizeIs(24));
  EXPECT_NE(dealt_codes(26), dealt_codes(26));
}

// Right, right: down. Wrong: up. By hand: 0.5 → 0.25 → 0.5 → 0.25 → 0.5 …
TEST(Staircase, FallsAfterRightAnswersInARowAndGrowsAfterEachWrongOne) {
  Staircase staircase({.field = "x", .start_ratio = 0.5, .step_factor = 2.0, .reversals = 6});
  const auto answer = [&](bool is_right) {
    staircase.answer(is_right);
    return staircase.difference_ratio();
  };
  EXPECT_EQ(answer(true), 0.5);
  EXPECT_EQ(answer(true), 0.25);
  EXPECT_EQ(answer(true), 0.25);
  EXPECT_EQ(answer(false), 0.5);  // turns at 0.25; the right one before counts no more
  EXPECT_EQ(answer(true), 0.5);
  EXPECT_EQ(answer(true), 0.25);  // turns at 0.5
  EXPECT_THAT(staircase.reversals(), ElementsAre(0.25, 0.5));
  EXPECT_TRUE(std::isnan(staircase.threshold_ratio()));
  EXPECT_EQ(answer(false), 0.5);
  answer(true);
  EXPECT_EQ(answer(true), 0.25);
  EXPECT_NEAR(staircase.threshold_ratio(), std::sqrt(0.25 * 0.5), 1e-12);
  EXPECT_FALSE(staircase.is_done());
  answer(false);
  answer(true);
  answer(true);
  EXPECT_TRUE(staircase.is_done());
}

// An observer who is right with probability Φ(d / 0.2): 2 right answers find Φ⁻¹(√½) · 0.2 = 0.109,
// 3 right ones Φ⁻¹(2^(−1/3)) · 0.2 = 0.164 [Levitt71].
TEST(Staircase, SettlesWhereTheTheoryOfLevittSays) {
  for (const auto& [right_answers, expected] :
       std::map<std::uint64_t, double>{{2, 0.10903}, {3, 0.16387}}) {
    Random random(7);
    double sum = 0.0;
    constexpr int kSeries = 40;
    for (int i = 0; i < kSeries; ++i) {
      Staircase staircase({.field = "x",
                           .start_ratio = 0.5,
                           .step_factor = 1.1,
                           .right_answers = right_answers,
                           .reversals = 400,
                           .most_trials = 1'000'000});
      while (!staircase.is_done()) {
        staircase.answer(0.2 * random.normal() < staircase.difference_ratio());
      }
      sum += std::log(staircase.threshold_ratio());
    }
    EXPECT_NEAR(std::exp(sum / kSeries) / expected, 1.0, 0.04) << right_answers;
  }
}

class StudyFolder : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path path() const { return files_.path() / "s"; }
  test::TempFolder files_;
};

TaskScore score_of(double overshoot_m) {
  TaskScore score;
  score.end = TaskScore::End::kStopped;
  score.time_s = 2.5;
  score.overshoot_newton = overshoot_m;
  return score;
}

/// Does so many trials of a participant, as the command does. Returns their conditions.
std::vector<std::size_t> done(const Plan& plan, const std::filesystem::path& path,
                              std::uint64_t participant, int most) {
  const Folder folder(path, plan, false);
  Series series(plan, participant);
  for (const TrialRow& row : folder.rows(participant)) series.take(row.is_right);
  std::vector<std::size_t> conditions;
  while (const auto trial = series.next()) {
    if (most-- == 0) break;
    static_cast<void>(folder.begin(*trial));
    folder.keep(*trial, score_of(1.0), std::nullopt);
    series.take(std::nullopt);
    conditions.push_back(trial->condition);
  }
  return conditions;
}

TEST_F(StudyFolder, GoesOnWhereItWasCutOff) {
  const Plan plan = plan_of(2, 2);
  EXPECT_THAT(done(plan, path(), 2, 3), ElementsAre(1, 1, 0));
  // a trial that was cut off has no row
  std::filesystem::remove(path() / "P002/trial_003/row.csv");
  EXPECT_THAT(done(plan, path(), 2, 100), ElementsAre(0, 0));
  EXPECT_THAT(done(plan, path(), 2, 100), IsEmpty());
  EXPECT_THAT(done(plan, path(), 1, 100), ElementsAre(0, 0, 1, 1));
}

TEST_F(StudyFolder, OfAnotherStudyIsRefused) {
  Plan plan = plan_of(2);
  static_cast<void>(done(plan, path(), 1, 1));
  plan.fingerprint = 5;
  EXPECT_THROW(Folder(path(), plan, false), SetupError);
  files_.write("note.txt", "mine");
  EXPECT_THROW(Folder(files_.path(), plan, false), SetupError);
}

TEST_F(StudyFolder, HasKeysOfItsOwnAndKeepsThem) {
  const Plan plan = plan_of(26);
  const auto codes = Folder(path(), plan, false).codes();
  EXPECT_EQ(Folder(path(), plan, false).codes(), codes);
  const auto simulated = Folder(path(), plan, true).codes();
  EXPECT_EQ(Folder(path(), plan, true).codes(), simulated);
  EXPECT_NE(simulated, codes);
  EXPECT_NE(Folder(files_.path() / "other", plan, false).codes(), codes);
}

TEST_F(StudyFolder, WithAKeyThatDoesNotFitIsRefused) {
  Plan plan = plan_of(3);
  plan.conditions[1].name = "with \"quotes\", a comma\nand lines";
  const auto codes = Folder(path(), plan, false).codes();
  const auto refusal = [&](const std::string& key) -> std::string {
    files_.write("s/key.csv", key);
    try {
      EXPECT_EQ(Folder(path(), plan, false).codes(), codes);
    } catch (const SetupError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("key.csv"), HasSubstr("; put back the key")));
      return error.what();
    }
    return "";
  };
  const std::string right = key_text(plan, codes);
  EXPECT_EQ(refusal(right), "");
  EXPECT_THAT(refusal("A,x\n"), HasSubstr("does not begin with code,condition"));
  const std::string two = "code,condition\nA,condition 0\n";
  EXPECT_THAT(refusal(two + "A,condition 2\n"), HasSubstr("code A is given twice"));
  EXPECT_THAT(refusal(two + "B,condition 0\n"), HasSubstr("\"condition 0\" is given twice"));
  EXPECT_THAT(refusal(two + "B,condition 7\n"), HasSubstr("\"condition 7\" is no condition"));
  EXPECT_THAT(refusal(two + "D,condition 2\n"), HasSubstr("\"D\" is no code of this study"));
  EXPECT_THAT(refusal(two + "B,condition 2\n"), HasSubstr("has no code of \"with"));
  EXPECT_THAT(refusal(two + "B\n"), HasSubstr("a row that is not code,condition"));
  std::filesystem::remove(path() / "key.csv");
  EXPECT_THROW(Folder(path(), plan, false), SetupError);
  EXPECT_NO_THROW(Folder(path(), plan, true));
}

// Two conditions whose codes have changed places: what was measured would be that of the other.
TEST_F(StudyFolder, WithTrialsOfAnotherKeyIsRefused) {
  const Plan plan = plan_of(2);
  static_cast<void>(done(plan, path(), 1, 1));
  std::vector<std::string> codes = Folder(path(), plan, false).codes();
  std::swap(codes[0], codes[1]);
  files_.write("s/key.csv", key_text(plan, codes));
  const Folder folder(path(), plan, false);
  EXPECT_THROW(static_cast<void>(folder.rows(1)), SetupError);
}

TEST_F(StudyFolder, OneProcessAtATimeDoesTheTrialsOfAParticipant) {
  const Plan plan = plan_of(2);
  const Folder folder(path(), plan, false);
  const ParticipantLock lock(folder, 1);
  EXPECT_THROW(ParticipantLock(folder, 1), SetupError);
  EXPECT_NO_THROW(ParticipantLock(folder, 2));
}

TEST_F(StudyFolder, ItsTableIsBlindUntilItIsOpened) {
  const Plan plan = plan_of(2);
  static_cast<void>(done(plan, path(), 1, 100));
  const Folder folder(path(), plan, false);
  const std::string blind = table_csv(plan, folder, false);
  EXPECT_THAT(blind,
              testing::StartsWith("study,participant,simulated,trial,block,trial_in_block,code,"));
  EXPECT_THAT(blind, Not(HasSubstr("condition")));
  EXPECT_THAT(summary_text(plan, folder, false), Not(HasSubstr("condition 0")));
  const std::string open = table_csv(plan, folder, true);
  EXPECT_THAT(open, AllOf(testing::StartsWith("condition,study,"),
                          HasSubstr("\ncondition 0,trial,1,0,1,1,1,"),
                          HasSubstr("\ncondition 1,trial,1,0,2,2,1,")));
  // the same number of cells in each row
  std::istringstream lines(open);
  std::set<std::ptrdiff_t> commas;
  for (std::string line; std::getline(lines, line);) {
    commas.insert(std::count(line.begin(), line.end(), ','));
  }
  EXPECT_THAT(commas, SizeIs(1));
  for (const auto& entry : std::filesystem::recursive_directory_iterator(path() / "P001")) {
    EXPECT_THAT(entry.path().filename().string(),
                testing::AnyOf("trial_001", "trial_002", "row.csv"));
  }
}

}  // namespace
}  // namespace palpate::study
