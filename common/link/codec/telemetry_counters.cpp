// SPDX-License-Identifier: Apache-2.0
#include "common/link/codec/telemetry_counters.h"

#include <cmath>
#include <limits>

namespace palpate::wire {
namespace {

void put(const LinkCounters& c, v1::LinkCounters& to) {
  to.set_accepted(c.accepted);
  to.set_skipped(c.skipped);
  to.set_duplicates(c.duplicates);
  to.set_out_of_order(c.out_of_order);
  to.set_rejected(c.rejected);
  to.set_sessions(c.sessions);
  to.set_ahead(c.ahead);
}
LinkCounters link(const v1::LinkCounters& c) {
  return {.accepted = c.accepted(),
          .skipped = c.skipped(),
          .duplicates = c.duplicates(),
          .out_of_order = c.out_of_order(),
          .rejected = c.rejected(),
          .ahead = c.ahead(),
          .sessions = c.sessions()};
}

void put(const LoopCounters& c, v1::LoopCounters& to) {
  to.set_ticks(c.ticks);
  to.set_skipped_ticks(c.skipped_ticks);
  to.set_worst_lateness_ns(c.worst_lateness.count());
}
LoopCounters loop(const v1::LoopCounters& c) {
  return {.ticks = c.ticks(),
          .skipped_ticks = c.skipped_ticks(),
          .worst_lateness = Duration(c.worst_lateness_ns())};
}

}  // namespace

void put(const DeviceCounters& c, v1::DeviceCounters& to) {
  put(c.loop, *to.mutable_loop());
  put(c.force_command, *to.mutable_force_command());
  to.set_longest_skip_ticks(c.longest_skip_ticks);
  to.set_answered_ticks(c.answered_ticks);
  to.set_leased_ticks(c.leased_ticks);
  to.set_fallback_ticks(c.fallback_ticks);
  to.set_limp_ticks(c.limp_ticks);
  to.set_start_up_ticks(c.start_up_ticks);
  to.set_peak_limited_ticks(c.peak_limited_ticks);
  to.set_fault_ticks(c.fault_ticks);
  to.set_device_faults(c.device_faults);
  to.set_fault_resets(c.fault_resets);
  to.set_late_switches(c.late_switches);
  to.set_is_monitor_off(c.is_monitor_off);
  to.set_monitor_reductions(c.monitor_reductions);
  to.set_too_fast_readings(c.too_fast_readings);
  to.set_coarse_readings(c.coarse_readings);
  to.set_outside_readings(c.outside_readings);
  to.set_repeated_readings(c.repeated_readings);
  to.set_checked_friction_ratio(c.checked_friction_ratio);
  to.set_has_no_motor_watchdog(c.has_no_motor_watchdog);
  to.set_accepts_no_motor_watchdog(c.accepts_no_motor_watchdog);
  to.set_dead_man_ticks(c.dead_man_ticks);
  to.set_uncalibrated_ticks(c.uncalibrated_ticks);
  to.set_unacknowledged_ticks(c.unacknowledged_ticks);
  to.set_checking_ticks(c.checking_ticks);
  to.set_checked_motor_gain(c.checked_motor_gain);
  to.set_frozen_ticks(c.frozen_ticks);
  to.set_ledger_excesses(c.ledger_excesses);
  to.set_phase(static_cast<std::uint32_t>(c.phase));
  to.set_page_acknowledgements(c.page_acknowledgements);
  to.set_page_acknowledgements_refused(c.page_acknowledgements_refused);
  to.set_is_release_unconfirmed(c.is_release_unconfirmed);
  to.set_last_fault(static_cast<std::uint32_t>(c.last_fault));
  to.set_non_finite_commands(c.non_finite_commands);
  to.set_max_force_newton(c.max_force_newton);
  to.set_largest_jump_newton(c.largest_jump_newton);
  to.set_minimum_true_energy_joule(c.minimum_true_energy_joule);
}
void check_counters(const v1::DeviceCounters& c, Verdict& verdict) {
  verdict.require(c.has_loop());
  verdict.require(c.has_force_command());
  verdict.time(c.loop().worst_lateness_ns());
  verdict.expect(c.phase() <= static_cast<std::uint32_t>(DevicePhase::kChecking));
  verdict.expect(c.last_fault() <= static_cast<std::uint32_t>(FaultReason::kMotorsDiffer));
  verdict.finite(c.max_force_newton());
  verdict.finite(c.largest_jump_newton());
  verdict.finite(c.checked_friction_ratio());
  verdict.finite(c.checked_motor_gain());
  verdict.finite_or_nan(c.minimum_true_energy_joule());
}
DeviceCounters counters(const v1::DeviceCounters& c) {
  return {.loop = loop(c.loop()),
          .longest_skip_ticks = c.longest_skip_ticks(),
          .force_command = link(c.force_command()),
          .answered_ticks = c.answered_ticks(),
          .leased_ticks = c.leased_ticks(),
          .fallback_ticks = c.fallback_ticks(),
          .limp_ticks = c.limp_ticks(),
          .start_up_ticks = c.start_up_ticks(),
          .peak_limited_ticks = c.peak_limited_ticks(),
          .fault_ticks = c.fault_ticks(),
          .device_faults = c.device_faults(),
          .fault_resets = c.fault_resets(),
          .last_fault = static_cast<FaultReason>(c.last_fault()),
          .non_finite_commands = c.non_finite_commands(),
          .late_switches = c.late_switches(),
          .is_monitor_off = c.is_monitor_off(),
          .monitor_reductions = c.monitor_reductions(),
          .ledger_excesses = c.ledger_excesses(),
          .too_fast_readings = c.too_fast_readings(),
          .coarse_readings = c.coarse_readings(),
          .outside_readings = c.outside_readings(),
          .repeated_readings = c.repeated_readings(),
          .checked_friction_ratio = c.checked_friction_ratio(),
          .checked_motor_gain = c.checked_motor_gain(),
          .has_no_motor_watchdog = c.has_no_motor_watchdog(),
          .accepts_no_motor_watchdog = c.accepts_no_motor_watchdog(),
          .dead_man_ticks = c.dead_man_ticks(),
          .frozen_ticks = c.frozen_ticks(),
          .uncalibrated_ticks = c.uncalibrated_ticks(),
          .unacknowledged_ticks = c.unacknowledged_ticks(),
          .checking_ticks = c.checking_ticks(),
          .phase = static_cast<DevicePhase>(c.phase()),
          .page_acknowledgements = c.page_acknowledgements(),
          .page_acknowledgements_refused = c.page_acknowledgements_refused(),
          .is_release_unconfirmed = c.is_release_unconfirmed(),
          .max_force_newton = c.max_force_newton(),
          .largest_jump_newton = c.largest_jump_newton(),
          .minimum_true_energy_joule = c.minimum_true_energy_joule()};
}

void put(const MofcCounters& c, v1::MofcCounters& to) {
  put(c.device_state, *to.mutable_device_state());
  put(c.interaction, *to.mutable_interaction());
  to.set_ticks(c.ticks);
  to.set_contact_ticks(c.contact_ticks);
  to.set_clamped_ticks(c.clamped_ticks);
  to.set_debt_ticks(c.debt_ticks);
  to.set_stale_ticks(c.stale_ticks);
  to.set_late_physics_ticks(c.late_physics_ticks);
  to.set_ledger_resets(c.ledger_resets);
  to.set_disturbed_contact_ticks(c.disturbed_contact_ticks);
  to.set_disturbed_clamped_ticks(c.disturbed_clamped_ticks);
  to.set_motions_dropped(c.motions_dropped);
  to.set_motions_suppressed(c.motions_suppressed);
  to.set_transparency_integral_ns(c.transparency_integral_ns);
  to.set_transparency_time_ns(c.transparency_time_ns);
  to.set_too_fast_ticks(c.too_fast_ticks);
  put(c.standby_interaction, *to.mutable_standby_interaction());
  to.set_physics_term(c.physics_term);
  to.set_standby_ticks(c.standby_ticks);
  to.set_physics_switches(c.physics_switches);
  to.set_grips(c.grips);
  to.set_grips_torn(c.grips_torn);
  to.set_grips_slipped(c.grips_slipped);
  to.set_punctures(c.punctures);
}
void check_counters(const v1::MofcCounters& c, Verdict& verdict) {
  verdict.require(c.has_device_state());
  verdict.require(c.has_interaction());
  verdict.finite(c.transparency_integral_ns());
}
MofcCounters counters(const v1::MofcCounters& c) {
  return {.device_state = link(c.device_state()),
          .interaction = link(c.interaction()),
          .ticks = c.ticks(),
          .contact_ticks = c.contact_ticks(),
          .clamped_ticks = c.clamped_ticks(),
          .debt_ticks = c.debt_ticks(),
          .too_fast_ticks = c.too_fast_ticks(),
          .stale_ticks = c.stale_ticks(),
          .late_physics_ticks = c.late_physics_ticks(),
          .ledger_resets = c.ledger_resets(),
          .disturbed_contact_ticks = c.disturbed_contact_ticks(),
          .disturbed_clamped_ticks = c.disturbed_clamped_ticks(),
          .motions_dropped = c.motions_dropped(),
          .motions_suppressed = c.motions_suppressed(),
          .transparency_integral_ns = c.transparency_integral_ns(),
          .transparency_time_ns = c.transparency_time_ns(),
          .standby_interaction = link(c.standby_interaction()),
          .physics_term = c.physics_term(),
          .standby_ticks = c.standby_ticks(),
          .physics_switches = c.physics_switches(),
          .grips = c.grips(),
          .grips_torn = c.grips_torn(),
          .grips_slipped = c.grips_slipped(),
          .punctures = c.punctures()};
}

void put(const PhysicsCounters& c, v1::PhysicsCounters& to) {
  put(c.loop, *to.mutable_loop());
  put(c.tool_motion, *to.mutable_tool_motion());
  to.set_contact_steps(c.contact_steps);
  to.set_is_started_in_contact(c.is_started_in_contact);
  to.set_tissues_skipped(c.tissues_skipped);
  to.set_tissues_visited(c.tissues_visited);
  to.set_octree_cells_visited(c.octree_cells_visited);
  to.set_octree_last_cell_hits(c.octree_last_cell_hits);
  to.set_tissues_asleep(c.tissues_asleep);
  to.set_surfaces_shared(c.surfaces_shared);
  to.set_interactions_suppressed(c.interactions_suppressed);
  to.set_mesh_frames(c.mesh_frames);
  to.set_meshes_skipped(c.meshes_skipped);
  to.set_tissue_changes(c.tissue_changes);
  to.set_tissue_changes_refused(c.tissue_changes_refused);
  to.set_elastic_solves(c.elastic_solves);
  to.set_elastic_solves_skipped(c.elastic_solves_skipped);
  to.set_elastic_solves_late(c.elastic_solves_late);
  to.set_elastic_solves_failed(c.elastic_solves_failed);
  to.set_elastic_steps_skipped(c.elastic_steps_skipped);
  to.set_elastic_residual_ratio(c.elastic_residual_ratio);
  if (!std::isnan(c.elastic_error_newton)) to.set_elastic_error_newton(c.elastic_error_newton);
  if (!std::isnan(c.elastic_bound_newton)) to.set_elastic_bound_newton(c.elastic_bound_newton);
  to.set_elastic_bound_violations(c.elastic_bound_violations);
  to.set_elastic_bounds_checked(c.elastic_bounds_checked);
  to.set_elastic_contact_steps(c.elastic_contact_steps);
  to.set_elastic_unknown_bound_steps(c.elastic_unknown_bound_steps);
  to.set_elastic_tips_appeared(c.elastic_tips_appeared);
  to.set_elastic_points_held(c.elastic_points_held);
  to.set_elastic_energised_steps(c.elastic_energised_steps);
  to.set_elastic_bodies_remade(c.elastic_bodies_remade);
  to.set_elastic_elements_removed(c.elastic_elements_removed);
  to.set_elastic_elements_loose(c.elastic_elements_loose);
  to.set_elastic_bodies_refused(c.elastic_bodies_refused);
  to.set_elastic_bodies_restored(c.elastic_bodies_restored);
  to.set_elastic_attachments_torn(c.elastic_attachments_torn);
  to.set_elastic_torn_joule(c.elastic_torn_joule);
  to.set_elastic_faces_cut(c.elastic_faces_cut);
  to.set_elastic_cut_joule(c.elastic_cut_joule);
  to.set_elastic_solves_repaired(c.elastic_solves_repaired);
  to.set_worst_compute_time_ns(c.worst_compute_time.count());
}
void check_counters(const v1::PhysicsCounters& c, Verdict& verdict) {
  verdict.require(c.has_loop());
  verdict.require(c.has_tool_motion());
  verdict.time(c.loop().worst_lateness_ns());
  verdict.time(c.worst_compute_time_ns());
  verdict.finite(c.elastic_residual_ratio());
  verdict.finite(c.elastic_error_newton());
  verdict.finite(c.elastic_bound_newton());
  verdict.finite(c.elastic_torn_joule());
  verdict.finite(c.elastic_cut_joule());
}
PhysicsCounters counters(const v1::PhysicsCounters& c) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  return {
      .loop = loop(c.loop()),
      .tool_motion = link(c.tool_motion()),
      .contact_steps = c.contact_steps(),
      .is_started_in_contact = c.is_started_in_contact(),
      .tissues_skipped = c.tissues_skipped(),
      .tissues_visited = c.tissues_visited(),
      .octree_cells_visited = c.octree_cells_visited(),
      .octree_last_cell_hits = c.octree_last_cell_hits(),
      .tissues_asleep = c.tissues_asleep(),
      .surfaces_shared = c.surfaces_shared(),
      .interactions_suppressed = c.interactions_suppressed(),
      .mesh_frames = c.mesh_frames(),
      .meshes_skipped = c.meshes_skipped(),
      .tissue_changes = c.tissue_changes(),
      .tissue_changes_refused = c.tissue_changes_refused(),
      .elastic_solves = c.elastic_solves(),
      .elastic_solves_skipped = c.elastic_solves_skipped(),
      .elastic_solves_late = c.elastic_solves_late(),
      .elastic_solves_failed = c.elastic_solves_failed(),
      .elastic_solves_repaired = c.elastic_solves_repaired(),
      .elastic_steps_skipped = c.elastic_steps_skipped(),
      .elastic_residual_ratio = c.elastic_residual_ratio(),
      .elastic_error_newton = c.has_elastic_error_newton() ? c.elastic_error_newton() : kUnknown,
      .elastic_bound_newton = c.has_elastic_bound_newton() ? c.elastic_bound_newton() : kUnknown,
      .elastic_bound_violations = c.elastic_bound_violations(),
      .elastic_bounds_checked = c.elastic_bounds_checked(),
      .elastic_contact_steps = c.elastic_contact_steps(),
      .elastic_unknown_bound_steps = c.elastic_unknown_bound_steps(),
      .elastic_tips_appeared = c.elastic_tips_appeared(),
      .elastic_points_held = c.elastic_points_held(),
      .elastic_energised_steps = c.elastic_energised_steps(),
      .elastic_bodies_remade = c.elastic_bodies_remade(),
      .elastic_elements_removed = c.elastic_elements_removed(),
      .elastic_elements_loose = c.elastic_elements_loose(),
      .elastic_bodies_refused = c.elastic_bodies_refused(),
      .elastic_bodies_restored = c.elastic_bodies_restored(),
      .elastic_attachments_torn = c.elastic_attachments_torn(),
      .elastic_torn_joule = c.elastic_torn_joule(),
      .elastic_faces_cut = c.elastic_faces_cut(),
      .elastic_cut_joule = c.elastic_cut_joule(),
      .worst_compute_time = Duration(c.worst_compute_time_ns())};
}

}  // namespace palpate::wire
