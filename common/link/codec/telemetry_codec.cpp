// SPDX-License-Identifier: Apache-2.0
// telemetry_codec.cpp — hop 5: the telemetry batches of the three nodes.
#include <algorithm>
#include <type_traits>
#include <vector>

#include "common/link/codec/telemetry_counters.h"
#include "common/link/codec/wire_format.h"
#include "palpate/v1/telemetry.pb.h"

namespace palpate {

using namespace wire;

namespace {

constexpr std::size_t kMaxVersionBytes = 64;
constexpr std::size_t kMaxSideBytes = 64;

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

void fill_acted(const DeviceTick& r, bool has_wrist, v1::ActedForces& wire) {
  wire.add_count(r.acted_count);
  wire.add_from_ns(r.acted_count > 0 ? ns(r.acted[0].from) : 0);
  for (std::uint32_t i = 0; i < r.acted_count; ++i) {
    const AppliedForce& acted = r.acted[i];
    wire.add_until_ns(ns(acted.until));
    append(acted.force_on_hand_newton, *wire.mutable_force_on_hand_newton());
    if (has_wrist) {
      append(acted.wrist_torque_newton_m, *wire.mutable_wrist_torque_on_hand_newton_m());
    }
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
  const Doubles& torques = wire.wrist_torque_on_hand_newton_m();
  check_finite(torques, torques.empty() ? 0 : wire.until_ns_size(), 3, verdict);
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
      if (!wire.wrist_torque_on_hand_newton_m().empty()) {
        acted.wrist_torque_newton_m = vector(wire.wrist_torque_on_hand_newton_m(), interval);
      }
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
  const bool has_buttons = std::any_of(records.begin(), records.end(),
                                       [](const DeviceTick& r) { return r.buttons != 0; });
  const bool has_wrist = std::any_of(records.begin(), records.end(),
                                     [](const DeviceTick& r) { return r.has_wrist(); });
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
    if (has_buttons) wire.add_buttons(r.buttons);
    fill_acted(r, has_wrist, *wire.mutable_acted());
    if (!has_wrist) continue;
    append(r.wrist_torque_newton_m, *wire.mutable_wrist_torque_on_hand_newton_m());
    append(r.true_wrist_angle_rad, *wire.mutable_true_wrist_angle_rad());
    append(r.true_wrist_velocity_rad_per_s, *wire.mutable_true_wrist_velocity_rad_per_s());
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
  if (!wire.buttons().empty()) check_length(wire.buttons(), rows, 1, verdict);
  if (wire.has_acted()) check_acted(wire.acted(), rows, verdict);
  for (const Doubles* const wrist :
       {&wire.wrist_torque_on_hand_newton_m(), &wire.true_wrist_angle_rad(),
        &wire.true_wrist_velocity_rad_per_s()}) {
    check_finite_or_nan(*wrist, wire.wrist_torque_on_hand_newton_m().empty() ? 0 : rows, 3,
                        verdict);
  }
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
  r.buttons = wire.buttons().empty() ? 0 : wire.buttons(i);
  r.true_tool_position_world_m = vector(wire.true_tool_position_world_m(), i);
  r.true_tool_velocity_world_m_per_s = vector(wire.true_tool_velocity_world_m_per_s(), i);
  r.true_energy_joule = wire.true_energy_joule(i);
  r.minimum_true_energy_joule = wire.minimum_true_energy_joule(i);
  r.wrist_torque_newton_m = r.true_wrist_angle_rad = r.true_wrist_velocity_rad_per_s =
      Vector3::Constant(kNaN);
  if (wire.wrist_torque_on_hand_newton_m().empty()) return;
  r.wrist_torque_newton_m = vector(wire.wrist_torque_on_hand_newton_m(), i);
  r.true_wrist_angle_rad = vector(wire.true_wrist_angle_rad(), i);
  r.true_wrist_velocity_rad_per_s = vector(wire.true_wrist_velocity_rad_per_s(), i);
}

enum MofcFlags : std::uint32_t { kClamped = 1, kInContact = 2, kFromStandby = 4, kGrip = 56 };
constexpr std::uint32_t kGripShift = 3;

void fill_records(const std::vector<MofcTick>& records, v1::MofcTelemetry& wire) {
  const bool has_wrist = std::any_of(records.begin(), records.end(), [](const MofcTick& r) {
    return !r.requested_wrist_torque_newton_m.hasNaN();
  });
  for (const MofcTick& r : records) {
    if (has_wrist) {
      append(r.requested_wrist_torque_newton_m, *wire.mutable_requested_wrist_torque_newton_m());
    }
    wire.add_device_session_id(r.device_session_id);
    wire.add_device_sequence(r.device_sequence);
    wire.add_device_sampled_at_ns(ns(r.device_sampled_at));
    append(r.requested_force_on_hand_newton, *wire.mutable_requested_force_on_hand_newton());
    append(r.commanded_force_on_hand_newton, *wire.mutable_commanded_force_on_hand_newton());
    append(r.f_max_newton, *wire.mutable_f_max_newton());
    wire.add_ledger_energy_joule(r.ledger_energy_joule);
    wire.add_force_age_ns(r.force_age.count());
    wire.add_state(static_cast<std::uint32_t>(r.state));
    wire.add_flags((r.is_clamped ? kClamped : 0U) | (r.is_in_contact ? kInContact : 0U) |
                   (r.is_from_standby ? kFromStandby : 0U) |
                   (static_cast<std::uint32_t>(r.grip) << kGripShift));
  }
}
void check_records(const v1::MofcTelemetry& wire, Verdict& verdict) {
  const int rows = wire.device_sequence_size();
  check_length(wire.device_session_id(), rows, 1, verdict);
  check_times(wire.device_sampled_at_ns(), rows, verdict);
  check_finite(wire.requested_force_on_hand_newton(), rows, 3, verdict);
  check_finite(wire.commanded_force_on_hand_newton(), rows, 3, verdict);
  const Doubles& torques = wire.requested_wrist_torque_newton_m();
  check_finite_or_nan(torques, torques.empty() ? 0 : rows, 3, verdict);
  check_length(wire.f_max_newton(), rows, 3, verdict);
  check_finite_or_nan(wire.ledger_energy_joule(), rows, 1, verdict);
  check_times(wire.force_age_ns(), rows, verdict);
  check_length(wire.state(), rows, 1, verdict);
  for (const std::uint32_t state : wire.state()) {
    verdict.expect(state <= static_cast<std::uint32_t>(MofcState::kClutched));
  }
  check_length(wire.flags(), rows, 1, verdict);
  for (const std::uint32_t flags : wire.flags()) {
    verdict.expect((flags & kGrip) >> kGripShift <= static_cast<std::uint32_t>(GripState::kCuts));
  }
}
void read_record(const v1::MofcTelemetry& wire, int i, MofcTick& r) {
  r.device_session_id = wire.device_session_id(i);
  r.device_sequence = wire.device_sequence(i);
  r.device_sampled_at = time(wire.device_sampled_at_ns(i));
  r.requested_force_on_hand_newton = vector(wire.requested_force_on_hand_newton(), i);
  r.commanded_force_on_hand_newton = vector(wire.commanded_force_on_hand_newton(), i);
  r.f_max_newton = vector(wire.f_max_newton(), i);
  r.ledger_energy_joule = wire.ledger_energy_joule(i);
  r.force_age = Duration(wire.force_age_ns(i));
  r.state = static_cast<MofcState>(wire.state(i));
  r.is_clamped = (wire.flags(i) & kClamped) != 0;
  r.is_in_contact = (wire.flags(i) & kInContact) != 0;
  r.is_from_standby = (wire.flags(i) & kFromStandby) != 0;
  r.grip = static_cast<GripState>((wire.flags(i) & kGrip) >> kGripShift);
  r.requested_wrist_torque_newton_m = wire.requested_wrist_torque_newton_m().empty()
                                          ? Vector3(Vector3::Constant(kNaN))
                                          : vector(wire.requested_wrist_torque_newton_m(), i);
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
