// SPDX-License-Identifier: Apache-2.0
// Plans, balanced orders, staircases and what a folder keeps: against counts and formulas.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

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

// The rows of four are 0 1 3 2, 1 2 0 3, …; here place 0 has condition 2, place 1 condition 0, ….
TEST(Order, ParticipantsTakeTheRowsOfTheSquareOfTheKeyInTurn) {
  const std::vector<std::size_t> square{2, 0, 3, 1};
  EXPECT_THAT(order_of(square, 1), ElementsAre(2, 0, 1, 3));
  EXPECT_THAT(order_of(square, 2), ElementsAre(0, 3, 2, 1));
  EXPECT_THAT(order_of(square, 6), ElementsAre(0, 3, 2, 1));
}

// Counted anew, of any square that is dealt out: each condition once at each place, each once after
// each other (twice if their number is odd).
TEST(Order, IsBalancedOverTheParticipantsWhateverTheKey) {
  for (const std::size_t n : {2U, 3U, 4U, 7U, 8U}) {
    const std::size_t share = n % 2 == 0 ? 1 : 2;
    const Key key = dealt_key(n);
    std::map<std::pair<std::size_t, std::size_t>, std::size_t> at;
    std::map<std::pair<std::size_t, std::size_t>, std::size_t> after;
    for (std::uint64_t participant = 1; participant <= share * n; ++participant) {
      const auto order = order_of(key.square, participant);
      ASSERT_THAT(order, SizeIs(n));
      for (std::size_t i = 0; i < n; ++i) ++at[{i, order[i]}];
      for (std::size_t i = 1; i < n; ++i) ++after[{order[i - 1], order[i]}];
    }
    EXPECT_THAT(at, AllOf(SizeIs(n * n), Each(testing::Pair(testing::_, share)))) << n;
    EXPECT_THAT(after, AllOf(SizeIs(n * (n - 1)), Each(testing::Pair(testing::_, share)))) << n;
  }
}

// Of the 36 ways to deal out three codes and three places, whatever the other has, one is missing
// after 1000 draws with probability 36 · (35/36)^1000 < 1e-10; 26 are the same twice with 1/26!.
TEST(Key, CodesAndPlacesAreDealtAnewEachTimeAndApart) {
  std::set<std::pair<std::vector<std::string>, std::vector<std::size_t>>> dealt;
  for (int i = 0; i < 1000; ++i) {
    const Key key = dealt_key(3);
    EXPECT_EQ(std::set<std::string>(key.codes.begin(), key.codes.end()),
              (std::set<std::string>{"A", "B", "C"}));
    EXPECT_EQ(std::set<std::size_t>(key.square.begin(), key.square.end()),
              (std::set<std::size_t>{0, 1, 2}));
    dealt.insert({key.codes, key.square});
  }
  EXPECT_THAT(dealt, SizeIs(36));
  EXPECT_NE(dealt_key(26).codes, dealt_key(26).codes);
  EXPECT_NE(dealt_key(26).square, dealt_key(26).square);
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

// One right answer: down. By hand: 0.5, 0.25, 0.5, 0.25, 0.5, 1, 0.5, 0.25, 0.5, …
TEST(Staircase, APairOfReversalsAtTheLargestDifferenceIsLeftOut) {
  const StaircasePlan plan{.field = "x",
                           .start_ratio = 0.5,
                           .step_factor = 2.0,
                           .right_answers = 1,
                           .reversals = 8,
                           .most_ratio = 1.0};
  Staircase staircase(plan);
  for (const char answer : std::string("rwrwwrrwrwr")) staircase.answer(answer == 'r');
  EXPECT_THAT(staircase.reversals(), ElementsAre(0.25, 0.5, 0.25, 1.0, 0.25, 0.5, 0.25, 0.5));
  EXPECT_FALSE(staircase.is_beyond_range());
  EXPECT_NEAR(staircase.threshold_ratio(), std::sqrt(0.25 * 0.5), 1e-12);
}

// Who feels nothing is right half of the time, and turns again and again below the limit.
TEST(Staircase, OfAnObserverWhoOnlyGuessesTheThresholdIsBeyondTheRange) {
  Random random(7);
  int beyond = 0;
  for (int i = 0; i < 200; ++i) {
    Staircase staircase({.field = "x",
                         .start_ratio = 0.2,
                         .step_factor = 1.26,
                         .reversals = 14,
                         .most_trials = 400,
                         .most_ratio = 0.5});
    while (!staircase.is_done()) staircase.answer(random.below(2) == 0);
    beyond += staircase.is_beyond_range() ? 1 : 0;
    EXPECT_TRUE(!staircase.is_beyond_range() || std::isnan(staircase.threshold_ratio()));
  }
  EXPECT_GT(beyond, 150);
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

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
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
  Series series(plan, folder.key().square, participant);
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
  static_cast<void>(done(plan, path(), 1, 0));
  files_.write("s/key.csv", "code,condition,place\nA,condition 0,1\nB,condition 1,2\n");
  EXPECT_THAT(done(plan, path(), 2, 3), ElementsAre(1, 1, 0));
  // a trial that was cut off has no row
  std::filesystem::remove(path() / "P002/trial_003/row.csv");
  EXPECT_THAT(done(plan, path(), 2, 100), ElementsAre(0, 0));
  EXPECT_THAT(done(plan, path(), 2, 100), IsEmpty());
  EXPECT_THAT(done(plan, path(), 1, 100), ElementsAre(0, 0, 1, 1));
}

// Who reads the plan, the documents and the blind table: "participant 1 has row 1 of the square, 0
// 1 3 2". Of four conditions one guess in four is right by chance: of 200 folders 50 ± 37 are six
// standard deviations.
TEST_F(StudyFolder, ItsBlindTableAndThePlanTellNoCondition) {
  const Plan plan = plan_of(4);
  const std::array<std::size_t, 4> row{0, 1, 3, 2};
  std::array<int, 4> right{};
  for (int i = 0; i < 200; ++i) {
    const auto place = files_.path() / std::to_string(i);
    static_cast<void>(done(plan, place, 1, 100));
    const Folder folder(place, plan, false);
    std::istringstream table(table_csv(plan, folder, false));
    std::string line;
    std::getline(table, line);
    for (std::size_t block = 0; block < 4; ++block) {
      std::getline(table, line);
      const std::vector<std::string> cells = cells_of(line);
      ASSERT_EQ(cells[4], std::to_string(block + 1));
      // the truth, from the key file itself
      const std::string key = text_of(place / "key.csv");
      const std::string name = "condition " + std::to_string(row[block]);
      right[block] += key.find("\n" + cells[6] + "," + name) != std::string::npos ? 1 : 0;
    }
  }
  EXPECT_THAT(right, Each(testing::AllOf(testing::Ge(13), testing::Le(87))));
}

TEST_F(StudyFolder, OfAnOlderVersionGoesOnAsItBegan) {
  const Plan plan = plan_of(4);
  static_cast<void>(done(plan, path(), 1, 0));
  EXPECT_TRUE(Folder(path(), plan, false).key().is_square_dealt);
  files_.write("s/key.csv",
               "code,condition\nC,condition 0\nA,condition 1\nB,condition 2\nD,condition 3\n");
  EXPECT_THAT(done(plan, path(), 1, 100), ElementsAre(0, 1, 3, 2));
  EXPECT_THAT(done(plan, path(), 2, 100), ElementsAre(1, 2, 0, 3));
  EXPECT_FALSE(Folder(path(), plan, false).key().is_square_dealt);
  EXPECT_TRUE(Folder(path(), plan, true).key().is_square_dealt);
}

TEST_F(StudyFolder, NobodyElseReadsWhatTellsTheCondition) {
  const Plan plan = plan_of(2);
  const Folder folder(path(), plan, false);
  const ParticipantLock lock(folder, 1);
  using std::filesystem::perms;
  for (const char* const secret : {"key.csv", "key_simulated.csv", "P001"}) {
    EXPECT_EQ(std::filesystem::status(path() / secret).permissions() &
                  (perms::group_all | perms::others_all),
              perms::none)
        << secret;
  }
}

TEST_F(StudyFolder, ThatWasCutOffWhileItWasMadeSaysWhatToDo) {
  files_.write("s/key.csv", "x\n");
  try {
    const Folder folder(path(), plan_of(2), false);
    ADD_FAILURE();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("has a key but no study.txt"),
                                    HasSubstr("else remove the folder")));
  }
}

// A link that leads nowhere: nothing can be made there.
TEST_F(StudyFolder, APlaceThatCannotBeMadeIsSaidWithItsReason) {
  const Plan plan = plan_of(2);
  const Folder folder(path(), plan, false);
  std::filesystem::create_symlink("/nowhere/at/all", path() / "P001");
  try {
    const ParticipantLock lock(folder, 1);
    ADD_FAILURE();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("P001: cannot be made: "),
                                    Not(HasSubstr("No such file")), HasSubstr("--folder")));
  }
}

// They were done, and a table without them would look whole.
TEST_F(StudyFolder, TrialsBehindAMissingOneAreNamed) {
  const Plan plan = plan_of(2, 2);
  static_cast<void>(done(plan, path(), 1, 100));
  static_cast<void>(done(plan, path(), 2, 100));
  const Folder folder(path(), plan, false);
  std::filesystem::remove(path() / "P001/trial_004/row.csv");  // the newest was cut off
  EXPECT_THAT(folder.left_out(), IsEmpty());
  std::filesystem::remove(path() / "P002/trial_002/row.csv");
  const std::vector<LeftOut> behind = folder.left_out();
  ASSERT_THAT(behind, SizeIs(1));
  EXPECT_EQ(behind[0].missing, path() / "P002/trial_002/row.csv");
  EXPECT_THAT(behind[0].trials, ElementsAre(3, 4));
  std::filesystem::remove_all(path() / "P001/trial_001");
  EXPECT_THAT(folder.participants(), ElementsAre(2));
  ASSERT_THAT(folder.left_out(), SizeIs(2));
  EXPECT_EQ(folder.left_out()[0].missing, path() / "P001/trial_001/row.csv");
  EXPECT_THAT(folder.left_out()[0].trials, ElementsAre(2, 3));
}

TEST_F(StudyFolder, AThresholdBeyondTheRangeIsNone) {
  Plan plan = plan_of(1);
  plan.staircase = {.field = "x",
                    .start_ratio = 0.2,
                    .step_factor = 2.0,
                    .reversals = 6,
                    .most_trials = 10,
                    .most_ratio = 0.5,
                    .alternatives = {{}, {}}};
  EXPECT_THAT(done(plan, path(), 1, 100), SizeIs(10));  // each answer is wrong
  EXPECT_THAT(summary_text(plan, Folder(path(), plan, false), true),
              HasSubstr("threshold beyond the range of the staircase (50 %), of 1 participant\n"));
}

TEST_F(StudyFolder, ACopyOfAParticipantDoesNotCount) {
  const Plan plan = plan_of(2);
  static_cast<void>(done(plan, path(), 1, 100));
  std::filesystem::copy(path() / "P001", path() / "P1", std::filesystem::copy_options::recursive);
  EXPECT_THAT(Folder(path(), plan, false).participants(), ElementsAre(1));
}

TEST_F(StudyFolder, ARowThatWasEditedIsRefused) {
  const Plan plan = plan_of(2);
  static_cast<void>(done(plan, path(), 1, 100));
  const std::filesystem::path file = path() / "P001/trial_001/row.csv";
  const std::string row = text_of(file);
  const auto refusal = [&](const std::string& text) -> std::string {
    files_.write("s/P001/trial_001/row.csv", text);
    try {
      static_cast<void>(Folder(path(), plan, false).rows(1));
    } catch (const SetupError& error) {
      return error.what();
    }
    return "";
  };
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = row;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from << "\n" << row;
    return text.replace(at, from.size(), to);
  };
  EXPECT_EQ(refusal(row), "");
  EXPECT_THAT(refusal(with(",2.5,", ",2.4,")), HasSubstr("it was edited or is damaged"));
  // an older row, without a checksum: what follows from the rows before it is still checked
  const std::string older = row.substr(0, row.find("# checksum"));
  EXPECT_EQ(refusal(older), "");
  const std::size_t begin = older.find("trial,1,0,1,1,1,");
  ASSERT_NE(begin, std::string::npos);
  EXPECT_THAT(refusal(std::string(older).replace(begin, 9, "trial,7,0")),
              HasSubstr("is the row of another trial"));
  // a row of another trial in its place
  EXPECT_NE(refusal(text_of(path() / "P001/trial_002/row.csv")), "");
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
  const auto key_of = [&](const std::filesystem::path& place, bool is_simulated) {
    const Folder folder(place, plan, is_simulated);
    return std::pair(folder.key().codes, folder.key().square);
  };
  const auto people = key_of(path(), false);
  EXPECT_EQ(key_of(path(), false), people);
  const auto simulated = key_of(path(), true);
  EXPECT_EQ(key_of(path(), true), simulated);
  EXPECT_NE(simulated.first, people.first);
  EXPECT_NE(simulated.second, people.second);
  const auto other = key_of(files_.path() / "other", false);
  EXPECT_NE(other.first, people.first);
  EXPECT_NE(other.second, people.second);
}

TEST_F(StudyFolder, WithAKeyThatDoesNotFitIsRefused) {
  Plan plan = plan_of(3);
  plan.conditions[1].name = "=with \"quotes\", a comma\nand lines";
  const Key key = Folder(path(), plan, false).key();
  const auto refusal = [&](const std::string& text) -> std::string {
    files_.write("s/key.csv", text);
    try {
      const Folder folder(path(), plan, false);
      EXPECT_EQ(folder.key().codes, key.codes);
      EXPECT_EQ(folder.key().square, key.square);
    } catch (const SetupError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("key.csv"), HasSubstr("; put back the key")));
      return error.what();
    }
    return "";
  };
  const std::string right = key_text(plan, key);
  EXPECT_THAT(right, HasSubstr(",\"'=with \"\"quotes\"\", a"));  // no formula of a spreadsheet
  EXPECT_EQ(refusal(right), "");
  EXPECT_THAT(refusal("A,x\n"), HasSubstr("does not begin with code,condition,place"));
  const std::string one = "code,condition,place\nA,condition 0,2\n";
  EXPECT_THAT(refusal(one + "A,condition 2,1\n"), HasSubstr("code A is given twice"));
  EXPECT_THAT(refusal(one + "B,condition 0,1\n"), HasSubstr("\"condition 0\" is given twice"));
  EXPECT_THAT(refusal(one + "B,condition 7,1\n"), HasSubstr("\"condition 7\" is no condition"));
  EXPECT_THAT(refusal(one + "D,condition 2,1\n"), HasSubstr("\"D\" is no code of this study"));
  EXPECT_THAT(refusal(one + "B,condition 2,1\n"), HasSubstr("has no code of \"=with"));
  EXPECT_THAT(refusal(one + "B,condition 2,2\n"), HasSubstr("place 2 is given twice"));
  EXPECT_THAT(refusal(one + "B,condition 2,4\n"), HasSubstr("\"4\" is no place of the order"));
  EXPECT_THAT(refusal(one + "B,condition 2,1x\n"), HasSubstr("\"1x\" is no place"));
  EXPECT_THAT(refusal(one + "B,condition 2\n"), HasSubstr("not code,condition,place"));
  std::filesystem::remove(path() / "key.csv");
  EXPECT_THROW(Folder(path(), plan, false), SetupError);
  EXPECT_NO_THROW(Folder(path(), plan, true));
}

// Two conditions whose codes have changed places: what was measured would be that of the other.
TEST_F(StudyFolder, WithTrialsOfAnotherKeyIsRefused) {
  const Plan plan = plan_of(2);
  static_cast<void>(done(plan, path(), 1, 1));
  Key key = Folder(path(), plan, false).key();
  std::swap(key.codes[0], key.codes[1]);
  files_.write("s/key.csv", key_text(plan, key));
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
  EXPECT_THAT(open, AllOf(testing::StartsWith("condition,study,"), HasSubstr(",trial,1,0,1,1,1,"),
                          HasSubstr(",trial,1,0,2,2,1,"), HasSubstr("\ncondition 0,trial,"),
                          HasSubstr("\ncondition 1,trial,")));
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
