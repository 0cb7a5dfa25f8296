// SPDX-License-Identifier: Apache-2.0
// Tasks with the real programs: one run has one score, whoever computes it; random tasks;
// sensitivity over a set of them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "tests/property/seeds.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/web_client.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using test::Outcome;
using test::run_program;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

const std::string kTasks = test::source_dir() + "/deploy/sessions/tasks/";
const std::string kLumpSearch = test::source_dir() + "/deploy/sessions/tasks/lump_search.txtpb";
const std::string kPoorSearch =
    test::source_dir() + "/deploy/sessions/tasks/lump_search_poor.txtpb";
const std::string kEpidural = test::source_dir() + "/deploy/sessions/tasks/epidural.txtpb";
const std::string kEpiduralPoor = test::source_dir() + "/deploy/sessions/tasks/epidural_poor.txtpb";

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
  tissue_limit { tissue: "pad" most_force_newton: 0.4 most_damage_newton_s: 0.01 }
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
  EXPECT_EQ(task["tissues"][0]["is_damaged"], true);
  EXPECT_EQ(scored({path("run.mcap")})["runs"][path("run.mcap")], task);
  EXPECT_THAT(run.out, HasSubstr("\ntask\n"));

  ASSERT_EQ(palpate({"report", path("run.mcap"), "-o", path("run.html")}).status, 0);
  EXPECT_THAT(text_of(path("run.html")), HasSubstr("<h2>Task</h2>"));
}

/// What the page of a replay says of the task at its end.
json replayed(const std::string& file) {
  test::Program replay("palpate", {"replay", file, "--set", "viewer.web={port: 0}"});
  const std::string address = "http://127.0.0.1:";
  if (!test::await(
          [&] { return replay.out().find("waiting for the page") != std::string::npos; })) {
    ADD_FAILURE() << replay.out() << replay.err();
    return {};
  }
  const auto port = static_cast<std::uint16_t>(std::stoi(replay.out().substr(address.size())));
  test::WebClient page(port);
  EXPECT_TRUE(page.open_web_socket());
  EXPECT_TRUE(page.send_text(R"({"op":"subscribe","subscriptions":[{"id":2,"channelId":2},)"
                             R"({"id":3,"channelId":3}]})"));
  json told;
  const auto has_ended = [&] {
    test::WebClient client(port);
    client.send_raw("GET /task HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    const std::string answer = client.read_to_end();
    const std::size_t body = answer.find("\r\n\r\n");
    if (body != std::string::npos) told = json::parse(answer.substr(body + 4), nullptr, false);
    return told.is_object() && told["task"]["phase"] == "ended";
  };
  EXPECT_TRUE(test::await(has_ended, 60s)) << told.dump() << replay.err();
  return told["task"]["score"];
}

// Nobody could start it there, so it began with the run.
TEST_F(Tasks, AReplayOfALockstepRunShowsItsScoreWhoeverStartsTheTask) {
  for (const std::string start : {"with_run", "by_person"}) {
    SCOPED_TRACE(start);
    const Outcome run = palpate({"loopback", session_, "--seconds", "2", "--no-ideal", "--set",
                                 "task.start=" + start, "--record", path(start + ".mcap"), "--json",
                                 path(start + ".json")});
    ASSERT_EQ(run.status, 0) << run.err;
    const json task = json::parse(text_of(path(start + ".json")))["task"];
    EXPECT_EQ(task["ticks"], 2000);
    EXPECT_EQ(scored({path(start + ".mcap")})["runs"][path(start + ".mcap")], task);
    const json shown = replayed(path(start + ".mcap"));
    // what a busy machine loses on the way is said
    if (shown["missing_ticks"] == 0) {
      EXPECT_EQ(shown, task);
    } else {
      EXPECT_EQ(shown["ticks"].get<int>() + shown["missing_ticks"].get<int>(), 2000);
    }
  }
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

TEST_F(Tasks, AClassIsOnePageThatLoadsNothingAndWhoseNamesAreText) {
  const std::string name = path("<i>&\"anna.mcap");
  ASSERT_EQ(palpate({"loopback", session_, "-q", "--seconds", "2", "--no-ideal", "--record", name})
                .status,
            0);
  const std::string other = path("ben.mcap");
  std::filesystem::copy_file(name, other);
  const Outcome twice = palpate({"score", name, other, name, "--html", path("class.html")});
  EXPECT_EQ(twice.status, 2);
  EXPECT_THAT(twice.err, HasSubstr("it is given twice, and would count twice"));
  ASSERT_EQ(palpate({"score", name, other, "--html", path("class.html"), "--regions",
                     path("regions.csv")})
                .status,
            0);
  const std::string regions = text_of(path("regions.csv"));
  EXPECT_THAT(regions, AllOf(HasSubstr("run,region,outcome,"), HasSubstr("ben.mcap,elsewhere,")));
  const std::string html = text_of(path("class.html"));
  EXPECT_THAT(html, AllOf(HasSubstr("aria-label=\"Force over the task, at most "),
                          HasSubstr("<path d=\"M")));
  // 2 s, in which the hand marks the ball once, without a lesion-free run
  EXPECT_THAT(html, AllOf(HasSubstr("<h2>What was found</h2>"), HasSubstr("Sensitivity"),
                          HasSubstr("no case"), HasSubstr("default-src 'none'"),
                          HasSubstr("&lt;i&gt;&amp;&quot;anna.mcap")));
  EXPECT_THAT(html, AllOf(testing::Not(HasSubstr("<i>")), testing::Not(HasSubstr("<script")),
                          testing::Not(HasSubstr("http:")), testing::Not(HasSubstr("https:"))));
  EXPECT_EQ(palpate({"score", name, "--html", path("class.html")}).status, 2) << "overwrites";
  // a name in Latin-1, on pages that say that they are UTF-8
  const std::string latin = path("caf\xE9.mcap");
  std::filesystem::copy_file(name, latin);
  ASSERT_EQ(palpate({"score", latin, "--html", path("latin.html")}).status, 0);
  ASSERT_EQ(palpate({"report", latin, "-o", path("report.html")}).status, 0);
  for (const char* const page : {"latin.html", "report.html"}) {
    const std::string text = text_of(path(page));
    EXPECT_EQ(text.find('\xE9'), std::string::npos) << page;
    EXPECT_THAT(text, HasSubstr("caf\xEF\xBF\xBD"));
  }
}

// As a viewer that is killed, or a disk that is full, leaves it.
TEST_F(Tasks, ARecordingThatBreaksOffIsThePartOfATask) {
  const std::string whole = path("whole.mcap");
  ASSERT_EQ(palpate({"loopback", session_, "-q", "--seconds", "4", "--no-ideal", "--record", whole})
                .status,
            0);
  const std::string bytes = text_of(whole);
  const std::string cut = files_.write("cut.mcap", bytes.substr(0, bytes.size() * 6 / 10));
  const Outcome score =
      palpate({"score", cut, "--json", path("cut.json"), "--csv", path("cut.csv")});
  EXPECT_EQ(score.status, 1) << score.err;
  EXPECT_THAT(score.out, HasSubstr("task\n  The recording breaks off "));
  EXPECT_THAT(text_of(path("cut.json")), HasSubstr("\"is_cut\": true"));
  EXPECT_THAT(text_of(path("cut.csv")), HasSubstr(",palpation,run_ended,1,"));

  // so is a whole file that was made of it, and a copy of the first part of the whole
  const std::string recovered = path("recovered.mcap");
  ASSERT_EQ(palpate({"recover", cut, recovered}).status, 0);
  const std::string begin = path("begin.mcap");
  ASSERT_EQ(palpate({"cut", whole, begin, "--to", "2"}).status, 0);
  const std::string copy = path("copy.mcap");
  ASSERT_EQ(palpate({"cut", whole, copy, "--to", "1000"}).status, 0);
  const Outcome copies =
      palpate({"score", recovered, begin, copy, "--csv", path("copies.csv"), "-q"});
  EXPECT_THAT(text_of(path("copies.csv")), AllOf(HasSubstr("recovered.mcap,palpation,run_ended,1,"),
                                                 HasSubstr("begin.mcap,palpation,run_ended,1,"),
                                                 HasSubstr("copy.mcap,palpation,")))
      << copies.err;
  EXPECT_THAT(text_of(path("copies.csv")), Not(HasSubstr("copy.mcap,palpation,run_ended,1,")));
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
  // one of many costs the others nothing
  ASSERT_EQ(palpate({"loopback", session_, "-q", "--seconds", "2", "--no-ideal", "--record",
                     path("good.mcap")})
                .status,
            0);
  files_.write("empty.mcap", "");
  const Outcome some = palpate({"score", path("plain.mcap"), path("good.mcap"), path("empty.mcap"),
                                "--csv", path("class.csv")});
  EXPECT_EQ(some.status, 2);
  EXPECT_THAT(some.err, AllOf(HasSubstr("not scored: "), HasSubstr("plain.mcap: its session"),
                              HasSubstr("empty.mcap")));
  const std::string csv = text_of(path("class.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 2) << csv;
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

// Of their search the first two presses, which are those at the lump.
TEST_F(Tasks, ALumpInALiverIsFoundByAFirmHandAndNotByOneThatHardlyPresses) {
  const auto scored_run = [&](const std::string& session) {
    const Outcome outcome =
        palpate({"loopback", kTasks + session, "--no-ideal", "--seconds", "2.8", "--json", "-"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return json::parse(outcome.out)["task"];
  };
  const json firm = scored_run("liver_lump.txtpb");
  EXPECT_EQ(firm["found"], 1) << firm;
  EXPECT_EQ(firm["false_alarms"], 0);
  EXPECT_EQ(firm["overshoot_n"], 0.0);
  const json light = scored_run("liver_lump_poor.txtpb");
  EXPECT_EQ(light["missed"], 1) << light;
  EXPECT_LT(light["targets"][0]["force"]["most_n"], light["targets"][0]["palpable_n"]);
}

/// The least of a column of a CSV.
double least_of(const std::string& csv, const std::string& column) {
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  std::istringstream head(line);
  std::string cell;
  int place = 0;
  while (std::getline(head, cell, ',') && cell != column) ++place;
  double least = std::numeric_limits<double>::infinity();
  while (std::getline(lines, line)) {
    std::istringstream row(line);
    for (int i = 0; i <= place; ++i) std::getline(row, cell, ',');
    least = std::min(least, std::stod(cell));
  }
  return least;
}

constexpr double kNeedleTip_m = 0.0007;
constexpr double kFlavumEnds_m = 0.033;

TEST_F(Tasks, TheGoodHandStopsBehindTheMembraneAndThePoorOneIsToldWhatItHurt) {
  const auto run = [&](const std::string& session, const std::string& name) {
    Outcome outcome = palpate({"loopback", session, "--no-ideal", "--csv", path(name + ".csv"),
                               "--json", path(name + ".json"), "--record", path(name + ".mcap")});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return outcome;
  };
  const Outcome good = run(kEpidural, "good");
  const json through = json::parse(text_of(path("good.json")))["task"];
  EXPECT_EQ(through["kind"], "needle");
  EXPECT_EQ(through["outcome"], "through") << good.out;
  EXPECT_LT(through["told_after_s"].get<double>(), 1.0);
  EXPECT_EQ(through["false_alarms"], 0);
  // behind the far side of the membrane, by the positions of the run
  const double behind_m =
      kNeedleTip_m - least_of(text_of(path("good.csv")), "zm_m") - kFlavumEnds_m;
  EXPECT_GT(behind_m, 0.0005);
  EXPECT_NEAR(through["overshoot_m"].get<double>() / behind_m, 1.0, 0.01);
  // the force when it gave way is the largest while the tip was in it
  const json& flavum = through["layers"][3];
  EXPECT_NEAR(flavum["puncture_n"].get<double>() / flavum["force"]["most_n"].get<double>(), 1.0,
              0.01);
  // its threshold, and what the layers before it hold
  EXPECT_NEAR(flavum["puncture_n"].get<double>() / (1.8 + 0.1 + 0.05 + 0.4), 1.0, 0.02);
  EXPECT_EQ(scored({path("good.mcap")})["runs"][path("good.mcap")], through);

  const Outcome poor = run(kEpiduralPoor, "poor");
  const json hurt = json::parse(text_of(path("poor.json")))["task"];
  EXPECT_EQ(hurt["outcome"], "injury") << poor.out;
  EXPECT_THAT(poor.out, HasSubstr("You punctured dura, which was to be spared."));
  EXPECT_THAT(palpate({"score", path("good.mcap"), path("poor.mcap")}).out,
              AllOf(HasSubstr("  through, "), HasSubstr("  injury, ")));
}

// A hand that nothing deflects: its path gives depth, way, time and overshoot.
TEST_F(Tasks, WhatAStiffHandDoesWithANeedleFollowsFromItsPath) {
  const Outcome outcome =
      palpate({"loopback", kEpidural, "--no-ideal", "--json", path("stiff.json"), "--set",
               "hand.stiffness_newton_per_m=1e6", "--set", "hand.damping_newton_s_per_m=2000"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json task = json::parse(text_of(path("stiff.json")))["task"];
  // the foremost point begins 10 mm before the skin and ends 34.7 mm deep, 1.7 mm behind the
  // membrane (deploy/sessions/tasks/epidural.csv)
  EXPECT_NEAR(task["overshoot_m"].get<double>() / 0.0017, 1.0, 0.01);
  EXPECT_NEAR(task["insertion_depth_m"].get<double>() / 0.0347, 1.0, 0.01);
  EXPECT_NEAR(task["path_m"].get<double>() / 0.0447, 1.0, 0.01);
  EXPECT_NEAR(task["time_s"].get<double>() / 9.5, 1.0, 0.01);
  // the flavum gives way 1.8 N / (1400 N/m) below its top at 30 mm; the path goes from 28 mm on at
  // 5.125 s with 2.5 mm/s
  const double gives_way_m = 0.030 + 1.8 / 1400.0;
  const json& flavum = task["layers"][3];
  EXPECT_NEAR(flavum["puncture_depth_m"].get<double>() / gives_way_m, 1.0, 0.01);
  EXPECT_NEAR(flavum["punctured_after_s"].get<double>() / (5.125 + (gives_way_m - 0.028) / 0.0025),
              1.0, 0.01);
}

TEST_F(Tasks, TheGoodHandHoldsTheTissueAtTheTargetAndThePoorOneTearsIt) {
  const auto run = [&](const std::string& session, const std::string& name) {
    Outcome outcome = palpate({"loopback", kTasks + session, "--no-ideal", "--json",
                               path(name + ".json"), "--record", path(name + ".mcap")});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return outcome;
  };
  const Outcome good = run("traction.txtpb", "good");
  const json done = json::parse(text_of(path("good.json")))["task"];
  EXPECT_EQ(done["kind"], "traction");
  EXPECT_EQ(done["outcome"], "done") << good.out;
  EXPECT_EQ(done["grips"], 1);
  EXPECT_EQ(done["tears"], 0);
  EXPECT_EQ(done["slips"], 0);
  EXPECT_EQ(done["unknown_grip_ticks"], 0);
  EXPECT_EQ(done["overshoot_n"], 0.0);
  EXPECT_EQ(scored({path("good.mcap")})["runs"][path("good.mcap")], done);

  const Outcome poor = run("traction_poor.txtpb", "poor");
  const json torn = json::parse(text_of(path("poor.json")))["task"];
  EXPECT_EQ(torn["outcome"], "torn") << poor.out;
  EXPECT_EQ(torn["tears"], 1);
  EXPECT_GT(torn["overshoot_n"].get<double>(), 0.0);
  EXPECT_THAT(poor.out, HasSubstr("You tore the tissue after "));
  EXPECT_EQ(scored({path("poor.mcap")})["runs"][path("poor.mcap")], torn);
  EXPECT_THAT(palpate({"score", path("good.mcap"), path("poor.mcap")}).out,
              AllOf(HasSubstr("  done, "), HasSubstr("  torn, ")));
}

// A hand that nothing deflects: its path gives times and ways.
TEST_F(Tasks, WhatAStiffHandDoesWithAGripperFollowsFromItsPath) {
  const Outcome outcome = palpate({"loopback", kTasks + "traction.txtpb", "--no-ideal", "--json",
                                   path("stiff.json"), "--set", "hand.stiffness_newton_per_m=1e6",
                                   "--set", "hand.damping_newton_s_per_m=2000"});
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json task = json::parse(text_of(path("stiff.json")))["task"];
  // deploy/sessions/tasks/traction.csv: 3.5 mm until 2 s, 25.5 mm from 5 s on; the target is at
  // 24 mm, 3 mm around it
  const double reached_s = 2.0 + 3.0 * (0.021 - 0.0035) / 0.022;
  // the button closes them at 1.8 s; they hold with the next full solution, 20 ms later at most
  EXPECT_NEAR(task["held_after_s"].get<double>(), 1.8125, 0.0125);
  EXPECT_NEAR(task["reached_after_s"].get<double>() / reached_s, 1.0, 0.01);
  EXPECT_NEAR(task["done_after_s"].get<double>() / (reached_s + 5.0), 1.0, 0.01);
  // until the tip is below 21 mm again, on the way down with 10 mm/s from 11.5 s on
  EXPECT_NEAR(task["longest_s"].get<double>() / (11.5 + 0.45 - reached_s), 1.0, 0.01);
  EXPECT_NEAR(task["within_ratio"].get<double>(), 1.0, 1e-6);
  EXPECT_NEAR(task["retraction_m"].get<double>() / 0.022, 1.0, 0.01);
  EXPECT_NEAR(task["path_m"].get<double>() / 0.093, 1.0, 0.01);
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

// Lesions that no test chose, in an area of 2 × 2 cm: who presses with what is predicted to do
// finds all of them, who does not, none.
TEST_F(Tasks, OfRandomLesionsAFirmHandFindsAllAndALightOneNone) {
  std::string session = text_of(kLumpSearch);
  const auto put = [&](const std::string& from, const std::string& to) {
    session.replace(session.find(from), from.size(), to);
  };
  put("../block.msh", test::source_dir() + "/deploy/sessions/block.msh");
  put("\"lump_search.csv\"", "\"" + kTasks + "lump_search.csv\"");
  put("size_m { x: 0.03 y: 0.03", "size_m { x: 0.02 y: 0.02");
  files_.write("small.txtpb", session);
  const std::uint64_t count = test::seed_count(1);
  const auto detection = [&](const std::string& newton) {
    const std::string folder = path(newton);
    std::filesystem::create_directory(folder);
    const Outcome made =
        palpate({"make-task", path("small.txtpb"), "-q", "-o", folder, "--seed", "21", "--count",
                 std::to_string(count), "--search-newton", newton});
    EXPECT_EQ(made.status, 0) << made.err;
    std::vector<std::string> score{"score", "--json", "-"};
    for (const auto& made_session : std::filesystem::directory_iterator(folder)) {
      if (made_session.path().extension() != ".txtpb") continue;
      const std::string run = made_session.path().string() + ".mcap";
      const Outcome outcome =
          palpate({"loopback", made_session.path().string(), "-q", "--no-ideal", "--record", run});
      EXPECT_EQ(outcome.status, 0) << outcome.err;
      score.push_back(run);
    }
    return json::parse(palpate(score).out)["detection"];
  };
  const json firm = detection("2");
  EXPECT_EQ(firm["sensitivity"]["hits"], count) << firm;
  EXPECT_EQ(firm["sensitivity"]["cases"], count) << firm;
  EXPECT_EQ(firm["false_alarms"], 0) << firm;
  const json light = detection("0.2");
  EXPECT_EQ(light["sensitivity"]["hits"], 0) << light;
  EXPECT_EQ(light["sensitivity"]["cases"], count) << light;
}

}  // namespace
}  // namespace palpate
