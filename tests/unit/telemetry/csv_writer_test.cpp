// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/csv_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <vector>

#include "common/core/check.h"
#include "common/core/random.h"

namespace palpate::viewer {
namespace {

using namespace std::chrono_literals;

const char* const kHeader =
    "t_s,x_m,y_m,z_m,xm_m,ym_m,zm_m,fe_x,fe_y,fe_z,fs_x,fs_y,fs_z,fi_x,fi_y,fi_z,"
    "f_max_x,f_max_y,f_max_z,energy_j,true_energy_j,force_age_s,"
    "in_contact,clamped,fallback,peak_limited,"
    "judged_s,transparency_s,along_n2s,ideal_n2s,error_n2s,error_ns,beyond_jnd_s,grip";

std::string test_file() {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  return testing::TempDir() + "palpate_csv_" + test->name() + ".csv";
}

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::stringstream text(line);
  for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
  return cells;
}

// The rows as a written file holds them, header left out.
std::vector<std::string> written(const std::vector<TickRow>& rows) {
  const std::string path = test_file();
  {
    CsvWriter csv(path);
    for (const TickRow& row : rows) csv.write(row);
    csv.close();
    EXPECT_EQ(csv.take_error(), std::nullopt);
  }
  std::vector<std::string> lines = lines_of(path);
  std::filesystem::remove(path);
  EXPECT_EQ(lines.at(0), kHeader);
  lines.erase(lines.begin());
  return lines;
}

std::string cell(const TickRow& row, const std::string& column) {
  const std::vector<std::string> names = cells_of(kHeader);
  const auto place = std::find(names.begin(), names.end(), column) - names.begin();
  return cells_of(written({row}).at(0)).at(static_cast<std::size_t>(place));
}

TickRow full_row() {
  TickRow row;
  row.device_session_id = 1;
  row.device.sampled_at = TimePoint(1ms);
  row.device.true_tool_position_world_m = {0.1, 0.2, 0.3};
  row.device.measured_tool_position_world_m = {0.11, 0.22, 0.33};
  row.device.measured_hand_position_m = {9, 9, 9};
  row.device.force_on_hand_newton = {4, 5, 6};
  row.device.true_energy_joule = 0.004;
  row.device.guard = GuardState::kAnswered;
  row.device.is_answered = true;
  row.device.is_peak_limited = true;
  row.mofc.emplace();
  row.mofc->requested_force_on_hand_newton = {1, 2, 3};
  row.mofc->commanded_force_on_hand_newton = {9, 9, 9};
  row.mofc->f_max_newton = {1.5, 1.5, 1.5};
  row.mofc->ledger_energy_joule = 0.003;
  row.mofc->force_age = 2ms;
  row.mofc->state = MofcState::kContact;
  row.mofc->is_in_contact = true;
  row.mofc->grip = GripState::kSlips;
  row.mofc->is_clamped = true;
  row.ideal_force_on_hand_newton = {7, 8, 9};
  row.to_ideal.emplace(ForceComparison::Integrals{.judged_s = 1,
                                                  .transparency_s = 2,
                                                  .along_n2s = 3,
                                                  .reference_n2s = 4,
                                                  .error_n2s = 5,
                                                  .error_ns = 6,
                                                  .beyond_jnd_s = 7});
  return row;
}

TEST(CsvWriter, WritesEveryColumnInItsPlace) {
  EXPECT_EQ(written({full_row()}).at(0),
            "0.001,0.1,0.2,0.3,0.11,0.22,0.33,1,2,3,4,5,6,7,8,9,1.5,1.5,1.5,0.003,0.004,0.002,"
            "1,1,0,1,1,2,3,4,5,6,7,2");
}

TEST(CsvWriter, HasTwelveMoreColumnsWithAWrist) {
  TickRow row = full_row();
  row.device.true_wrist_angle_rad = {0.1, 0.2, 0.3};
  row.device.wrist_torque_newton_m = {0.04, 0.05, 0.06};
  row.mofc->requested_wrist_torque_newton_m = {0.01, 0.02, 0.03};
  row.ideal_wrist_torque_newton_m = {0.07, 0.08, 0.09};
  const std::string path = test_file();
  {
    CsvWriter csv(path);
    csv.write(row);
    csv.close();
  }
  const std::vector<std::string> lines = lines_of(path);
  std::filesystem::remove(path);
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0],
            std::string(kHeader) + ",a_1,a_2,a_3,te_1,te_2,te_3,ts_1,ts_2,ts_3,ti_1,ti_2,ti_3");
  EXPECT_TRUE(lines[1].ends_with(",2,0.1,0.2,0.3,0.01,0.02,0.03,0.04,0.05,0.06,0.07,0.08,0.09"));
}

TEST(CsvWriter, WritesNanForWhatIsNotKnown) {
  TickRow row;
  row.device.sampled_at = TimePoint(2s);
  row.device.measured_tool_position_world_m = {1, 2, 3};

  EXPECT_EQ(written({row}).at(0),
            "2,nan,nan,nan,1,2,3,nan,nan,nan,0,0,0,nan,nan,nan,nan,nan,nan,nan,nan,nan,"
            "nan,nan,0,0,nan,nan,nan,nan,nan,nan,nan,nan");
}

TEST(CsvWriter, WritesNegativeNanLikeAnyOther) {
  TickRow row = full_row();
  row.device.true_energy_joule = -kNaN;

  EXPECT_EQ(cell(row, "true_energy_j"), "nan");
}

TEST(CsvWriter, GivesAnAgeOnlyToAForceOfPhysics) {
  TickRow row = full_row();
  row.mofc->force_age = 0ns;  // answered within the tick
  EXPECT_EQ(cell(row, "force_age_s"), "0");
  row.mofc->state = MofcState::kNoPhysics;
  EXPECT_EQ(cell(row, "force_age_s"), "nan");
  row.mofc->state = MofcState::kClutched;
  EXPECT_EQ(cell(row, "force_age_s"), "nan");
}

TEST(CsvWriter, PrefersTrueContactToWhatPhysicsSaid) {
  TickRow row = full_row();
  row.is_truly_in_contact = false;
  EXPECT_EQ(cell(row, "in_contact"), "0");
  row.is_truly_in_contact.reset();
  EXPECT_EQ(cell(row, "in_contact"), "1");
  row.mofc.reset();
  EXPECT_EQ(cell(row, "in_contact"), "nan");
  row.is_truly_in_contact = true;
  EXPECT_EQ(cell(row, "in_contact"), "1");
}

TEST(CsvWriter, CallsItFallbackOnlyAfterTheFirstAnswerOfASession) {
  const auto row = [](std::uint64_t session, GuardState guard) {
    TickRow made = full_row();
    made.device_session_id = session;
    made.device.guard = guard;
    made.device.is_answered = guard == GuardState::kAnswered;
    return made;
  };

  const std::vector<std::string> lines = written({
      row(1, GuardState::kLimp),      // not alive yet
      row(1, GuardState::kAnswered),  //
      row(1, GuardState::kLeased),    // a late answer, the lease runs
      row(1, GuardState::kFallback),  //
      row(1, GuardState::kFading),    //
      row(1, GuardState::kLimp),      // now it is limp for want of an answer
      row(1, GuardState::kFault),     //
      row(1, GuardState::kAnswered),  //
      row(2, GuardState::kLimp),      // restarted
  });

  std::string fallback;
  for (const std::string& line : lines) fallback += cells_of(line).at(24);
  EXPECT_EQ(fallback, "000111100");
}

TEST(CsvWriter, WritesDoublesThatReadBackToTheBit) {
  Random random(2);
  std::vector<double> values = {0.1,
                                -0.0,
                                1.0 / 3.0,
                                std::numeric_limits<double>::min(),
                                std::numeric_limits<double>::denorm_min(),
                                -std::numeric_limits<double>::max(),
                                std::numeric_limits<double>::infinity()};
  for (int i = 0; i < 1000; ++i)
    values.push_back(random.normal() * std::pow(10.0, random.below(20)));
  std::vector<TickRow> rows(values.size(), full_row());
  for (std::size_t i = 0; i < values.size(); ++i) rows[i].device.true_energy_joule = values[i];

  const std::vector<std::string> lines = written(rows);

  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string text = cells_of(lines.at(i)).at(20);
    double back = 0.0;
    const auto result = std::from_chars(text.data(), text.data() + text.size(), back);
    ASSERT_EQ(result.ptr, text.data() + text.size()) << text;
    ASSERT_EQ(std::memcmp(&back, &values[i], sizeof back), 0) << text;
  }
}

// The longest number has 24 characters: −2.2250738585072014e-308.
TEST(CsvWriter, HoldsARowOfTheLongestNumbers) {
  const double longest = -std::numeric_limits<double>::min();
  TickRow row = full_row();
  row.device.sampled_at = TimePoint::min();
  for (Vector3* v : {&row.device.true_tool_position_world_m, &row.device.force_on_hand_newton,
                     &row.device.measured_tool_position_world_m, &row.ideal_force_on_hand_newton,
                     &row.mofc->requested_force_on_hand_newton, &row.mofc->f_max_newton}) {
    *v = Vector3::Constant(longest);
  }
  row.device.true_energy_joule = longest;
  row.mofc->ledger_energy_joule = longest;

  const std::string line = written({row}).at(0);

  EXPECT_EQ(cells_of(line).size(), 34U);
  EXPECT_EQ(cells_of(line).at(18), "-2.2250738585072014e-308");
}

TEST(CsvWriter, KeepsEveryRowOfALongRun) {
  std::vector<TickRow> rows(5000, full_row());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].device.sampled_at = TimePoint(std::chrono::seconds(i));
  }

  const std::vector<std::string> lines = written(rows);

  ASSERT_EQ(lines.size(), rows.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    ASSERT_EQ(cells_of(lines[i]).at(0), std::to_string(i));
    ASSERT_EQ(cells_of(lines[i]).size(), 34U);
  }
}

TEST(CsvWriter, ShowsAReaderEveryRowAfterAFlush) {
  const std::string path = test_file();
  CsvWriter csv(path);
  csv.write(full_row());
  csv.flush();

  EXPECT_EQ(lines_of(path).size(), 2U);
  csv.write(full_row());
  csv.close();
  EXPECT_EQ(lines_of(path).size(), 3U);
  csv.write(full_row());  // after close: nothing
  csv.close();
  EXPECT_EQ(lines_of(path).size(), 3U);
  std::filesystem::remove(path);
}

TEST(CsvWriter, RefusesAPathItCannotWrite) {
  try {
    const CsvWriter csv("/nonexistent/folder/run.csv");
    FAIL() << "should have thrown";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("/nonexistent/folder/run.csv"),
                                             testing::HasSubstr("No such file or directory"),
                                             testing::HasSubstr("writable")));
  }
}

// /dev/full takes nothing, like a full disk.
TEST(CsvWriter, TellsOfAFullDiskOnce) {
  CsvWriter csv("/dev/full");
  EXPECT_EQ(csv.take_error(), std::nullopt);

  for (int i = 0; i < 10000; ++i) csv.write(full_row());
  const std::optional<std::string> error = csv.take_error();
  for (int i = 0; i < 10000; ++i) csv.write(full_row());
  csv.close();

  ASSERT_TRUE(error.has_value());
  EXPECT_THAT(*error, testing::HasSubstr("No space left on device"));
  EXPECT_EQ(csv.take_error(), std::nullopt);
}

TEST(CsvWriter, TellsOfAFullDiskAtTheLastRow) {
  CsvWriter csv("/dev/full");
  csv.write(full_row());
  EXPECT_EQ(csv.take_error(), std::nullopt) << "still buffered";

  csv.close();

  EXPECT_TRUE(csv.take_error().has_value());
}

}  // namespace
}  // namespace palpate::viewer
