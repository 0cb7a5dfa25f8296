// SPDX-License-Identifier: Apache-2.0
// The verdict on a run: the right cause for each trouble, and grades by the stated limits.
#include "common/telemetry/verdict/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>
#include <string>

#include "tests/unit/telemetry/verdict_cases.h"

namespace palpate {
namespace {

using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::Not;

/// All texts and remedies.
std::string words_of(const std::vector<RunFinding>& findings) {
  std::string words;
  for (const RunFinding& finding : findings) words += finding.text + ": " + finding.remedy + "\n";
  return words;
}

RunFacts lockstep_facts(const TroubledRun& run) {
  RunFacts facts = facts_of(run.session, report_of(run));
  // no row was added: what the statistics would have
  facts.minimum_true_energy_joule = run.device.minimum_true_energy_joule;
  facts.maximum_force_newton = run.device.max_force_newton;
  return facts;
}

TEST(Verdict, NamesTheCauseOfEveryTrouble) {
  std::size_t checked = 0;
  for (const VerdictCase& one : verdict_cases()) {
    if (!one.is_of_lockstep) continue;
    SCOPED_TRACE(one.name);
    const TroubledRun run = run_of(one);
    const std::vector<RunFinding> findings = judge(lockstep_facts(run));
    EXPECT_EQ(cause_of(findings), one.cause) << words_of(findings);
    EXPECT_EQ(name(grade_of(findings)), one.grade) << words_of(findings);
    EXPECT_THAT(words_of(findings), HasSubstr(one.remedy));
    ++checked;
  }
  EXPECT_GE(checked, 20u);
}

TEST(Verdict, NoShareIsMoreThanAll) {
  const std::regex share("([0-9.]+) %");
  for (const VerdictCase& one : verdict_cases()) {
    for (const RunFinding& finding : judge(lockstep_facts(run_of(one)))) {
      EXPECT_LE(finding.share, 1.0) << one.name << ": " << finding.text;
      std::smatch found;
      if (!std::regex_search(finding.text, found, share)) continue;
      EXPECT_LE(std::stod(found[1]), 100.0) << one.name << ": " << finding.text;
    }
  }
}

// The device gave no force, so neither the tissue nor the hand is to blame, and what the session
// accepts changes nothing.
TEST(Verdict, OfAWorkspaceThatLeavesNoForceBlamesNothingElse) {
  for (const bool is_accepted : {false, true}) {
    TroubledRun run;
    run.device.has_no_motor_watchdog = true;
    run.device.accepts_no_motor_watchdog = is_accepted;
    run.device.max_force_newton = 0.0;
    run.device.peak_limited_ticks = 5'000;
    run.mofc.clamped_ticks = 2'000;
    run.physics.is_started_in_contact = true;
    const std::string words = words_of(judge(lockstep_facts(run)));
    EXPECT_THAT(words, HasSubstr("workspace_half_extent_m"));
    for (const char* const wrong : {"softer tissue", "begin outside", "NO_MOTOR_WATCHDOG"}) {
      EXPECT_THAT(words, Not(HasSubstr(wrong)));
    }
  }
}

// The fault itself took 3 % of the run; the person came 6 s later.
TEST(Verdict, AfterAFaultNamesWhatTheDeviceWaitedFor) {
  TroubledRun run;
  run.device.device_faults = run.device.fault_resets = 1;
  run.device.last_fault = FaultReason::kDeviceNotReady;
  run.device.fault_ticks = 300;
  run.device.uncalibrated_ticks = 5'000;
  run.device.unacknowledged_ticks = 700;
  run.device.checking_ticks = 200;
  run.device.limp_ticks = 5'900;
  run.device.answered_ticks = 10'000 - 6'200;
  const std::vector<RunFinding> findings = judge(lockstep_facts(run));
  EXPECT_THAT(words_of(findings),
              HasSubstr("no force in 59 % of the ticks: after its first force the device waited "
                        "for its connection or calibration (50 %), waited for an acknowledgement "
                        "(7 %), checked its motors (2 %)"));
  const auto unanswered = std::find_if(findings.begin(), findings.end(), [](const RunFinding& one) {
    return one.what == "ticks_unanswered";
  });
  ASSERT_NE(unanswered, findings.end());
  EXPECT_EQ(unanswered->cause, "device_waited");
}

TEST(Verdict, BlamesNoSimulatedFaultWhereThereIsNone) {
  for (const VerdictCase& one : verdict_cases()) {
    const TroubledRun run = run_of(one);
    const auto is_simulated = [](const std::string& setting) {
      return setting.starts_with("faults.") || setting.starts_with("adversary.");
    };
    if (std::any_of(one.settings.begin(), one.settings.end(), is_simulated)) continue;
    EXPECT_THAT(words_of(judge(lockstep_facts(run))), Not(HasSubstr("simulated"))) << one.name;
  }
}

TEST(Verdict, BlamesThePathOnlyIfNothingElseKeptTheToolAway) {
  for (const VerdictCase& one : verdict_cases()) {
    const TroubledRun run = run_of(one);
    const std::vector<RunFinding> findings = judge(lockstep_facts(run));
    const bool is_blamed = words_of(findings).find("check the hand's path") != std::string::npos;
    EXPECT_EQ(is_blamed, one.cause == "path") << one.name << "\n" << words_of(findings);
  }
}

// its consequences are not told as causes of their own
TEST(Verdict, OfAFaultBlamesNoOtherNode) {
  for (const VerdictCase& one : verdict_cases()) {
    if (one.cause != "device_fault") continue;
    const TroubledRun run = run_of(one);
    for (const RunFinding& finding : judge(lockstep_facts(run))) {
      EXPECT_TRUE(finding.grade == Grade::kGood || finding.cause == "device_fault")
          << one.name << ": " << finding.text;
    }
  }
}

// a dead-man button that nobody held is not fair where the missing contact is bad
TEST(Verdict, GradesNoCauseBetterThanItsConsequence) {
  for (const VerdictCase& one : verdict_cases()) {
    const TroubledRun run = run_of(one);
    const std::vector<RunFinding> findings = judge(lockstep_facts(run));
    for (const RunFinding& effect : findings) {
      for (const RunFinding& cause : findings) {
        if (cause.what != effect.cause || cause.grade == Grade::kGood) continue;
        EXPECT_GE(cause.grade, effect.grade) << one.name << "\n" << words_of(findings);
      }
    }
  }
}

TEST(Verdict, OfTooFewProcessorsDoesNotBlameSceneOrOtherPrograms) {
  const auto with = [](std::size_t processors) {
    RunFacts facts = lockstep_facts(TroubledRun{});
    facts.is_in_real_time = true;
    facts.sides = 8;
    facts.processors = processors;
    facts.load = 14.2;
    facts.physics_hz = 300.0;
    facts.device.loop.skipped_ticks = 2'000;
    facts.device.answered_ticks = 8'000;
    facts.device.fallback_ticks = 2'000;
    return judge(facts);
  };
  const std::vector<RunFinding> few = with(2);
  EXPECT_EQ(cause_of(few), "too_few_processors") << words_of(few);
  EXPECT_THAT(words_of(few), HasSubstr("8 sides on 2 processors (load 14.2)"));
  EXPECT_THAT(words_of(few), Not(HasSubstr("simplify the scene")));
  EXPECT_THAT(words_of(few), Not(HasSubstr("stop other programs")));
  const std::vector<RunFinding> many = with(16);
  EXPECT_THAT(words_of(many), HasSubstr("simplify the scene"));
  EXPECT_THAT(words_of(many), HasSubstr("stop other programs"));
}

// of the ticks, or of the news where a force is held
TEST(Verdict, BlamesASimulatedFaultThatDisturbedWhatIsLost) {
  const auto cause_with = [](const std::vector<std::string>& settings, std::uint64_t disturbed) {
    VerdictCase one;
    one.trouble = [&](TroubledRun& run) {
      run.mofc.clamped_ticks = 2'000;
      run.mofc.disturbed_contact_ticks = disturbed;
      run.mofc.disturbed_clamped_ticks = std::min<std::uint64_t>(disturbed, 1'900);
    };
    one.settings = settings;
    return cause_of(judge(lockstep_facts(run_of(one))));
  };
  for (const char* setting :
       {"adversary.physics=push_along", "adversary.clamp=drift", "adversary.tick_jitter_ratio=0.5",
        "adversary.late_tick_ratio=0.1", "faults.device.skip={from_s: 1 until_s: 2}",
        "faults.device.late_ratio=0.1",
        "faults.device={late_switch_ratio: 0.1 late_switch_us: 300}",
        "faults.device_state.loss_ratio=0.1", "faults.force_command.burst_ratio=0.1",
        "faults.force_command.outage={from_s: 1 until_s: 2}"}) {
    EXPECT_THAT(cause_with({"mofc.mode=paper", setting}, 2'100), HasSubstr("simulated_"))
        << setting;
    if (std::string(setting).starts_with("faults.")) {
      EXPECT_EQ(cause_with({"mofc.mode=paper", setting}, 0), "mode") << setting;
    }
  }
  for (const char* fault : {"delay_ms=3", "loss_ratio=0.6", "burst_ratio=0.5"}) {
    for (const std::string link : {"faults.tool_motion.", "faults.interaction."}) {
      EXPECT_EQ(cause_with({"mofc.interaction=held", link + fault}, 0), "simulated_physics");
      EXPECT_EQ(cause_with({"mofc.mode=paper", link + fault}, 0), "mode") << fault;
      EXPECT_EQ(cause_with({link + fault}, 0), "tissue_stiff") << fault;
    }
  }
  EXPECT_EQ(cause_with({"mofc.interaction=held", "faults.interaction.delay_ms=1"}, 0),
            "interaction_held");
}

// what is lost, late or false now and then explains no loss of a third of the contact
TEST(Verdict, BlamesNoSimulatedFaultThatDisturbsNextToNothing) {
  for (const auto& [setting, cause] :
       {std::pair{"mofc.mode=paper", "mode"},
        {"mofc.guard_settings.credit_cap_joule=1e-4", "credit_cap"},
        {"device.start_ramp_ms=20000", "start_ramp"},
        {"mofc.controller=energy_bounding", "controller"},
        {"mofc.velocity_estimator={difference {}}", "velocity_estimator"},
        {"device.rate_hz=1000", "tissue_stiff"}}) {
    for (const char* fault :
         {"tool_motion.loss_ratio=0.0001", "interaction.delay_ms=0.005",
          "device_state.duplicate_ratio=0.9", "force_command.jitter_ms=0.01",
          "interaction.outage={from_s: 100 until_s: 200}", "device.late_ratio=0.0001"}) {
      VerdictCase one;
      one.trouble = [](TroubledRun& run) { run.mofc.clamped_ticks = 2'000; };
      one.settings = {setting, std::string("faults.") + fault};
      RunFacts facts = lockstep_facts(run_of(one));
      facts.force_error_rms_ratio = 0.6;
      facts.excess_reversals = 5;
      EXPECT_EQ(cause_of(judge(facts)), cause) << fault << "\n" << words_of(judge(facts));
    }
  }
}

// the ideal run knows of a contact of which mofc_node does not
TEST(Verdict, DoesNotSayThatTheToolNeverTouchedWhereItDid) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  facts.mofc.contact_ticks = 0;
  facts.true_contact_ticks = 2'499;
  const std::string words = words_of(judge(facts));
  EXPECT_THAT(words, HasSubstr("2499 ticks"));
  EXPECT_THAT(words, Not(HasSubstr("never touched")));
  EXPECT_THAT(words, Not(HasSubstr("check the hand's path")));
}

TEST(Verdict, OfNoContactNamesWhatKeptTheToolAway) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  facts.mofc.contact_ticks = 0;
  facts.device_rate_hz = 1'000.0;
  facts.duration_s = 17.0;
  facts.has_tissue = true;
  EXPECT_EQ(cause_of(judge(facts)), "run_short");
  facts.clutched_ticks = 9'000;
  EXPECT_EQ(cause_of(judge(facts)), "clutched");
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("clutch_button"));
  facts.has_tissue = false;
  EXPECT_EQ(cause_of(judge(facts)), "no_tissue");
  facts.has_tissue = true;
  facts.clutched_ticks = 0;
  facts.duration_s = 10.0;
  EXPECT_EQ(cause_of(judge(facts)), "path");
}

// nothing but what the run itself shows: a net behind a controller changes nothing about it
TEST(Verdict, JudgesTheClampedShareBehindASafetyNet) {
  VerdictCase one;
  one.trouble = [](TroubledRun& run) { run.mofc.clamped_ticks = 2'700; };
  one.settings = {"mofc.controller=energy_bounding", "mofc.safety_net=true"};
  const std::vector<RunFinding> findings = judge(lockstep_facts(run_of(one)));
  EXPECT_THAT(words_of(findings), HasSubstr("54 % of the contact was clamped"));
  EXPECT_EQ(cause_of(findings), "controller") << words_of(findings);
  one.trouble = [](TroubledRun& run) { run.mofc.clamped_ticks = 7'450; };  // of 5,000 in contact
  EXPECT_THAT(words_of(judge(lockstep_facts(run_of(one)))),
              HasSubstr("100 % of the contact was clamped"));
}

/// Physics in real time that made 614 of 1,000 steps a second.
RunFacts slow_physics() {
  RunFacts facts = lockstep_facts(TroubledRun{});
  facts.is_in_real_time = true;
  facts.physics_rate_hz = 1'000.0;
  facts.physics_hz = 614.0;
  facts.physics.worst_compute_time = std::chrono::microseconds(1'500);
  return facts;
}

TEST(Verdict, OfAPhysicsThatStoodStillDoesNotBlameItsSteps) {
  RunFacts facts = slow_physics();
  facts.physics_busy_ratio = 0.02;
  facts.physics_gap_s = 1.4;
  facts.physics_gap_ratio = 0.37;
  EXPECT_EQ(cause_of(judge(facts)), "physics_paused");
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("no step for 1.4 s"));
  facts.physics.worst_compute_time = std::chrono::milliseconds(1'400);  // in the middle of a step
  EXPECT_EQ(cause_of(judge(facts)), "physics_paused");
  facts.mofc.stale_ticks = 1'500;  // and longer than its force holds
  EXPECT_EQ(cause_of(judge(facts)), "physics_silent");
  EXPECT_THAT(words_of(judge(facts)), Not(HasSubstr("simplify the scene")));
}

TEST(Verdict, OfAPhysicsThatHadToWaitForAProcessorBlamesTheMachine) {
  RunFacts facts = slow_physics();
  facts.physics_busy_ratio = 0.1;
  EXPECT_EQ(cause_of(judge(facts)), "machine_late") << words_of(judge(facts));
  EXPECT_THAT(words_of(judge(facts)), Not(HasSubstr("simplify the scene")));
  facts.physics_busy_ratio = 0.95;
  EXPECT_EQ(cause_of(judge(facts)), "physics_slow");
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("up to 1.5 ms: simplify the scene"));
}

// a step for each answer, however many there could be
TEST(Verdict, OfAPhysicsThatIsWaitedForJudgesWhetherItCame) {
  RunFacts facts = slow_physics();
  facts.waits_for_physics = true;
  facts.physics_hz = 100.0;
  EXPECT_EQ(grade_of(judge(facts)), Grade::kGood) << words_of(judge(facts));
  facts.mofc.late_physics_ticks = 4'000;
  EXPECT_EQ(cause_of(judge(facts)), "physics_slow");
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("too late in 40 % of the ticks"));
}

// as it wakes, it takes what it finds for the newest
TEST(Verdict, OfAClampThatWasStoppedDoesNotBlameThePhysics) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  facts.is_in_real_time = true;
  facts.device.answered_ticks -= 1'500;
  facts.device.limp_ticks = 1'500;
  facts.mofc.ticks = 8'500;
  facts.mofc.stale_ticks = 1'275;
  EXPECT_EQ(cause_of(judge(facts)), "mofc_paused") << words_of(judge(facts));
  facts.mofc.stale_ticks = 3'000;
  EXPECT_EQ(cause_of(judge(facts)), "physics_silent") << words_of(judge(facts));
}

// as in a part of a recording that holds some topics
TEST(Verdict, OfWhatIsNotRecordedJudgesNothing) {
  for (const bool has_device : {false, true}) {
    RunFacts facts = lockstep_facts(TroubledRun{});
    facts.maximum_force_newton = has_device ? 1.0 : 0.0;
    if (!has_device) facts.device = {};
    facts.device_node.is_recorded = facts.device_node.is_heard = has_device;
    facts.mofc_node.is_recorded = facts.mofc_node.is_heard = !has_device;
    facts.physics_node.is_recorded = facts.physics_node.is_heard = false;
    if (has_device) facts.mofc = {};
    EXPECT_EQ(grade_of(judge(facts)), Grade::kGood) << words_of(judge(facts));
    EXPECT_THAT(words_of(judge(facts)),
                HasSubstr(has_device ? "leaves out mofc_node, physics_node"
                                     : "leaves out device_node, physics_node"));
    facts.mofc.clamped_ticks = 4'000;
    EXPECT_EQ(grade_of(judge(facts)), has_device ? Grade::kGood : Grade::kBad);
  }
}

// launch counts its starts, a recording cannot
TEST(Verdict, OfAPhysicsThatNeverSpokeSaysSoHoweverOftenItWasStarted) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  facts.mofc.interaction = {};
  facts.mofc.contact_ticks = 0;
  facts.physics_node = {.is_heard = false, .restarts = 3};
  EXPECT_EQ(cause_of(judge(facts)), "physics_silent");
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("started 4 times"));
}

TEST(Verdict, SaysLocalOnlyWhereItIsNotSet) {
  for (const VerdictCase& one : verdict_cases()) {
    const TroubledRun run = run_of(one);
    if (run.session.side().mofc.interaction != InteractionUse::kLocal) continue;
    EXPECT_THAT(words_of(judge(lockstep_facts(run))), Not(HasSubstr("interaction=local")))
        << one.name;
  }
}

/// Of a run in which only this is known.
Grade grade_with(const std::function<void(RunFacts&)>& change) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  change(facts);
  return grade_of(judge(facts));
}

// good below 10 %, fair below 30 %
TEST(Verdict, GradesAWrongForceByTheStatedLimits) {
  for (double RunFacts::*figure : {&RunFacts::force_error_rms_ratio, &RunFacts::beyond_jnd_ratio}) {
    const auto grade = [&](double value) {
      return grade_with([&](RunFacts& facts) { facts.*figure = value; });
    };
    EXPECT_EQ(grade(kNaN), Grade::kGood);
    EXPECT_EQ(grade(0.099), Grade::kGood);
    EXPECT_EQ(grade(0.101), Grade::kFair);
    EXPECT_EQ(grade(0.299), Grade::kFair);
    EXPECT_EQ(grade(0.301), Grade::kBad);
  }
  const auto clamped = [&](std::uint64_t ticks) {
    return grade_with([&](RunFacts& facts) { facts.mofc.clamped_ticks = ticks; });
  };
  EXPECT_EQ(clamped(490), Grade::kGood);  // of 5,000 in contact
  EXPECT_EQ(clamped(510), Grade::kFair);
  EXPECT_EQ(clamped(1510), Grade::kBad);
  const auto bound = [&](double newton) {  // of a force of 1 N
    return grade_with([&](RunFacts& facts) { facts.physics.elastic_bound_newton = newton; });
  };
  EXPECT_EQ(bound(0.09), Grade::kGood);
  EXPECT_EQ(bound(0.11), Grade::kFair);
  EXPECT_EQ(bound(0.31), Grade::kBad);
  EXPECT_EQ(bound(kNaN), Grade::kGood);  // of a run that did not touch elastic tissue
  const auto reversals = [&](std::uint64_t excess) {
    return grade_with([&](RunFacts& facts) { facts.excess_reversals = excess; });
  };
  EXPECT_EQ(reversals(2), Grade::kGood);
  EXPECT_EQ(reversals(3), Grade::kBad);
}

// 97 % of the samples beyond the JND and 30 reversals too many
TEST(Verdict, IsNotGoodBecauseNoEnergyWasExtracted) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  facts.beyond_jnd_ratio = 0.97;
  facts.excess_reversals = 30;
  const std::vector<RunFinding> findings = judge(facts);
  EXPECT_THAT(findings, Contains(Field(&RunFinding::what, "energy")));
  EXPECT_EQ(grade_of(findings), Grade::kBad);
  EXPECT_THAT(words_of(findings), HasSubstr("97 % of the samples"));
  EXPECT_THAT(words_of(findings), HasSubstr("the hand chatters"));
}

TEST(Verdict, OfAnUnreadableSessionClaimsNothingAboutIt) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  RunFacts bare;
  bare.controller = "mofc guard";
  bare.device = facts.device;
  bare.mofc = facts.mofc;
  bare.mofc.clamped_ticks = 4'000;
  EXPECT_EQ(cause_of(judge(bare)), "unknown");
}

TEST(Verdict, AsJsonHasGradeCauseAndFindings) {
  RunFacts facts = lockstep_facts(TroubledRun{});
  EXPECT_EQ(verdict_json(judge(facts))["grade"], "good");
  facts.device.device_faults = 1;
  facts.device.last_fault = FaultReason::kDeviceSilent;
  const auto json = verdict_json(judge(facts));
  EXPECT_EQ(json["grade"], "bad");
  EXPECT_EQ(json["cause"], "device_fault");
  EXPECT_THAT(json["findings"][0]["text"].get<std::string>(), HasSubstr("device silent"));
  EXPECT_FALSE(json["findings"][0]["remedy"].get<std::string>().empty());
}

// The counters of all processes of a device are summed; a fault of one that is gone is over.
TEST(Verdict, AFaultOfAProcessThatIsGoneIsNotLatched) {
  RunFacts facts;
  facts.device.loop.ticks = 1000;
  facts.device.device_faults = 1;
  facts.device.phase = DevicePhase::kEnabled;
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("latched at the end"));
  facts.device_node.restarts = 1;
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("before device_node was started again"));
  facts.device.phase = DevicePhase::kFaulted;
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("latched at the end"));
  facts.device.phase = DevicePhase::kEnabled;
  facts.device.fault_resets = 1;
  EXPECT_THAT(words_of(judge(facts)), HasSubstr("reset since"));
}

}  // namespace
}  // namespace palpate
