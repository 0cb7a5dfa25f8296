// SPDX-License-Identifier: Apache-2.0
// Tasks with the real programs: one run has one score, whoever computes it; random tasks;
// sensitivity over a set of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using nlohmann::json;
using test::Outcome;
using test::run_program;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::SizeIs;

constexpr const char* kLumpSearch = PALPATE_SOURCE_DIR "/deploy/sessions/tasks/lump_search.txtpb";
constexpr const char* kPoorSearch =
    PALPATE_SOURCE_DIR "/deploy/sessions/tasks/lump_search_poor.txtpb";

/// A hand that presses 10 mm into a pad with a hard ball, and marks it with button 0.
constexpr const char* kSearch = R"(
name: "search"
realtime { priority: 0 cpu: -1 }
device { monitor: off }
hand {
  sinusoid { center_m { x: 0.01 z: -0.004 } amplitude_m { x: 0.02 z: 0.006 } frequency_hz { x: 0.3 z: 0.9 } }
  press { button: 0 from_s: 1.2 until_s: 1.3 }
}
mofc { controller: none stale_after_ms: 200 }
scene {
  tool { tip_radius_m: 0.005 }
  tissue {
    name: "pad" box { center_m { z: -0.02 } size_m { x: 0.1 y: 0.1 z: 0.04 } }
    kelvin_voigt {
      stiffness_newton_per_m: 200
      inclusion { center_m { x: 0.02 z: -0.006 } radius_m: 0.006 stiffness_newton_per_m: 900 }
    }
  }
}
task {
  mark_button: 0 most_force_newton: 1.5
  palpation { tissue: "pad" target { name: "ball" lesion: 0 palpable_newton: 0.5 } least_force_newton: 0.3 }
}
viewer { web { disabled: true } }
)";

class Tasks : public testing::Test {
 protected:
  Tasks() { session_ = files_.write("search.txtpb", kSearch); }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  static Outcome palpate(const std::vector<std::string>& arguments) {
    return run_program("palpate", arguments);
  }
  [[nodiscard]] json scored(const std::vector<std::string>& files) const {
    std::vector<std::string> arguments{"score", "-q", "--json", "-"};
    arguments.insert(arguments.end(), files.begin(), files.end());
    const Outcome outcome = palpate(arguments);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return json::parse(outcome.out);
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string session_;
};

TEST_F(Tasks, ALockstepRunAndItsRecordingHaveOneScore) {
  const Outcome run = palpate({"loopback", session_, "--seconds", "4", "--no-ideal", "--record",
                               path("run.mcap"), "--json", path("run.json")});
  ASSERT_EQ(run.status, 0) << run.err;
  const json task = json::parse(text_of(path("run.json")))["task"];
  EXPECT_EQ(task["kind"], "palpation");
  EXPECT_EQ(task["end"], "run_ended");
  EXPECT_EQ(task["ticks"], 4000);
  EXPECT_EQ(task["missing_ticks"], 0);
  ASSERT_THAT(task["marks"], SizeIs(1));
  EXPECT_GT(task["coverage_ratio"], 0.0);
  EXPECT_EQ(scored({path("run.mcap")})["runs"][path("run.mcap")], task);
  EXPECT_THAT(run.out, HasSubstr("\ntask\n"));

  ASSERT_EQ(palpate({"report", path("run.mcap"), "-o", path("run.html")}).status, 0);
  EXPECT_THAT(text_of(path("run.html")), HasSubstr("<h2>Task</h2>"));
}

TEST_F(Tasks, ARunInRealTimeAndItsRecordingHaveOneScore) {
  const Outcome run = palpate({"launch", session_, "--no-realtime", "--no-viewer", "--seconds", "3",
                               "--record", path("run.mcap"), "--json", path("run.json")});
  ASSERT_EQ(run.status, 0) << run.err;
  const json task = json::parse(text_of(path("run.json")))["task"];
  EXPECT_GT(task["ticks"], 1000);
  EXPECT_GT(task["coverage_ratio"], 0.0);
  EXPECT_EQ(scored({path("run.mcap")})["runs"][path("run.mcap")], task);
}

TEST_F(Tasks, ATableOfRunsAndTheirDetection) {
  for (const char* name : {"a.mcap", "b.mcap"}) {
    ASSERT_EQ(palpate({"loopback", session_, "-q", "--seconds", "2", "--no-ideal", "--record",
                       path(name)})
                  .status,
              0);
  }
  const Outcome table = palpate({"score", path("a.mcap"), path("b.mcap"), "--csv", path("c.csv")});
  EXPECT_EQ(table.status, 0) << table.err;
  EXPECT_THAT(table.out, AllOf(HasSubstr("a.mcap"), HasSubstr("b.mcap"), HasSubstr("sensitivity")));
  const std::string csv = text_of(path("c.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  EXPECT_THAT(palpate({"score", "--compare", path("a.mcap"), path("b.mcap")}).out,
              HasSubstr("coverage "));
}

TEST_F(Tasks, WhatHasNoTaskIsRefused) {
  std::string plain = kSearch;
  plain.erase(plain.find("task {"), plain.find("viewer {") - plain.find("task {"));
  const std::string session = files_.write("plain.txtpb", plain);
  ASSERT_EQ(palpate({"loopback", session, "-q", "--seconds", "1", "--no-ideal", "--record",
                     path("plain.mcap")})
                .status,
            0);
  const Outcome score = palpate({"score", path("plain.mcap")});
  EXPECT_EQ(score.status, 2);
  EXPECT_THAT(score.err, HasSubstr("plain.mcap: its session has no task; give task { … }"));
  const Outcome make = palpate({"make-task", session_, "-o", files_.path().string()});
  EXPECT_EQ(make.status, 2);
  EXPECT_THAT(make.err, HasSubstr("lesions are placed in an elastic body only"));
}

TEST_F(Tasks, TheGoodHandFindsTheLumpAndThePoorOneIsToldThatItPressedTooLightly) {
  const Outcome good =
      palpate({"loopback", kLumpSearch, "--no-ideal", "--json", path("good.json")});
  ASSERT_EQ(good.status, 0) << good.err;
  const json found = json::parse(text_of(path("good.json")))["task"];
  EXPECT_EQ(found["found"], 1) << good.out;
  EXPECT_EQ(found["false_alarms"], 0);
  EXPECT_GT(found["coverage_ratio"], 0.9);
  const Outcome poor =
      palpate({"loopback", kPoorSearch, "--no-ideal", "--json", path("poor.json")});
  ASSERT_EQ(poor.status, 0) << poor.err;
  EXPECT_EQ(json::parse(text_of(path("poor.json")))["task"]["missed"], 1);
  EXPECT_THAT(poor.out, HasSubstr("missed. You pressed too lightly"));
}

TEST_F(Tasks, ASeedGivesTheSameLesionsAndEachItsOwn) {
  const auto make = [&](const std::string& folder, const std::vector<std::string>& more) {
    std::filesystem::create_directory(path(folder));
    std::vector<std::string> arguments{"make-task",  kLumpSearch, "-q", "-o",
                                       path(folder), "--seed",    "7"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = palpate(arguments);
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return load_session(path(folder) + "/lump_search_7.txtpb");
  };
  const Session first = make("a", {"--count", "2", "--search-newton", "3", "--spacing-mm", "20"});
  const Session again = make("b", {});
  const Session other = load_session(path("a") + "/lump_search_8.txtpb");
  const auto lump = [](const Session& session) {
    EXPECT_THAT(session.task->palpation()->targets, SizeIs(1));
    return session.task->palpation()->targets.at(0);
  };
  EXPECT_EQ(lump(first).center_m, lump(again).center_m);
  EXPECT_EQ(lump(first).palpable_newton, lump(again).palpable_newton);
  EXPECT_NE(lump(first).center_m, lump(other).center_m);
  for (const Session& session : {first, other}) {
    EXPECT_GT(lump(session).contrast_ratio, 0.07);
    EXPECT_GT(lump(session).palpable_newton, 0.05);
    EXPECT_LE(std::abs(lump(session).center_m.x()), 0.015);
    EXPECT_TRUE(std::holds_alternative<RecordedPath>(session.side().hand.path));
    EXPECT_NEAR(session.duration_s, 4 * 1.4, 1e-9);  // 2 × 2 presses
  }
}

}  // namespace
}  // namespace palpate
