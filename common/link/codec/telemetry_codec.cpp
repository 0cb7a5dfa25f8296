// SPDX-License-Identifier: Apache-2.0
// telemetry_codec.cpp — hop 5: the telemetry batches of the three nodes.
#include <algorithm>
#include <type_traits>
#include <vector>

#include "common/link/codec/wire_format.h"
#include "palpate/v1/telemetry.pb.h"

namespace palpate {

using namespace wire;

namespace {

constexpr std::size_t kMaxVersionBytes = 64;
constexpr std::size_t kMaxSideBytes = 64;

// --- counters --------------------------------------------------------------------------------

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

void put(const DeviceCounters& c, v1::DeviceCounters& to) {
  put(c.loop, *to.mutable_loop());
  put(c.force_command, *to.mutable_force_command());
  to.set_answered_ticks(c.answered_ticks);
  to.set_leased_ticks(c.leased_ticks);
  to.set_fallback_ticks(c.fallback_ticks);
  to.set_limp_ticks(c.limp_ticks);
  to.set_peak_limited_ticks(c.peak_limited_ticks);
  to.set_fault_ticks(c.fault_ticks);
  to.set_device_faults(c.device_faults);
  to.set_fault_resets(c.fault_resets);
  to.set_late_switches(c.late_switches);
  to.set_is_monitor_off(c.is_monitor_off);
  to.set_monitor_reductions(c.monitor_reductions);
  to.set_too_fast_readings(c.too_fast_readings);
  to.set_coarse_readings(c.coarse_readings);
  to.set_checked_friction_ratio(c.checked_friction_ratio);
  to.set_has_no_motor_watchdog(c.has_no_motor_watchdog);
  to.set_accepts_no_motor_watchdog(c.accepts_no_motor_watchdog);
  to.set_dead_man_ticks(c.dead_man_ticks);
  to.set_phase(static_cast<std::uint32_t>(c.phase));
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
  verdict.expect(c.phase() <= static_cast<std::uint32_t>(DevicePhase::kFaulted));
  verdict.expect(c.last_fault() <= static_cast<std::uint32_t>(FaultReason::kSuspended));
  verdict.finite(c.max_force_newton());
  verdict.finite(c.largest_jump_newton());
  verdict.finite(c.checked_friction_ratio());
  verdict.finite_or_nan(c.minimum_true_energy_joule());
}
DeviceCounters counters(const v1::DeviceCounters& c) {
  return {.loop = loop(c.loop()),
          .force_command = link(c.force_command()),
          .answered_ticks = c.answered_ticks(),
          .leased_ticks = c.leased_ticks(),
          .fallback_ticks = c.fallback_ticks(),
          .limp_ticks = c.limp_ticks(),
          .peak_limited_ticks = c.peak_limited_ticks(),
          .fault_ticks = c.fault_ticks(),
          .device_faults = c.device_faults(),
          .fault_resets = c.fault_resets(),
          .last_fault = static_cast<FaultReason>(c.last_fault()),
          .non_finite_commands = c.non_finite_commands(),
          .late_switches = c.late_switches(),
          .is_monitor_off = c.is_monitor_off(),
          .monitor_reductions = c.monitor_reductions(),
          .too_fast_readings = c.too_fast_readings(),
          .coarse_readings = c.coarse_readings(),
          .checked_friction_ratio = c.checked_friction_ratio(),
          .has_no_motor_watchdog = c.has_no_motor_watchdog(),
          .accepts_no_motor_watchdog = c.accepts_no_motor_watchdog(),
          .dead_man_ticks = c.dead_man_ticks(),
          .phase = static_cast<DevicePhase>(c.phase()),
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
  to.set_stale_ticks(c.stale_ticks);
  to.set_late_physics_ticks(c.late_physics_ticks);
  to.set_ledger_resets(c.ledger_resets);
  to.set_motions_dropped(c.motions_dropped);
  to.set_motions_suppressed(c.motions_suppressed);
  to.set_transparency_integral_ns(c.transparency_integral_ns);
  to.set_transparency_time_ns(c.transparency_time_ns);
  to.set_too_fast_ticks(c.too_fast_ticks);
  put(c.standby_interaction, *to.mutable_standby_interaction());
  to.set_physics_term(c.physics_term);
  to.set_standby_ticks(c.standby_ticks);
  to.set_physics_switches(c.physics_switches);
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
          .too_fast_ticks = c.too_fast_ticks(),
          .stale_ticks = c.stale_ticks(),
          .late_physics_ticks = c.late_physics_ticks(),
          .ledger_resets = c.ledger_resets(),
          .motions_dropped = c.motions_dropped(),
          .motions_suppressed = c.motions_suppressed(),
          .transparency_integral_ns = c.transparency_integral_ns(),
          .transparency_time_ns = c.transparency_time_ns(),
          .standby_interaction = link(c.standby_interaction()),
          .physics_term = c.physics_term(),
          .standby_ticks = c.standby_ticks(),
          .physics_switches = c.physics_switches()};
}

void put(const PhysicsCounters& c, v1::PhysicsCounters& to) {
  put(c.loop, *to.mutable_loop());
  put(c.tool_motion, *to.mutable_tool_motion());
  to.set_contact_steps(c.contact_steps);
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
  to.set_elastic_error_newton(c.elastic_error_newton);
  to.set_elastic_bound_newton(c.elastic_bound_newton);
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
}
PhysicsCounters counters(const v1::PhysicsCounters& c) {
  return {.loop = loop(c.loop()),
          .tool_motion = link(c.tool_motion()),
          .contact_steps = c.contact_steps(),
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
          .elastic_steps_skipped = c.elastic_steps_skipped(),
          .elastic_residual_ratio = c.elastic_residual_ratio(),
          .elastic_error_newton = c.elastic_error_newton(),
          .elastic_bound_newton = c.elastic_bound_newton(),
          .worst_compute_time = Duration(c.worst_compute_time_ns())};
}

// --- columns ---------------------------------------------------------------------------------

using Doubles = google::protobuf::RepeatedField<double>;
using Times = google::protobuf::RepeatedField<std::int64_t>;

void append(const Vector3& v, Doubles& column) {
  column.Add(v.x());
  column.Add(v.y());
  column.Add(v.z());
}
Vector3 vector(const Doubles& column, int i) {
  return {column[3 * i], column[3 * i + 1], column[3 * i + 2]};
}

void append(const Quaternion& q, Doubles& column) {
  for (const double x : {q.w(), q.x(), q.y(), q.z()}) column.Add(x);
}
Quaternion quaternion(const Doubles& column, int i) {
  return {column[4 * i], column[4 * i + 1], column[4 * i + 2], column[4 * i + 3]};
}

/// `rows` entries, `per_row` each.
template <class Column>
void check_length(const Column& column, int rows, int per_row, Verdict& verdict) {
  verdict.expect(column.size() % per_row == 0 && column.size() / per_row == rows);
}
void check_finite(const Doubles& column, int rows, int per_row, Verdict& verdict) {
  check_length(column, rows, per_row, verdict);
  for (const double x : column) verdict.finite(x);
}
void check_finite_or_nan(const Doubles& column, int rows, int per_row, Verdict& verdict) {
  check_length(column, rows, per_row, verdict);
  for (const double x : column) verdict.finite_or_nan(x);
}
void check_times(const Times& column, int rows, Verdict& verdict) {
  check_length(column, rows, 1, verdict);
  for (const std::int64_t t : column) verdict.time(t);
}

enum DeviceFlags : std::uint32_t {
  kAnswered = 1,
  kPeakLimited = 2,
  kClutched = 4,
  kMonitorReduced = 8
};

bool is_turned(const DeviceTick& r) {
  return r.measured_tool_orientation_world.coeffs() != Quaternion::Identity().coeffs();
}

/// Of ActedForces::position_at_end.
enum PositionAtEnd : std::uint32_t { kNotRead = 0, kGiven = 1, kOfTheTick = 2 };

void fill_acted(const DeviceTick& r, v1::ActedForces& wire) {
  wire.add_count(r.acted_count);
  wire.add_from_ns(r.acted_count > 0 ? ns(r.acted[0].from) : 0);
  for (std::uint32_t i = 0; i < r.acted_count; ++i) {
    const AppliedForce& acted = r.acted[i];
    wire.add_until_ns(ns(acted.until));
    append(acted.force_on_hand_newton, *wire.mutable_force_on_hand_newton());
    if (!acted.has_position_at_end) {
      wire.add_position_at_end(kNotRead);
    } else if (acted.hand_position_at_end_m == r.measured_hand_position_m) {
      wire.add_position_at_end(kOfTheTick);
    } else {
      wire.add_position_at_end(kGiven);
      append(acted.hand_position_at_end_m, *wire.mutable_hand_position_at_end_m());
    }
  }
}
void check_acted(const v1::ActedForces& wire, int rows, Verdict& verdict) {
  check_length(wire.count(), rows, 1, verdict);
  check_times(wire.from_ns(), rows, verdict);
  std::int64_t intervals = 0;
  for (const std::uint32_t count : wire.count()) {
    verdict.expect(count <= kMaxActedForces);
    intervals += count;
  }
  std::int64_t positions = 0;
  for (const std::uint32_t position : wire.position_at_end()) {
    verdict.expect(position <= kOfTheTick);
    if (position == kGiven) ++positions;
  }
  verdict.expect(intervals == wire.until_ns_size() && intervals == wire.position_at_end_size());
  check_times(wire.until_ns(), wire.until_ns_size(), verdict);
  check_finite(wire.force_on_hand_newton(), wire.until_ns_size(), 3, verdict);
  verdict.expect(3 * positions == wire.hand_position_at_end_m_size());
  for (const double x : wire.hand_position_at_end_m()) verdict.finite(x);
}
void read_acted(const v1::DeviceTelemetry& batch, std::vector<DeviceTick>& records) {
  const v1::ActedForces& wire = batch.acted();
  int interval = 0;
  int given = 0;
  for (std::size_t tick = 0; tick < records.size(); ++tick) {
    DeviceTick& r = records[tick];
    r.acted_count = batch.has_acted() ? wire.count(static_cast<int>(tick)) : 0;
    TimePoint from = r.acted_count > 0 ? time(wire.from_ns(static_cast<int>(tick))) : TimePoint{};
    for (std::uint32_t i = 0; i < r.acted_count; ++i, ++interval) {
      AppliedForce& acted = r.acted[i];
      const std::uint32_t position = wire.position_at_end(interval);
      acted = {.force_on_hand_newton = vector(wire.force_on_hand_newton(), interval),
               .from = from,
               .until = time(wire.until_ns(interval)),
               .has_position_at_end = position != kNotRead};
      if (position == kGiven) {
        acted.hand_position_at_end_m = vector(wire.hand_position_at_end_m(), given++);
      } else if (position == kOfTheTick) {
        acted.hand_position_at_end_m = r.measured_hand_position_m;
      }
      from = acted.until;
    }
  }
}

void fill_records(const std::vector<DeviceTick>& records, v1::DeviceTelemetry& wire) {
  const bool has_orientations = std::any_of(records.begin(), records.end(), is_turned);
  for (const DeviceTick& r : records) {
    wire.add_sequence(r.sequence);
    wire.add_sampled_at_ns(ns(r.sampled_at));
    wire.add_switched_at_ns(ns(r.switched_at));
    wire.add_lateness_ns(r.lateness.count());
    wire.add_reply_time_ns(r.reply_time.count());
    append(r.measured_hand_position_m, *wire.mutable_measured_hand_position_m());
    append(r.measured_tool_position_world_m, *wire.mutable_measured_tool_position_world_m());
    append(r.force_on_hand_newton, *wire.mutable_force_on_hand_newton());
    wire.add_guard(static_cast<std::uint32_t>(r.guard));
    wire.add_flags((r.is_answered ? kAnswered : 0U) | (r.is_peak_limited ? kPeakLimited : 0U) |
                   (r.is_clutched ? kClutched : 0U) |
                   (r.is_monitor_reduced ? kMonitorReduced : 0U));
    append(r.true_tool_position_world_m, *wire.mutable_true_tool_position_world_m());
    append(r.true_tool_velocity_world_m_per_s, *wire.mutable_true_tool_velocity_world_m_per_s());
    wire.add_true_energy_joule(r.true_energy_joule);
    wire.add_minimum_true_energy_joule(r.minimum_true_energy_joule);
    if (has_orientations) {
      append(r.measured_tool_orientation_world, *wire.mutable_measured_tool_orientation_world());
    }
    fill_acted(r, *wire.mutable_acted());
  }
}
void check_records(const v1::DeviceTelemetry& wire, Verdict& verdict) {
  const int rows = wire.sequence_size();
  check_times(wire.sampled_at_ns(), rows, verdict);
  check_times(wire.switched_at_ns(), rows, verdict);
  check_times(wire.lateness_ns(), rows, verdict);
  check_times(wire.reply_time_ns(), rows, verdict);
  check_finite(wire.measured_hand_position_m(), rows, 3, verdict);
  check_finite(wire.measured_tool_position_world_m(), rows, 3, verdict);
  check_finite(wire.force_on_hand_newton(), rows, 3, verdict);
  check_length(wire.guard(), rows, 1, verdict);
  for (const std::uint32_t guard : wire.guard()) {
    verdict.expect(guard <= static_cast<std::uint32_t>(GuardState::kFault));
  }
  check_length(wire.flags(), rows, 1, verdict);
  check_finite_or_nan(wire.true_tool_position_world_m(), rows, 3, verdict);
  check_finite_or_nan(wire.true_tool_velocity_world_m_per_s(), rows, 3, verdict);
  check_finite_or_nan(wire.true_energy_joule(), rows, 1, verdict);
  check_finite_or_nan(wire.minimum_true_energy_joule(), rows, 1, verdict);
  const Doubles& orientations = wire.measured_tool_orientation_world();
  check_finite(orientations, orientations.empty() ? 0 : rows, 4, verdict);
  if (wire.has_acted()) check_acted(wire.acted(), rows, verdict);
}
void read_record(const v1::DeviceTelemetry& wire, int i, DeviceTick& r) {
  r.sequence = wire.sequence(i);
  r.sampled_at = time(wire.sampled_at_ns(i));
  r.switched_at = time(wire.switched_at_ns(i));
  r.lateness = Duration(wire.lateness_ns(i));
  r.reply_time = Duration(wire.reply_time_ns(i));
  r.measured_hand_position_m = vector(wire.measured_hand_position_m(), i);
  r.measured_tool_position_world_m = vector(wire.measured_tool_position_world_m(), i);
  r.measured_tool_orientation_world = wire.measured_tool_orientation_world().empty()
                                          ? Quaternion::Identity()
                                          : quaternion(wire.measured_tool_orientation_world(), i);
  r.force_on_hand_newton = vector(wire.force_on_hand_newton(), i);
  r.guard = static_cast<GuardState>(wire.guard(i));
  r.is_answered = (wire.flags(i) & kAnswered) != 0;
  r.is_peak_limited = (wire.flags(i) & kPeakLimited) != 0;
  r.is_clutched = (wire.flags(i) & kClutched) != 0;
  r.is_monitor_reduced = (wire.flags(i) & kMonitorReduced) != 0;
  r.true_tool_position_world_m = vector(wire.true_tool_position_world_m(), i);
  r.true_tool_velocity_world_m_per_s = vector(wire.true_tool_velocity_world_m_per_s(), i);
  r.true_energy_joule = wire.true_energy_joule(i);
  r.minimum_true_energy_joule = wire.minimum_true_energy_joule(i);
}

enum MofcFlags : std::uint32_t { kClamped = 1, kInContact = 2, kFromStandby = 4 };

void fill_records(const std::vector<MofcTick>& records, v1::MofcTelemetry& wire) {
  for (const MofcTick& r : records) {
    wire.add_device_session_id(r.device_session_id);
    wire.add_device_sequence(r.device_sequence);
    wire.add_device_sampled_at_ns(ns(r.device_sampled_at));
    append(r.asked_force_on_hand_newton, *wire.mutable_asked_force_on_hand_newton());
    append(r.commanded_force_on_hand_newton, *wire.mutable_commanded_force_on_hand_newton());
    append(r.f_max_newton, *wire.mutable_f_max_newton());
    wire.add_ledger_energy_joule(r.ledger_energy_joule);
    wire.add_force_age_ns(r.force_age.count());
    wire.add_state(static_cast<std::uint32_t>(r.state));
    wire.add_flags((r.is_clamped ? kClamped : 0U) | (r.is_in_contact ? kInContact : 0U) |
                   (r.is_from_standby ? kFromStandby : 0U));
  }
}
void check_records(const v1::MofcTelemetry& wire, Verdict& verdict) {
  const int rows = wire.device_sequence_size();
  check_length(wire.device_session_id(), rows, 1, verdict);
  check_times(wire.device_sampled_at_ns(), rows, verdict);
  check_finite(wire.asked_force_on_hand_newton(), rows, 3, verdict);
  check_finite(wire.commanded_force_on_hand_newton(), rows, 3, verdict);
  check_length(wire.f_max_newton(), rows, 3, verdict);
  check_finite_or_nan(wire.ledger_energy_joule(), rows, 1, verdict);
  check_times(wire.force_age_ns(), rows, verdict);
  check_length(wire.state(), rows, 1, verdict);
  for (const std::uint32_t state : wire.state()) {
    verdict.expect(state <= static_cast<std::uint32_t>(MofcState::kClutched));
  }
  check_length(wire.flags(), rows, 1, verdict);
}
void read_record(const v1::MofcTelemetry& wire, int i, MofcTick& r) {
  r.device_session_id = wire.device_session_id(i);
  r.device_sequence = wire.device_sequence(i);
  r.device_sampled_at = time(wire.device_sampled_at_ns(i));
  r.asked_force_on_hand_newton = vector(wire.asked_force_on_hand_newton(), i);
  r.commanded_force_on_hand_newton = vector(wire.commanded_force_on_hand_newton(), i);
  r.f_max_newton = vector(wire.f_max_newton(), i);
  r.ledger_energy_joule = wire.ledger_energy_joule(i);
  r.force_age = Duration(wire.force_age_ns(i));
  r.state = static_cast<MofcState>(wire.state(i));
  r.is_clamped = (wire.flags(i) & kClamped) != 0;
  r.is_in_contact = (wire.flags(i) & kInContact) != 0;
  r.is_from_standby = (wire.flags(i) & kFromStandby) != 0;
}

void fill_records(const std::vector<PhysicsTick>& records, v1::PhysicsTelemetry& wire) {
  for (const PhysicsTick& r : records) {
    wire.add_sequence(r.sequence);
    wire.add_stepped_at_ns(ns(r.stepped_at));
    wire.add_device_sequence(r.device_sequence);
    append(r.tool_position_world_m, *wire.mutable_tool_position_world_m());
    append(r.force_on_tool_newton, *wire.mutable_force_on_tool_newton());
    wire.add_stored_energy_joule(r.stored_energy_joule);
    wire.add_contact_count(r.contact_count);
    wire.add_compute_time_ns(r.compute_time.count());
    wire.add_penetration_m(r.penetration_m);
    wire.add_stiffness_newton_per_m(r.stiffness_newton_per_m);
  }
}
void check_records(const v1::PhysicsTelemetry& wire, Verdict& verdict) {
  const int rows = wire.sequence_size();
  check_times(wire.stepped_at_ns(), rows, verdict);
  check_length(wire.device_sequence(), rows, 1, verdict);
  check_finite(wire.tool_position_world_m(), rows, 3, verdict);
  check_finite(wire.force_on_tool_newton(), rows, 3, verdict);
  check_finite(wire.stored_energy_joule(), rows, 1, verdict);
  check_length(wire.contact_count(), rows, 1, verdict);
  check_times(wire.compute_time_ns(), rows, verdict);
  for (const Doubles* column : {&wire.penetration_m(), &wire.stiffness_newton_per_m()}) {
    if (!column->empty()) check_finite_or_nan(*column, rows, 1, verdict);
  }
}
void read_record(const v1::PhysicsTelemetry& wire, int i, PhysicsTick& r) {
  r.sequence = wire.sequence(i);
  r.stepped_at = time(wire.stepped_at_ns(i));
  r.device_sequence = wire.device_sequence(i);
  r.tool_position_world_m = vector(wire.tool_position_world_m(), i);
  r.force_on_tool_newton = vector(wire.force_on_tool_newton(), i);
  r.stored_energy_joule = wire.stored_energy_joule(i);
  r.contact_count = wire.contact_count(i);
  r.compute_time = Duration(wire.compute_time_ns(i));
  r.penetration_m = wire.penetration_m().empty() ? kNaN : wire.penetration_m(i);
  r.stiffness_newton_per_m =
      wire.stiffness_newton_per_m().empty() ? kNaN : wire.stiffness_newton_per_m(i);
}

int rows(const v1::DeviceTelemetry& wire) { return wire.sequence_size(); }
int rows(const v1::MofcTelemetry& wire) { return wire.device_sequence_size(); }
int rows(const v1::PhysicsTelemetry& wire) { return wire.sequence_size(); }

// --- batches ---------------------------------------------------------------------------------

/// Whole batches: header fields, counters, columns.
template <class Record, class Counters, class Wire>
struct BatchFormat {
  using Message = Wire;

  static void fill(const TelemetryBatch<Record, Counters>& m, Message& wire) {
    put(m.counters, *wire.mutable_counters());
    wire.set_records_lost(m.records_lost);
    wire.set_peers_refused(m.peers_refused);
    wire.set_node_version(m.node_version);
    wire.set_side(m.side);
    fill_records(m.records, wire);
  }

  static void check(const Message& wire, Verdict& verdict) {
    verdict.require(wire.has_counters());
    verdict.expect(wire.node_version().size() <= kMaxVersionBytes);
    verdict.expect(wire.side().size() <= kMaxSideBytes);
    check_counters(wire.counters(), verdict);
    check_records(wire, verdict);
  }

  static void read(const Message& wire, TelemetryBatch<Record, Counters>& m) {
    m.counters = counters(wire.counters());
    m.records_lost = wire.records_lost();
    m.peers_refused = wire.peers_refused();
    m.node_version = wire.node_version();
    m.side = wire.side();
    m.records.resize(static_cast<std::size_t>(rows(wire)));
    for (int i = 0; i < rows(wire); ++i) {
      read_record(wire, i, m.records[static_cast<std::size_t>(i)]);
    }
    if constexpr (std::is_same_v<Record, DeviceTick>) read_acted(wire, m.records);
  }
};

}  // namespace

template <>
struct WireFormat<DeviceBatch> : BatchFormat<DeviceTick, DeviceCounters, v1::DeviceTelemetry> {};
template class Codec<DeviceBatch>;

template <>
struct WireFormat<MofcBatch> : BatchFormat<MofcTick, MofcCounters, v1::MofcTelemetry> {};
template class Codec<MofcBatch>;

template <>
struct WireFormat<PhysicsBatch> : BatchFormat<PhysicsTick, PhysicsCounters, v1::PhysicsTelemetry> {
};
template class Codec<PhysicsBatch>;

}  // namespace palpate
