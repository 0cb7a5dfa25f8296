// SPDX-License-Identifier: Apache-2.0
// Studies with the real programs: participants whose senses are known, a study that is killed, and
// trials in real time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using test::Outcome;
using test::Program;
using test::run_program;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string kSessions = test::source_dir() + "/deploy/sessions/tasks/";

class Studies : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  static Outcome palpate(const std::vector<std::string>& arguments) {
    return run_program("palpate", arguments);
  }
  [[nodiscard]] std::string plan(const std::string& text) const {
    return files_.write("plan.txtpb", "name: \"try\" " + text);
  }
  /// One trial is one press on each pad, 1.8 s a pad.
  [[nodiscard]] std::string staircase_plan(const std::string& reversals) const {
    return plan(std::string("session: \"") + kSessions +
                "stiffer_side.txtpb\" condition { name: \"as it is\" } seconds: 4.2 staircase { "
                "field: \"scene.tissue[0].kelvin_voigt.inclusion[0].stiffness_newton_per_m\" "
                "reference: 150 start_ratio: 0.2 reversals: " +
                reversals +
                " alternative { set: "
                "\"scene.tissue[0].kelvin_voigt.inclusion[0].center_m.x=-0.03\" } alternative { "
                "set: \"scene.tissue[0].kelvin_voigt.inclusion[0].center_m.x=0.03\" } }");
  }
  [[nodiscard]] std::vector<std::string> trials(const std::string& plan_file,
                                                const std::string& folder,
                                                const std::string& participant) const {
    return {"study",     plan_file,    "--folder", path(folder), "--participant",
            participant, "--loopback", "--weber",  "0.1"};
  }
  [[nodiscard]] std::string table(const std::string& plan_file, const std::string& folder) const {
    return palpate({"study", "report", plan_file, "--folder", path(folder), "--simulated", "--csv",
                    "-"})
        .out;
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
};

/// Φ⁻¹(√½), the difference of two forces in units of their noise that is told rightly in 70.7 %.
constexpr double kLevitt2 = 0.54516;

TEST_F(Studies, AStaircaseFindsTheThresholdOfParticipantsWhoseSensesAreKnown) {
  const std::string file = staircase_plan("14");
  for (const char* participant : {"1", "2", "3", "4", "5", "6"}) {
    const Outcome outcome = palpate(trials(file, "s", participant));
    ASSERT_EQ(outcome.status, 0) << outcome.err;
  }
  const Outcome report =
      palpate({"study", "report", file, "--folder", path("s"), "--simulated", "--unblind"});
  ASSERT_EQ(report.status, 0) << report.err;
  std::smatch found;
  ASSERT_TRUE(std::regex_search(
      report.out, found,
      std::regex("as it is .*threshold ([0-9.]+) % \\(95 % interval ([0-9.]+) … ([0-9.]+) %, 6 ")))
      << report.out;
  // d/(W √(1 + (1 + d)²)) = Φ⁻¹(√½) with W = 0.1
  double expected = 0.1;
  for (int i = 0; i < 50; ++i) {
    expected = kLevitt2 * 0.1 * std::sqrt(1.0 + (1.0 + expected) * (1.0 + expected));
  }
  EXPECT_NEAR(std::stod(found[1]) / (100.0 * expected), 1.0, 0.35) << report.out;
  EXPECT_LT(std::stod(found[2]), 100.0 * expected) << report.out;
  EXPECT_GT(std::stod(found[3]), 100.0 * expected) << report.out;
}

TEST_F(Studies, AStaircaseThatEndsByItsTrialsHasNoThreshold) {
  const std::string file = staircase_plan("14 most_trials: 4");
  ASSERT_EQ(palpate(trials(file, "s", "1")).status, 0);
  const Outcome report = palpate({"study", "report", file, "--folder", path("s"), "--simulated"});
  EXPECT_THAT(report.out, HasSubstr("threshold not known: too few reversals within most_trials"));
}

TEST_F(Studies, AKillCostsTheTrialThatRunsAndNothingElse) {
  const std::string file = staircase_plan("6");
  const Outcome whole = palpate(trials(file, "whole", "1"));
  ASSERT_EQ(whole.status, 0) << whole.err;
  const auto row = [&](const std::string& number) {
    return std::filesystem::exists(path("cut") + "/S001/trial_" + number + "/row.csv");
  };
  {
    Program running("palpate", trials(file, "cut", "1"));
    ASSERT_TRUE(test::await([&] { return row("003"); })) << running.err();
    running.send_signal(SIGKILL);
    running.wait();
  }
  EXPECT_THAT(table(file, "cut"), Not(table(file, "whole")));
  EXPECT_EQ(palpate(trials(file, "cut", "1")).status, 0);
  const std::string cut = table(file, "cut");
  EXPECT_EQ(cut, table(file, "whole"));
  EXPECT_GT(std::count(cut.begin(), cut.end(), '\n'), 8);
}

TEST_F(Studies, NoisyHandsDoTheTrialsOfAShippedStudyInBalancedOrder) {
  const std::string study = test::source_dir() + "/deploy/studies/epidural_delay.txtpb";
  for (const char* participant : {"1", "2"}) {
    const Outcome outcome =
        palpate({"study", study, "--folder", path("e"), "--participant", participant, "--loopback",
                 "--hand-noise-mm", "0.3", "-q", "--trials", "4"});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
  }
  const Outcome report = palpate({"study", "report", study, "--folder", path("e"), "--simulated",
                                  "--unblind", "--csv", path("e.csv")});
  EXPECT_EQ(report.status, 0) << report.err;
  const std::string csv = text_of(path("e.csv"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 9);
  EXPECT_THAT(
      csv, AllOf(HasSubstr("condition,study,participant,simulated,trial,"), HasSubstr(",needle,")));
  const auto condition_of = [&](const std::string& participant_trial_and_block) {
    const std::size_t at = csv.find(",epidural_delay," + participant_trial_and_block);
    EXPECT_NE(at, std::string::npos) << participant_trial_and_block << "\n" << csv;
    return csv.substr(csv.rfind('\n', at) + 1, at - csv.rfind('\n', at) - 1);
  };
  // three trials each; the first rows of the square of three are 0 1 2 and 1 2 0
  EXPECT_EQ(condition_of("1,1,1,1,1,"), condition_of("1,1,3,1,3,"));
  EXPECT_NE(condition_of("1,1,1,1,1,"), condition_of("1,1,4,2,1,"));
  EXPECT_EQ(condition_of("1,1,4,2,1,"), condition_of("2,1,1,1,1,"));
  // to try a plan costs no participant: people begin with their first trial
  const Outcome people = palpate({"study", "report", study, "--folder", path("e")});
  EXPECT_THAT(people.out, HasSubstr("epidural_delay: 0 participants"));
}

// The field is at most 0.1 (docs/session.md): 0.05 · (1 + 1). Nobody marks, so every answer is
// wrong: 30 %, 60 %, 120 %, ….
TEST_F(Studies, ASeriesGrowsNoFartherThanItsFieldAndSaysSo) {
  const std::string begin = std::string("session: \"") + kSessions +
                            "stiffer_side.txtpb\"\nseconds: 1 condition { name: \"a\" }\n";
  const std::string end =
      " step_factor: 2 right_answers: 1 most_trials: 5 alternative {} alternative { set: "
      "\"name=other\" } }";
  const std::string file =
      plan(begin +
           "staircase { field: \"task.palpation.coverage_radius_m\" reference: 0.05 "
           "start_ratio: 0.3" +
           end);
  const Outcome outcome =
      palpate({"study", file, "--folder", path("g"), "--participant", "1", "--loopback"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("plan.txtpb:3:"),
                                 HasSubstr("staircase.field: the session takes a difference of at "
                                           "most 100 %"),
                                 HasSubstr("coverage_radius_m"), HasSubstr("give another")));
  const std::string csv = table(file, "g");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 6) << csv;
  for (const char* difference : {",A,0.3,", ",A,0.6,", ",A,1,"}) {
    EXPECT_THAT(csv, HasSubstr(difference));
  }
  EXPECT_THAT(csv, Not(HasSubstr(",A,1.2,")));
  // a start beyond it
  const Outcome refused =
      palpate({"study",
               plan(begin +
                    "staircase { field: \"task.palpation.coverage_radius_m\" reference: 0.05\n"
                    "start_ratio: 1.3" +
                    end),
               "--folder", path("h"), "--participant", "1", "--loopback"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("plan.txtpb:4:"), HasSubstr("staircase.start_ratio: "),
                                 HasSubstr("coverage_radius_m")));
}

// What a report reads is left as it is: by name, by a link, and whatever --overwrite says.
TEST_F(Studies, AReportDestroysNothingThatItReads) {
  const std::string session = files_.write("own.txtpb", R"(
    name: "study_own" hand { hold { position_m { z: 0.01 } } }
    scene { tissue { name: "pad" half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
    task { free {} time_s: 1 }
  )");
  const std::string file = plan("session: \"own.txtpb\" seconds: 1 condition { name: \"a\" }");
  ASSERT_EQ(
      palpate({"study", file, "--folder", path("k"), "--participant", "1", "--loopback"}).status,
      0);
  std::filesystem::create_symlink(path("k") + "/study.txt", path("link.csv"));
  std::filesystem::create_hard_link(path("k") + "/key_simulated.csv", path("twin.csv"));
  const std::vector<std::string> all{path("k") + "/key.csv",
                                     path("k") + "/key_simulated.csv",
                                     path("k") + "/study.txt",
                                     path("k") + "/S001/trial_001/row.csv",
                                     path("k") + "/S001/trial_001/run.mcap",
                                     path("link.csv"),
                                     path("twin.csv"),
                                     session,
                                     file};
  for (const std::string& one : all) {
    const std::string before = text_of(one);
    const Outcome outcome = palpate({"study", "report", file, "--folder", path("k"), "--simulated",
                                     "--csv", one, "--overwrite"});
    EXPECT_EQ(outcome.status, 2) << one;
    EXPECT_THAT(outcome.err, HasSubstr("is read by this command")) << one;
    EXPECT_EQ(text_of(one), before) << one;
  }
}

TEST_F(Studies, ATrialInRealTimeEndsWithItsTask) {
  const std::string session = files_.write("hold.txtpb", R"(
    name: "study_hold" realtime { priority: 0 cpu: -1 } viewer { web { disabled: true } }
    hand { sinusoid { center_m { z: 0.02 } amplitude_m { z: 0.01 } frequency_hz { z: 2 } } }
    scene { tissue { name: "pad" half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
    task { free {} time_s: 1 }
  )");
  // the hand is faster than assumed: what a node says of it would tell the condition
  const std::string file = plan(
      "session: \"hold.txtpb\" condition { name: \"one\" set: "
      "\"mofc.guard_settings.v_max_m_per_s=0.01\" } repeats: 2");
  const Outcome first =
      palpate({"study", file, "--folder", path("r"), "--participant", "7", "--trials", "1"});
  EXPECT_EQ(first.status, 0) << first.err;
  EXPECT_EQ(
      first.err,
      "palpate: participant 7, trial 1\npalpate: participant 7 goes on with trial 2: the same "
      "command\n");
  EXPECT_THAT(text_of(path("r/P007/trial_001/messages.txt")),
              HasSubstr("event=hand_faster_than_assumed"));
  const std::string csv =
      palpate({"study", "report", file, "--folder", path("r"), "--csv", "-"}).out;
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 2);
  EXPECT_THAT(csv, HasSubstr("\ntry,7,0,1,1,1,A,,,,free,"));
}

// A port is taken: said, and nothing of the condition.
TEST_F(Studies, ATrialThatFailsSaysCausesThatTellNoCondition) {
  const int taken = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  ASSERT_EQ(bind(taken, reinterpret_cast<sockaddr*>(&address), size), 0);
  ASSERT_EQ(listen(taken, 1), 0);
  ASSERT_EQ(getsockname(taken, reinterpret_cast<sockaddr*>(&address), &size), 0);
  files_.write("busy.txtpb", R"(
    name: "study_busy" realtime { priority: 0 cpu: -1 } viewer { web { disabled: true } } links { device_telemetry: "tcp://127.0.0.1:)" +
                                 std::to_string(ntohs(address.sin_port)) + R"(" }
    scene { tissue { name: "pad" half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
    task { free {} time_s: 1 }
  )");
  const std::string file =
      plan("session: \"busy.txtpb\" condition { name: \"secret\" set: \"mofc.mode=paper\" }");
  const Outcome outcome = palpate({"study", file, "--folder", path("b"), "--participant", "1"});
  close(taken);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("a port or address is in use: end the other program that has it"),
                    HasSubstr("messages.txt"), Not(HasSubstr("secret")), Not(HasSubstr("paper"))));
}

// Both have the session's name: the second is told so, which tells nothing of the condition.
TEST_F(Studies, OfTwoParticipantsAtOnceTheSecondIsToldWhy) {
  files_.write("twice.txtpb", R"(
    name: "study_twice" realtime { priority: 0 cpu: -1 } viewer { web { disabled: true } }
    scene { tissue { name: "pad" half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
    task { free {} time_s: 60 }
  )");
  const std::string file =
      plan("session: \"twice.txtpb\" condition { name: \"secret\" set: \"mofc.mode=paper\" }");
  Program first("palpate", {"study", file, "--folder", path("t"), "--participant", "1"});
  ASSERT_TRUE(test::await([&] {
    return std::filesystem::exists(path("t/P001/trial_001/run.mcap"));
  })) << first.err();
  const Outcome second = palpate({"study", file, "--folder", path("t"), "--participant", "2"});
  first.send_signal(SIGINT);
  first.wait();
  EXPECT_EQ(second.status, 1);
  EXPECT_THAT(second.err, AllOf(HasSubstr("this session is already launched on this machine"),
                                Not(HasSubstr("secret")), Not(HasSubstr("paper"))));
}

TEST_F(Studies, AReportOfWhatFollowsAMissingTrialIsIncomplete) {
  files_.write("own.txtpb", R"(
    name: "study_gap" hand { hold { position_m { z: 0.01 } } }
    scene { tissue { name: "pad" half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
    task { free {} time_s: 1 }
  )");
  const std::string file =
      plan("session: \"own.txtpb\" seconds: 1 repeats: 3 condition { name: \"a\" }");
  ASSERT_EQ(
      palpate({"study", file, "--folder", path("g"), "--participant", "1", "--loopback"}).status,
      0);
  const std::vector<std::string> report{"study",    "report",  file,
                                        "--folder", path("g"), "--simulated"};
  EXPECT_EQ(palpate(report).status, 0);
  std::filesystem::remove(path("g/S001/trial_002/row.csv"));
  const Outcome outcome = palpate(report);
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("1 trials of 1 participants"));
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("S001/trial_002/row.csv is missing"),
                                 HasSubstr("does not count: trial 3; ")));
}

TEST_F(Studies, WrongPlansAreRefusedWithPlaceAndRemedy) {
  const auto refusal = [&](const std::string& text) {
    const Outcome outcome = palpate({"study", plan(text), "--participant", "1"});
    EXPECT_EQ(outcome.status, 2);
    return outcome.err;
  };
  const std::string session = std::string("session: \"") + kSessions + "epidural.txtpb\" ";
  EXPECT_THAT(refusal(session), HasSubstr("condition: 1 … 26 are required"));
  EXPECT_THAT(refusal(session + "condition { name: \"a\" } condition { name: \"a\" }"),
              AllOf(HasSubstr("plan.txtpb:1:"), HasSubstr("condition[1].name: another condition")));
  EXPECT_THAT(refusal(session + "\ncondition { name: \"good\" }\n"
                                "condition { name: \"a\" set: \"mofc.mode=best\" }"),
              AllOf(HasSubstr("plan.txtpb:3:"),
                    HasSubstr("condition[1].set[0]: of condition \"a\": mofc.mode: mode = best")));
  EXPECT_THAT(refusal(session + "\nset: \"mofc.mode=best\"\ncondition { name: \"a\" }"),
              AllOf(HasSubstr("plan.txtpb:2:"), HasSubstr(": set[0]: mofc.mode: mode = best")));
  EXPECT_THAT(refusal(session + "\n\ncondition { }"),
              AllOf(HasSubstr("plan.txtpb:3:"), HasSubstr("condition[0].name: required")));
  EXPECT_THAT(
      refusal(std::string("session: \"") + kSessions +
              "stiffer_side.txtpb\"\ncondition { name: \"a\" }\nstaircase { field: \"name\" "
              "reference: 1 alternative {} alternative {} }"),
      AllOf(HasSubstr("plan.txtpb:3:"),
            HasSubstr("staircase.field: \"name\" is no number with decimals; give")));
  EXPECT_THAT(palpate({"study", plan(session + "condition { name: \"a\" }"), "--participant", "1",
                       "--loopback", "--weber", "0.1"})
                  .err,
              HasSubstr("--weber: the plan has no staircase"));
  EXPECT_THAT(refusal(session + "condition { name: \"a\" } staircase { field: \"duration_s\" "
                                "reference: 1 alternative {} alternative {} }"),
              HasSubstr("a staircase needs task { palpation"));
  EXPECT_THAT(refusal(std::string("session: \"") + kSessions +
                      "../default.txtpb\" condition { name: \"a\" }"),
              AllOf(HasSubstr("plan.txtpb:1:"), HasSubstr("session: "), HasSubstr("has no task")));
  const std::string staircase =
      " staircase { field: \"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m\" reference: 1 "
      "alternative {} alternative {} }";
  for (const char* rival : {"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=9", "scene={}"}) {
    std::string text = session;
    text.append("\n\ncondition { name: \"a\" set: \"").append(rival).append("\" }");
    EXPECT_THAT(refusal(text + staircase),
                AllOf(HasSubstr("plan.txtpb:3:"), HasSubstr("condition[0].set[0]: "),
                      HasSubstr("sets what the staircase sets")))
        << rival;
  }
  EXPECT_THAT(refusal(session + "\ncondition { name: \"a\\377b\" }"),
              AllOf(HasSubstr("plan.txtpb:2:"), HasSubstr("condition[0].name: is not UTF-8 text")));
  EXPECT_THAT(refusal(session + "condition { name: \"a\\000b\" }"), HasSubstr("zero bytes"));
  EXPECT_THAT(refusal("\n\nsession: \"nowhere.txtpb\" condition { name: \"a\" }"),
              AllOf(HasSubstr("plan.txtpb:3:"), HasSubstr("session: "), HasSubstr("nowhere.txtpb"),
                    HasSubstr("no such file")));
  EXPECT_THAT(refusal("condition { nam: \"a\" }"), HasSubstr("nam"));
  EXPECT_THAT(palpate({"study", plan(session + "condition { name: \"a\" }")}).err,
              HasSubstr("give --participant N"));
}

}  // namespace
}  // namespace palpate
