// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/verdict/causes.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// From these values on they cost `default` a tenth of its force and more (transparency 0.99 below).
constexpr double kLongLatency_s = 0.3e-3;
constexpr double kCoarseResolution_m = 0.2e-3;
constexpr double kLittleFriction_newton = 0.01;
constexpr double kFriction_ratio = 0.95;  // of the profile, as the hands-off check found it
constexpr double kUsualRate_hz = 1000.0;
/// What disturbs a tick spoils up to so many: a ledger that a burst has emptied fills by and by.
constexpr double kAftermath = 5.0;
/// Of the session: what it disturbs less is not named, however little was lost.
constexpr double kLeastSimulated = 0.01;
/// Of the skipped ticks, or of the missing steps: those of the longest hole.
constexpr double kMostlyOneHole = 0.5;
constexpr double kMostlySilent = 0.7;  // of what is missing: it stood still, it was not slow
constexpr double kMostlyBusy = 0.5;    // of its time: it computed, it was not kept waiting
/// Of session.duration_s: what the hand does at the end of its path is still to come.
constexpr double kWholeRun = 0.95;
/// A hole that no scheduler makes in a process that may run.
constexpr double kStopped_s = 1.0;
/// Of the default: from it on the cap takes force from `default`.
constexpr double kLowCap_ratio = 0.5;
/// Of the share of the whole contact: it is clamped as often where nothing was disturbed.
constexpr double kAsOften = 0.5;
/// Of the messages of the physics, lost or a step late: what needs them is noticeably older.
constexpr double kOftenOld = 0.5;
constexpr double kCoarseDeadband_m = 0.5e-3;
/// Of the ticks without an answer: those after lease and fallback have ended.
constexpr double kMostlyLimp = 0.8;

}  // namespace

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

std::uint64_t start_up_ticks(const DeviceCounters& device) {
  return device.answered_ticks > 0 ? device.start_up_ticks : 0;
}

std::string percent(double share) {
  return share < 0.1 ? fmt::format("{:.2g} %", 100.0 * share)
                     : fmt::format("{:.0f} %", 100.0 * share);
}

std::string thousands(double value) {
  std::string digits = fmt::format("{:.0f}", value);
  for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3) {
    digits.insert(static_cast<std::size_t>(at), ",");
  }
  return digits;
}

std::optional<Cause> Causes::found(std::initializer_list<const char*> events,
                                   double least_share) const {
  for (const char* event : events) {
    const auto it = std::find_if(findings_.begin(), findings_.end(), [&](const RunFinding& one) {
      return one.grade != Grade::kGood && one.what == event && one.share >= least_share;
    });
    if (it != findings_.end()) return Cause{event, "because of the above: " + it->text};
  }
  return std::nullopt;
}

std::optional<Cause> Causes::simulated(SimulatedAt place, double loss, double least_delay_s) const {
  const double period_s = 1.0 / f_.device_rate_hz;
  const double run_s =
      static_cast<double>(f_.device.loop.ticks + f_.device.loop.skipped_ticks) * period_s;
  const SimulatedDisturbance disturbance =
      simulated_at(place, f_.faults, f_.adversary, period_s, run_s, least_delay_s);
  if (disturbance.fields.empty() ||
      disturbance.share < std::max(kLeastSimulated, loss / kAftermath)) {
    return std::nullopt;
  }
  const auto* what = place == SimulatedAt::kExchange ? "simulated_exchange"
                     : place == SimulatedAt::kDevice ? "simulated_device"
                     : place == SimulatedAt::kClamp  ? "simulated_clamp"
                                                     : "simulated_physics";
  return Cause{what, "simulated by `" + disturbance.fields + "` of the session"};
}

Cause Causes::of_late_ticks(double skipped) const {
  if (const auto cause = found({"device_restarted"})) return *cause;
  if (const auto cause = simulated(SimulatedAt::kDevice, skipped)) return *cause;
  if (!f_.is_in_real_time) return {"unknown", "in lockstep no tick is late by itself: report it"};
  if (const auto cause = stopped_process()) return *cause;
  if (const auto cause = few_processors()) return *cause;
  return {"machine_late", "run `palpate doctor`, stop other programs"};
}

std::optional<Cause> Causes::stopped_process() const {
  const DeviceCounters& device = f_.device;
  const double hole_s = static_cast<double>(device.longest_skip_ticks) / f_.device_rate_hz;
  if (!(hole_s >= kStopped_s) ||
      ratio(device.longest_skip_ticks, device.loop.skipped_ticks) < kMostlyOneHole) {
    return std::nullopt;
  }
  return Cause{
      "device_stopped",
      fmt::format("device_node did not run for {:.2g} s at a stretch, which no busy machine "
                  "does: its process was stopped (SIGSTOP, a debugger, a paused container) "
                  "or the machine was suspended; keep both running during a session",
                  hole_s)};
}

std::optional<Cause> Causes::few_processors() const {
  if (f_.processors == 0 || f_.sides <= f_.processors) return std::nullopt;
  return Cause{
      "too_few_processors",
      fmt::format(
          "{} sides on {} {}{}, too few for their ticks and the physics: use fewer sides, a "
          "lower device.rate_hz, or a larger machine",
          f_.sides, f_.processors, f_.processors == 1 ? "processor" : "processors",
          std::isfinite(f_.load) ? fmt::format(" (load {:.1f})", f_.load) : "")};
}

std::optional<Cause> Causes::paused_clamp() const {
  const DeviceCounters& device = f_.device;
  const std::uint64_t limp =
      device.limp_ticks - std::min(device.limp_ticks, start_up_ticks(device));
  if (!f_.is_in_real_time ||
      ratio(limp, device.leased_ticks + device.fallback_ticks + limp) < kMostlyLimp) {
    return std::nullopt;
  }
  return Cause{"mofc_paused",
               fmt::format("mofc_node was silent for {:.2g} s in all, not late: it was starting, "
                           "stopped, or kept from its processor (`palpate doctor`)",
                           static_cast<double>(limp) / f_.device_rate_hz)};
}

Cause Causes::of_no_answer(double unanswered) const {
  if (const auto cause =
          found({"device_waited", "device_fault", "device_not_enabled", "dead_man_button",
                 "mofc_silent", "mofc_restarted", "device_restarted", "command_not_finite"})) {
    return *cause;
  }
  for (const SimulatedAt place :
       {SimulatedAt::kExchange, SimulatedAt::kClamp, SimulatedAt::kDevice}) {
    if (const auto cause = simulated(place, unanswered)) return *cause;
  }
  const std::uint64_t scheduled = f_.device.loop.ticks + f_.device.loop.skipped_ticks;
  const double late = ratio(f_.device.late_switches, scheduled);
  if (late > 0.0 && late >= unanswered / kAftermath) {
    return {"late_switch", fmt::format("{} forces began after their deadline; run `palpate doctor`",
                                       f_.device.late_switches)};
  }
  if (!f_.is_in_real_time) {
    return {"unknown", "device.reply_us or mofc.wait_for_physics_ms leaves no time for an answer"};
  }
  if (const auto cause = few_processors()) return *cause;
  if (const auto cause = paused_clamp()) return *cause;
  return {"machine_late",
          "run `palpate doctor`, stop other programs, or use --together device,mofc"};
}

Cause Causes::of_silent_physics(double silent) const {
  if (auto cause = simulated(SimulatedAt::kPhysics, silent)) {
    return {"physics_silent", std::move(cause->remedy)};
  }
  // when it wakes, it answers readings that are older than any news of the physics
  const bool has_clamp = !found({"device_not_enabled", "dead_man_button", "mofc_silent"});
  const std::uint64_t limp =
      f_.device.limp_ticks - std::min(f_.device.limp_ticks, start_up_ticks(f_.device));
  if (const auto cause = paused_clamp(); cause && has_clamp && limp >= f_.mofc.stale_ticks) {
    return *cause;
  }
  return {"physics_silent",
          "see the log of physics_node: it was restarted, stopped, or its steps take long"};
}

Cause Causes::of_slow_physics(double missing) const {
  if (f_.waits_for_physics) {
    if (const auto cause = simulated(SimulatedAt::kPhysics, missing)) return *cause;
  }
  if (f_.physics_gap_ratio >= kMostlyOneHole * missing) {
    if (const auto cause = found({"physics_silent"})) return *cause;
    return {"physics_paused",
            fmt::format("physics_node made no step for {:.2g} s at a stretch: it was stopped, kept "
                        "from its processor (`palpate doctor`), or one step took so long",
                        f_.physics_gap_s)};
  }
  if (const auto cause = found({"physics_silent"}, kMostlySilent * missing)) return *cause;
  if (const auto cause = few_processors()) return *cause;
  if (f_.is_in_real_time && f_.physics_busy_ratio > 0.0 && f_.physics_busy_ratio < kMostlyBusy) {
    return {"machine_late",
            fmt::format("its steps took {} of the time, so it was kept from its processor: run "
                        "`palpate doctor`, stop other programs",
                        percent(f_.physics_busy_ratio))};
  }
  const double worst_s = to_seconds(f_.physics.worst_compute_time);
  return {"physics_slow",
          (worst_s > 0.0 ? fmt::format("its steps took up to {:.1f} ms: ", 1e3 * worst_s) : "") +
              "simplify the scene, lower physics.rate_hz, or give it a processor of its own"};
}

Cause Causes::of_extracted_energy() const {
  if (const auto cause = simulated(SimulatedAt::kClamp, 0.0)) return *cause;
  if (!f_.is_limited && f_.controller == "none") {
    return {"no_controller", "no controller limits the force; try --set mofc.controller=mofc"};
  }
  if (!f_.is_limited) {
    return {"controller", "the controller `" + f_.controller +
                              "` does not prevent it here; try --set mofc.safety_net=true"};
  }
  if (const auto cause = found({"path_jumps", "hand_too_fast", "encoder_coarse"})) return *cause;
  if (f_.controller == "mofc paper") {
    return {"mode_paper", "mode paper assumes undelayed forces; try --set mofc.mode=guard"};
  }
  return {"profile_wrong",
          "use mode guard, and a device profile that is a lower bound (`palpate identify`)"};
}

Cause Causes::of_no_contact() const {
  if (const auto cause = found({"device_waited", "device_fault", "device_not_enabled",
                                "mofc_silent", "physics_silent", "device_restarted",
                                "mofc_restarted", "physics_restarted", "dead_man_button"})) {
    return *cause;
  }
  const double ticks = static_cast<double>(f_.device.loop.ticks);
  const double touched = f_.true_contact_ticks > 0
                             ? static_cast<double>(f_.true_contact_ticks) / std::max(ticks, 1.0)
                             : 1.0;
  for (const SimulatedAt place : {SimulatedAt::kExchange, SimulatedAt::kPhysics}) {
    if (const auto cause = simulated(place, touched)) return *cause;
  }
  if (f_.true_contact_ticks > 0) {
    return {"physics_late",
            "no contact reached mofc_node in time: a higher physics.rate_hz, or a "
            "longer run"};
  }
  if (!f_.has_tissue) return {"no_tissue", "the session has no tissue: add scene { tissue { … } }"};
  const double clutched = static_cast<double>(f_.clutched_ticks) / std::max(ticks, 1.0);
  if (clutched >= kFairRatio) {
    return {"clutched", "the clutch was held in " + percent(clutched) +
                            " of the ticks, where the tool does not follow the hand: release "
                            "device.workspace.clutch_button"};
  }
  if (f_.is_foreign_physics && f_.mofc.interaction.accepted > 0) {
    return {"no_contact_told",
            "the program of physics.command answers, but never with a contact or a force: check "
            "its scene and units (`palpate conform physics` presses into it), and the hand's path"};
  }
  if (!f_.is_simulated) return {"no_contact", "move the device to the tissue"};
  const double run_s = ticks / f_.device_rate_hz;
  if (run_s < kWholeRun * f_.duration_s) {
    return {"run_short",
            fmt::format("the run took {:.3g} s of the {:.3g} s of the session, and its hand may "
                        "touch later: run longer; `palpate scene check` says whether it does",
                        run_s, f_.duration_s)};
  }
  return {"path", "check the hand's path and the places of the tissues: `palpate scene check`"};
}

/// Of the run, not of single ticks.
std::optional<Cause> Causes::of_run(double least_share) const {
  if (auto cause = found(
          {"device_waited", "device_fault", "device_not_enabled", "elastic_failed", "elastic_late",
           "encoder_coarse", "readings_repeated", "path_jumps", "hand_too_fast", "monitor_reduced",
           "ledger_too_high", "dead_man_button", "position_frozen"},
          least_share)) {
    return cause;
  }
  if (auto cause = simulated(SimulatedAt::kHostile, 0.0)) return cause;
  return simulated(SimulatedAt::kClamp, 0.0);
}

Causes::LossPlace Causes::place_of_loss() const {
  const MofcCounters& mofc = f_.mofc;
  const double everywhere = ratio(mofc.clamped_ticks, mofc.contact_ticks);
  const std::uint64_t contact =
      mofc.contact_ticks - std::min(mofc.contact_ticks, mofc.disturbed_contact_ticks);
  const std::uint64_t clamped =
      mofc.clamped_ticks - std::min(mofc.clamped_ticks, mofc.disturbed_clamped_ticks);
  if (everywhere < kFairRatio || ratio(contact, mofc.contact_ticks) < kFairRatio) {
    return LossPlace::kUnknown;
  }
  return ratio(clamped, contact) >= kAsOften * everywhere ? LossPlace::kElsewhere
                                                          : LossPlace::kDisturbed;
}

/// Skipped, not answered, or without physics.
std::optional<Cause> Causes::disturbed_ticks(double loss) const {
  const double least_share = loss / kAftermath;
  if (auto cause = found({"device_restarted", "mofc_restarted"})) return cause;
  if (found({"physics_silent"}, least_share)) {
    return found({"physics_restarted", "physics_silent"});
  }
  if (auto cause = found({"ticks_unanswered", "ticks_skipped"}, least_share)) return cause;
  if (auto cause = simulated(SimulatedAt::kDevice, loss)) return cause;
  return simulated(SimulatedAt::kExchange, loss);
}

/// Of the physics, where the force needs it at every step.
std::optional<Cause> Causes::old_news(double loss) const {
  if (!needs_news()) return std::nullopt;
  if (auto cause = found({"physics_restarted", "physics_slow"}, loss / kAftermath)) return cause;
  // within a step nobody notices a delay; one message lost leaves the force a step older
  const double step_s = 1.0 / std::min(f_.physics_rate_hz, f_.device_rate_hz);
  for (const SimulatedAt place : {SimulatedAt::kPhysics, SimulatedAt::kStandby}) {
    if (place == SimulatedAt::kStandby && f_.mofc.standby_ticks == 0) continue;
    if (auto cause = simulated(place, kAftermath * kOftenOld, step_s)) return cause;
  }
  return std::nullopt;
}

std::optional<Cause> Causes::begin_of_run(double loss) const {
  const double contact_s = static_cast<double>(f_.mofc.contact_ticks) / f_.device_rate_hz;
  const double run_s = static_cast<double>(f_.device.loop.ticks) / f_.device_rate_hz;
  // the ramp and the contact overlap by so much at least
  const double in_ramp_s = f_.physics.is_started_in_contact
                               ? std::min(contact_s, f_.start_ramp_s)
                               : std::min(contact_s, f_.start_ramp_s + contact_s - run_s);
  if (in_ramp_s >= std::max(kFairRatio, kMostlyOneHole * loss) * contact_s && contact_s > 0.0) {
    return Cause{"start_ramp",
                 fmt::format("the force grows from zero for {:.1f} s, by device.start_ramp_ms: "
                             "touch later, run longer, or lower it",
                             f_.start_ramp_s)};
  }
  if (f_.physics.is_started_in_contact) {
    return Cause{"started_in_contact",
                 "the tool was in tissue when the run began, where nobody had stored the energy of "
                 "a press: begin outside"};
  }
  return std::nullopt;
}

std::optional<Cause> Causes::credit_cap() const {
  constexpr double kUsual_joule = MofcConfig{}.guard.credit_cap_joule;
  if (f_.controller != "mofc guard" || !(f_.credit_cap_joule <= kLowCap_ratio * kUsual_joule)) {
    return std::nullopt;
  }
  return Cause{"credit_cap",
               fmt::format("the cap of the credit is low: raise "
                           "mofc.guard_settings.credit_cap_joule, {} here, {} by default",
                           energy_text(f_.credit_cap_joule), energy_text(kUsual_joule))};
}

std::optional<Cause> Causes::no_friction() const {
  if (!(f_.coulomb_newton < kLittleFriction_newton)) return std::nullopt;
  return Cause{"no_friction",
               fmt::format("by device.profile the device has {:g} N of dry friction, which is what "
                           "absorbs the energy of sampling: `palpate identify` measures it",
                           f_.coulomb_newton)};
}

std::optional<Cause> Causes::device(double least_share) const {
  if (auto cause = found({"no_motor_watchdog", "peak_force"}, least_share)) return cause;
  const double lowered = f_.device.checked_friction_ratio;
  if (lowered > 0.0 && lowered < kFriction_ratio) {
    return Cause{"friction_lowered",
                 fmt::format("the hands-off check found {} of the profile's friction: `palpate "
                             "identify` measures it",
                             percent(lowered))};
  }
  if (f_.latency_s >= kLongLatency_s) {
    return Cause{
        "device_latency",
        fmt::format("by device.latency_us positions and forces are {:.1f} ms old, and what "
                    "that can cost is held back: give the true one, or a faster device",
                    1e3 * f_.latency_s)};
  }
  if (f_.position_resolution_m >= kCoarseResolution_m) {
    return Cause{
        "resolution",
        fmt::format("device.profile.position_resolution_m is {:.2g} mm, and the energy that "
                    "hides in a step is held back: give the true one, or softer tissue",
                    1e3 * f_.position_resolution_m)};
  }
  return std::nullopt;
}

std::optional<Cause> Causes::physics() const {
  if (is_coarse() && !f_.is_local) {
    return Cause{"physics_rate",
                 fmt::format("physics computes {} forces a second for {} ticks: raise "
                             "physics.rate_hz, or set mofc.interaction=local",
                             thousands(f_.physics_rate_hz), thousands(f_.device_rate_hz))};
  }
  if (std::isfinite(f_.solve_rate_hz)) {
    return Cause{"solve_rate",
                 fmt::format("elastic tissue is solved only {:g} times a second: raise "
                             "elastic.solve_rate_hz",
                             f_.solve_rate_hz)};
  }
  if (is_coarse()) {
    return Cause{"physics_rate",
                 fmt::format("contact models are {} times a second old, for {} "
                             "ticks: raise physics.rate_hz",
                             thousands(f_.physics_rate_hz), thousands(f_.device_rate_hz))};
  }
  return std::nullopt;
}

std::optional<Cause> Causes::controller_settings() const {
  if (f_.controller == "mofc paper" || f_.controller == "mofc vector") {
    return Cause{"mode", "mode " + f_.controller.substr(5) +
                             " holds back more than mode guard: try --set mofc.mode=guard"};
  }
  if (!f_.has_kalman_velocity) {
    return Cause{"velocity_estimator",
                 "differences of positions make the damping of the tissue noisy, and that costs "
                 "energy: mofc.velocity_estimator { kalman {} }, or tissue without damping"};
  }
  return std::nullopt;
}

/// What thins the messages between clamp and physics.
std::optional<Cause> Causes::deadband() const {
  if (!needs_news()) return std::nullopt;
  const double newton = f_.maximum_force_newton;
  if (const auto& one = f_.interaction_deadband;
      one && (one->ratio >= kFairRatio || one->floor_newton >= kFairRatio * newton)) {
    return Cause{"deadband",
                 fmt::format("by physics.interaction_deadband a force stays until it is {} or {:g} "
                             "N off: lower ratio and floor_newton, or leave it out",
                             percent(one->ratio), one->floor_newton)};
  }
  if (const auto& one = f_.motion_deadband;
      one && (one->ratio >= kFairRatio || one->floor_m >= kCoarseDeadband_m)) {
    return Cause{"deadband",
                 fmt::format("by mofc.motion_deadband physics hears of the tool when it is {} or "
                             "{:g} mm off: lower ratio and floor_m, or leave it out",
                             percent(one->ratio), 1e3 * one->floor_m)};
  }
  return std::nullopt;
}

std::optional<Cause> Causes::rate_and_mode() const {
  if (f_.device_rate_hz < kUsualRate_hz) {
    return Cause{"device_rate",
                 fmt::format("{:g} ticks a second: raise device.rate_hz, or make the tissue softer "
                             "or more damped",
                             f_.device_rate_hz)};
  }
  return controller_settings();
}

/// What the session sets for the whole run.
std::optional<Cause> Causes::settings(double loss) const {
  if (f_.is_limited) {
    if (auto cause = no_friction()) return cause;
  }
  if (is_other_controller()) {
    return Cause{f_.controller == "none" ? "no_controller" : "controller",
                 "the controller `" + f_.controller + "`; compare --set mofc.controller=mofc"};
  }
  if (auto cause = begin_of_run(loss)) return cause;
  if (auto cause = credit_cap()) return cause;
  if (auto cause = device(loss / kAftermath)) return cause;
  if (is_coarse() || is_held() || std::isfinite(f_.solve_rate_hz)) return std::nullopt;
  return rate_and_mode();
}

Cause Causes::of_debt(double loss) const {
  if (auto cause = of_run(0.0)) return *cause;
  if (auto cause = found({"device_restarted", "mofc_restarted"})) return *cause;
  if (auto cause = settings(loss)) return *cause;
  return {"energy_debt",
          "the hand got more than was counted, and pays it back by its motion: see the log"};
}

Cause Causes::of_loss(double loss) const {
  const LossPlace place = place_of_loss();
  if (const auto cause = held_to_no_force()) return *cause;
  if (const auto cause = of_run(loss / kAftermath)) return *cause;
  if (const auto cause = found({"energy_debt"}, 0.5 * loss)) return *cause;
  if (place == LossPlace::kDisturbed) {
    if (const auto cause = disturbed_ticks(loss)) return *cause;
  }
  if (const auto cause = settings(loss)) return *cause;
  if (place == LossPlace::kUnknown) {
    if (const auto cause = disturbed_ticks(loss)) return *cause;
  }
  if (const auto cause = old_news(loss)) return *cause;
  if (const auto cause = deadband()) return *cause;
  if (const auto cause = physics()) return *cause;
  if (!f_.is_session_known) return {"unknown", "the session cannot be read here, only its figures"};
  if (is_held()) {
    return {"interaction_held", "forces arrive a round trip late: set mofc.interaction=local"};
  }
  if (const auto cause = rate_and_mode()) return *cause;
  if (place == LossPlace::kDisturbed) {
    return {"press_lost",
            "mofc_node began, or the force came back, while the tool was in tissue, where nobody "
            "knows what energy the press has stored: the force is limited until the tool leaves"};
  }
  return {"tissue_stiff",
          "the requested force creates energy that the device's friction cannot absorb: softer "
          "tissue, another damping of it, or a higher device.rate_hz"};
}

}  // namespace palpate
