// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/event_log.h"

namespace palpate {
namespace {

constexpr std::uint64_t kLongDebt_ticks = 1'000;  // in all; shorter debts are no news

/// An episode ends after this long without a tick of it.
constexpr Duration kQuiet = std::chrono::seconds(1);

}  // namespace

void GrowthEvent::note(std::uint64_t count, TimePoint now) {
  const std::uint64_t growth = count - last_;
  last_ = count;
  if (const std::uint64_t due = throttle_.note(now, growth)) {
    log_.log(level_, "event={} count={}", event_, due);
  }
}

void EpisodeEvent::note(std::uint64_t ticks, TimePoint now) {
  if (ticks != ticks_) {
    if (!is_under_way_) {
      is_under_way_ = true;
      ticks_before_ = ticks_;
      log_.warn("event={}_began", event_);
    }
    ticks_ = ticks;
    grew_at_ = now;
  } else if (is_under_way_ && now - grew_at_ >= kQuiet) {
    is_under_way_ = false;
    log_.info("event={}_ended ticks={}", event_, ticks_ - ticks_before_);
  }
}

void LinkEvents::note(const LinkCounters& counters, TimePoint now) {
  if (counters.sessions > 0 && last_.sessions == 0) {
    log_.info("event=peer_up link={}", link_);
  } else if (counters.sessions > last_.sessions) {
    log_.warn("event=peer_restarted link={} sessions={}", link_, counters.sessions);
  }
  if (const auto due = rejections_.note(now, counters.rejected - last_.rejected)) {
    log_.warn("event=messages_rejected link={} count={}", link_, due);
  }
  if (const auto due = ahead_.note(now, counters.ahead - last_.ahead)) {
    log_.warn("event=answers_ahead link={} count={}", link_, due);
  }
  last_ = counters;
}

EventLog<DeviceCounters>::EventLog(spdlog::logger& log)
    : force_command_(log, "force_command"),
      log_(log),
      non_finite_commands_(log, spdlog::level::err, "command_not_finite"),
      late_switches_(log, spdlog::level::warn, "switch_late"),
      monitor_reductions_(log, spdlog::level::err, "monitor_reduced"),
      ledger_excesses_(log, spdlog::level::err, "ledger_too_high"),
      too_fast_(log, spdlog::level::warn, "hand_faster_than_assumed"),
      coarse_readings_(log, spdlog::level::warn, "encoder_coarser_than_profile"),
      outside_(log, spdlog::level::warn, "hand_outside_workspace"),
      frozen_(log, spdlog::level::warn, "position_stands_still"),
      acknowledged_(log, spdlog::level::info, "acknowledged_by_page"),
      not_acknowledged_(log, spdlog::level::warn, "page_acknowledgement_refused"),
      overruns_(log, spdlog::level::warn, "ticks_skipped"),
      fallback_(log, "fallback") {}

void EventLog<DeviceCounters>::note(const DeviceCounters& counters, TimePoint now) {
  force_command_.note(counters.force_command, now);
  if (counters.device_faults != faults_) {
    log_.error(
        "event=device_fault reason=\"{}\" count={} remedy=\"clear the cause, then send SIGUSR2 "
        "(event=acknowledge_with)\"",
        name(counters.last_fault), counters.device_faults - faults_);
    faults_ = counters.device_faults;
  }
  if (counters.is_release_unconfirmed != is_release_unconfirmed_) {
    is_release_unconfirmed_ = counters.is_release_unconfirmed;
    if (is_release_unconfirmed_) {
      log_.error("event=release_unconfirmed remedy=\"{}\"", kReleaseUnconfirmedText);
    } else {
      log_.info("event=release_confirmed");
    }
  }
  if (counters.fault_resets != fault_resets_) {
    log_.info("event=device_fault_reset");
    fault_resets_ = counters.fault_resets;
  }
  acknowledged_.note(counters.page_acknowledgements, now);
  not_acknowledged_.note(counters.page_acknowledgements_refused, now);
  if (counters.phase != phase_) note_phase(counters.phase);
  non_finite_commands_.note(counters.non_finite_commands, now);
  late_switches_.note(counters.late_switches, now);
  monitor_reductions_.note(counters.monitor_reductions, now);
  ledger_excesses_.note(counters.ledger_excesses, now);
  too_fast_.note(counters.too_fast_readings, now);
  coarse_readings_.note(counters.coarse_readings, now);
  outside_.note(counters.outside_readings, now);
  frozen_.note(counters.frozen_ticks, now);
  if (counters.checked_motor_gain != motor_gain_) {
    motor_gain_ = counters.checked_motor_gain;
    if (motor_gain_ > 0.0) {
      log_.info("event=motor_gain at_least={:.2f}: of what the session says, by its friction",
                motor_gain_);
    }
  }
  overruns_.note(counters.loop.skipped_ticks, now);

  // before the first answer, limp is the initial state; after it, the end of a fallback
  if (!was_answered_) limp_ticks_at_start_ = counters.limp_ticks;
  was_answered_ = was_answered_ || counters.answered_ticks > 0;
  fallback_.note(counters.fallback_ticks + counters.limp_ticks - limp_ticks_at_start_, now);
}

/// A simulated device is enabled from its start, and a fault has its own line.
void EventLog<DeviceCounters>::note_phase(DevicePhase phase) {
  const bool is_first = phase_ == DevicePhase::kUnknown;
  phase_ = phase;
  if (phase == DevicePhase::kConnected) {
    log_.warn(
        "event=device_phase phase=connected remedy=\"calibrate the device as event=device_prompt "
        "asks for, then send SIGUSR2 (event=acknowledge_with)\"");
  } else if (phase == DevicePhase::kCalibrated) {
    log_.warn(
        "event=device_phase phase=calibrated remedy=\"no force yet: make sure that the handle is "
        "free, then send SIGUSR2 (event=acknowledge_with), or press the session's dead-man "
        "button\"");
  } else if (phase == DevicePhase::kChecking) {
    log_.warn(
        "event=device_phase phase=checking remedy=\"the motors push a little to and fro, along one "
        "axis after the other, while the dead-man button is held if the session names one: let the "
        "handle hang, or hold it loosely and still\"");
  } else if (phase == DevicePhase::kEnabled && !is_first) {
    log_.info("event=device_phase phase=enabled");
  }
}

EventLog<MofcCounters>::EventLog(spdlog::logger& log)
    : device_state_(log, "device_state"),
      interaction_(log, "interaction"),
      standby_interaction_(log, "standby_interaction"),
      log_(log),
      late_physics_(log, spdlog::level::warn, "physics_late"),
      too_fast_(log, spdlog::level::warn, "hand_faster_than_assumed"),
      motions_dropped_(log, spdlog::level::warn, "motions_dropped"),
      ledger_resets_(log, spdlog::level::info, "ledger_reset"),
      grips_(log, spdlog::level::info, "tissue_held"),
      grips_torn_(log, spdlog::level::info, "tissue_torn"),
      grips_slipped_(log, spdlog::level::info, "tissue_slipped_out"),
      punctures_(log, spdlog::level::info, "tissue_punctured"),
      stale_(log, "interaction_stale") {}

void EventLog<MofcCounters>::note(const MofcCounters& counters, TimePoint now) {
  device_state_.note(counters.device_state, now);
  interaction_.note(counters.interaction, now);
  standby_interaction_.note(counters.standby_interaction, now);
  if (counters.physics_switches != physics_switches_) {
    const bool is_standby = counters.physics_term % 2 == 1;
    log_.warn("event=physics_switched term={} speaks={} count={}", counters.physics_term,
              is_standby ? "standby" : "first", counters.physics_switches - physics_switches_);
    physics_switches_ = counters.physics_switches;
  }
  late_physics_.note(counters.late_physics_ticks, now);
  too_fast_.note(counters.too_fast_ticks, now);
  motions_dropped_.note(counters.motions_dropped, now);
  ledger_resets_.note(counters.ledger_resets, now);
  if (!has_told_debt_ && counters.debt_ticks >= kLongDebt_ticks) {
    has_told_debt_ = true;
    log_.warn(
        "event=energy_debt ticks={}: the account is below 0, and the force stays within what "
        "friction bears until the hand has paid it back; told once",
        counters.debt_ticks);
  }
  grips_.note(counters.grips, now);
  grips_torn_.note(counters.grips_torn, now);
  grips_slipped_.note(counters.grips_slipped, now);
  punctures_.note(counters.punctures, now);
  stale_.note(counters.stale_ticks, now);
}

EventLog<PhysicsCounters>::EventLog(spdlog::logger& log)
    : tool_motion_(log, "tool_motion"),
      overruns_(log, spdlog::level::warn, "ticks_skipped"),
      tissue_changes_refused_(log, spdlog::level::warn, "tissue_change_refused"),
      removed_(log, spdlog::level::info, "tissue_ablated"),
      loose_(log, spdlog::level::warn, "tissue_cut_off"),
      refused_(log, spdlog::level::warn, "ablation_refused"),
      restored_(log, spdlog::level::info, "tissue_restored"),
      torn_(log, spdlog::level::info, "attachment_torn"),
      cut_(log, spdlog::level::info, "tissue_cut") {}

void EventLog<PhysicsCounters>::note(const PhysicsCounters& counters, TimePoint now) {
  tool_motion_.note(counters.tool_motion, now);
  overruns_.note(counters.loop.skipped_ticks, now);
  tissue_changes_refused_.note(counters.tissue_changes_refused, now);
  removed_.note(counters.elastic_elements_removed, now);
  loose_.note(counters.elastic_elements_loose, now);
  refused_.note(counters.elastic_bodies_refused, now);
  restored_.note(counters.elastic_bodies_restored, now);
  torn_.note(counters.elastic_attachments_torn, now);
  cut_.note(counters.elastic_faces_cut, now);
}

}  // namespace palpate
