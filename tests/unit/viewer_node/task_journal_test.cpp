// SPDX-License-Identifier: Apache-2.0
// A viewer_node that is killed, and one that is started after it.
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/session/session_file.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/task/task_support.h"
#include "viewer_node/task/task_view.h"

namespace palpate::viewer {
namespace {

constexpr std::uint64_t kEndTick = 6000;

class TaskJournals : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<TaskJournal> journal() const {
    return std::make_unique<TaskJournal>(file_);
  }
  /// As a kill leaves it.
  void keep() const { std::filesystem::copy_file(file_, kept_); }
  void put_back() const { std::filesystem::rename(kept_, file_); }
  void takes(TaskView& view, std::uint64_t from, std::uint64_t until,
             std::uint64_t device = test::kDevice) const {
    for (std::uint64_t i = from; i < until; ++i) {
      const double t_s = static_cast<double>(i) * 1e-3;
      test::Tip tip = test::pressed(0.01 * std::sin(t_s), 0.002 * t_s, 0.002, 1.0 + 0.1 * t_s);
      tip.buttons = i == 1500 ? 1U : 0U;
      view.take(test::row_of(i, tip, device));
    }
  }
  /// The first viewer of the run.
  void is_killed_at(std::uint64_t tick) const {
    {
      TaskView first(session_, journal());
      first.take(scene());
      first.take(marks(false));
      takes(first, 0, tick);
      keep();
    }
    put_back();
  }
  [[nodiscard]] static TelemetryMessage scene() { return {test::plane_scene()}; }
  /// Of the whole run, by which it was started and stopped.
  [[nodiscard]] static RunState marks(bool has_stop) {
    RunState run;
    run.markers.push_back({.at_ns = 1,
                           .kind = Marker::Kind::kTaskStart,
                           .device_session_id = test::kDevice,
                           .device_sequence = 1000});
    if (has_stop) {
      run.markers.push_back({.at_ns = 2,
                             .kind = Marker::Kind::kTaskStop,
                             .device_session_id = test::kDevice,
                             .device_sequence = kEndTick});
    }
    return run;
  }

  Session session_ = parse_session(R"(
    name: "x"
    scene { tool { tip_radius_m: 0.006 }
      tissue { name: "pad" box { center_m { z: -0.02 } size_m { x: 0.1 y: 0.1 z: 0.04 } }
        kelvin_voigt { stiffness_newton_per_m: 400
          inclusion { center_m { z: -0.01 } radius_m: 0.006 stiffness_newton_per_m: 900 } } } }
    task { start: by_person mark_button: 0
      palpation { tissue: "pad" target { name: "ball" lesion: 0 } } })",
                                   "x.txtpb", {}, "/tmp");
  test::TempFolder folder_;
  std::filesystem::path file_ = folder_.path() / "task.journal";
  std::filesystem::path kept_ = folder_.path() / "kept";
};

// Killed in the middle of the task and again after its end: the score is that of a viewer that was
// never killed, but for what nobody saw.
TEST_F(TaskJournals, AViewerThatIsStartedAgainGoesOnWithTheScore) {
  TaskView whole(session_);
  whole.take(scene());
  whole.take(marks(true));
  takes(whole, 0, kEndTick + 10);
  ASSERT_TRUE(whole.has_ended());

  is_killed_at(3000);
  {
    TaskView second(session_, journal());
    takes(second, 3400, 3500);  // before marks and surface
    EXPECT_FALSE(second.has_ended());
    second.take(scene());
    second.take(marks(false));
    takes(second, 3500, 4000);
    EXPECT_NEAR(second.state().elapsed_s, 3.0, 0.01);
    second.take(marks(true));
    takes(second, 4000, kEndTick + 10);
    ASSERT_TRUE(second.has_ended());
    const TaskScore& score = second.score();
    // 0.4 s without a viewer, and 0.2 s that were not written
    EXPECT_GE(score.missing_ticks, 400U);
    EXPECT_LE(score.missing_ticks, 600U);
    EXPECT_EQ(score.ticks + score.missing_ticks, whole.score().ticks);
    EXPECT_EQ(score.time_s, whole.score().time_s);
    ASSERT_EQ(score.marks.size(), 1U);
    EXPECT_EQ(score.marks[0].t_s, whole.score().marks[0].t_s);
    EXPECT_EQ(score.targets[0].outcome, whole.score().targets[0].outcome);
    EXPECT_NEAR(score.coverage_ratio, whole.score().coverage_ratio, 0.02);
    keep();
  }
  put_back();
  TaskView third(session_, journal());
  third.take(scene());
  third.take(marks(true));
  takes(third, kEndTick + 2000, kEndTick + 2100);
  EXPECT_TRUE(third.has_ended());
  EXPECT_EQ(third.score().marks.size(), 1U);
  EXPECT_LE(third.score().missing_ticks, 800U);
}

TEST_F(TaskJournals, OfAnotherRunNothingIsTaken) {
  is_killed_at(3000);
  TaskView other(session_, journal());
  other.take(scene());
  takes(other, 10, 2500, test::kDevice + 1);
  EXPECT_EQ(other.state().phase, TaskState::Phase::kWaiting);
}

TEST_F(TaskJournals, IsOfOneProcessAndGoneWithIt) {
  {
    TaskJournal first(file_);
    EXPECT_TRUE(std::filesystem::exists(file_));
    const TickRow row = test::row_of(5, {});
    EXPECT_FALSE(first.continues(row));
    TaskJournal second(file_);
    EXPECT_FALSE(second.continues(row));
    second.append(row);
    EXPECT_EQ(second.size_bytes(), 0U);
  }
  EXPECT_FALSE(std::filesystem::exists(file_));
  TaskJournal nowhere(folder_.path() / "none" / "task.journal");
  nowhere.append(test::row_of(5, {}));
  EXPECT_EQ(nowhere.size_bytes(), 0U);
}

// Without what ran before, too much is missing to say what was missed.
TEST_F(TaskJournals, WhatWasNotSeenIsNotJudged) {
  TaskView late(session_);
  late.take(scene());
  late.take(marks(true));
  takes(late, 4000, kEndTick + 10);
  ASSERT_TRUE(late.has_ended());
  EXPECT_FALSE(late.score().is_judged());
  for (const std::string& finding : late.state().findings) {
    EXPECT_EQ(finding.find("missed"), std::string::npos) << finding;
    EXPECT_EQ(finding.find("searched"), std::string::npos) << finding;
  }
  EXPECT_EQ(score_json(late.score())["is_judged"], false);
}

}  // namespace
}  // namespace palpate::viewer
