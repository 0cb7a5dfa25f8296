// SPDX-License-Identifier: Apache-2.0
// `palpate sweep` as a user runs it: what is killed loses nothing and repeats nothing, the table is
// the same whoever computes it, and a violation comes with the line that repeats it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "tests/loopback/campaign/campaign_support.h"
#include "tests/support/machine/places.h"
#include "tests/support/text.h"

namespace palpate {
namespace {

using test::children_of;
using test::kSmallRuns;
using test::logged_lines;
using test::Outcome;
using test::Program;
using test::run_program;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;

using Sweep = test::CampaignFolder;

TEST_F(Sweep, WorkersKilledAtRandomLoseNothingAndNothingIsComputedTwice) {
  std::mt19937 random(7);
  Program sweep("palpate", arguments_of("killed", {"--workers", "2"}));
  int kills = 0;
  // a worker dies whenever a few more runs are done
  for (int lines = 3; lines < kSmallRuns - 20; lines += 10 + static_cast<int>(random() % 15)) {
    ASSERT_TRUE(test::await([&] { return logged_lines(path("killed")) >= lines; }));
    const std::vector<pid_t> workers = children_of(sweep.pid());
    if (workers.empty()) continue;
    ::kill(workers[random() % workers.size()], SIGKILL);
    ++kills;
  }
  EXPECT_EQ(sweep.wait(), 0) << sweep.err();

  EXPECT_GT(kills, 0);
  EXPECT_EQ(text_of(path("killed.csv")), undisturbed());
  EXPECT_THAT(sweep.out(), HasSubstr("160 runs"));
  // a line that was cut by a kill has no sum and counts as one more
  EXPECT_LE(logged_lines(path("killed")), kSmallRuns + kills);
}

TEST_F(Sweep, ASweepKilledAtRandomGoesOnWhereItWas) {
  test::adopt_orphans();
  for (int lines : {5, 40, 41, 110}) {
    Program sweep("palpate", arguments_of("killed", {"--workers", "2", "--overwrite"}));
    ASSERT_TRUE(test::await([&] { return logged_lines(path("killed")) >= lines; }));
    sweep.send_signal(SIGKILL);
    EXPECT_THAT(sweep.wait(), testing::AnyOf(128 + SIGKILL, 0));  // it may have ended before
    EXPECT_TRUE(test::all_children_end());
  }
  const int before = logged_lines(path("killed"));

  const Outcome last = run_program("palpate", arguments_of("killed", {"--overwrite"}));

  EXPECT_EQ(last.status, 0) << last.err;
  EXPECT_THAT(last.out, HasSubstr(std::to_string(before) + " from before"));
  EXPECT_EQ(text_of(path("killed.csv")), undisturbed());
}

TEST_F(Sweep, CtrlCEndsItAndTheSameCommandGoesOn) {
  {
    Program sweep("palpate", arguments_of("stopped", {"--workers", "2"}));
    ASSERT_TRUE(test::await([&] { return logged_lines(path("stopped")) >= 10; }));
    sweep.send_signal(SIGINT);
    EXPECT_EQ(sweep.wait(), 1);
    EXPECT_THAT(sweep.err(), HasSubstr("the same command goes on"));
  }
  EXPECT_EQ(run_program("palpate", arguments_of("stopped")).status, 0);
  EXPECT_EQ(text_of(path("stopped.csv")), undisturbed());
  EXPECT_EQ(logged_lines(path("stopped")), kSmallRuns);
}

TEST_F(Sweep, ALineThatIsCutOrChangedIsNoResult) {
  const std::string whole = undisturbed();
  const auto log = files_.path() / "undisturbed" / "worker-0.log";
  std::string text = text_of(log);
  text[text.find(' ', text.find('\n')) + 3] ^= 1;  // a figure of the second line
  text.resize(text.size() - 9);                    // the last sum
  std::ofstream(log, std::ios::binary) << text;

  const Outcome again =
      run_program("palpate", arguments_of("undisturbed", {"--overwrite", "--workers", "1"}));

  EXPECT_EQ(again.status, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("2 runs computed"));
  EXPECT_EQ(text_of(path("undisturbed.csv")), whole);
}

TEST_F(Sweep, SharesComputedApartGiveTheSameTable) {
  for (const char* share : {"1/3", "0/3", "2/3"}) {
    const Outcome outcome =
        run_program("palpate", {"sweep", campaign_, "--folder", path("shared"), "--share", share});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
  }
  const Outcome collected = run_program("palpate", arguments_of("shared"));

  EXPECT_THAT(collected.out, HasSubstr("0 runs computed"));
  EXPECT_EQ(text_of(path("shared.csv")), undisturbed());
}

// Without a controller some early run draws energy.
TEST_F(Sweep, TheFirstViolationEndsItAndItsLineRepeatsIt) {
  std::string text = test::replaced(test::kSmallCampaign, "at_least: -1\n", "at_least: -1e-6\n");
  campaign_ = files_.write("stop.txtpb", text + "stop_at_violation: true\n");
  const Outcome outcome =
      run_program("palpate", arguments_of("stop", {"--workers", "2", "--json", path("stop.json")}));
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("the first that violates a limit"));
  const Outcome alone =
      run_program("palpate", {"sweep", campaign_, "--folder", path("alone"), "--csv",
                              path("alone.csv"), "--workers", "1", "--worst", "1"});
  EXPECT_EQ(alone.status, 1);
  EXPECT_EQ(text_of(path("stop.csv")), text_of(path("alone.csv")));

  // the line, run by a shell
  const std::size_t begin = outcome.out.find("palpate loopback");
  ASSERT_NE(begin, std::string::npos);
  const std::string line = outcome.out.substr(begin, outcome.out.find('\n', begin) - begin);
  const Outcome repeated =
      run_program("/bin/sh", {"-c", test::binary_dir() + "/" + line + " -q --no-ideal --json -"});
  const std::string rows = text_of(path("stop.json"));
  const auto last = nlohmann::json::parse(rows.substr(rows.rfind('\n', rows.size() - 2) + 1));
  EXPECT_TRUE(last.at("violates").get<bool>());
  EXPECT_EQ(nlohmann::json::parse(repeated.out).at("min_true_energy_j"),
            last.at("min_true_energy_j"));

  // its recording
  const std::string recording = path("alone") + "/worst-1.mcap";
  EXPECT_THAT(alone.out, HasSubstr(recording + ": run " + last.at("run").dump() + "\n"));
  const Outcome info = run_program("palpate", {"info", recording});
  EXPECT_EQ(info.status, 0) << info.err;
  EXPECT_THAT(info.out, HasSubstr("hostile"));
}

TEST_F(Sweep, TheTableAndItsJsonLinesSayTheSame) {
  ASSERT_EQ(run_program("palpate", arguments_of("both", {"--json", path("both.json")})).status, 0);
  std::istringstream csv(text_of(path("both.csv")));
  std::istringstream json(text_of(path("both.json")));
  const auto cells_of = [](const std::string& line) {
    std::vector<std::string> cells;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
    return cells;
  };
  std::string line;
  ASSERT_TRUE(std::getline(csv, line));
  const std::vector<std::string> names = cells_of(line);
  int rows = 0;
  for (std::string object_text; std::getline(json, object_text); ++rows) {
    const auto object = nlohmann::json::parse(object_text);
    ASSERT_TRUE(std::getline(csv, line)) << "row " << rows;
    const std::vector<std::string> cells = cells_of(line);
    ASSERT_EQ(cells.size(), names.size()) << line;
    ASSERT_EQ(object.size(), names.size()) << object_text;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const nlohmann::json& value = object.at(names[i]);
      if (value.is_number()) {
        EXPECT_EQ(std::stod(cells[i]), value.get<double>()) << names[i] << ", row " << rows;
      } else if (value.is_string()) {
        EXPECT_EQ(cells[i], value.get<std::string>()) << names[i] << ", row " << rows;
      }
    }
  }
  EXPECT_EQ(rows, kSmallRuns);
  EXPECT_FALSE(std::getline(csv, line));
}

TEST_F(Sweep, ReportDrawsMapsOfCells) {
  campaign_ = files_.write("map.txtpb", R"(
name: "map"
session: ")" + test::source_dir() + R"(/deploy/sessions/hostile.txtpb"
seconds: 0.1
vary { name: "rate" field: "physics.rate_hz" values { value: "50" value: "1000" } }
vary { name: "stiffness" field: "scene.tissue[0].kelvin_voigt.stiffness_newton_per_m"
       values { value: "100" value: "200" value: "400" } }
report: "max_force_n"
report: "ticks"
)");
  ASSERT_EQ(run_program("palpate", arguments_of("map")).status, 0);
  const Outcome report =
      run_program("palpate", {"sweep", "report", campaign_, "--folder", path("map"), "--quantity",
                              "ticks", "--svg", path("map.svg")});

  EXPECT_EQ(report.status, 0) << report.err;
  EXPECT_THAT(report.out, AllOf(HasSubstr("stiffness"), HasSubstr("rate       100       200"),
                                HasSubstr("1000       100       100       100")));
  EXPECT_THAT(text_of(path("map.svg")), AllOf(HasSubstr("<svg"), HasSubstr(">1000<")));
  EXPECT_EQ(run_program("palpate",
                        {"sweep", "report", campaign_, "--folder", path("map"), "--across", "mass"})
                .status,
            2);
}

TEST_F(Sweep, WhatCannotBeComputedIsRefusedWithPlaceRuleAndRemedy) {
  const auto complaint = [&](const std::string& text) {
    const Outcome outcome = run_program(
        "palpate", {"sweep", files_.write("wrong.txtpb", text), "--folder", path("wrong")});
    EXPECT_EQ(outcome.status, 2) << outcome.out;
    return outcome.err;
  };
  EXPECT_THAT(complaint(test::replaced(test::kSmallCampaign, "uniform", "unifrm")),
              HasSubstr("wrong.txtpb:14:"));
  EXPECT_THAT(complaint(test::replaced(test::kSmallCampaign, "low: 0.05", "low: 5")),
              AllOf(HasSubstr("wrong.txtpb:14:"), HasSubstr("high must be above low")));
  EXPECT_THAT(complaint(test::replaced(test::kSmallCampaign, "max_force_n", "max_force")),
              AllOf(HasSubstr("wrong.txtpb:16:"), HasSubstr("is no quantity; give one of")));
  EXPECT_THAT(complaint(test::replaced(test::kSmallCampaign, "runs: 80", "runs: 0")),
              AllOf(HasSubstr("wrong.txtpb:6:"), HasSubstr("must be 1 …")));
  EXPECT_THAT(complaint(test::replaced(test::kSmallCampaign, "mofc.controller=none", "mofc.x=1")),
              HasSubstr("mofc.x"));
  EXPECT_THAT(complaint("name: \"x\" session: \"nowhere.txtpb\" report: \"ticks\""),
              HasSubstr("nowhere.txtpb"));
}

TEST_F(Sweep, AFolderBelongsToOneCampaignAndATableIsNotReplaced) {
  static_cast<void>(undisturbed());
  const Outcome twice = run_program("palpate", arguments_of("undisturbed"));
  EXPECT_EQ(twice.status, 2);
  EXPECT_THAT(twice.err, HasSubstr("--overwrite"));
  campaign_ = files_.write("other.txtpb",
                           test::replaced(test::kSmallCampaign, "seconds: 1\n", "seconds: 0.3\n"));
  const Outcome other =
      run_program("palpate", {"sweep", campaign_, "--folder", path("undisturbed")});
  EXPECT_EQ(other.status, 2);
  EXPECT_THAT(other.err, HasSubstr("has the results of another campaign"));
}

// --- adversary ----------------------------------------------------------------------------------

TEST_F(Sweep, AdversaryIsForLockstepOnlyUnlessItIsLeftOut) {
  const std::string session = test::source_dir() + "/deploy/sessions/hostile.txtpb";
  const std::vector<std::string> attack{"--set", "adversary.physics=push_along"};
  for (const char* node : {"device_node", "mofc_node", "physics_node"}) {
    const Outcome refused = run_program(node, {"--session", session, attack[0], attack[1]});
    EXPECT_EQ(refused.status, 2);
    EXPECT_THAT(refused.err, AllOf(HasSubstr("adversary"), HasSubstr("--no-adversary")));
  }
  const Outcome launch = run_program("palpate", {"launch", session, attack[0], attack[1]});
  EXPECT_EQ(launch.status, 2);
  EXPECT_THAT(launch.err, HasSubstr("--no-adversary"));
  const Outcome attacked = run_program(
      "palpate", {"loopback", session, "--seconds", "0.5", "--json", "-", attack[0], attack[1]});
  const Outcome honest =
      run_program("palpate", {"loopback", session, "--seconds", "0.5", "--json", "-"});
  EXPECT_NE(nlohmann::json::parse(attacked.out).at("transparency"),
            nlohmann::json::parse(honest.out).at("transparency"));
}

/// Two hands, each recorded in a file of its own.
class SweepOfFiles : public Sweep {
 protected:
  SweepOfFiles() {
    write_hand("first.csv", "0.005");
    write_hand("second.csv", "0.004");
    files_.write("files.txtpb", R"(
name: "files"
session: "press.txtpb"
seconds: 0.2
runs: 2
vary { field: "hand.recorded.file" values { value: "first.csv" value: "second.csv" } }
report: "max_force_n"
)");
    files_.write("press.txtpb", R"(
name: "press"
device { simulated {} }
hand { recorded { file: "first.csv" } }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 500 } } }
)");
  }
  [[nodiscard]] static std::string hand(const std::string& depth_m) {
    return "t,x,y,z\n0,0,0,0.01\n0.1,0,0,-" + depth_m + "\n";
  }
  void write_hand(const std::string& name, const std::string& depth_m) {
    files_.write(name, hand(depth_m));
  }
  [[nodiscard]] Outcome sweep(const std::string& folder,
                              const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"sweep", path("files.txtpb"),   "--folder",    path(folder),
                                       "--csv", path(folder + ".csv"), "--overwrite", "--workers",
                                       "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("palpate", arguments);
  }
};

TEST_F(SweepOfFiles, AFolderIsRefusedOnceAFileOfAnyCellHasChanged) {
  ASSERT_EQ(sweep("results").status, 0);
  write_hand("second.csv", "0.006");
  const Outcome changed = sweep("results");
  EXPECT_EQ(changed.status, 2);
  EXPECT_THAT(changed.err, HasSubstr("file of its session"));
  write_hand("second.csv", "0.004");
  EXPECT_EQ(sweep("results").status, 0);
}

// The option replaces the scene in which the choice before it names a file; in its cell, no other
// value of the choice can be set.
TEST_F(SweepOfFiles, AFileThatOnlyAnotherOptionLeavesInPlaceIsCovered) {
  const auto write_body = [this](const std::string& name, const std::string& depth_m) {
    files_.write(name, "v 0.1 0 -" + depth_m + "\nv 0.2 0 -0.1\nv 0.1 0.1 -0.1\nv 0.1 0 -0.2\n" +
                           "f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n");
  };
  write_body("first.obj", "0.1");
  write_body("second.obj", "0.1");
  files_.write("press.txtpb", R"(
name: "press"
device { simulated {} }
hand { recorded { file: "first.csv" } }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 500 } }
        tissue { triangle_surface { file: "first.obj" }
                 kelvin_voigt { stiffness_newton_per_m: 500 } } }
)");
  files_.write("files.txtpb", R"(
name: "files"
session: "press.txtpb"
seconds: 0.2
runs: 4
vary { field: "scene.tissue[1].triangle_surface.file"
       choice { value: "first.obj" value: "second.obj" } }
vary { name: "scene"
       options { option { name: "flat" set: "scene={ tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 500 } } }" }
                 option { name: "body" } } }
report: "max_force_n"
)");
  for (const char* changed : {"first.obj", "second.obj"}) {
    const std::string folder = std::string("results_") + changed;
    const Outcome first = sweep(folder);
    ASSERT_EQ(first.status, 0) << first.err;
    write_body(changed, "0.09");
    const Outcome outcome = sweep(folder);
    EXPECT_EQ(outcome.status, 2) << changed;
    EXPECT_THAT(outcome.err, HasSubstr("file of its session")) << changed;
  }
}

// It is loaded where a session names a controller that it has.
TEST_F(SweepOfFiles, AFolderIsRefusedOnceTheLibraryOfControllersHasChanged) {
  const auto prefix = files_.path() / "prefix";
  std::filesystem::create_directories(prefix / "bin");
  std::filesystem::create_directories(prefix / "lib/palpate");
  for (const char* file : {"bin/palpate_tools", "lib/palpate/palpate_rivals.so"}) {
    std::filesystem::copy_file(std::filesystem::path(test::binary_dir()) / ".." / file,
                               prefix / file);
  }
  const std::vector<std::string> arguments{"sweep", path("files.txtpb"), "--folder",
                                           path("results")};
  const std::string program = prefix / "bin/palpate_tools";
  const Outcome first = run_program(program, arguments);
  ASSERT_EQ(first.status, 0) << first.err;
  EXPECT_EQ(run_program(program, arguments).status, 0);
  std::ofstream(prefix / "lib/palpate/palpate_rivals.so", std::ios::app) << "another build";
  const Outcome changed = run_program(program, arguments);
  EXPECT_EQ(changed.status, 2);
  EXPECT_THAT(changed.err, HasSubstr("or the program changed"));
}

TEST_F(SweepOfFiles, AFileThatChangesWhileItRunsEndsItAndNoResultOfTheNewOneIsKept) {
  // half written, a file is refused by the run that reads it; the cause is the change
  for (const std::string& text : {std::string{}, hand("0.006")}) {
    Program running("palpate", {"sweep", path("files.txtpb"), "--folder", path("results"), "--runs",
                                "200000", "--workers", "2"});
    const int lines_before = logged_lines(path("results"));
    ASSERT_TRUE(test::await([&] { return logged_lines(path("results")) >= lines_before + 5; }));
    files_.write("second.csv", text);
    files_.write("first.csv", text);
    EXPECT_EQ(running.wait(), 2) << running.err();
    EXPECT_THAT(running.err(), HasSubstr("has changed since the sweep began"));
    write_hand("second.csv", "0.004");
    write_hand("first.csv", "0.005");
  }
  ASSERT_EQ(sweep("results").status, 0);
  ASSERT_EQ(sweep("undisturbed").status, 0);
  EXPECT_EQ(text_of(path("results.csv")), text_of(path("undisturbed.csv")));
}

TEST_F(SweepOfFiles, AFolderWithLinksOrPipesIsRefusedAndTheirTargetsAreLeftAlone) {
  const std::string other = files_.write("other.txt", "of another program");
  const struct {
    const char* name;
    bool is_link;
  } strange[] = {{"worker-0.log", true}, {"lock", true}, {"campaign.txt", false}, {"a.log", false}};
  for (const auto& [name, is_link] : strange) {
    const std::filesystem::path folder = path(std::string("with_") + name);
    std::filesystem::create_directory(folder);
    if (is_link) {
      std::filesystem::create_symlink(other, folder / name);
    } else {
      ASSERT_EQ(::mkfifo((folder / name).c_str(), 0600), 0);
    }
    const Outcome outcome = sweep(folder.filename());
    EXPECT_EQ(outcome.status, 2) << name;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr(name), HasSubstr("holds files only"))) << name;
    EXPECT_EQ(text_of(other), "of another program") << name;
  }
}

TEST_F(SweepOfFiles, AFileOfAHugeSizeInTheFolderIsRefusedAndNotReadWhole) {
  for (const char* name : {"campaign.txt", "worker-0.log", "slurm.job"}) {
    const std::filesystem::path folder = path(std::string("with_") + name);
    std::filesystem::create_directory(folder);
    std::ofstream(folder / name) << "7";
    std::filesystem::resize_file(folder / name, std::uintmax_t{40} << 30U);  // sparse
    const Outcome outcome = sweep(folder.filename(), {"--slurm"});
    EXPECT_EQ(outcome.status, 2) << name;
    EXPECT_THAT(outcome.err, HasSubstr(name));
  }
}

TEST_F(SweepOfFiles, GoesOnWithMoreRunsAndWithFewer) {
  const Outcome few = sweep("results", {"--runs", "3"});
  ASSERT_EQ(few.status, 0) << few.err;
  EXPECT_EQ(logged_lines(path("results")), 6);
  const Outcome more = sweep("results", {"--runs", "5"});
  ASSERT_EQ(more.status, 0) << more.err;
  EXPECT_EQ(logged_lines(path("results")), 10);
  ASSERT_EQ(sweep("at_once", {"--runs", "5"}).status, 0);
  EXPECT_EQ(text_of(path("results.csv")), text_of(path("at_once.csv")));
  const std::string five = text_of(path("results.csv"));
  ASSERT_EQ(sweep("results").status, 0);
  ASSERT_EQ(sweep("two").status, 0);
  EXPECT_EQ(text_of(path("results.csv")), text_of(path("two.csv")));
  EXPECT_EQ(logged_lines(path("results")), 10);
}

}  // namespace
}  // namespace palpate
