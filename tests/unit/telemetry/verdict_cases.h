// SPDX-License-Identifier: Apache-2.0
// verdict_cases.h — runs in which one thing went wrong, and the cause that every verdict on them
// has to name.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "common/telemetry/summary.h"
#include "tests/support/temp_folder.h"

namespace palpate {

/// A run of 10 s as every source of facts sees it.
struct TroubledRun {
  Session session;
  DeviceCounters device;
  MofcCounters mofc;
  PhysicsCounters physics;
  std::uint64_t physics_steps = 10'000;
  bool is_device_restarted = false;
  bool is_mofc_restarted = false;
  bool is_physics_restarted = false;
  bool is_physics_heard = true;
  bool is_mofc_heard = true;

  /// 10,000 ticks at 1 kHz, all answered, 5,000 in contact; the physics at 1 kHz.
  TroubledRun() {
    device.loop.ticks = device.answered_ticks = 10'000;
    device.force_command.accepted = 10'000;
    device.phase = DevicePhase::kEnabled;
    device.max_force_newton = 1.0;
    device.minimum_true_energy_joule = 0.0;
    mofc.ticks = 10'000;
    mofc.contact_ticks = 5'000;
    mofc.device_state = {.accepted = 10'000, .sessions = 1};
    mofc.interaction = {.accepted = 10'000, .sessions = 1};
    device.force_command.sessions = 1;
    physics.contact_steps = 5'000;
  }
};

struct VerdictCase {
  std::string name;
  std::string cause;   ///< empty: the run is good
  std::string remedy;  ///< words that the finding must have
  std::string grade;
  std::function<void(TroubledRun&)> trouble;
  std::vector<std::string> settings = {};  ///< of the session
  bool is_of_lockstep = true;              ///< can happen there
  bool is_of_real_time = true;             ///< can happen there
};

/// What lockstep counts of it, without a row.
inline RunReport report_of(const TroubledRun& run) {
  RunReport report;
  report.device = run.device;
  report.mofc = run.mofc;
  report.physics = run.physics;
  report.physics.loop.ticks = run.physics_steps;
  report.simulated_s = 10.0;
  // lockstep has no supervisor: restarts are new sessions on the links
  if (run.is_device_restarted) report.mofc.device_state.sessions = 2;
  if (run.is_mofc_restarted) report.device.force_command.sessions = 2;
  if (run.is_physics_restarted) report.mofc.interaction.sessions = 2;
  return report;
}

/// The run of a case. Its session is in a folder of this process, where a recording of it finds the
/// files that it names.
inline TroubledRun run_of(const VerdictCase& one) {
  static const test::TempFolder folder;
  static const std::string file =
      (folder.write("path.csv", "t,x,y,z\n0,0,0,0\n1,0,0,0\n1.01,0,0,-0.03\n"),
       folder.write("verdict.txtpb",
                    "name: \"verdict\"\n"
                    "device { rate_hz: 1000 simulated {} }\n"
                    "physics { rate_hz: 1000 }\n"
                    "scene { tissue { name: \"block\" half_space {} "
                    "kelvin_voigt { stiffness_newton_per_m: 250 } } }\n"));
  TroubledRun run;
  run.session = load_session(file, one.settings);
  one.trouble(run);
  return run;
}

inline void unanswered(TroubledRun& run, std::uint64_t ticks) {
  run.device.answered_ticks -= ticks;
  run.device.fallback_ticks += ticks;
}

/// mofc_node answers after so many ticks for the first time.
inline void started_late(TroubledRun& run, std::uint64_t ticks) {
  run.device.answered_ticks -= ticks;
  run.device.limp_ticks = run.device.start_up_ticks = ticks;
}

inline std::vector<VerdictCase> verdict_cases() {
  const std::string jump = "hand.recorded={file: \"path.csv\"}";
  return {
      {"nothing", "", "", "good", [](TroubledRun&) {}},
      {"a device_node that begins a little before mofc_node", "", "", "good",
       [](TroubledRun& run) { started_late(run, 17); }},
      {"a mofc_node that takes seconds to begin", "", "the first 3 s", "good",
       [](TroubledRun& run) { started_late(run, 3'000); }},
      {"a mofc_node that begins late and then is stopped",
       "mofc_paused",
       "1 s in all",
       "bad",
       [](TroubledRun& run) {
         started_late(run, 17);
         run.device.answered_ticks -= 1'000;
         run.device.limp_ticks += 1'000;
       },
       {},
       false},
      {"a driver that delivers readings twice", "readings_repeated", "newer reading", "fair",
       [](TroubledRun& run) { run.device.repeated_readings = 4'000; }},
      {"a driver that stalls now and then", "", "", "good",
       [](TroubledRun& run) { run.device.repeated_readings = 300; }},
      {"a device_node that was stopped for a while",
       "device_stopped",
       "SIGSTOP",
       "bad",
       [](TroubledRun& run) {
         run.device.loop.ticks -= 3'004;
         run.device.answered_ticks -= 3'004;
         run.device.loop.skipped_ticks = 3'004;
         run.device.longest_skip_ticks = 3'000;
       },
       {},
       false},
      {"a force that the session scales to nothing",
       "force_ratio",
       "give 1",
       "bad",
       [](TroubledRun& run) { run.device.max_force_newton = 0.0; },
       {"device.workspace.force_ratio=0"}},
      {"a clamp that lets nothing through", "tissue_stiff", "no force was rendered", "bad",
       [](TroubledRun& run) { run.device.max_force_newton = 0.0; }},
      {"a cap that is too low",
       "credit_cap",
       "100 µJ here",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"mofc.guard_settings.credit_cap_joule=1e-4"}},
      {"a noisy velocity and a simulated fault that touches no tick",
       "velocity_estimator",
       "kalman",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"mofc.velocity_estimator={difference {}}", "faults.force_command.delay_ms=0.2"}},
      {"a latched fault", "device_fault", "reset the fault", "bad",
       [](TroubledRun& run) {
         run.device.device_faults = 1;
         run.device.last_fault = FaultReason::kDeviceGone;
         run.device.phase = DevicePhase::kFaulted;
         run.device.fault_ticks = 5'000;
         unanswered(run, 5'000);
         run.mofc.contact_ticks = 0;
       }},
      {"a fault before the first answer", "device_fault", "reset the fault", "bad",
       [](TroubledRun& run) {
         run.device.device_faults = 1;
         run.device.last_fault = FaultReason::kReadFailed;
         run.device.phase = DevicePhase::kFaulted;
         run.device.fault_ticks = 10'000;
         unanswered(run, 10'000);
         run.mofc.contact_ticks = 0;
         run.mofc.interaction = {};
       }},
      {"a fault that was reset", "device_fault", "encoders", "bad",
       [](TroubledRun& run) {
         run.device.device_faults = run.device.fault_resets = 1;
         run.device.last_fault = FaultReason::kPositionJumped;
         run.device.fault_ticks = 10;
       }},
      {"a fault because the recorded hand jumps",
       "device_fault",
       "1.000 s: smooth it",
       "bad",
       [](TroubledRun& run) {
         run.device.device_faults = 1;
         run.device.last_fault = FaultReason::kPositionJumped;
       },
       {jump}},
      {"motors that may still push", "release_unconfirmed", "switch off", "bad",
       [](TroubledRun& run) { run.device.is_release_unconfirmed = true; }},
      {"a device that nobody acknowledged", "device_not_enabled", "acknowledge", "bad",
       [](TroubledRun& run) {
         run.device.phase = DevicePhase::kCalibrated;
         run.device.max_force_newton = 0.0;
         run.mofc.contact_ticks = 0;
       }},
      {"a run that ends while the motors are checked",
       "device_not_enabled",
       "hold the handle loosely",
       "bad",
       [](TroubledRun& run) {
         run.device.phase = DevicePhase::kChecking;
         run.device.max_force_newton = 0.4;  // of the check
         run.device.answered_ticks = 0;
         run.device.limp_ticks = run.device.start_up_ticks = 10'000;
         run.mofc.clamped_ticks = 5'000;
       },
       {},
       false},
      {"a device that waits for its calibration again",
       "device_waited",
       "calibrate it",
       "bad",
       [](TroubledRun& run) {
         run.device.uncalibrated_ticks = 5'000;
         run.device.unacknowledged_ticks = 700;
         run.device.checking_ticks = 200;
         run.device.answered_ticks = 10'000 - 6'200;
         run.device.limp_ticks = 5'900;
       },
       {},
       false},
      {"an account in debt", "energy_debt", "pays it back by its motion", "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = run.mofc.debt_ticks = 4'000; }},
      {"a dead-man button that was not held", "dead_man_button", "hold", "bad",
       [](TroubledRun& run) {
         run.device.dead_man_ticks = 9'000;
         run.mofc.contact_ticks = 0;
       }},
      {"a coarser encoder than the profile's", "encoder_coarse", "position_resolution_m", "bad",
       [](TroubledRun& run) { run.device.coarse_readings = 5; }},
      {"a hand outside of a bounded workspace", "outside_workspace", "workspace_half_extent_m",
       "bad", [](TroubledRun& run) { run.device.outside_readings = 5; }},
      {"a hand outside at each reading of each tick", "outside_workspace",
       "workspace_half_extent_m", "bad",
       [](TroubledRun& run) { run.device.outside_readings = 2 * run.device.loop.ticks; }},
      {"a restarted device", "device_restarted", "log", "bad",
       [](TroubledRun& run) {
         run.is_device_restarted = true;
         unanswered(run, 100);
       }},
      {"a restarted clamp", "mofc_restarted", "log", "bad",
       [](TroubledRun& run) {
         run.is_mofc_restarted = true;
         unanswered(run, 100);
       }},
      {"a restarted physics", "physics_restarted", "log", "bad",
       [](TroubledRun& run) {
         run.is_physics_restarted = true;
         run.mofc.stale_ticks = 300;
       }},
      {"a clamp that never answered",
       "mofc_silent",
       "not heard",
       "bad",
       [](TroubledRun& run) {
         unanswered(run, 10'000);
         run.is_mofc_heard = false;
         run.mofc = {};
       },
       {},
       false},
      {"a clamp that sends no numbers", "command_not_finite", "", "bad",
       [](TroubledRun& run) {
         run.device.non_finite_commands = 3'000;
         unanswered(run, 3'000);
       }},
      {"a physics that was never heard",
       "physics_silent",
       "not heard",
       "bad",
       [](TroubledRun& run) {
         run.is_physics_heard = false;
         run.mofc.interaction = {};
         run.mofc.contact_ticks = 0;
       },
       {},
       false},
      {"a physics that falls silent", "physics_silent", "physics_node", "bad",
       [](TroubledRun& run) { run.mofc.stale_ticks = 4'000; }},
      {"a physics silenced by a fault of the session",
       "physics_silent",
       "faults.interaction",
       "bad",
       [](TroubledRun& run) { run.mofc.stale_ticks = 4'000; },
       {"faults.interaction.outage={from_s: 1 until_s: 2}"}},
      {"a physics of 628 Hz", "physics_slow", "628 of 1,000", "bad",
       [](TroubledRun& run) { run.physics_steps = 6'280; }},
      {"a physics of 900 Hz", "physics_slow", "900 of 1,000", "fair",
       [](TroubledRun& run) { run.physics_steps = 9'000; }},
      {"late solutions", "elastic_late", "solve_rate_hz", "bad",
       [](TroubledRun& run) {
         run.physics.elastic_solves = 500;
         run.physics.elastic_solves_late = 300;
         run.mofc.clamped_ticks = 2'000;
       }},
      {"failed solutions", "elastic_failed", "press less deep", "bad",
       [](TroubledRun& run) {
         run.physics.elastic_solves = 500;
         run.physics.elastic_solves_failed = 300;
       }},
      {"a hand faster than v_max", "hand_too_fast", "v_max", "bad",
       [](TroubledRun& run) { run.mofc.too_fast_ticks = 500; }},
      {"a recorded hand that jumps",
       "path_jumps",
       "1.000 s",
       "bad",
       [](TroubledRun& run) { run.device.too_fast_readings = 200; },
       {jump}},
      {"an unlimited controller behind the monitor",
       "monitor_reduced",
       "does not limit",
       "bad",
       [](TroubledRun& run) { run.device.monitor_reductions = 3'000; },
       {"mofc.controller=none"}},
      {"a clamp that lies",
       "monitor_reduced",
       "adversary.clamp",
       "bad",
       [](TroubledRun& run) { run.device.monitor_reductions = 3'000; },
       {"adversary.clamp=full_force"}},
      {"a ledger that counts too much", "ledger_too_high", "device.profile", "fair",
       [](TroubledRun& run) { run.device.ledger_excesses = 7; }},
      {"a clamp that lies about its ledger",
       "ledger_too_high",
       "adversary.clamp",
       "bad",
       [](TroubledRun& run) { run.device.ledger_excesses = 9'000; },
       {"adversary.clamp=lying_ledger"}},
      {"a ledger that counts on friction that is not there", "ledger_too_high", "40 %", "fair",
       [](TroubledRun& run) {
         run.device.checked_friction_ratio = 0.4;
         run.device.ledger_excesses = 7;
       }},
      {"less friction than the profile claims", "monitor_reduced", "40 %", "fair",
       [](TroubledRun& run) {
         run.device.checked_friction_ratio = 0.4;
         run.device.monitor_reductions = 20;
       }},
      {"a busy machine",
       "machine_late",
       "doctor",
       "bad",
       [](TroubledRun& run) {
         run.device.loop.ticks -= 2'000;
         run.device.answered_ticks -= 2'000;
         run.device.loop.skipped_ticks = 2'000;
       },
       {},
       false},
      {"answers that are late on a busy machine",
       "machine_late",
       "--together",
       "fair",
       [](TroubledRun& run) { unanswered(run, 200); },
       {},
       false},
      {"simulated late ticks",
       "simulated_device",
       "faults.device",
       "bad",
       [](TroubledRun& run) {
         run.device.loop.ticks -= 2'000;
         run.device.answered_ticks -= 2'000;
         run.device.loop.skipped_ticks = 2'000;
       },
       {"faults.device.late_ratio=0.5"}},
      {"simulated loss between device and clamp",
       "simulated_exchange",
       "faults.force_command",
       "bad",
       [](TroubledRun& run) { unanswered(run, 3'000); },
       {"faults.force_command.loss_ratio=0.3"}},
      {"no answers in lockstep without any fault",
       "unknown",
       "",
       "fair",
       [](TroubledRun& run) { unanswered(run, 200); },
       {},
       true,
       false},
      {"no controller",
       "no_controller",
       "mofc.controller=mofc",
       "bad",
       [](TroubledRun& run) { run.device.minimum_true_energy_joule = -2e-3; },
       {"mofc.controller=none"}},
      {"another controller",
       "controller",
       "safety_net",
       "bad",
       [](TroubledRun& run) { run.device.minimum_true_energy_joule = -2e-3; },
       {"mofc.controller=energy_tank"}},
      {"a profile above the device", "profile_wrong", "lower bound", "bad",
       [](TroubledRun& run) { run.device.minimum_true_energy_joule = -2e-3; }},
      {"a path beside the tissue", "path", "hand's path", "bad",
       [](TroubledRun& run) { run.mofc.contact_ticks = 0; }},
      {"a run that ends before the hand is there",
       "run_short",
       "10 s of the 17 s",
       "bad",
       [](TroubledRun& run) { run.mofc.contact_ticks = 0; },
       {"duration_s=17"}},
      {"a physics of somebody's own that never answers with a force",
       "no_contact_told",
       "check its scene and units",
       "bad",
       [](TroubledRun& run) { run.mofc.contact_ticks = 0; },
       {"duration_s=17", "physics.command=[\"./own\"]"}},
      {"a mofc_node that begins while the tool is in tissue", "press_lost", "until the tool leaves",
       "bad",
       [](TroubledRun& run) {
         started_late(run, 1'100);
         run.mofc.clamped_ticks = run.mofc.contact_ticks / 2;
         run.mofc.disturbed_contact_ticks = run.mofc.disturbed_clamped_ticks =
             run.mofc.clamped_ticks;
       }},
      {"held forces of a slow physics",
       "physics_rate",
       "mofc.interaction=local",
       "bad",
       [](TroubledRun& run) {
         run.physics_steps = 1'000;
         run.mofc.clamped_ticks = 3'000;
       },
       {"mofc.interaction=held", "physics.rate_hz=100"}},
      {"held forces",
       "interaction_held",
       "mofc.interaction=local",
       "fair",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 1'000; },
       {"mofc.interaction=held"}},
      {"a slow physics with local models",
       "physics_rate",
       "raise physics.rate_hz",
       "bad",
       [](TroubledRun& run) {
         run.physics_steps = 1'000;
         run.mofc.clamped_ticks = 3'000;
       },
       {"physics.rate_hz=100"}},
      {"coarse solutions",
       "solve_rate",
       "only 10 times",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"scene.tissue={name: \"liver\" tetrahedral_mesh {file: \"liver.msh\"} "
        "elastic {young_pa: 10e3 solve_rate_hz: 10 fixed {half_space {point_m {z: -0.01}}}}}",
        "scene.tool.tip_radius_m=0.004"}},
      {"a simulated delay",
       "simulated_physics",
       "faults.tool_motion",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"mofc.interaction=held", "faults.tool_motion.delay_ms=40"}},
      {"a simulated delay that local models bridge",
       "tissue_stiff",
       "softer",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"faults.tool_motion.delay_ms=40"}},
      {"a mode that holds back, while the physics is silent and not",
       "mode",
       "mofc.mode=guard",
       "bad",
       [](TroubledRun& run) {
         run.mofc.stale_ticks = 900;
         run.mofc.clamped_ticks = 3'000;
         run.mofc.disturbed_contact_ticks = 600;
         run.mofc.disturbed_clamped_ticks = 400;
       },
       {"mofc.mode=paper"}},
      {"a mode that holds back, and a loss where the physics is silent",
       "physics_silent",
       "physics_node",
       "bad",
       [](TroubledRun& run) {
         run.mofc.stale_ticks = 1'900;
         run.mofc.clamped_ticks = 2'000;
         run.mofc.disturbed_contact_ticks = 2'000;
         run.mofc.disturbed_clamped_ticks = 1'900;
       },
       {"mofc.mode=paper"}},
      {"a late device, and a physics that made fewer steps",
       "device_latency",
       "2.0 ms old",
       "bad",
       [](TroubledRun& run) {
         run.physics_steps = 7'330;
         run.mofc.clamped_ticks = 4'600;
       },
       {"device.latency_us=2000"}},
      {"held forces of a physics that made fewer steps",
       "physics_slow",
       "733 of 1,000",
       "bad",
       [](TroubledRun& run) {
         run.physics_steps = 7'330;
         run.mofc.clamped_ticks = 2'000;
       },
       {"mofc.interaction=held"}},
      {"forces that wait until they are far off",
       "deadband",
       "interaction_deadband",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"mofc.interaction=held", "physics.interaction_deadband={ratio: 0.6 floor_newton: 0.5}"}},
      {"a clamp that a simulated loss keeps from answering",
       "mofc_silent",
       "faults.force_command",
       "bad",
       [](TroubledRun& run) { unanswered(run, 10'000); },
       {"faults.force_command.loss_ratio=1"}},
      {"a fault, after which no physics is asked",
       "device_fault",
       "encoders",
       "bad",
       [](TroubledRun& run) {
         run.device.device_faults = 1;
         run.device.last_fault = FaultReason::kPositionJumped;
         run.device.phase = DevicePhase::kFaulted;
         run.device.fault_ticks = 9'900;
         unanswered(run, 9'900);
         run.mofc.ticks = run.mofc.late_physics_ticks = 100;
         run.mofc.contact_ticks = 0;
       },
       {"mofc.interaction=held", "device.rate_hz=100", "mofc.wait_for_physics_ms=5"}},
      {"a physics that is silent after a late start of the clamp", "physics_silent",
       "log of physics_node", "bad",
       [](TroubledRun& run) {
         started_late(run, 2'000);
         run.device.answered_ticks -= 1;
         run.device.limp_ticks += 1;
         run.mofc.stale_ticks = 1'200;
       }},
      {"tissue too stiff for the device", "tissue_stiff", "softer", "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; }},
      {"a few late answers, and tissue too stiff for the device", "tissue_stiff", "softer", "bad",
       [](TroubledRun& run) {
         unanswered(run, 20);
         run.mofc.clamped_ticks = 3'000;
       }},
      {"a short silence of the physics, and no friction",
       "no_friction",
       "dry friction",
       "bad",
       [](TroubledRun& run) {
         run.mofc.stale_ticks = 50;
         run.mofc.clamped_ticks = 3'000;
       },
       {"device.profile.coulomb_newton=0"}},
      {"a simulated delay of a device without friction",
       "no_friction",
       "dry friction",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"device.profile.coulomb_newton=0", "faults.interaction.delay_ms=1"}},
      {"a limit that is seldom met, and tissue too stiff", "tissue_stiff", "softer", "bad",
       [](TroubledRun& run) {
         run.device.peak_limited_ticks = 600;
         run.mofc.clamped_ticks = 4'700;
       }},
      {"an encoder that makes the hand seem fast", "encoder_coarse", "position_resolution_m", "bad",
       [](TroubledRun& run) {
         run.device.coarse_readings = 3;
         run.device.too_fast_readings = 127;
         run.mofc.clamped_ticks = 3'000;
       }},
      {"no controller, and motors at their limit",
       "no_controller",
       "mofc.controller=mofc",
       "bad",
       [](TroubledRun& run) { run.device.peak_limited_ticks = 4'000; },
       {"mofc.controller=none"}},
      {"a clamp that lies, and motors at their limit",
       "simulated_clamp",
       "adversary.clamp",
       "bad",
       [](TroubledRun& run) { run.device.peak_limited_ticks = 9'000; },
       {"adversary.clamp=full_force"}},
      {"forces of the same tick",
       "device_rate",
       "device.rate_hz",
       "fair",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 1'000; },
       {"mofc.interaction=held", "device.rate_hz=100", "mofc.wait_for_physics_ms=5"}},
      {"a mode that holds back more",
       "mode",
       "mofc.mode=guard",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"mofc.mode=vector"}},
      {"a noisy velocity",
       "velocity_estimator",
       "kalman",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"mofc.velocity_estimator={difference {}}"}},
      {"switches that come late", "late_switch", "200 forces", "fair",
       [](TroubledRun& run) {
         run.device.late_switches = 200;
         unanswered(run, 200);
       }},
      {"a clamp that was stopped for a while, and a late switch",
       "mofc_paused",
       "2 s in all",
       "bad",
       [](TroubledRun& run) {
         run.device.late_switches = 1;
         run.device.answered_ticks -= 2'010;
         run.device.leased_ticks = 10;
         run.device.limp_ticks = 2'000;
       },
       {},
       false},
      {"a device that is too weak", "peak_force", "stronger device", "bad",
       [](TroubledRun& run) {
         run.device.peak_limited_ticks = 2'000;
         run.mofc.clamped_ticks = 1'000;
       }},
      {"a device that is too weak now and then, and nothing else", "peak_force", "stronger device",
       "fair", [](TroubledRun& run) { run.device.peak_limited_ticks = 600; }},
      {"motors that end no force", "no_motor_watchdog", "NO_MOTOR_WATCHDOG", "fair",
       [](TroubledRun& run) { run.device.has_no_motor_watchdog = true; }},
      {"motors that end no force and may hold any, pressed from the start", "no_motor_watchdog",
       "workspace_half_extent_m", "bad",
       [](TroubledRun& run) {
         run.device.has_no_motor_watchdog = true;
         run.device.max_force_newton = 0.0;
         run.device.peak_limited_ticks = 5'000;
         run.mofc.clamped_ticks = 2'000;
         run.physics.is_started_in_contact = true;
       }},
      {"motors that end no force and may hold any, accepted", "no_motor_watchdog",
       "workspace_half_extent_m", "bad",
       [](TroubledRun& run) {
         run.device.has_no_motor_watchdog = run.device.accepts_no_motor_watchdog = true;
         run.device.max_force_newton = 0.0;
         run.device.peak_limited_ticks = 5'000;
         run.mofc.clamped_ticks = 2'000;
         run.physics.is_started_in_contact = true;
       }},
      {"motors that end no force, accepted", "", "", "good",
       [](TroubledRun& run) {
         run.device.has_no_motor_watchdog = run.device.accepts_no_motor_watchdog = true;
       }},
      {"a dead-man button that nobody held",
       "dead_man_button",
       "hold",
       "bad",
       [](TroubledRun& run) {
         run.device.dead_man_ticks = 10'000;
         unanswered(run, 10'000);
       },
       {"device.dead_man_button=1"}},
      {"a run that is over before the ramp is",
       "start_ramp",
       "start_ramp_ms",
       "bad",
       [](TroubledRun& run) {
         run.mofc.contact_ticks = 8'000;
         run.mofc.clamped_ticks = 3'000;
       },
       {"device.start_ramp_ms=5000"}},
      {"a tool that begins in tissue, with a long ramp",
       "start_ramp",
       "start_ramp_ms",
       "bad",
       [](TroubledRun& run) {
         run.mofc.clamped_ticks = 3'000;
         run.physics.is_started_in_contact = true;
       },
       {"device.start_ramp_ms=2000"}},
      {"a tool that begins in tissue, with the usual ramp",
       "started_in_contact",
       "begin outside",
       "bad",
       [](TroubledRun& run) {
         run.mofc.contact_ticks = run.mofc.clamped_ticks = 1'000;
         run.physics.is_started_in_contact = true;
       },
       {"device.start_ramp_ms=100"}},
      {"a long ramp in the air",
       "tissue_stiff",
       "softer",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"device.start_ramp_ms=4000"}},
      {"a tool that begins in tissue", "started_in_contact", "begin outside", "bad",
       [](TroubledRun& run) {
         run.mofc.clamped_ticks = 3'000;
         run.physics.is_started_in_contact = true;
       }},
      {"a device without friction",
       "no_friction",
       "dry friction",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"device.profile.coulomb_newton=0"}},
      {"friction that the check lowered", "friction_lowered", "60 %", "bad",
       [](TroubledRun& run) {
         run.device.checked_friction_ratio = 0.6;
         run.mofc.clamped_ticks = 3'000;
       }},
      {"a device that is late",
       "device_latency",
       "0.5 ms old",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"device.latency_us=500"}},
      {"a coarse encoder, and the profile says so",
       "resolution",
       "0.3 mm",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"device.profile.position_resolution_m=3e-4"}},
      {"a slow device",
       "device_rate",
       "250 ticks a second",
       "bad",
       [](TroubledRun& run) { run.mofc.clamped_ticks = 3'000; },
       {"device.rate_hz=250"}},
      {"a disturbed standby",
       "simulated_physics",
       "faults.standby_interaction",
       "bad",
       [](TroubledRun& run) {
         run.mofc.standby_ticks = 5'000;
         run.mofc.clamped_ticks = 3'000;
       },
       {"mofc.interaction=held", "physics.standby={}", "faults.standby_interaction.delay_ms=40"}},
      {"a bound as large as the force", "tissue_stiff", "of its solution", "bad",
       [](TroubledRun& run) { run.physics.elastic_bound_newton = 0.5; }},
      {"a force whose error nothing bounds", "tissue_stiff", "40 % of the contact", "fair",
       [](TroubledRun& run) {
         run.physics.elastic_contact_steps = 5'000;
         run.physics.elastic_unknown_bound_steps = 2'000;
       }},
      {"a bound that does not hold", "tissue_stiff", "30 % of the measured errors", "fair",
       [](TroubledRun& run) {
         run.physics.elastic_bound_newton = 0.01;
         run.physics.elastic_bounds_checked = 300;
         run.physics.elastic_bound_violations = 90;
       }},
  };
}

}  // namespace palpate
