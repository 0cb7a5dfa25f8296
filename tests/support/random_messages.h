// SPDX-License-Identifier: Apache-2.0
// random_messages.h — random messages that satisfy every rule of proto/palpate/v1, and their
// equality, which is bitwise and includes NaN.
#pragma once

#include <algorithm>
#include <cstring>
#include <limits>

#include "common/core/messages.h"
#include "common/core/physics_term.h"
#include "common/core/random.h"
#include "common/core/scene_messages.h"
#include "common/telemetry/run_messages.h"
#include "common/telemetry/telemetry.h"
#include "deploy/lockstep/random_elastic.h"
#include "deploy/lockstep/random_surface.h"

namespace palpate::test {

using palpate::random_vector;
using palpate::randomise;

inline TimePoint random_time(Random& random) {
  return TimePoint(Duration(static_cast<std::int64_t>(random.below(1ULL << 60))));
}
inline Duration random_duration(Random& random) {
  return Duration(static_cast<std::int64_t>(random.below(1'000'000'001)));
}
inline Quaternion random_orientation(Random& random) {
  Quaternion q(random.normal(), random.normal(), random.normal(), random.normal());
  q.normalize();
  return q;
}
inline Header random_header(Random& random) {
  return {.session_id = random.bits() | 1,
          .sequence = random.bits(),
          .sampled_at = random_time(random)};
}
inline LinkCounters random_link_counters(Random& random) {
  return {.accepted = random.bits(),
          .skipped = random.bits(),
          .duplicates = random.bits(),
          .out_of_order = random.bits(),
          .rejected = random.bits(),
          .ahead = random.bits(),
          .sessions = random.bits()};
}
inline LoopCounters random_loop_counters(Random& random) {
  return {.ticks = random.bits(),
          .skipped_ticks = random.bits(),
          .worst_lateness = random_duration(random)};
}

inline void randomise(DeviceState& m, Random& random) {
  m = DeviceState{};
  m.header = random_header(random);
  m.hand_position_m = random_vector(random, 1.0);
  m.tool_position_world_m = random_vector(random, 1000.0);
  m.tool_orientation_world = random_orientation(random);
  m.buttons = static_cast<std::uint32_t>(random.bits());
  m.is_clutched = random.chance(0.5);
  m.applied_count = static_cast<std::uint32_t>(random.below(kMaxAppliedForces + 1));
  TimePoint from = random_time(random);
  for (std::uint32_t i = 0; i < m.applied_count; ++i) {
    const TimePoint until = from + random_duration(random);
    m.applied[i] = {.force_on_hand_newton = random_vector(random, 1000.0),
                    .from = from,
                    .until = until,
                    .hand_position_at_end_m = random_vector(random, 1.0),
                    .has_position_at_end = random.chance(0.5)};
    // without a reading the position is not valid and not sent
    if (!m.applied[i].has_position_at_end) m.applied[i].hand_position_at_end_m.setZero();
    from = until;
  }
  m.acting_force_on_hand_newton = random_vector(random, 1000.0);
  m.acting_until =
      m.header.sampled_at + Duration(static_cast<std::int64_t>(random.below(1'000'000'001)));
  m.monitor_energy_joule =
      random.chance(0.5) ? random.uniform(-1.0, 1.0) : std::numeric_limits<double>::infinity();
  if (random.chance(0.5)) return;
  m.wrist.emplace();
  m.wrist->pose.angle_rad = random_vector(random, 1000.0);
  for (int joint = 0; joint < 3; ++joint) {
    m.wrist->pose.axes.col(joint) = random_vector(random, 1.0).normalized();
  }
  m.wrist->acting_torque_newton_m = random_vector(random, 100.0);
  for (std::uint32_t i = 0; i < m.applied_count; ++i) {
    m.applied[i].wrist_torque_newton_m = random_vector(random, 100.0);
    if (m.applied[i].has_position_at_end) {
      m.applied[i].wrist_angle_at_end_rad = random_vector(random, 1000.0);
    }
  }
}

inline void randomise(ForceCommand& m, Random& random) {
  m.header = random_header(random);
  m.answers_session_id = random.bits() | 1;
  m.answers_sequence = random.bits();
  m.answers_sampled_at = random_time(random);
  m.force_on_hand_newton = random_vector(random, 1000.0);
  m.valid_for = random_duration(random);
  m.begins_within = random_duration(random);
  m.counted_energy_joule = random.chance(0.5) ? random.uniform(-1.0, 1.0) : kNaN;
  m.wrist_torque_newton_m =
      random.chance(0.5) ? random_vector(random, 100.0) : Vector3(Vector3::Zero());
}

inline Wave random_wave(Random& random) {
  if (random.chance(0.5)) return {};
  return {.stream = random.bits(),
          .sum = random_vector(random, 1e6),
          .energy_joule = random.uniform(0.0, 1e9),
          .impedance_newton_s_per_m = random.uniform(1e-3, 1e4)};
}

inline void randomise(ToolMotion& m, Random& random) {
  m.header = random_header(random);
  m.device_session_id = random.bits() | 1;
  m.device_sequence = random.bits();
  m.device_sampled_at = random_time(random);
  m.tool_position_world_m = random_vector(random, 1000.0);
  m.tool_orientation_world = random_orientation(random);
  m.tool_velocity_world_m_per_s = random_vector(random, 1000.0);
  m.buttons = static_cast<std::uint32_t>(random.bits());
  m.receipts = {
      .store_id = random.bits() | 1,
      .newest = random.bits(),
      .received = random.bits(),
      .loop_age = random_duration(random),
      .tile_slots = 1 + static_cast<std::uint32_t>(random.below(kTileSlots)),
      .tiles_per_message = 1 + static_cast<std::uint32_t>(random.below(kMaxTilesPerMessage))};
  m.elastic_receipts.reset();
  if (random.chance(0.5)) m.elastic_receipts = {.newest = random.bits(), .received = random.bits()};
  m.physics_term = random.below(kMaxPhysicsTerm + 1);
  m.scene_time.reset();
  if (random.chance(0.5)) m.scene_time = random_time(random);
  m.wave = random_wave(random);
  m.grip.reset();
  if (random.chance(0.5)) {
    m.grip = {.physics_session_id = random.bits() | 1,
              .number = 1 + static_cast<std::uint32_t>(random.below(1000)),
              .slip_m = random_vector(random, 1.0),
              .has_let_go = random.chance(0.5)};
  }
  m.wants_torque = random.chance(0.5);
  m.tool_angular_velocity_world_rad_per_s =
      m.wants_torque ? random_vector(random, 1000.0) : Vector3(Vector3::Zero());
}

inline Matrix3 random_matrix(Random& random, double limit) {
  Matrix3 m;
  for (int i = 0; i < 9; ++i) m(i / 3, i % 3) = random.uniform(-limit, limit);
  return m;
}

/// A contact with every field in range.
inline void randomise(Contact& c, Random& random) {
  c = {.tissue = static_cast<std::uint32_t>(random.bits()),
       .penetration_m = random.uniform(1e-9, 1.0),
       .normal_world = random_vector(random, 1.0).normalized(),
       .curvature_per_m = random_matrix(random, 100.0),
       .surface_velocity_world_m_per_s = random_vector(random, 10.0),
       .elastic_force_on_tool_newton = random_vector(random, 1e4),
       .d_force_d_position = random_matrix(random, 1e6),
       .d_force_d_velocity = random_matrix(random, 1e4),
       .stiffening_newton_per_m2 = random.uniform(-1e9, 1e9),
       .stiffening_newton_per_m3 = random.uniform(0.0, 1e9),
       .hunt_crossley_exponent = random.uniform(1.0, 5.0),
       .hunt_crossley_depth_m = random.uniform(1e-4, 0.1),
       .hunt_crossley_stiffness_newton_per_m = random.uniform(0.0, 1e6),
       .hunt_crossley_damping_newton_s_per_m = random.uniform(0.0, 1e4),
       .friction_coefficient = random.uniform(0.01, 2.0),
       .friction_stiffness_newton_per_m = random.uniform(0.0, 1e6),
       .stretch_m = random_vector(random, 1.0),
       .stored_energy_joule = random.uniform(0.0, 1e3),
       .is_adhesive = random.chance(0.5),
       .trust_radius_m = random.uniform(1e-4, 1000.0),
       .force_on_tool_newton = random_vector(random, 1e4),
       .is_shaft = random.chance(0.5),
       .is_behind = random.chance(0.5),
       .is_punctured = random.chance(0.5),
       .held_m = random_vector(random, 1.0),
       .relaxed_m = random.uniform(-1.0, 1.0)};
  if (random.chance(0.5)) c.arm_m = random_vector(random, 1000.0);
}

/// The jaws hold it.
inline Contact random_grip(Random& random) {
  const Matrix3 some = random_matrix(random, 1.0);
  const Matrix3 spring = random.uniform(1.0, 1e4) * (some * some.transpose() + Matrix3::Identity());
  return {.tissue = static_cast<std::uint32_t>(random.bits()),
          .penetration_m = random.uniform(1e-6, 1.0),
          .elastic_force_on_tool_newton = random_vector(random, 1e4),
          .d_force_d_position = -0.5 * (spring + spring.transpose()),
          .stored_energy_joule = random.uniform(0.0, 1e3),
          .is_adhesive = true,
          .trust_radius_m = random.uniform(1e-4, 1000.0),
          .force_on_tool_newton = random_vector(random, 1e4),
          .grip = {.number = 1 + static_cast<std::uint32_t>(random.below(1000)),
                   .buttons = static_cast<std::uint32_t>(random.bits()) | 1U,
                   .slip_newton = random.uniform(1e-3, 1e4),
                   .tear_newton = random.uniform(1e-3, 1e4),
                   .reach_m = random.uniform(1e-3, 1.0),
                   .slip_m = random_vector(random, 1.0)}};
}

/// A needle or a blade holds it.
inline Contact random_needle(Random& random) {
  Contact contact = random_grip(random);
  contact.grip.needle = {
      .inward_world = (random_vector(random, 1.0) + 2.0 * Vector3::UnitX()).normalized(),
      .cutting_newton = random.uniform(0.0, 1e4),
      .spreading_newton = random.uniform(0.0, 1e4),
      .friction_newton_per_m = random.uniform(0.0, 1e6),
      .deepest_m = random.uniform(0.0, 1e3)};
  if (random.chance(0.5)) {
    NeedleLaw& blade = contact.grip.needle;
    blade.edge_world = blade.inward_world.cross(random_vector(random, 1.0)).normalized();
    blade.friction_newton = random.uniform(0.0, 1e4);
  }
  return contact;
}

inline void randomise(Interaction& m, Random& random) {
  m = Interaction{};
  m.header = random_header(random);
  m.device_session_id = random.bits() | 1;
  m.device_sequence = random.bits();
  m.device_sampled_at = random_time(random);
  m.tool_position_world_m = random_vector(random, 1000.0);
  m.tool_orientation_world = random_orientation(random);
  m.force_on_tool_newton = random_vector(random, 1e4);
  m.stored_energy_joule = random.uniform(0.0, 1e3);
  m.contact_count = static_cast<std::uint32_t>(random.below(2 * kMaxContacts));  // may exceed
  // contacts that touch are listed as far as there is room, then near ones
  const auto touching = std::min<std::uint32_t>(m.contact_count, kMaxContacts);
  m.listed_count = touching + static_cast<std::uint32_t>(random.below(kMaxContacts - touching + 1));
  for (std::uint32_t i = 0; i < m.listed_count; ++i) {
    randomise(m.contacts[i], random);
    if (i >= touching) m.contacts[i].penetration_m *= -1.0;
  }
  randomise(m.surface, random);
  // with few contacts and without tiles there is room for an elastic body
  if (m.listed_count <= kMaxContactsWithElastic && m.contact_count <= kMaxContactsWithElastic) {
    m.surface.has_description = false;
    m.surface.number = m.surface.tile_count = 0;
    randomise(m.elastic, random);
  }
  m.physics_term = random.below(kMaxPhysicsTerm + 1);
  m.scene_ahead = random_time(random).time_since_epoch();
  m.steps = random.bits();
  if (random.chance(0.5)) m.torque_on_tool_newton_m = random_vector(random, 1e4);
  if (touching > 0 && random.chance(0.2)) {
    m.contacts[0] = random.chance(0.5) ? random_needle(random) : random_grip(random);
  }
  m.wave = random_wave(random);
}

inline void randomise(DeviceTick& r, Random& random) {
  r.sequence = random.bits();
  r.sampled_at = random_time(random);
  r.switched_at = random_time(random);
  r.lateness = random_duration(random);
  r.reply_time = random_duration(random);
  r.measured_hand_position_m = random_vector(random, 1.0);
  r.measured_tool_position_world_m = random_vector(random, 1.0);
  r.measured_tool_orientation_world = random_orientation(random);
  r.force_on_hand_newton = random_vector(random, 10.0);
  r.acted_count = static_cast<std::uint32_t>(random.below(kMaxActedForces + 1));
  TimePoint from = random_time(random);
  for (std::uint32_t i = 0; i < r.acted_count; ++i) {
    r.acted[i] = {.force_on_hand_newton = random_vector(random, 10.0),
                  .from = from,
                  .until = random_time(random),
                  .has_position_at_end = random.chance(0.5)};
    if (r.acted[i].has_position_at_end) {
      r.acted[i].hand_position_at_end_m =
          random.chance(0.5) ? r.measured_hand_position_m : random_vector(random, 1.0);
    }
    from = r.acted[i].until;
  }
  r.guard = static_cast<GuardState>(random.below(6));
  r.is_answered = random.chance(0.5);
  r.is_peak_limited = random.chance(0.5);
  r.buttons = static_cast<std::uint32_t>(random.bits());
  r.is_clutched = random.chance(0.5);
  r.is_monitor_reduced = random.chance(0.5);
  if (random.chance(0.5)) {  // with a wrist
    r.wrist_torque_newton_m = random_vector(random, 1.0);
    r.true_wrist_angle_rad = random_vector(random, 3.0);
    r.true_wrist_velocity_rad_per_s = random_vector(random, 6.0);
  }
  if (random.chance(0.5)) {  // a simulated device: otherwise NaN
    r.true_tool_position_world_m = random_vector(random, 1.0);
    r.true_tool_velocity_world_m_per_s = random_vector(random, 1.0);
    r.true_energy_joule = random.uniform(-1.0, 1.0);
    r.minimum_true_energy_joule = random.uniform(-1.0, 1.0);
  }
}

inline void randomise(MofcTick& r, Random& random) {
  r.device_session_id = random.bits();
  r.device_sequence = random.bits();
  r.device_sampled_at = random_time(random);
  r.requested_force_on_hand_newton = random_vector(random, 10.0);
  r.commanded_force_on_hand_newton = random_vector(random, 10.0);
  if (random.chance(0.5)) {  // a controller: otherwise NaN
    r.f_max_newton = random_vector(random, 10.0);
    r.ledger_energy_joule = random.uniform(-1.0, 1.0);
  }
  r.force_age = random_duration(random);
  r.state = static_cast<MofcState>(random.below(5));
  r.is_clamped = random.chance(0.5);
  r.is_from_standby = random.chance(0.5);
  r.is_in_contact = random.chance(0.5);
  r.grip = static_cast<GripState>(random.below(7));
  if (random.chance(0.5)) r.requested_wrist_torque_newton_m = random_vector(random, 1.0);
}

inline void randomise(PhysicsTick& r, Random& random) {
  r.sequence = random.bits();
  r.stepped_at = random_time(random);
  r.device_sequence = random.bits();
  r.tool_position_world_m = random_vector(random, 1.0);
  r.force_on_tool_newton = random_vector(random, 10.0);
  r.stored_energy_joule = random.uniform(0.0, 1.0);
  r.contact_count = static_cast<std::uint32_t>(random.bits());
  r.compute_time = random_duration(random);
  r.penetration_m = random.chance(0.9) ? random.uniform(0.0, 0.1) : kNaN;
  r.stiffness_newton_per_m = random.chance(0.9) ? random.uniform(-10.0, 1e6) : kNaN;
}

inline void randomise(DeviceCounters& c, Random& random) {
  c.loop = random_loop_counters(random);
  c.force_command = random_link_counters(random);
  c.answered_ticks = random.bits();
  c.longest_skip_ticks = random.bits();
  c.leased_ticks = random.bits();
  c.fallback_ticks = random.bits();
  c.limp_ticks = random.bits();
  c.start_up_ticks = random.bits();
  c.peak_limited_ticks = random.bits();
  c.fault_ticks = random.bits();
  c.device_faults = random.bits();
  c.fault_resets = random.bits();
  c.last_fault = static_cast<FaultReason>(random.below(5));
  c.non_finite_commands = random.bits();
  c.late_switches = random.bits();
  c.is_monitor_off = random.chance(0.5);
  c.monitor_reductions = random.bits();
  c.ledger_excesses = random.bits();
  c.too_fast_readings = random.bits();
  c.coarse_readings = random.bits();
  c.outside_readings = random.bits();
  c.repeated_readings = random.bits();
  c.checked_friction_ratio = random.uniform(0.0, 1.0);
  c.has_no_motor_watchdog = random.chance(0.5);
  c.accepts_no_motor_watchdog = random.chance(0.5);
  c.checked_motor_gain = random.uniform();
  c.frozen_ticks = random.below(1000);
  c.dead_man_ticks = random.bits();
  c.uncalibrated_ticks = random.bits();
  c.unacknowledged_ticks = random.bits();
  c.checking_ticks = random.bits();
  c.phase = static_cast<DevicePhase>(random.below(7));
  c.page_acknowledgements = random.bits();
  c.page_acknowledgements_refused = random.bits();
  c.is_release_unconfirmed = random.chance(0.5);
  c.max_force_newton = random.uniform(0.0, 10.0);
  c.largest_jump_newton = random.uniform(0.0, 10.0);
  c.minimum_true_energy_joule = random.chance(0.5) ? random.uniform(-1.0, 1.0) : kNaN;
}

inline void randomise(MofcCounters& c, Random& random) {
  c.device_state = random_link_counters(random);
  c.interaction = random_link_counters(random);
  c.ticks = random.bits();
  c.contact_ticks = random.bits();
  c.clamped_ticks = random.bits();
  c.debt_ticks = random.bits();
  c.too_fast_ticks = random.bits();
  c.stale_ticks = random.bits();
  c.late_physics_ticks = random.bits();
  c.ledger_resets = random.bits();
  c.disturbed_contact_ticks = random.bits();
  c.disturbed_clamped_ticks = random.bits();
  c.motions_dropped = random.bits();
  c.motions_suppressed = random.bits();
  c.transparency_integral_ns = random.uniform(0.0, 1e6);
  c.transparency_time_ns = random.bits();
  c.standby_interaction = random_link_counters(random);
  c.physics_term = random.bits();
  c.standby_ticks = random.bits();
  c.physics_switches = random.bits();
  c.grips = random.bits();
  c.grips_torn = random.bits();
  c.grips_slipped = random.bits();
  c.punctures = random.bits();
}

inline void randomise(PhysicsCounters& c, Random& random) {
  c.loop = random_loop_counters(random);
  c.tool_motion = random_link_counters(random);
  c.contact_steps = random.bits();
  c.tissues_skipped = random.bits();
  c.tissues_visited = random.bits();
  c.octree_cells_visited = random.bits();
  c.octree_last_cell_hits = random.bits();
  c.tissues_asleep = random.bits();
  c.surfaces_shared = random.bits();
  c.interactions_suppressed = random.bits();
  c.mesh_frames = random.bits();
  c.meshes_skipped = random.bits();
  c.tissue_changes = random.bits();
  c.tissue_changes_refused = random.bits();
  c.elastic_solves = random.bits();
  c.elastic_solves_skipped = random.bits();
  c.elastic_solves_late = random.bits();
  c.elastic_solves_failed = random.bits();
  c.elastic_steps_skipped = random.bits();
  c.elastic_residual_ratio = random.uniform(0.0, 1.0);
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  c.elastic_error_newton = random.chance(0.3) ? unknown : random.uniform(0.0, 10.0);
  c.elastic_bound_newton = random.chance(0.3) ? unknown : random.uniform(0.0, 10.0);
  c.elastic_bound_violations = random.bits();
  c.elastic_bounds_checked = random.bits();
  c.elastic_contact_steps = random.bits();
  c.elastic_unknown_bound_steps = random.bits();
  c.is_started_in_contact = random.chance(0.5);
  c.elastic_tips_appeared = random.bits();
  c.elastic_points_held = static_cast<std::uint32_t>(random.bits());
  c.elastic_solves_repaired = random.bits();
  c.elastic_energised_steps = random.bits();
  c.elastic_bodies_remade = random.bits();
  c.elastic_elements_removed = random.bits();
  c.elastic_elements_loose = random.bits();
  c.elastic_bodies_refused = random.bits();
  c.elastic_bodies_restored = random.bits();
  c.elastic_attachments_torn = random.bits();
  c.elastic_torn_joule = random.uniform(0.0, 1.0);
  c.elastic_faces_cut = random.bits();
  c.elastic_cut_joule = random.uniform(0.0, 1.0);
  c.worst_compute_time = random_duration(random);
}

template <class Record, class Counters>
void randomise(TelemetryBatch<Record, Counters>& m, Random& random) {
  m.header = random_header(random);
  randomise(m.counters, random);
  m.records_lost = random.bits();
  m.peers_refused = random.bits();
  m.node_version = std::to_string(random.bits());
  m.side = random.below(2) == 0 ? "" : std::to_string(random.bits());
  m.records.assign(random.below(50), Record{});
  for (Record& record : m.records) randomise(record, random);
}

inline std::vector<float> random_floats(Random& random, std::size_t count, double low,
                                        double high) {
  std::vector<float> numbers(count);
  for (float& x : numbers) x = static_cast<float>(random.uniform(low, high));
  return numbers;
}
inline std::string random_text(Random& random) {
  std::string text(random.below(60), ' ');
  for (char& c : text) c = static_cast<char>('!' + random.below(90));
  return text;
}

inline void randomise(TissueSurface& t, Random& random) {
  t.name = random_text(random);
  t.shape = static_cast<TissueShape>(random.below(8));
  const std::size_t vertices = random.below(20);
  t.mesh.vertices_m = random_floats(random, 3 * vertices, -1000.0, 1000.0);
  t.mesh.triangles.assign(vertices == 0 ? 0 : 3 * random.below(30), 0);
  for (std::uint32_t& index : t.mesh.triangles) {
    index = static_cast<std::uint32_t>(random.below(vertices));
  }
  t.vertex_stiffness_newton_per_m.clear();
  if (random.chance(0.5)) {
    t.vertex_stiffness_newton_per_m = random_floats(random, vertices, 0.0, 1e4);
  }
  t.stiffness_newton_per_m = random.uniform(0.0, 1e4);
  t.damping_newton_s_per_m = random.uniform(0.0, 1e3);
  t.is_restorable = random.chance(0.5);
}

inline void randomise(SceneState& m, Random& random) {
  m = SceneState{};
  m.header = random_header(random);
  m.revision = random.bits() | 1;
  m.session_name = random_text(random);
  m.session_text = random_text(random);
  m.controller = random_text(random);
  m.device_rate_hz = random.uniform(1.0, 1e4);
  m.physics_rate_hz = random.uniform(1.0, 1e4);
  m.peak_force_newton = random.uniform(0.1, 100.0);
  m.tip_radius_m = random.uniform(0.0, 0.1);
  m.shaft_length_m = random.uniform(0.0, 0.5);
  m.shaft_radius_m = random.uniform(0.0, 0.1);
  m.workspace_scale_ratio = random.uniform(0.1, 10.0);
  m.accepts_changes = random.chance(0.5);
  if (random.chance(0.5)) {
    m.reach = ReachBox{.center_m = random_vector(random, 1.0),
                       .half_extent_m = Vector3::Constant(random.uniform(0.01, 1.0))};
  }
  m.tissues.resize(random.below(5));
  for (TissueSurface& tissue : m.tissues) randomise(tissue, random);
  if (random.chance(0.5)) {
    m.pointer = PointerConfig{.center_m = random_vector(random, 1.0),
                              .reach_m = random.uniform(0.01, 1.0),
                              .speed_m_per_s = random.uniform(0.01, 1.0),
                              .holder_timeout = random_duration(random) + Duration(1)};
  }
}

inline void randomise(MeshFrame& m, Random& random) {
  m.header = random_header(random);
  m.scene_revision = random.bits() | 1;
  m.tissue = static_cast<std::uint32_t>(random.bits());
  m.first_vertex = static_cast<std::uint32_t>(random.bits());
  m.vertices_m = random_floats(random, 3 * random.below(100), -1000.0, 1000.0);
  m.device_sequence = random.bits();
  m.displacement_world_m = random_vector(random, 1.0);
  if (random.chance(0.5)) {
    m.vertex_strain = random_floats(random, m.vertices_m.size() / 3, 0.0, 2.0);
  }
}

inline void randomise(HandTarget& m, Random& random) {
  m.header = random_header(random);
  m.holder_id = random.bits() | 1;
  m.hand_position_m = random_vector(random, 1000.0);
  m.is_released = random.chance(0.5);
  m.buttons = static_cast<std::uint32_t>(random.bits());
}

inline std::string random_line(Random& random, std::size_t most) {
  std::string line(random.below(most + 1), ' ');
  for (char& letter : line) letter = static_cast<char>('a' + random.below(26));
  return line;
}
inline void randomise(RunState& m, Random& random) {
  m = {};
  m.header = random_header(random);
  m.markers.resize(random.below(RunState::kMostMarkers + 1));
  for (Marker& marker : m.markers) {
    marker = {.at_ns = random.bits(),
              .text = random_line(random, Marker::kMostTextBytes),
              .origin = random_line(random, Marker::kMostOriginBytes),
              .kind = static_cast<Marker::Kind>(random.below(3)),
              .device_session_id = random.bits(),
              .device_sequence = random.bits()};
  }
  if (random.chance(0.5)) return;
  m.replay = {.file = random_line(random, 20),
              .position_s = random.uniform(0.0, 10.0),
              .length_s = random.uniform(0.0, 10.0),
              .speed_ratio = random.uniform(0.1, 10.0),
              .is_paused = random.chance(0.5),
              .begin_ns = random.bits(),
              .runs = random.bits()};
}
inline void randomise(RunRequest& m, Random& random) {
  m = {};
  m.header = random_header(random);
  if (random.chance(0.5)) m.marker = random_line(random, Marker::kMostTextBytes);
  if (random.chance(0.5)) m.seek_s = random.uniform(0.0, RunRequest::kLongest_s);
  if (random.chance(0.5)) m.is_paused = random.chance(0.5);
  if (random.chance(0.5)) m.speed_ratio = random.uniform(0.1, RunRequest::kFastest_ratio);
  if (random.chance(0.5)) m.is_recording = random.chance(0.5);
  m.marker_kind = static_cast<Marker::Kind>(random.below(3));
}
inline void randomise(TissueChange& m, Random& random) {
  m.header = random_header(random);
  m.tissue = static_cast<std::uint32_t>(random.bits());
  m.restores = random.chance(0.5);
  m.stiffness_newton_per_m = m.restores ? 0.0 : random.uniform(1.0, 1e6);
  m.damping_newton_s_per_m = m.restores ? 0.0 : random.uniform(0.0, 1e4);
}

inline void randomise(Acknowledgement& m, Random& random) {
  constexpr std::array kPhases = {DevicePhase::kConnected, DevicePhase::kCalibrated,
                                  DevicePhase::kFaulted};
  m.header = random_header(random);
  m.device_session_id = random.bits() | 1;
  m.seen = {.phase = kPhases[random.below(kPhases.size())], .device_faults = random.bits()};
}

template <class T>
T random_message(Random& random) {
  T message;
  randomise(message, random);
  return message;
}

// --- equality ---------------------------------------------------------------------------------

inline bool same(double a, double b) { return std::memcmp(&a, &b, sizeof(a)) == 0; }
inline bool same(const Vector3& a, const Vector3& b) {
  return same(a.x(), b.x()) && same(a.y(), b.y()) && same(a.z(), b.z());
}
inline bool same(const Quaternion& a, const Quaternion& b) {
  return same(a.w(), b.w()) && same(a.x(), b.x()) && same(a.y(), b.y()) && same(a.z(), b.z());
}
inline bool same(const Header& a, const Header& b) {
  return a.session_id == b.session_id && a.sequence == b.sequence && a.sampled_at == b.sampled_at;
}
inline bool same(const LinkCounters& a, const LinkCounters& b) {
  return a.accepted == b.accepted && a.skipped == b.skipped && a.duplicates == b.duplicates &&
         a.out_of_order == b.out_of_order && a.rejected == b.rejected && a.ahead == b.ahead &&
         a.sessions == b.sessions;
}
inline bool same(const LoopCounters& a, const LoopCounters& b) {
  return a.ticks == b.ticks && a.skipped_ticks == b.skipped_ticks &&
         a.worst_lateness == b.worst_lateness;
}
inline bool same(const AppliedForce& a, const AppliedForce& b) {
  return same(a.force_on_hand_newton, b.force_on_hand_newton) && a.from == b.from &&
         a.until == b.until && same(a.hand_position_at_end_m, b.hand_position_at_end_m) &&
         a.has_position_at_end == b.has_position_at_end &&
         same(a.wrist_torque_newton_m, b.wrist_torque_newton_m) &&
         same(a.wrist_angle_at_end_rad, b.wrist_angle_at_end_rad);
}
inline bool same(const WristState& a, const WristState& b) {
  return same(a.pose.angle_rad, b.pose.angle_rad) && a.pose.axes == b.pose.axes &&
         same(a.acting_torque_newton_m, b.acting_torque_newton_m);
}
inline bool same(const DeviceState& a, const DeviceState& b) {
  return same(a.header, b.header) && same(a.hand_position_m, b.hand_position_m) &&
         same(a.tool_position_world_m, b.tool_position_world_m) &&
         same(a.tool_orientation_world, b.tool_orientation_world) && a.buttons == b.buttons &&
         a.is_clutched == b.is_clutched && a.applied_count == b.applied_count &&
         same(a.acting_force_on_hand_newton, b.acting_force_on_hand_newton) &&
         a.acting_until == b.acting_until && a.monitor_energy_joule == b.monitor_energy_joule &&
         a.wrist.has_value() == b.wrist.has_value() && (!a.wrist || same(*a.wrist, *b.wrist)) &&
         std::equal(a.applied.begin(), a.applied.begin() + a.applied_count, b.applied.begin(),
                    [](const auto& x, const auto& y) { return same(x, y); });
}
inline bool same(const ForceCommand& a, const ForceCommand& b) {
  return same(a.header, b.header) && a.answers_session_id == b.answers_session_id &&
         a.answers_sequence == b.answers_sequence && a.answers_sampled_at == b.answers_sampled_at &&
         same(a.force_on_hand_newton, b.force_on_hand_newton) && a.valid_for == b.valid_for &&
         a.begins_within == b.begins_within &&
         same(a.counted_energy_joule, b.counted_energy_joule) &&
         same(a.wrist_torque_newton_m, b.wrist_torque_newton_m);
}
inline bool same(const Wave& a, const Wave& b) {
  return a.stream == b.stream && same(a.sum, b.sum) && a.energy_joule == b.energy_joule &&
         a.impedance_newton_s_per_m == b.impedance_newton_s_per_m;
}
inline bool same(const ToolMotion& a, const ToolMotion& b) {
  return same(a.header, b.header) && a.device_session_id == b.device_session_id &&
         a.device_sequence == b.device_sequence && a.device_sampled_at == b.device_sampled_at &&
         same(a.tool_position_world_m, b.tool_position_world_m) &&
         same(a.tool_orientation_world, b.tool_orientation_world) &&
         same(a.tool_velocity_world_m_per_s, b.tool_velocity_world_m_per_s) &&
         a.buttons == b.buttons && a.receipts.store_id == b.receipts.store_id &&
         a.receipts.newest == b.receipts.newest && a.receipts.received == b.receipts.received &&
         a.receipts.loop_age == b.receipts.loop_age &&
         a.receipts.tile_slots == b.receipts.tile_slots &&
         a.receipts.tiles_per_message == b.receipts.tiles_per_message &&
         a.physics_term == b.physics_term && a.scene_time == b.scene_time && same(a.wave, b.wave) &&
         a.wants_torque == b.wants_torque &&
         same(a.tool_angular_velocity_world_rad_per_s, b.tool_angular_velocity_world_rad_per_s) &&
         a.grip.has_value() == b.grip.has_value() &&
         (!a.grip || (a.grip->physics_session_id == b.grip->physics_session_id &&
                      a.grip->number == b.grip->number && same(a.grip->slip_m, b.grip->slip_m) &&
                      a.grip->has_let_go == b.grip->has_let_go));
}
inline bool same(const HalfSpaceGeometry& a, const HalfSpaceGeometry& b) {
  return same(a.point_m, b.point_m) && same(a.normal, b.normal);
}
inline bool same(const SphereGeometry& a, const SphereGeometry& b) {
  return same(a.center_m, b.center_m) && a.radius_m == b.radius_m;
}
inline bool same(const BoxGeometry& a, const BoxGeometry& b) {
  return same(a.center_m, b.center_m) && same(a.size_m, b.size_m);
}
inline bool same(const CapsuleGeometry& a, const CapsuleGeometry& b) {
  return same(a.from_m, b.from_m) && same(a.to_m, b.to_m) && a.radius_m == b.radius_m;
}
inline bool same(const TiledGeometry& a, const TiledGeometry& b) {
  return a.is_sheet == b.is_sheet && a.is_cloud == b.is_cloud;
}
inline bool same(const InclusionConfig& a, const InclusionConfig& b) {
  return same(a.center_m, b.center_m) && a.radius_m == b.radius_m &&
         a.transition_m == b.transition_m && a.stiffness_newton_per_m == b.stiffness_newton_per_m &&
         a.damping_newton_s_per_m == b.damping_newton_s_per_m;
}
inline bool same(const KelvinVoigtMaterial& a, const KelvinVoigtMaterial& b) {
  return a.stiffness_newton_per_m == b.stiffness_newton_per_m &&
         a.damping_newton_s_per_m == b.damping_newton_s_per_m &&
         a.is_damping_isotropic == b.is_damping_isotropic && a.is_adhesive == b.is_adhesive &&
         a.stiffening_newton_per_m3 == b.stiffening_newton_per_m3 &&
         a.relaxing_stiffness_newton_per_m == b.relaxing_stiffness_newton_per_m &&
         a.relaxation_time_s == b.relaxation_time_s &&
         a.friction_coefficient == b.friction_coefficient &&
         a.friction_stiffness_newton_per_m == b.friction_stiffness_newton_per_m &&
         a.puncture_newton == b.puncture_newton && a.cutting_newton == b.cutting_newton;
}
inline bool same(const TissueDescription& a, const TissueDescription& b) {
  return a.slot == b.slot && a.version == b.version && a.tissue == b.tissue &&
         a.geometry.index() == b.geometry.index() &&
         std::visit(
             [&](const auto& shape) {
               return same(shape, std::get<std::decay_t<decltype(shape)>>(b.geometry));
             },
             a.geometry) &&
         same(a.material, b.material) && a.inclusion_count == b.inclusion_count &&
         std::equal(a.inclusions.begin(), a.inclusions.begin() + a.inclusion_count,
                    b.inclusions.begin(),
                    [](const auto& x, const auto& y) { return same(x, y); }) &&
         same(a.motion.amplitude_m, b.motion.amplitude_m) &&
         a.motion.frequency_hz == b.motion.frequency_hz &&
         a.motion.phase_rad == b.motion.phase_rad && a.tool.tip_radius_m == b.tool.tip_radius_m &&
         a.tool.shaft_length_m == b.tool.shaft_length_m &&
         a.tool.shaft_radius_m == b.tool.shaft_radius_m;
}
inline bool same(const SurfaceTile& a, const SurfaceTile& b) {
  return a.slot == b.slot && a.described_slot == b.described_slot && a.version == b.version &&
         same(a.origin_m, b.origin_m) && a.step_m == b.step_m && a.vertex_count == b.vertex_count &&
         a.facet_count == b.facet_count && a.point_count == b.point_count &&
         std::equal(a.points.begin(), a.points.begin() + a.point_count, b.points.begin()) &&
         std::equal(a.vertices.begin(), a.vertices.begin() + a.vertex_count, b.vertices.begin()) &&
         std::equal(a.facets.begin(), a.facets.begin() + a.facet_count, b.facets.begin());
}
inline bool same(const SurfaceNews& a, const SurfaceNews& b) {
  if (a.store_id != b.store_id) return false;
  if (a.store_id == 0) return true;  // none
  return a.number == b.number && a.has_description == b.has_description &&
         (!a.has_description || same(a.description, b.description)) &&
         a.tile_count == b.tile_count && a.coverage_count == b.coverage_count &&
         a.pending_count == b.pending_count &&
         std::equal(a.tiles.begin(), a.tiles.begin() + a.tile_count, b.tiles.begin(),
                    [](const auto& x, const auto& y) { return same(x, y); }) &&
         std::equal(
             a.coverages.begin(), a.coverages.begin() + a.coverage_count, b.coverages.begin(),
             [](const auto& x, const auto& y) {
               return x.described_slot == y.described_slot &&
                      x.description_version == y.description_version &&
                      same(x.region.from_m, y.region.from_m) &&
                      same(x.region.to_m, y.region.to_m) && x.region.radius_m == y.region.radius_m;
             }) &&
         std::equal(a.pending.begin(), a.pending.begin() + a.pending_count, b.pending.begin(),
                    [](const auto& x, const auto& y) {
                      return x.slot == y.slot && x.described_slot == y.described_slot &&
                             x.version == y.version && x.center_m == y.center_m &&
                             x.radius_m == y.radius_m;
                    });
}
inline bool same(const NeedleLaw& a, const NeedleLaw& b) {
  return same(a.inward_world, b.inward_world) && a.cutting_newton == b.cutting_newton &&
         a.spreading_newton == b.spreading_newton &&
         a.friction_newton_per_m == b.friction_newton_per_m && a.deepest_m == b.deepest_m &&
         same(a.edge_world, b.edge_world) && a.friction_newton == b.friction_newton;
}
inline bool same(const Contact& a, const Contact& b) {
  return a.tissue == b.tissue && same(a.arm_m, b.arm_m) && same(a.penetration_m, b.penetration_m) &&
         same(a.normal_world, b.normal_world) &&
         same(a.force_on_tool_newton, b.force_on_tool_newton) &&
         a.curvature_per_m == b.curvature_per_m &&
         same(a.surface_velocity_world_m_per_s, b.surface_velocity_world_m_per_s) &&
         same(a.elastic_force_on_tool_newton, b.elastic_force_on_tool_newton) &&
         a.d_force_d_position == b.d_force_d_position &&
         a.d_force_d_velocity == b.d_force_d_velocity &&
         a.stiffening_newton_per_m2 == b.stiffening_newton_per_m2 &&
         a.stiffening_newton_per_m3 == b.stiffening_newton_per_m3 &&
         a.hunt_crossley_exponent == b.hunt_crossley_exponent &&
         a.hunt_crossley_depth_m == b.hunt_crossley_depth_m &&
         a.hunt_crossley_stiffness_newton_per_m == b.hunt_crossley_stiffness_newton_per_m &&
         a.hunt_crossley_damping_newton_s_per_m == b.hunt_crossley_damping_newton_s_per_m &&
         a.stored_energy_joule == b.stored_energy_joule && a.is_adhesive == b.is_adhesive &&
         a.trust_radius_m == b.trust_radius_m && a.friction_coefficient == b.friction_coefficient &&
         a.friction_stiffness_newton_per_m == b.friction_stiffness_newton_per_m &&
         same(a.stretch_m, b.stretch_m) && a.is_shaft == b.is_shaft && a.is_behind == b.is_behind &&
         a.is_punctured == b.is_punctured && same(a.held_m, b.held_m) &&
         same(a.relaxed_m, b.relaxed_m) && a.grip.number == b.grip.number &&
         a.grip.buttons == b.grip.buttons && same(a.grip.slip_newton, b.grip.slip_newton) &&
         same(a.grip.tear_newton, b.grip.tear_newton) && same(a.grip.reach_m, b.grip.reach_m) &&
         same(a.grip.slip_m, b.grip.slip_m) && same(a.grip.needle, b.grip.needle);
}
inline bool same(const ElasticNews& a, const ElasticNews& b) {
  if (a.store_id != b.store_id || a.number != b.number) return false;
  if (a.store_id == 0) return true;
  if (a.has_point != b.has_point) return false;
  if (a.has_point) {
    const ElasticPoint& p = a.point;
    const ElasticPoint& q = b.point;
    if (p.has_other != q.has_other) return false;
    for (std::size_t i = 0; i < kElasticSlots; ++i) {
      if (p.has_other[i] && p.others[i] != q.others[i]) return false;
    }
    return p.patch == q.patch && p.slot == q.slot && p.version == q.version &&
           same(p.rest_m, q.rest_m) && p.rigid_give_m_per_newton == q.rigid_give_m_per_newton &&
           p.is_held == q.is_held && p.step_m_per_newton == q.step_m_per_newton && p.own == q.own;
  }
  const ElasticState& s = a.state;
  const ElasticState& t = b.state;
  return s.patch == t.patch && s.tissue == t.tissue && s.number == t.number &&
         s.tip_radius_m == t.tip_radius_m && same(s.center_m, t.center_m) &&
         same(s.force_outside_patch_newton, t.force_outside_patch_newton) &&
         s.friction_coefficient == t.friction_coefficient &&
         s.friction_stiffness_newton_per_m == t.friction_stiffness_newton_per_m &&
         s.has_rest == t.has_rest && s.compliance_ratio == t.compliance_ratio &&
         same(s.carried_m, t.carried_m) && same(s.carried_m_per_s, t.carried_m_per_s) &&
         s.carried_at_s == t.carried_at_s && same(s.normal, t.normal) && same(s.from_m, t.from_m) &&
         same(s.to_m, t.to_m) && s.radius_m == t.radius_m && s.away_step_m == t.away_step_m &&
         s.force_step_newton == t.force_step_newton && s.places == t.places;
}
inline bool same(const Interaction& a, const Interaction& b) {
  const auto listed = static_cast<std::ptrdiff_t>(a.listed_count);
  return same(a.header, b.header) && a.device_session_id == b.device_session_id &&
         a.device_sequence == b.device_sequence && a.device_sampled_at == b.device_sampled_at &&
         same(a.tool_position_world_m, b.tool_position_world_m) &&
         same(a.tool_orientation_world, b.tool_orientation_world) &&
         same(a.force_on_tool_newton, b.force_on_tool_newton) &&
         same(a.torque_on_tool_newton_m, b.torque_on_tool_newton_m) &&
         same(a.stored_energy_joule, b.stored_energy_joule) && a.contact_count == b.contact_count &&
         a.listed_count == b.listed_count && same(a.surface, b.surface) &&
         same(a.elastic, b.elastic) && a.physics_term == b.physics_term &&
         a.scene_ahead == b.scene_ahead && a.steps == b.steps && same(a.wave, b.wave) &&
         std::equal(a.contacts.begin(), a.contacts.begin() + listed, b.contacts.begin(),
                    [](const auto& x, const auto& y) { return same(x, y); });
}
inline bool same(const DeviceTick& a, const DeviceTick& b) {
  const bool has_same_acted =
      a.acted_count == b.acted_count &&
      std::equal(a.acted.begin(), a.acted.begin() + a.acted_count, b.acted.begin(),
                 [](const AppliedForce& x, const AppliedForce& y) { return same(x, y); });
  return has_same_acted && a.sequence == b.sequence && a.sampled_at == b.sampled_at &&
         a.switched_at == b.switched_at && a.lateness == b.lateness &&
         a.reply_time == b.reply_time &&
         same(a.measured_hand_position_m, b.measured_hand_position_m) &&
         same(a.measured_tool_position_world_m, b.measured_tool_position_world_m) &&
         same(a.measured_tool_orientation_world, b.measured_tool_orientation_world) &&
         same(a.force_on_hand_newton, b.force_on_hand_newton) && a.guard == b.guard &&
         a.is_answered == b.is_answered && a.is_peak_limited == b.is_peak_limited &&
         a.is_clutched == b.is_clutched && a.is_monitor_reduced == b.is_monitor_reduced &&
         a.buttons == b.buttons &&
         same(a.true_tool_position_world_m, b.true_tool_position_world_m) &&
         same(a.true_tool_velocity_world_m_per_s, b.true_tool_velocity_world_m_per_s) &&
         same(a.wrist_torque_newton_m, b.wrist_torque_newton_m) &&
         same(a.true_wrist_angle_rad, b.true_wrist_angle_rad) &&
         same(a.true_wrist_velocity_rad_per_s, b.true_wrist_velocity_rad_per_s) &&
         same(a.true_energy_joule, b.true_energy_joule) &&
         same(a.minimum_true_energy_joule, b.minimum_true_energy_joule);
}
inline bool same(const MofcTick& a, const MofcTick& b) {
  return a.device_session_id == b.device_session_id && a.device_sequence == b.device_sequence &&
         a.device_sampled_at == b.device_sampled_at &&
         same(a.requested_force_on_hand_newton, b.requested_force_on_hand_newton) &&
         same(a.commanded_force_on_hand_newton, b.commanded_force_on_hand_newton) &&
         same(a.f_max_newton, b.f_max_newton) &&
         same(a.ledger_energy_joule, b.ledger_energy_joule) && a.force_age == b.force_age &&
         a.state == b.state && a.is_clamped == b.is_clamped && a.is_in_contact == b.is_in_contact &&
         a.is_from_standby == b.is_from_standby && a.grip == b.grip &&
         same(a.requested_wrist_torque_newton_m, b.requested_wrist_torque_newton_m);
}
inline bool same(const PhysicsTick& a, const PhysicsTick& b) {
  return a.sequence == b.sequence && a.stepped_at == b.stepped_at &&
         a.device_sequence == b.device_sequence &&
         same(a.tool_position_world_m, b.tool_position_world_m) &&
         same(a.force_on_tool_newton, b.force_on_tool_newton) &&
         same(a.stored_energy_joule, b.stored_energy_joule) && a.contact_count == b.contact_count &&
         a.compute_time == b.compute_time && same(a.penetration_m, b.penetration_m) &&
         same(a.stiffness_newton_per_m, b.stiffness_newton_per_m);
}
inline bool same(const DeviceCounters& a, const DeviceCounters& b) {
  return same(a.loop, b.loop) && same(a.force_command, b.force_command) &&
         a.answered_ticks == b.answered_ticks && a.leased_ticks == b.leased_ticks &&
         a.fallback_ticks == b.fallback_ticks && a.limp_ticks == b.limp_ticks &&
         a.start_up_ticks == b.start_up_ticks && a.repeated_readings == b.repeated_readings &&
         a.longest_skip_ticks == b.longest_skip_ticks &&
         a.peak_limited_ticks == b.peak_limited_ticks && a.device_faults == b.device_faults &&
         a.fault_ticks == b.fault_ticks && a.fault_resets == b.fault_resets &&
         a.last_fault == b.last_fault && a.non_finite_commands == b.non_finite_commands &&
         a.late_switches == b.late_switches && a.is_monitor_off == b.is_monitor_off &&
         a.monitor_reductions == b.monitor_reductions && a.ledger_excesses == b.ledger_excesses &&
         a.too_fast_readings == b.too_fast_readings && a.coarse_readings == b.coarse_readings &&
         a.outside_readings == b.outside_readings &&
         same(a.checked_friction_ratio, b.checked_friction_ratio) &&
         a.has_no_motor_watchdog == b.has_no_motor_watchdog &&
         a.accepts_no_motor_watchdog == b.accepts_no_motor_watchdog &&
         a.checked_motor_gain == b.checked_motor_gain && a.frozen_ticks == b.frozen_ticks &&
         a.dead_man_ticks == b.dead_man_ticks && a.phase == b.phase &&
         a.uncalibrated_ticks == b.uncalibrated_ticks &&
         a.unacknowledged_ticks == b.unacknowledged_ticks && a.checking_ticks == b.checking_ticks &&
         a.page_acknowledgements == b.page_acknowledgements &&
         a.page_acknowledgements_refused == b.page_acknowledgements_refused &&
         a.is_release_unconfirmed == b.is_release_unconfirmed &&
         same(a.max_force_newton, b.max_force_newton) &&
         same(a.largest_jump_newton, b.largest_jump_newton) &&
         same(a.minimum_true_energy_joule, b.minimum_true_energy_joule);
}
inline bool same(const MofcCounters& a, const MofcCounters& b) {
  return same(a.device_state, b.device_state) && same(a.interaction, b.interaction) &&
         a.ticks == b.ticks && a.contact_ticks == b.contact_ticks &&
         a.clamped_ticks == b.clamped_ticks && a.debt_ticks == b.debt_ticks &&
         a.too_fast_ticks == b.too_fast_ticks && a.stale_ticks == b.stale_ticks &&
         a.late_physics_ticks == b.late_physics_ticks && a.ledger_resets == b.ledger_resets &&
         a.disturbed_contact_ticks == b.disturbed_contact_ticks &&
         a.disturbed_clamped_ticks == b.disturbed_clamped_ticks &&
         a.motions_dropped == b.motions_dropped && a.motions_suppressed == b.motions_suppressed &&
         same(a.transparency_integral_ns, b.transparency_integral_ns) &&
         a.transparency_time_ns == b.transparency_time_ns &&
         same(a.standby_interaction, b.standby_interaction) && a.physics_term == b.physics_term &&
         a.standby_ticks == b.standby_ticks && a.physics_switches == b.physics_switches &&
         a.grips == b.grips && a.grips_torn == b.grips_torn && a.grips_slipped == b.grips_slipped &&
         a.punctures == b.punctures;
}
inline bool same(const PhysicsCounters& a, const PhysicsCounters& b) {
  return same(a.loop, b.loop) && same(a.tool_motion, b.tool_motion) &&
         a.contact_steps == b.contact_steps && a.tissues_skipped == b.tissues_skipped &&
         a.tissues_visited == b.tissues_visited &&
         a.octree_cells_visited == b.octree_cells_visited &&
         a.octree_last_cell_hits == b.octree_last_cell_hits &&
         a.tissues_asleep == b.tissues_asleep && a.surfaces_shared == b.surfaces_shared &&
         a.interactions_suppressed == b.interactions_suppressed && a.mesh_frames == b.mesh_frames &&
         a.meshes_skipped == b.meshes_skipped && a.tissue_changes == b.tissue_changes &&
         a.tissue_changes_refused == b.tissue_changes_refused &&
         a.elastic_solves == b.elastic_solves &&
         a.elastic_solves_skipped == b.elastic_solves_skipped &&
         a.elastic_solves_late == b.elastic_solves_late &&
         a.elastic_solves_failed == b.elastic_solves_failed &&
         a.elastic_steps_skipped == b.elastic_steps_skipped &&
         same(a.elastic_residual_ratio, b.elastic_residual_ratio) &&
         same(a.elastic_error_newton, b.elastic_error_newton) &&
         same(a.elastic_bound_newton, b.elastic_bound_newton) &&
         a.elastic_bound_violations == b.elastic_bound_violations &&
         a.elastic_bounds_checked == b.elastic_bounds_checked &&
         a.elastic_contact_steps == b.elastic_contact_steps &&
         a.elastic_unknown_bound_steps == b.elastic_unknown_bound_steps &&
         a.is_started_in_contact == b.is_started_in_contact &&
         a.elastic_tips_appeared == b.elastic_tips_appeared &&
         a.elastic_points_held == b.elastic_points_held &&
         a.elastic_solves_repaired == b.elastic_solves_repaired &&
         a.elastic_energised_steps == b.elastic_energised_steps &&
         a.elastic_bodies_remade == b.elastic_bodies_remade &&
         a.elastic_elements_removed == b.elastic_elements_removed &&
         a.elastic_elements_loose == b.elastic_elements_loose &&
         a.elastic_bodies_refused == b.elastic_bodies_refused &&
         a.elastic_bodies_restored == b.elastic_bodies_restored &&
         a.elastic_attachments_torn == b.elastic_attachments_torn &&
         a.elastic_torn_joule == b.elastic_torn_joule &&
         a.elastic_faces_cut == b.elastic_faces_cut && a.elastic_cut_joule == b.elastic_cut_joule &&
         a.worst_compute_time == b.worst_compute_time;
}
inline bool same(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0);
}
inline bool same(const TissueSurface& a, const TissueSurface& b) {
  return a.name == b.name && a.shape == b.shape && same(a.mesh.vertices_m, b.mesh.vertices_m) &&
         a.mesh.triangles == b.mesh.triangles &&
         same(a.vertex_stiffness_newton_per_m, b.vertex_stiffness_newton_per_m) &&
         same(a.stiffness_newton_per_m, b.stiffness_newton_per_m) &&
         same(a.damping_newton_s_per_m, b.damping_newton_s_per_m);
}
inline bool same(const PointerConfig& a, const PointerConfig& b) {
  return same(a.center_m, b.center_m) && same(a.reach_m, b.reach_m) &&
         same(a.speed_m_per_s, b.speed_m_per_s) && a.holder_timeout == b.holder_timeout;
}
inline bool same(const SceneState& a, const SceneState& b) {
  return same(a.header, b.header) && a.revision == b.revision && a.session_name == b.session_name &&
         a.session_text == b.session_text && a.controller == b.controller &&
         same(a.device_rate_hz, b.device_rate_hz) && same(a.physics_rate_hz, b.physics_rate_hz) &&
         same(a.peak_force_newton, b.peak_force_newton) && same(a.tip_radius_m, b.tip_radius_m) &&
         same(a.shaft_length_m, b.shaft_length_m) && same(a.shaft_radius_m, b.shaft_radius_m) &&
         same(a.workspace_scale_ratio, b.workspace_scale_ratio) &&
         std::equal(a.tissues.begin(), a.tissues.end(), b.tissues.begin(), b.tissues.end(),
                    [](const auto& x, const auto& y) { return same(x, y); }) &&
         a.accepts_changes == b.accepts_changes && a.reach.has_value() == b.reach.has_value() &&
         (!a.reach || (same(a.reach->center_m, b.reach->center_m) &&
                       same(a.reach->half_extent_m, b.reach->half_extent_m))) &&
         a.pointer.has_value() == b.pointer.has_value() &&
         (!a.pointer || same(*a.pointer, *b.pointer));
}
inline bool same(const MeshFrame& a, const MeshFrame& b) {
  return same(a.header, b.header) && a.scene_revision == b.scene_revision && a.tissue == b.tissue &&
         a.first_vertex == b.first_vertex && same(a.vertices_m, b.vertices_m) &&
         a.device_sequence == b.device_sequence &&
         same(a.displacement_world_m, b.displacement_world_m) &&
         same(a.vertex_strain, b.vertex_strain);
}
inline bool same(const HandTarget& a, const HandTarget& b) {
  return same(a.header, b.header) && a.holder_id == b.holder_id &&
         same(a.hand_position_m, b.hand_position_m) && a.is_released == b.is_released &&
         a.buttons == b.buttons;
}
inline bool same(const RunState& a, const RunState& b) {
  return same(a.header, b.header) && a.markers == b.markers && a.replay == b.replay;
}
inline bool same(const RunRequest& a, const RunRequest& b) {
  return same(a.header, b.header) && a.marker == b.marker && a.seek_s == b.seek_s &&
         a.is_paused == b.is_paused && a.speed_ratio == b.speed_ratio &&
         a.is_recording == b.is_recording && a.marker_kind == b.marker_kind;
}
inline bool same(const TissueChange& a, const TissueChange& b) {
  return same(a.header, b.header) && a.tissue == b.tissue &&
         same(a.stiffness_newton_per_m, b.stiffness_newton_per_m) &&
         same(a.damping_newton_s_per_m, b.damping_newton_s_per_m) && a.restores == b.restores;
}
inline bool same(const Acknowledgement& a, const Acknowledgement& b) {
  return same(a.header, b.header) && a.device_session_id == b.device_session_id &&
         a.seen.phase == b.seen.phase && a.seen.device_faults == b.seen.device_faults;
}
template <class Record, class Counters>
bool same(const TelemetryBatch<Record, Counters>& a, const TelemetryBatch<Record, Counters>& b) {
  return same(a.header, b.header) && same(a.counters, b.counters) &&
         a.records_lost == b.records_lost && a.peers_refused == b.peers_refused &&
         a.node_version == b.node_version && a.side == b.side &&
         std::equal(a.records.begin(), a.records.end(), b.records.begin(), b.records.end(),
                    [](const auto& x, const auto& y) { return same(x, y); });
}

}  // namespace palpate::test
