#include "common/link/codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "palpate/v1/common.pb.h"
#include "palpate/v1/exchange.pb.h"
#include "palpate/v1/physics.pb.h"
#include "palpate/v1/scene.pb.h"
#include "palpate/v1/telemetry.pb.h"

namespace palpate {
namespace {

// Limits of the .proto comments.
constexpr double kMaxPositionM = 1e3;
constexpr double kMaxVelocityMPerS = 1e3;
constexpr double kMaxForceOnHandNewton = 1e3;
constexpr double kMaxForceOnToolNewton = 1e6;
constexpr double kMaxCurvaturePerM = 1e9;
constexpr double kMaxLawCoefficient = 1e12;
constexpr double kMaxStiffening = 1e18;
constexpr double kMaxFrictionCoefficient = 1000.0;
constexpr std::int64_t kMaxLeaseNs = 1'000'000'000;
constexpr double kUnitTolerance = 1e-6;
constexpr std::size_t kMaxSessionNameBytes = 64;
/// 73 years: two stamps within it can be subtracted without overflow.
constexpr std::int64_t kMaxTimeNs = std::int64_t{1} << 61;
/// |v|² of a vector that its sender has normalised differs from 1 by a few roundings (2e-16 each).
constexpr double kRounding = 4e-15;

// --- single values ----------------------------------------------------------------------------

std::int64_t ns(TimePoint t) { return t.time_since_epoch().count(); }
TimePoint time(std::int64_t ns) { return TimePoint(Duration(ns)); }

void put(const Vector3& v, v1::Vector3& to) {
  to.set_x(v.x());
  to.set_y(v.y());
  to.set_z(v.z());
}
Vector3 vector(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

void put(const Quaternion& q, v1::Quaternion& to) {
  to.set_w(q.w());
  to.set_x(q.x());
  to.set_y(q.y());
  to.set_z(q.z());
}

/// To norm 1, unless it is that already to within rounding: then a message that came by socket
/// equals one that came by memory.
template <class V>
V unit(V v) {
  if (std::abs(v.squaredNorm() - 1.0) > kRounding) v.normalize();
  return v;
}
Quaternion quaternion(const v1::Quaternion& q) {
  return unit(Quaternion(q.w(), q.x(), q.y(), q.z()));
}

void put(const Header& header, v1::Header& to) {
  to.set_protocol_major(kProtocolMajor);
  to.set_session_id(header.session_id);
  to.set_sequence(header.sequence);
  to.set_sampled_at_ns(ns(header.sampled_at));
}
Header header(const v1::Header& h) {
  return {.session_id = h.session_id(),
          .sequence = h.sequence(),
          .sampled_at = time(h.sampled_at_ns())};
}

void put_stamp(std::uint64_t session_id, std::uint64_t sequence, TimePoint sampled_at,
               v1::DeviceStamp& to) {
  to.set_session_id(session_id);
  to.set_sequence(sequence);
  to.set_sampled_at_ns(ns(sampled_at));
}

/// What is wrong with a message. Looks at every field and reports presence before finiteness before
/// range.
class Verdict {
 public:
  void require(bool is_present) { is_missing_ |= !is_present; }
  void expect(bool is_in_range) { is_out_of_range_ |= !is_in_range; }
  void finite(double x) { is_not_finite_ |= !std::isfinite(x); }
  void finite_or_nan(double x) { is_not_finite_ |= std::isinf(x); }
  void number(double x, double low, double high) {
    finite(x);
    expect(x >= low && x <= high);
  }
  void time(std::int64_t ns) { expect(ns >= -kMaxTimeNs && ns <= kMaxTimeNs); }

  /// Each component within ±limit.
  void vector(bool is_present, const v1::Vector3& v, double limit) {
    require(is_present);
    for (const double x : {v.x(), v.y(), v.z()}) number(x, -limit, limit);
  }
  void unit_vector(bool is_present, const v1::Vector3& v) {
    require(is_present);
    for (const double x : {v.x(), v.y(), v.z()}) finite(x);
    number(Vector3(v.x(), v.y(), v.z()).norm(), 1.0 - kUnitTolerance, 1.0 + kUnitTolerance);
  }
  void orientation(bool is_present, const v1::Quaternion& q) {
    require(is_present);
    for (const double x : {q.w(), q.x(), q.y(), q.z()}) finite(x);
    number(Quaternion(q.w(), q.x(), q.y(), q.z()).norm(), 1.0 - kUnitTolerance,
           1.0 + kUnitTolerance);
  }
  void header(const v1::Header& h) {
    expect(h.session_id() != 0);
    time(h.sampled_at_ns());
  }
  void stamp(bool is_present, const v1::DeviceStamp& s) {
    require(is_present);
    expect(s.session_id() != 0);
    time(s.sampled_at_ns());
  }

  [[nodiscard]] DecodeError error() const {
    if (is_missing_) return DecodeError::kMissingField;
    if (is_not_finite_) return DecodeError::kNotFinite;
    return is_out_of_range_ ? DecodeError::kOutOfRange : DecodeError::kNone;
  }

 private:
  bool is_missing_ = false;
  bool is_not_finite_ = false;
  bool is_out_of_range_ = false;
};

// --- hop 1 ------------------------------------------------------------------------------------

void fill(const DeviceState& m, v1::DeviceState& wire) {
  put(m.hand_position_m, *wire.mutable_hand_position_m());
  put(m.tool_position_world_m, *wire.mutable_tool_position_world_m());
  put(m.tool_orientation_world, *wire.mutable_tool_orientation_world());
  wire.set_buttons(m.buttons);
  wire.set_is_clutched(m.is_clutched);
  const std::size_t count = std::min<std::size_t>(m.applied_count, kMaxAppliedForces);
  for (std::size_t i = 0; i < count; ++i) {
    const AppliedForce& applied = m.applied[i];
    v1::AppliedForce& to = *wire.add_applied();
    put(applied.force_on_hand_newton, *to.mutable_force_on_hand_newton());
    to.set_from_ns(ns(applied.from));
    to.set_until_ns(ns(applied.until));
    if (applied.has_position_at_end) {
      put(applied.hand_position_at_end_m, *to.mutable_hand_position_at_end_m());
    }
  }
}

void check(const v1::DeviceState& wire, Verdict& verdict) {
  verdict.vector(wire.has_hand_position_m(), wire.hand_position_m(), kMaxPositionM);
  verdict.vector(wire.has_tool_position_world_m(), wire.tool_position_world_m(), kMaxPositionM);
  verdict.orientation(wire.has_tool_orientation_world(), wire.tool_orientation_world());
  verdict.expect(wire.applied_size() <= static_cast<int>(kMaxAppliedForces));
  const v1::AppliedForce* previous = nullptr;
  for (const v1::AppliedForce& applied : wire.applied()) {
    verdict.vector(applied.has_force_on_hand_newton(), applied.force_on_hand_newton(),
                   kMaxForceOnHandNewton);
    verdict.time(applied.from_ns());
    verdict.time(applied.until_ns());
    verdict.expect(applied.until_ns() >= applied.from_ns());
    verdict.expect(previous == nullptr || previous->until_ns() == applied.from_ns());
    if (applied.has_hand_position_at_end_m()) {
      verdict.vector(true, applied.hand_position_at_end_m(), kMaxPositionM);
    }
    previous = &applied;
  }
}

void read(const v1::DeviceState& wire, DeviceState& m) {
  m.hand_position_m = vector(wire.hand_position_m());
  m.tool_position_world_m = vector(wire.tool_position_world_m());
  m.tool_orientation_world = quaternion(wire.tool_orientation_world());
  m.buttons = wire.buttons();
  m.is_clutched = wire.is_clutched();
  m.applied_count = static_cast<std::uint32_t>(wire.applied_size());
  for (std::size_t i = 0; i < kMaxAppliedForces; ++i) {
    if (i >= m.applied_count) {
      m.applied[i] = AppliedForce{};
      continue;
    }
    const v1::AppliedForce& applied = wire.applied(static_cast<int>(i));
    m.applied[i] = {.force_on_hand_newton = vector(applied.force_on_hand_newton()),
                    .from = time(applied.from_ns()),
                    .until = time(applied.until_ns()),
                    .hand_position_at_end_m = vector(applied.hand_position_at_end_m()),
                    .has_position_at_end = applied.has_hand_position_at_end_m()};
  }
}

// --- hop 4 ------------------------------------------------------------------------------------

void fill(const ForceCommand& m, v1::ForceCommand& wire) {
  put_stamp(m.answers_session_id, m.answers_sequence, TimePoint{}, *wire.mutable_answers());
  put(m.force_on_hand_newton, *wire.mutable_force_on_hand_newton());
  wire.set_valid_for_ns(m.valid_for.count());
}

void check(const v1::ForceCommand& wire, Verdict& verdict) {
  verdict.stamp(wire.has_answers(), wire.answers());
  verdict.vector(wire.has_force_on_hand_newton(), wire.force_on_hand_newton(),
                 kMaxForceOnHandNewton);
  verdict.expect(wire.valid_for_ns() >= 0 && wire.valid_for_ns() <= kMaxLeaseNs);
}

void read(const v1::ForceCommand& wire, ForceCommand& m) {
  m.answers_session_id = wire.answers().session_id();
  m.answers_sequence = wire.answers().sequence();
  m.force_on_hand_newton = vector(wire.force_on_hand_newton());
  m.valid_for = Duration(wire.valid_for_ns());
}

// --- hop 2 ------------------------------------------------------------------------------------

void fill(const ToolMotion& m, v1::ToolMotion& wire) {
  put_stamp(m.device_session_id, m.device_sequence, m.device_sampled_at, *wire.mutable_device());
  put(m.tool_position_world_m, *wire.mutable_tool_position_world_m());
  put(m.tool_orientation_world, *wire.mutable_tool_orientation_world());
  put(m.tool_velocity_world_m_per_s, *wire.mutable_tool_velocity_world_m_per_s());
  wire.set_buttons(m.buttons);
}

void check(const v1::ToolMotion& wire, Verdict& verdict) {
  verdict.stamp(wire.has_device(), wire.device());
  verdict.vector(wire.has_tool_position_world_m(), wire.tool_position_world_m(), kMaxPositionM);
  verdict.orientation(wire.has_tool_orientation_world(), wire.tool_orientation_world());
  verdict.vector(wire.has_tool_velocity_world_m_per_s(), wire.tool_velocity_world_m_per_s(),
                 kMaxVelocityMPerS);
}

void read(const v1::ToolMotion& wire, ToolMotion& m) {
  m.device_session_id = wire.device().session_id();
  m.device_sequence = wire.device().sequence();
  m.device_sampled_at = time(wire.device().sampled_at_ns());
  m.tool_position_world_m = vector(wire.tool_position_world_m());
  m.tool_orientation_world = quaternion(wire.tool_orientation_world());
  m.tool_velocity_world_m_per_s = vector(wire.tool_velocity_world_m_per_s());
  m.buttons = wire.buttons();
}

// --- hop 3 ------------------------------------------------------------------------------------

using Matrix = google::protobuf::RepeatedField<double>;

void put(const Matrix3& matrix, Matrix& to) {
  if (matrix.isZero(0.0)) return;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) to.Add(matrix(row, column));
  }
}
Matrix3 matrix(const Matrix& m) {
  if (m.empty()) return Matrix3::Zero();
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}
void check(const Matrix& m, double limit, Verdict& verdict) {
  verdict.expect(m.empty() || m.size() == 9);
  for (const double x : m) verdict.number(x, -limit, limit);
}

void fill(const Contact& contact, v1::Contact& to) {
  to.set_tissue(contact.tissue);
  to.set_penetration_m(contact.penetration_m);
  put(contact.normal_world, *to.mutable_normal_world());
  put(contact.force_on_tool_newton, *to.mutable_force_on_tool_newton());
  put(contact.curvature_per_m, *to.mutable_curvature_per_m());
  put(contact.surface_velocity_world_m_per_s, *to.mutable_surface_velocity_world_m_per_s());
  put(contact.elastic_force_on_tool_newton, *to.mutable_elastic_force_on_tool_newton());
  put(contact.d_force_d_position, *to.mutable_d_force_d_position());
  put(contact.d_force_d_velocity, *to.mutable_d_force_d_velocity());
  to.set_stiffening_newton_per_m2(contact.stiffening_newton_per_m2);
  to.set_stiffening_newton_per_m3(contact.stiffening_newton_per_m3);
  to.set_stored_energy_joule(contact.stored_energy_joule);
  to.set_is_adhesive(contact.is_adhesive);
  to.set_trust_radius_m(contact.trust_radius_m);
  if (contact.friction_coefficient == 0.0) return;
  to.set_friction_coefficient(contact.friction_coefficient);
  to.set_friction_stiffness_newton_per_m(contact.friction_stiffness_newton_per_m);
  put(contact.stretch_m, *to.mutable_stretch_m());
}

void check(const v1::Contact& contact, Verdict& verdict) {
  verdict.number(contact.penetration_m(), -kMaxPositionM, kMaxPositionM);
  verdict.unit_vector(contact.has_normal_world(), contact.normal_world());
  verdict.vector(contact.has_force_on_tool_newton(), contact.force_on_tool_newton(),
                 kMaxForceOnToolNewton);
  check(contact.curvature_per_m(), kMaxCurvaturePerM, verdict);
  verdict.vector(contact.has_surface_velocity_world_m_per_s(),
                 contact.surface_velocity_world_m_per_s(), kMaxVelocityMPerS);
  verdict.vector(contact.has_elastic_force_on_tool_newton(), contact.elastic_force_on_tool_newton(),
                 kMaxLawCoefficient);
  check(contact.d_force_d_position(), kMaxLawCoefficient, verdict);
  check(contact.d_force_d_velocity(), kMaxLawCoefficient, verdict);
  verdict.number(contact.stiffening_newton_per_m2(), -kMaxStiffening, kMaxStiffening);
  verdict.number(contact.stiffening_newton_per_m3(), -kMaxStiffening, kMaxStiffening);
  verdict.finite(contact.stored_energy_joule());
  verdict.expect(contact.stored_energy_joule() >= 0.0);
  verdict.number(contact.trust_radius_m(), 0.0, kMaxPositionM);
  verdict.expect(contact.trust_radius_m() > 0.0);
  verdict.number(contact.friction_coefficient(), 0.0, kMaxFrictionCoefficient);
  verdict.number(contact.friction_stiffness_newton_per_m(), 0.0, kMaxLawCoefficient);
  if (contact.friction_coefficient() > 0.0 || contact.has_stretch_m()) {
    verdict.vector(contact.has_stretch_m(), contact.stretch_m(), kMaxPositionM);
  }
}

Contact contact(const v1::Contact& wire) {
  Contact contact;
  contact.tissue = wire.tissue();
  contact.penetration_m = wire.penetration_m();
  contact.normal_world = unit(vector(wire.normal_world()));
  contact.force_on_tool_newton = vector(wire.force_on_tool_newton());
  contact.curvature_per_m = matrix(wire.curvature_per_m());
  contact.surface_velocity_world_m_per_s = vector(wire.surface_velocity_world_m_per_s());
  contact.elastic_force_on_tool_newton = vector(wire.elastic_force_on_tool_newton());
  contact.d_force_d_position = matrix(wire.d_force_d_position());
  contact.d_force_d_velocity = matrix(wire.d_force_d_velocity());
  contact.stiffening_newton_per_m2 = wire.stiffening_newton_per_m2();
  contact.stiffening_newton_per_m3 = wire.stiffening_newton_per_m3();
  contact.stored_energy_joule = wire.stored_energy_joule();
  contact.is_adhesive = wire.is_adhesive();
  contact.trust_radius_m = wire.trust_radius_m();
  contact.friction_coefficient = wire.friction_coefficient();
  contact.friction_stiffness_newton_per_m = wire.friction_stiffness_newton_per_m();
  if (wire.has_stretch_m()) contact.stretch_m = vector(wire.stretch_m());
  return contact;
}

void fill(const Interaction& m, v1::Interaction& wire) {
  put_stamp(m.device_session_id, m.device_sequence, m.device_sampled_at, *wire.mutable_answers());
  put(m.tool_position_world_m, *wire.mutable_tool_position_world_m());
  put(m.tool_orientation_world, *wire.mutable_tool_orientation_world());
  put(m.force_on_tool_newton, *wire.mutable_force_on_tool_newton());
  wire.set_stored_energy_joule(m.stored_energy_joule);
  wire.set_contact_count(m.contact_count);
  const std::size_t count = std::min<std::size_t>(m.listed_count, kMaxContacts);
  for (std::size_t i = 0; i < count; ++i) fill(m.contacts[i], *wire.add_contacts());
}

void check(const v1::Interaction& wire, Verdict& verdict) {
  verdict.stamp(wire.has_answers(), wire.answers());
  verdict.vector(wire.has_tool_position_world_m(), wire.tool_position_world_m(), kMaxPositionM);
  verdict.orientation(wire.has_tool_orientation_world(), wire.tool_orientation_world());
  verdict.vector(wire.has_force_on_tool_newton(), wire.force_on_tool_newton(),
                 kMaxForceOnToolNewton);
  verdict.finite(wire.stored_energy_joule());
  verdict.expect(wire.stored_energy_joule() >= 0.0);
  // the deepest are listed first: touches that there is room for, then what is only near
  const auto listed = static_cast<std::uint32_t>(wire.contacts_size());
  const auto touching = static_cast<std::uint32_t>(
      std::count_if(wire.contacts().begin(), wire.contacts().end(),
                    [](const v1::Contact& one) { return one.penetration_m() > 0.0; }));
  verdict.expect(listed <= kMaxContacts);
  verdict.expect(touching == std::min<std::uint32_t>(wire.contact_count(), kMaxContacts));
  for (const v1::Contact& one : wire.contacts()) check(one, verdict);
}

void read(const v1::Interaction& wire, Interaction& m) {
  m.device_session_id = wire.answers().session_id();
  m.device_sequence = wire.answers().sequence();
  m.device_sampled_at = time(wire.answers().sampled_at_ns());
  m.tool_position_world_m = vector(wire.tool_position_world_m());
  m.tool_orientation_world = quaternion(wire.tool_orientation_world());
  m.force_on_tool_newton = vector(wire.force_on_tool_newton());
  m.stored_energy_joule = wire.stored_energy_joule();
  m.contact_count = wire.contact_count();
  m.listed_count = static_cast<std::uint32_t>(wire.contacts_size());
  for (std::uint32_t i = 0; i < m.listed_count; ++i) {
    m.contacts[i] = contact(wire.contacts(static_cast<int>(i)));
  }
}

// --- hop 5: counters --------------------------------------------------------------------------

void put(const LinkCounters& c, v1::LinkCounters& to) {
  to.set_accepted(c.accepted);
  to.set_skipped(c.skipped);
  to.set_duplicates(c.duplicates);
  to.set_out_of_order(c.out_of_order);
  to.set_rejected(c.rejected);
  to.set_sessions(c.sessions);
}
LinkCounters link(const v1::LinkCounters& c) {
  return {.accepted = c.accepted(),
          .skipped = c.skipped(),
          .duplicates = c.duplicates(),
          .out_of_order = c.out_of_order(),
          .rejected = c.rejected(),
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
  to.set_last_fault(static_cast<std::uint32_t>(c.last_fault));
  to.set_non_finite_commands(c.non_finite_commands);
  to.set_late_switches(c.late_switches);
  to.set_max_force_newton(c.max_force_newton);
  to.set_minimum_true_energy_joule(c.minimum_true_energy_joule);
}
void check(const v1::DeviceCounters& c, Verdict& verdict) {
  verdict.require(c.has_loop());
  verdict.require(c.has_force_command());
  verdict.time(c.loop().worst_lateness_ns());
  verdict.expect(c.last_fault() <= static_cast<std::uint32_t>(FaultReason::kWriteFailed));
  verdict.finite(c.max_force_newton());
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
          .max_force_newton = c.max_force_newton(),
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
  to.set_transparency_sum(c.transparency_sum);
  to.set_transparency_samples(c.transparency_samples);
  to.set_too_fast_ticks(c.too_fast_ticks);
}
void check(const v1::MofcCounters& c, Verdict& verdict) {
  verdict.require(c.has_device_state());
  verdict.require(c.has_interaction());
  verdict.finite(c.transparency_sum());
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
          .transparency_sum = c.transparency_sum(),
          .transparency_samples = c.transparency_samples()};
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
  to.set_worst_compute_time_ns(c.worst_compute_time.count());
}
void check(const v1::PhysicsCounters& c, Verdict& verdict) {
  verdict.require(c.has_loop());
  verdict.require(c.has_tool_motion());
  verdict.time(c.loop().worst_lateness_ns());
  verdict.time(c.worst_compute_time_ns());
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
          .worst_compute_time = Duration(c.worst_compute_time_ns())};
}

// --- hop 5: columns ---------------------------------------------------------------------------

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

enum DeviceFlags : std::uint32_t { kAnswered = 1, kPeakLimited = 2, kClutched = 4 };

bool is_turned(const DeviceTick& r) {
  return r.measured_tool_orientation_world.coeffs() != Quaternion::Identity().coeffs();
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
                   (r.is_clutched ? kClutched : 0U));
    append(r.true_tool_position_world_m, *wire.mutable_true_tool_position_world_m());
    append(r.true_tool_velocity_world_m_per_s, *wire.mutable_true_tool_velocity_world_m_per_s());
    wire.add_true_energy_joule(r.true_energy_joule);
    wire.add_minimum_true_energy_joule(r.minimum_true_energy_joule);
    if (has_orientations) {
      append(r.measured_tool_orientation_world, *wire.mutable_measured_tool_orientation_world());
    }
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
  r.true_tool_position_world_m = vector(wire.true_tool_position_world_m(), i);
  r.true_tool_velocity_world_m_per_s = vector(wire.true_tool_velocity_world_m_per_s(), i);
  r.true_energy_joule = wire.true_energy_joule(i);
  r.minimum_true_energy_joule = wire.minimum_true_energy_joule(i);
}

enum MofcFlags : std::uint32_t { kClamped = 1, kInContact = 2 };

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
    wire.add_flags((r.is_clamped ? kClamped : 0U) | (r.is_in_contact ? kInContact : 0U));
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
}

int rows(const v1::DeviceTelemetry& wire) { return wire.sequence_size(); }
int rows(const v1::MofcTelemetry& wire) { return wire.device_sequence_size(); }
int rows(const v1::PhysicsTelemetry& wire) { return wire.sequence_size(); }

// --- hop 5: batches ---------------------------------------------------------------------------

constexpr std::size_t kMaxVersionBytes = 64;
constexpr std::size_t kMaxSideBytes = 64;

template <class Record, class Counters, class Wire>
void fill(const TelemetryBatch<Record, Counters>& m, Wire& wire) {
  put(m.counters, *wire.mutable_counters());
  wire.set_records_lost(m.records_lost);
  wire.set_peers_refused(m.peers_refused);
  wire.set_node_version(m.node_version);
  wire.set_side(m.side);
  fill_records(m.records, wire);
}

template <class Wire>
requires requires(const Wire& wire) { wire.counters(); }
void check(const Wire& wire, Verdict& verdict) {
  verdict.require(wire.has_counters());
  verdict.expect(wire.node_version().size() <= kMaxVersionBytes);
  verdict.expect(wire.side().size() <= kMaxSideBytes);
  check(wire.counters(), verdict);
  check_records(wire, verdict);
}

template <class Record, class Counters, class Wire>
void read(const Wire& wire, TelemetryBatch<Record, Counters>& m) {
  m.counters = counters(wire.counters());
  m.records_lost = wire.records_lost();
  m.peers_refused = wire.peers_refused();
  m.node_version = wire.node_version();
  m.side = wire.side();
  m.records.resize(static_cast<std::size_t>(rows(wire)));
  for (int i = 0; i < rows(wire); ++i) {
    read_record(wire, i, m.records[static_cast<std::size_t>(i)]);
  }
}

// --- hop 5: scene -----------------------------------------------------------------------------

static_assert(std::endian::native == std::endian::little, "packed arrays are little-endian");

template <class Number>
void put(const std::vector<Number>& numbers, std::string& to) {
  to.assign(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(Number));
}
template <class Number>
void read(const std::string& bytes, std::vector<Number>& numbers) {
  numbers.resize(bytes.size() / sizeof(Number));
  if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), bytes.size());
}

/// Calls `visit` for each number of a packed array; what is left over at its end is out of range.
template <class Number, class Visit>
void for_each_number(const std::string& bytes, std::size_t per_row, Verdict& verdict,
                     const Visit& visit) {
  verdict.expect(bytes.size() % (per_row * sizeof(Number)) == 0);
  for (std::size_t at = 0; at + sizeof(Number) <= bytes.size(); at += sizeof(Number)) {
    Number number;
    std::memcpy(&number, bytes.data() + at, sizeof(Number));
    visit(number);
  }
}
void check_vertices(const std::string& bytes, Verdict& verdict) {
  for_each_number<float>(bytes, 3, verdict, [&](float x) {
    verdict.number(static_cast<double>(x), -kMaxPositionM, kMaxPositionM);
  });
}

void put(const TissueSurface& surface, v1::TissueSurface& to) {
  to.set_name(surface.name);
  to.set_shape(static_cast<v1::TissueSurface::Shape>(surface.shape));
  put(surface.mesh.vertices_m, *to.mutable_vertices_m());
  put(surface.mesh.triangles, *to.mutable_triangles());
  put(surface.vertex_stiffness_newton_per_m, *to.mutable_vertex_stiffness_newton_per_m());
  to.set_stiffness_newton_per_m(surface.stiffness_newton_per_m);
  to.set_damping_newton_s_per_m(surface.damping_newton_s_per_m);
}
void check(const v1::TissueSurface& surface, Verdict& verdict) {
  check_vertices(surface.vertices_m(), verdict);
  const std::size_t vertices = surface.vertices_m().size() / (3 * sizeof(float));
  for_each_number<std::uint32_t>(surface.triangles(), 3, verdict,
                                 [&](std::uint32_t index) { verdict.expect(index < vertices); });
  const std::string& stiffness = surface.vertex_stiffness_newton_per_m();
  verdict.expect(stiffness.empty() || stiffness.size() == vertices * sizeof(float));
  for_each_number<float>(stiffness, 1, verdict, [&](float k) {
    verdict.finite(static_cast<double>(k));
    verdict.expect(k >= 0.0F);
  });
  for (const double x : {surface.stiffness_newton_per_m(), surface.damping_newton_s_per_m()}) {
    verdict.finite(x);
    verdict.expect(x >= 0.0);
  }
}
void read(const v1::TissueSurface& wire, TissueSurface& surface) {
  surface.name = wire.name();
  // a newer physics_node may know more shapes: their vertices can be drawn all the same
  surface.shape = v1::TissueSurface::Shape_IsValid(wire.shape())
                      ? static_cast<TissueShape>(wire.shape())
                      : TissueShape::kUnknown;
  read(wire.vertices_m(), surface.mesh.vertices_m);
  read(wire.triangles(), surface.mesh.triangles);
  read(wire.vertex_stiffness_newton_per_m(), surface.vertex_stiffness_newton_per_m);
  surface.stiffness_newton_per_m = wire.stiffness_newton_per_m();
  surface.damping_newton_s_per_m = wire.damping_newton_s_per_m();
}

void fill(const SceneState& m, v1::SceneState& wire) {
  wire.set_revision(m.revision);
  wire.set_session_name(m.session_name);
  wire.set_session_text(m.session_text);
  wire.set_controller(m.controller);
  wire.set_device_rate_hz(m.device_rate_hz);
  wire.set_physics_rate_hz(m.physics_rate_hz);
  wire.set_peak_force_newton(m.peak_force_newton);
  wire.set_tip_radius_m(m.tip_radius_m);
  wire.set_shaft_length_m(m.shaft_length_m);
  wire.set_shaft_radius_m(m.shaft_radius_m);
  wire.set_workspace_scale_ratio(m.workspace_scale_ratio);
  for (const TissueSurface& surface : m.tissues) put(surface, *wire.add_tissues());
  if (m.pointer) {
    v1::SceneState::PointerHand& pointer = *wire.mutable_pointer();
    put(m.pointer->center_m, *pointer.mutable_center_m());
    pointer.set_reach_m(m.pointer->reach_m);
    pointer.set_speed_m_per_s(m.pointer->speed_m_per_s);
    pointer.set_holder_timeout_ns(m.pointer->holder_timeout.count());
  }
}

void check(const v1::SceneState& wire, Verdict& verdict) {
  const auto positive = [&](double x) {
    verdict.finite(x);
    verdict.expect(x > 0.0);
  };
  verdict.expect(wire.revision() > 0);
  verdict.expect(wire.session_name().size() <= kMaxSessionNameBytes);
  positive(wire.device_rate_hz());
  positive(wire.physics_rate_hz());
  positive(wire.peak_force_newton());
  for (const double length_m :
       {wire.tip_radius_m(), wire.shaft_length_m(), wire.shaft_radius_m()}) {
    verdict.number(length_m, 0.0, kMaxPositionM);
  }
  positive(wire.workspace_scale_ratio());
  for (const v1::TissueSurface& surface : wire.tissues()) check(surface, verdict);
  if (wire.has_pointer()) {
    const v1::SceneState::PointerHand& pointer = wire.pointer();
    verdict.vector(pointer.has_center_m(), pointer.center_m(), kMaxPositionM);
    positive(pointer.reach_m());
    positive(pointer.speed_m_per_s());
    verdict.time(pointer.holder_timeout_ns());
    verdict.expect(pointer.holder_timeout_ns() > 0);
  }
}

void read(const v1::SceneState& wire, SceneState& m) {
  m.revision = wire.revision();
  m.session_name = wire.session_name();
  m.session_text = wire.session_text();
  m.controller = wire.controller();
  m.device_rate_hz = wire.device_rate_hz();
  m.physics_rate_hz = wire.physics_rate_hz();
  m.peak_force_newton = wire.peak_force_newton();
  m.tip_radius_m = wire.tip_radius_m();
  m.shaft_length_m = wire.shaft_length_m();
  m.shaft_radius_m = wire.shaft_radius_m();
  m.workspace_scale_ratio = wire.workspace_scale_ratio();
  m.tissues.resize(static_cast<std::size_t>(wire.tissues_size()));
  for (int i = 0; i < wire.tissues_size(); ++i) {
    read(wire.tissues(i), m.tissues[static_cast<std::size_t>(i)]);
  }
  m.pointer.reset();
  if (wire.has_pointer()) {
    m.pointer = PointerConfig{.center_m = vector(wire.pointer().center_m()),
                              .reach_m = wire.pointer().reach_m(),
                              .speed_m_per_s = wire.pointer().speed_m_per_s(),
                              .holder_timeout = Duration(wire.pointer().holder_timeout_ns())};
  }
}

void fill(const MeshFrame& m, v1::MeshFrame& wire) {
  wire.set_scene_revision(m.scene_revision);
  wire.set_tissue(m.tissue);
  wire.set_first_vertex(m.first_vertex);
  put(m.vertices_m, *wire.mutable_vertices_m());
  wire.set_device_sequence(m.device_sequence);
  if (!m.displacement_world_m.isZero(0.0)) {
    put(m.displacement_world_m, *wire.mutable_displacement_world_m());
  }
}

void check(const v1::MeshFrame& wire, Verdict& verdict) {
  verdict.expect(wire.scene_revision() > 0);
  check_vertices(wire.vertices_m(), verdict);
  verdict.vector(true, wire.displacement_world_m(), kMaxPositionM);
}

void read(const v1::MeshFrame& wire, MeshFrame& m) {
  m.scene_revision = wire.scene_revision();
  m.tissue = wire.tissue();
  m.first_vertex = wire.first_vertex();
  read(wire.vertices_m(), m.vertices_m);
  m.device_sequence = wire.device_sequence();
  m.displacement_world_m = vector(wire.displacement_world_m());
}

// --- hop 6 ------------------------------------------------------------------------------------

void fill(const HandTarget& m, v1::HandTarget& wire) {
  wire.set_holder_id(m.holder_id);
  put(m.hand_position_m, *wire.mutable_hand_position_m());
  wire.set_is_released(m.is_released);
}

void check(const v1::HandTarget& wire, Verdict& verdict) {
  verdict.expect(wire.holder_id() != 0);
  verdict.vector(wire.has_hand_position_m(), wire.hand_position_m(), kMaxPositionM);
}

void read(const v1::HandTarget& wire, HandTarget& m) {
  m.holder_id = wire.holder_id();
  m.hand_position_m = vector(wire.hand_position_m());
  m.is_released = wire.is_released();
}

// --- which protobuf message carries which struct ----------------------------------------------

template <class T>
struct WireOf;
template <>
struct WireOf<DeviceState> {
  using Message = v1::DeviceState;
};
template <>
struct WireOf<ForceCommand> {
  using Message = v1::ForceCommand;
};
template <>
struct WireOf<ToolMotion> {
  using Message = v1::ToolMotion;
};
template <>
struct WireOf<Interaction> {
  using Message = v1::Interaction;
};
template <>
struct WireOf<DeviceBatch> {
  using Message = v1::DeviceTelemetry;
};
template <>
struct WireOf<MofcBatch> {
  using Message = v1::MofcTelemetry;
};
template <>
struct WireOf<PhysicsBatch> {
  using Message = v1::PhysicsTelemetry;
};
template <>
struct WireOf<SceneState> {
  using Message = v1::SceneState;
};
template <>
struct WireOf<MeshFrame> {
  using Message = v1::MeshFrame;
};
template <>
struct WireOf<HandTarget> {
  using Message = v1::HandTarget;
};

}  // namespace

const char* name(DecodeError error) {
  switch (error) {
    case DecodeError::kNone:
      return "none";
    case DecodeError::kTooLarge:
      return "too_large";
    case DecodeError::kWrongKind:
      return "wrong_kind";
    case DecodeError::kMalformed:
      return "malformed";
    case DecodeError::kWrongVersion:
      return "wrong_version";
    case DecodeError::kMissingField:
      return "missing_field";
    case DecodeError::kNotFinite:
      return "not_finite";
    case DecodeError::kOutOfRange:
      return "out_of_range";
  }
  return "?";
}

std::string explain(DecodeError error, std::uint32_t peer_major) {
  switch (error) {
    case DecodeError::kNone:
      return "frame accepted";
    case DecodeError::kTooLarge:
      return "frame longer than any message of this link: the peer is not a Palpate node";
    case DecodeError::kWrongKind:
      return "frame of another hop: two endpoints under links {} of the session are mixed up";
    case DecodeError::kMalformed:
      return "frame is not a Palpate message: the peer is not a Palpate node, or damages frames";
    case DecodeError::kWrongVersion:
      return "peer speaks protocol " + std::to_string(peer_major) + ", this program speaks " +
             std::to_string(kProtocolMajor) + ": update the older one";
    case DecodeError::kMissingField:
      return "a required field is absent: the peer breaks the contract of proto/palpate/v1";
    case DecodeError::kNotFinite:
      return "a number is NaN or infinite: look for a fault in the peer's computation";
    case DecodeError::kOutOfRange:
      return "a value is outside the range given in proto/palpate/v1: look for a fault in the "
             "peer's computation";
  }
  return "?";
}

template <class T>
struct Codec<T>::Wire {
  typename WireOf<T>::Message outgoing;
  typename WireOf<T>::Message incoming;
};

template <class T>
Codec<T>::Codec() : wire_(std::make_unique<Wire>()) {}
template <class T>
Codec<T>::~Codec() = default;
template <class T>
Codec<T>::Codec(Codec&&) noexcept = default;
template <class T>
Codec<T>& Codec<T>::operator=(Codec&&) noexcept = default;

template <class T>
std::size_t Codec<T>::encode(const T& message) {
  auto& wire = wire_->outgoing;
  wire.Clear();
  put(message.header, *wire.mutable_header());
  fill(message, wire);
  return 1 + wire.ByteSizeLong();
}

template <class T>
void Codec<T>::write(std::byte* to) const {
  *to = static_cast<std::byte>(kKindOf<T>);
  wire_->outgoing.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(to + 1));
}

template <class T>
DecodeError Codec<T>::decode(std::span<const std::byte> frame, T& message) {
  // what can be refused without parsing
  if (frame.size() > kMaxFrameBytes<T>) return DecodeError::kTooLarge;
  if (frame.empty()) return DecodeError::kMalformed;
  if (frame[0] != static_cast<std::byte>(kKindOf<T>)) return DecodeError::kWrongKind;
  auto& wire = wire_->incoming;
  if (!wire.ParseFromArray(frame.data() + 1, static_cast<int>(frame.size() - 1))) {
    return DecodeError::kMalformed;
  }

  // version first: a newer contract may give other fields another meaning
  const std::uint32_t major = wire.header().protocol_major();
  if (major == 0) return DecodeError::kMissingField;
  if (major != kProtocolMajor) {
    peer_major_ = major;
    return DecodeError::kWrongVersion;
  }

  Verdict verdict;
  verdict.header(wire.header());
  check(wire, verdict);
  if (verdict.error() != DecodeError::kNone) return verdict.error();

  message.header = header(wire.header());
  read(wire, message);
  return DecodeError::kNone;
}

template class Codec<DeviceState>;
template class Codec<ForceCommand>;
template class Codec<ToolMotion>;
template class Codec<Interaction>;
template class Codec<DeviceBatch>;
template class Codec<MofcBatch>;
template class Codec<PhysicsBatch>;
template class Codec<SceneState>;
template class Codec<MeshFrame>;
template class Codec<HandTarget>;

}  // namespace palpate
