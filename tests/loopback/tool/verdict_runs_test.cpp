// SPDX-License-Identifier: Apache-2.0
// Verdicts on sessions that are run, not on counters that are made up: the cause that loopback, and
// a recording of it, must name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "common/telemetry/verdict/verdict.h"
#include "deploy/lockstep/loopback.h"
#include "deploy/palpate/recordings/recording_info.h"
#include "tests/support/temp_folder.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

using nlohmann::json;

/// Two presses of 10 mm on soft tissue; nothing is wrong with it.
constexpr const char* kSession = R"(
name: "run"
duration_s: 2
device { rate_hz: 1000 simulated {} }
physics { rate_hz: 1000 }
hand {
  sinusoid {
    center_m { z: -0.005 } amplitude_m { z: 0.015 } frequency_hz { z: 1 } phase_rad { z: 1.57 }
  }
}
scene {
  tool { tip_radius_m: 0.003 }
  tissue {
    name: "block"
    half_space {}
    kelvin_voigt { stiffness_newton_per_m: 250 damping_newton_s_per_m: 1 }
  }
}
)";
/// Nothing that a run could show.
const char* const kHarmless[] = {
    "faults.interaction.loss_ratio=0.0001", "faults.tool_motion.jitter_ms=0.01",
    "faults.device_state.duplicate_ratio=0.001", "faults.device.late_ratio=0.0001",
    // more, but local models need no news for so short a time
    "faults.interaction.delay_ms=1", "faults.tool_motion.loss_ratio=0.1",
    "faults.interaction.loss_ratio=0.3"};

struct Case {
  const char* name;
  const char* cause;  ///< "": good
  std::vector<std::string> settings;
  const char* text = kSession;
  std::optional<double> seconds = {};
};

constexpr const char* kInclusion =
    "scene.tissue[0].kelvin_voigt={stiffness_newton_per_m: 100000 damping_newton_s_per_m: 5000}";

/// Each of these causes is also the cause where a harmless fault is simulated besides.
std::vector<Case> disturbed_too() {
  return {{"good", "", {}},
          {"mode", "mode", {"mofc.mode=vector"}},
          {"paper", "mode", {"mofc.mode=paper", kInclusion}},
          {"late_device", "device_latency", {"device.latency_us=3000"}},
          {"slow_device", "device_rate", {"device.rate_hz=100"}},
          {"stiff", "tissue_stiff", {kInclusion}},
          {"low_cap",
           "credit_cap",
           {"scene.tissue[0].kelvin_voigt={stiffness_newton_per_m: 3000 "
            "damping_newton_s_per_m: 60}",
            "mofc.guard_settings.credit_cap_joule=1e-6"}},
          {"ramp", "start_ramp", {"device.start_ramp_ms=20000"}},
          {"rival", "controller", {"mofc.controller=energy_bounding", "mofc.interaction=held"}}};
}

class VerdictRuns : public testing::TestWithParam<Case> {
 protected:
  struct Told {
    std::vector<RunFinding> loopback;
    json recording;
  };
  Told run(const std::vector<std::string>& settings) const {
    const Session session = load_session(folder_.write("run.txtpb", GetParam().text), settings);
    const std::string file = (folder_.path() / "run.mcap").string();
    LoopbackOptions options;
    options.seconds = GetParam().seconds;
    options.record = {.file = file, .may_overwrite = true};
    const RunReport report = run_loopback(session, options);
    RecordingFile recording(file);
    return {judge(facts_of(session, report)),
            json::parse(info_json(recording).dump())["figures"]["verdict"]};
  }
  test::TempFolder folder_;
};

TEST_P(VerdictRuns, NameTheCause) {
  const Told told = run(GetParam().settings);
  EXPECT_EQ(cause_of(told.loopback), GetParam().cause) << verdict_json(told.loopback).dump(1);
  EXPECT_EQ(told.recording["cause"], GetParam().cause) << told.recording.dump(1);
}

INSTANTIATE_TEST_SUITE_P(Causes, VerdictRuns, testing::ValuesIn(disturbed_too()),
                         [](const auto& one) { return std::string(one.param.name); });
INSTANTIATE_TEST_SUITE_P(
    Runs, VerdictRuns,
    testing::Values(
        Case{"rival_behind_net",
             "controller",
             {"mofc.controller=energy_bounding", "mofc.safety_net=true", "mofc.interaction=held"}},
        Case{"slow_device_that_is_waited_for",
             "device_rate",
             {"mofc.interaction=held", "device.rate_hz=100", "mofc.wait_for_physics_ms=5"}},
        Case{"coarse_physics", "physics_rate", {"mofc.interaction=held", "physics.rate_hz=50"}},
        Case{"coarse_encoder",
             "resolution",
             {"device.profile.position_resolution_m=1e-3",
              "device.simulated.position_resolution_m=1e-3"}},
        Case{"lost_answers", "simulated_exchange", {"faults.force_command.loss_ratio=0.3"}},
        Case{"late_ticks", "simulated_device", {"faults.device.late_ratio=0.3"}},
        Case{"silent_physics",
             "physics_silent",
             {"faults.interaction.outage={from_s: 0.2 until_s: 2}"}},
        Case{"old_news",
             "simulated_physics",
             {"mofc.interaction=held", "faults.interaction.delay_ms=10"}},
        Case{"coarse_deadband",
             "deadband",
             {"mofc.interaction=held",
              "physics.interaction_deadband={ratio: 0.6 floor_newton: 0.5}"}},
        Case{"begins_inside",
             "started_in_contact",
             {"hand.hold={position_m {z: -0.01}}"},
             kSession,
             1.0},
        Case{"no_state_arrives", "mofc_silent", {"faults.device_state.loss_ratio=1"}},
        Case{"no_answer_in_time", "mofc_silent", {"faults.force_command.delay_ms=3"}},
        Case{"new_sessions", "simulated_physics", {"adversary.physics=new_sessions"}},
        Case{"lying_clamp", "monitor_reduced", {"adversary.clamp=full_force"}},
        Case{"no_share_of_the_force", "force_ratio", {"device.workspace.force_ratio=0"}},
        Case{"away", "path", {"hand.sinusoid.center_m={z: 0.03}"}},
        Case{"over_too_early", "run_short", {}, kSession, 0.1},
        Case{"clutched",
             "clutched",
             {"device.workspace.clutch_button=1", "hand.press={button: 1 from_s: 0 until_s: 2}"}},
        Case{"nothing_to_touch",
             "no_tissue",
             {},
             "name: \"run\" duration_s: 1 device { rate_hz: 1000 simulated {} } "
             "physics { rate_hz: 1000 } hand { hold { position_m { z: -0.01 } } }"}),
    [](const auto& one) { return std::string(one.param.name); });

// not: check what the session does to it on purpose
TEST(VerdictOfARun, WithoutAnAnswerNamesWhatTheSessionSimulates) {
  const test::TempFolder folder;
  for (const char* fault : {"faults.device_state.loss_ratio=1", "faults.force_command.loss_ratio=1",
                            "faults.force_command.delay_ms=3", "faults.device_state.delay_ms=0.9",
                            "adversary.clamp=ahead"}) {
    const Session session = load_session(folder.write("run.txtpb", kSession), {fault});
    const std::vector<RunFinding> findings = judge(facts_of(session, run_loopback(session, {})));
    EXPECT_EQ(cause_of(findings), "mofc_silent") << fault;
    const auto silent = std::find_if(findings.begin(), findings.end(), [](const RunFinding& one) {
      return one.what == "mofc_silent";
    });
    ASSERT_NE(silent, findings.end());
    EXPECT_THAT(silent->remedy, testing::StartsWith("simulated by `")) << fault;
  }
}

class HarmlessFaults : public VerdictRuns {};

// what disturbs next to nothing changes no cause
TEST_P(HarmlessFaults, TakeNoBlame) {
  for (const char* fault : kHarmless) {
    SCOPED_TRACE(fault);
    std::vector<std::string> settings = GetParam().settings;
    settings.emplace_back(fault);
    const Told told = run(settings);
    EXPECT_EQ(cause_of(told.loopback), GetParam().cause) << verdict_json(told.loopback).dump(1);
    EXPECT_EQ(told.recording["cause"], GetParam().cause) << told.recording.dump(1);
  }
}

INSTANTIATE_TEST_SUITE_P(Runs, HarmlessFaults, testing::ValuesIn(disturbed_too()),
                         [](const auto& one) { return std::string(one.param.name); });

}  // namespace
}  // namespace palpate
