// SPDX-License-Identifier: Apache-2.0
// interaction_codec.cpp — hop 3: Interaction and its contacts.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "common/core/physics_term.h"
#include "common/link/codec/elastic_wire.h"
#include "common/link/codec/surface_wire.h"
#include "common/link/codec/wire_format.h"
#include "palpate/v1/interaction.pb.h"

namespace palpate {

using namespace wire;

namespace {

constexpr double kRightAngle = 1e-6;  // cosine between the edge of a blade and its way

using Matrix = google::protobuf::RepeatedField<double>;

void put_matrix(const Matrix3& matrix, Matrix& to) {
  if (matrix.isZero(0.0)) return;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) to.Add(matrix(row, column));
  }
}
Matrix3 matrix(const Matrix& m) {
  if (m.empty()) return Matrix3::Zero();
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
}
void check_matrix(const Matrix& m, double limit, Verdict& verdict) {
  verdict.expect(m.empty() || m.size() == 9);
  for (const double x : m) verdict.number(x, -limit, limit);
}

void put_grip(const Grip& grip, v1::Grip& to) {
  to.set_number(grip.number);
  to.set_buttons(grip.buttons);
  to.set_slip_newton(grip.slip_newton);
  to.set_tear_newton(grip.tear_newton);
  to.set_reach_m(grip.reach_m);
  put(grip.slip_m, *to.mutable_slip_m());
  if (!grip.needle.is_there()) return;
  v1::Needle& needle = *to.mutable_needle();
  put(grip.needle.inward_world, *needle.mutable_inward_world());
  needle.set_cutting_newton(grip.needle.cutting_newton);
  needle.set_spreading_newton(grip.needle.spreading_newton);
  needle.set_friction_newton_per_m(grip.needle.friction_newton_per_m);
  needle.set_deepest_m(grip.needle.deepest_m);
  needle.set_friction_newton(grip.needle.friction_newton);
  if (grip.needle.is_blade()) put(grip.needle.edge_world, *needle.mutable_edge_world());
}

/// The jaws are a spring, or a damper, that is the same in both directions of every motion, and no
/// motion is free.
bool is_spring(const Matrix& m) {
  if (m.size() != 9) return false;
  const Eigen::Map<const Matrix3> K(m.data());
  const double rounding = 1e-9 * K.cwiseAbs().maxCoeff();
  if (!((K - K.transpose()).cwiseAbs().maxCoeff() <= rounding)) return false;
  return Eigen::LLT<Matrix3>(-K).info() == Eigen::Success;
}

void check_needle(const v1::Needle& needle, Verdict& verdict) {
  verdict.unit_vector(needle.has_inward_world(), needle.inward_world());
  verdict.number(needle.cutting_newton(), 0.0, kMaxTissueForceNewton);
  verdict.number(needle.spreading_newton(), 0.0, kMaxTissueForceNewton);
  verdict.number(needle.friction_newton_per_m(), 0.0, kMaxStiffnessNewtonPerM);
  verdict.number(needle.deepest_m(), 0.0, kMaxPositionM);
  verdict.number(needle.friction_newton(), 0.0, kMaxTissueForceNewton);
  if (!needle.has_edge_world()) return;
  verdict.unit_vector(true, needle.edge_world());
  const double cosine = vector(needle.edge_world()).dot(vector(needle.inward_world()));
  verdict.expect(std::abs(cosine) <= kRightAngle);
}

void check_grip(const v1::Contact& contact, Verdict& verdict) {
  const v1::Grip& grip = contact.grip();
  verdict.expect(grip.number() > 0 && (grip.buttons() != 0 || grip.has_needle()));
  if (grip.has_needle()) check_needle(grip.needle(), verdict);
  for (const double newton : {grip.slip_newton(), grip.tear_newton()}) {
    verdict.number(newton, 0.0, kMaxTissueForceNewton);
    verdict.expect(newton > 0.0);
  }
  verdict.number(grip.reach_m(), 0.0, kMaxPositionM);
  verdict.expect(grip.reach_m() > 0.0);
  verdict.vector(grip.has_slip_m(), grip.slip_m(), kMaxPositionM);
  verdict.expect(contact.is_adhesive() && contact.penetration_m() > 0.0 &&
                 contact.curvature_per_m().empty() && contact.hunt_crossley_exponent() == 0.0 &&
                 contact.friction_coefficient() == 0.0 && is_spring(contact.d_force_d_position()) &&
                 (contact.d_force_d_velocity().empty() || is_spring(contact.d_force_d_velocity())));
}

NeedleLaw needle_of(const v1::Needle& wire) {
  return {.inward_world = unit(vector(wire.inward_world())),
          .cutting_newton = wire.cutting_newton(),
          .spreading_newton = wire.spreading_newton(),
          .friction_newton_per_m = wire.friction_newton_per_m(),
          .deepest_m = wire.deepest_m(),
          .edge_world = wire.has_edge_world() ? unit(vector(wire.edge_world())) : Vector3::Zero(),
          .friction_newton = wire.friction_newton()};
}

Grip grip_of(const v1::Grip& wire) {
  return {.number = wire.number(),
          .buttons = wire.buttons(),
          .slip_newton = wire.slip_newton(),
          .tear_newton = wire.tear_newton(),
          .reach_m = wire.reach_m(),
          .slip_m = vector(wire.slip_m()),
          .needle = wire.has_needle() ? needle_of(wire.needle()) : NeedleLaw{}};
}

void put_contact(const Contact& contact, v1::Contact& to) {
  to.set_tissue(contact.tissue);
  to.set_penetration_m(contact.penetration_m);
  put(contact.normal_world, *to.mutable_normal_world());
  put(contact.force_on_tool_newton, *to.mutable_force_on_tool_newton());
  put_matrix(contact.curvature_per_m, *to.mutable_curvature_per_m());
  put(contact.surface_velocity_world_m_per_s, *to.mutable_surface_velocity_world_m_per_s());
  put(contact.elastic_force_on_tool_newton, *to.mutable_elastic_force_on_tool_newton());
  put_matrix(contact.d_force_d_position, *to.mutable_d_force_d_position());
  put_matrix(contact.d_force_d_velocity, *to.mutable_d_force_d_velocity());
  to.set_stiffening_newton_per_m2(contact.stiffening_newton_per_m2);
  to.set_stiffening_newton_per_m3(contact.stiffening_newton_per_m3);
  to.set_stored_energy_joule(contact.stored_energy_joule);
  to.set_is_adhesive(contact.is_adhesive);
  to.set_trust_radius_m(contact.trust_radius_m);
  if (contact.hunt_crossley_exponent > 0.0) {
    to.set_hunt_crossley_exponent(contact.hunt_crossley_exponent);
    to.set_hunt_crossley_depth_m(contact.hunt_crossley_depth_m);
    to.set_hunt_crossley_stiffness_newton_per_m(contact.hunt_crossley_stiffness_newton_per_m);
    to.set_hunt_crossley_damping_newton_s_per_m(contact.hunt_crossley_damping_newton_s_per_m);
  }
  to.set_friction_coefficient(contact.friction_coefficient);
  to.set_friction_stiffness_newton_per_m(contact.friction_stiffness_newton_per_m);
  if (contact.friction_coefficient > 0.0 || !contact.stretch_m.isZero(0.0)) {
    put(contact.stretch_m, *to.mutable_stretch_m());
  }
  to.set_is_shaft(contact.is_shaft);
  to.set_is_behind(contact.is_behind);
  to.set_is_punctured(contact.is_punctured);
  if (!contact.held_m.isZero(0.0)) put(contact.held_m, *to.mutable_held_m());
  to.set_relaxed_m(contact.relaxed_m);
  if (contact.grip.number != 0) put_grip(contact.grip, *to.mutable_grip());
  if (!contact.arm_m.isZero(0.0)) put(contact.arm_m, *to.mutable_arm_m());
}

void check_contact(const v1::Contact& contact, Verdict& verdict) {
  verdict.number(contact.penetration_m(), -kMaxPositionM, kMaxPositionM);
  verdict.unit_vector(contact.has_normal_world(), contact.normal_world());
  verdict.vector(contact.has_force_on_tool_newton(), contact.force_on_tool_newton(),
                 kMaxTissueForceNewton);
  check_matrix(contact.curvature_per_m(), kMaxCurvaturePerM, verdict);
  verdict.vector(contact.has_surface_velocity_world_m_per_s(),
                 contact.surface_velocity_world_m_per_s(), kMaxTissueSpeedMPerS);
  verdict.vector(contact.has_elastic_force_on_tool_newton(), contact.elastic_force_on_tool_newton(),
                 kMaxTissueForceNewton);
  check_matrix(contact.d_force_d_position(), kMaxSlopeNewtonPerM, verdict);
  check_matrix(contact.d_force_d_velocity(), kMaxDampingNewtonSPerM, verdict);
  verdict.number(contact.stiffening_newton_per_m2(), -kMaxStiffeningNewtonPerM2,
                 kMaxStiffeningNewtonPerM2);
  verdict.number(contact.stiffening_newton_per_m3(), -kMaxStiffeningNewtonPerM3,
                 kMaxStiffeningNewtonPerM3);
  verdict.number(contact.stored_energy_joule(), 0.0, kMaxStoredEnergyJoule);
  verdict.number(contact.trust_radius_m(), 0.0, kMaxPositionM);
  verdict.expect(contact.trust_radius_m() > 0.0);
  if (contact.hunt_crossley_exponent() != 0.0) {
    verdict.number(contact.hunt_crossley_exponent(), 1.0, kMaxExponent);
    verdict.number(contact.hunt_crossley_depth_m(), kMinExponentDepthM, kMaxExponentDepthM);
  }
  verdict.number(contact.hunt_crossley_stiffness_newton_per_m(), 0.0, kMaxStiffnessNewtonPerM);
  verdict.number(contact.hunt_crossley_damping_newton_s_per_m(), 0.0, kMaxDampingNewtonSPerM);
  verdict.number(contact.friction_coefficient(), 0.0, kMaxFrictionCoefficient);
  verdict.number(contact.friction_stiffness_newton_per_m(), 0.0, kMaxStiffnessNewtonPerM);
  if (contact.friction_coefficient() > 0.0 || contact.has_stretch_m()) {
    verdict.vector(contact.has_stretch_m(), contact.stretch_m(), kMaxPositionM);
  }
  if (contact.has_held_m()) verdict.vector(true, contact.held_m(), kMaxPositionM);
  verdict.number(contact.relaxed_m(), -kMaxPositionM, kMaxPositionM);
  if (contact.has_grip()) check_grip(contact, verdict);
  if (contact.has_arm_m()) verdict.vector(true, contact.arm_m(), kMaxPositionM);
}

Contact contact_of(const v1::Contact& wire) {
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
  contact.hunt_crossley_exponent = wire.hunt_crossley_exponent();
  if (contact.hunt_crossley_exponent > 0.0) {
    contact.hunt_crossley_depth_m = wire.hunt_crossley_depth_m();
    contact.hunt_crossley_stiffness_newton_per_m = wire.hunt_crossley_stiffness_newton_per_m();
    contact.hunt_crossley_damping_newton_s_per_m = wire.hunt_crossley_damping_newton_s_per_m();
  }
  contact.friction_coefficient = wire.friction_coefficient();
  contact.friction_stiffness_newton_per_m = wire.friction_stiffness_newton_per_m();
  if (wire.has_stretch_m()) contact.stretch_m = vector(wire.stretch_m());
  contact.is_shaft = wire.is_shaft();
  contact.is_behind = wire.is_behind();
  contact.is_punctured = wire.is_punctured();
  if (wire.has_held_m()) contact.held_m = vector(wire.held_m());
  contact.relaxed_m = wire.relaxed_m();
  if (wire.has_grip()) contact.grip = grip_of(wire.grip());
  if (wire.has_arm_m()) contact.arm_m = vector(wire.arm_m());
  return contact;
}

}  // namespace

template <>
struct WireFormat<Interaction> {
  using Message = v1::Interaction;

  static void fill(const Interaction& m, v1::Interaction& wire) {
    put_stamp(m.device_session_id, m.device_sequence, m.device_sampled_at, *wire.mutable_answers());
    put(m.tool_position_world_m, *wire.mutable_tool_position_world_m());
    put(m.tool_orientation_world, *wire.mutable_tool_orientation_world());
    put(m.force_on_tool_newton, *wire.mutable_force_on_tool_newton());
    wire.set_stored_energy_joule(m.stored_energy_joule);
    wire.set_contact_count(m.contact_count);
    wire.set_physics_term(m.physics_term);
    wire.set_scene_ahead_ns(m.scene_ahead.count());
    wire.set_steps(m.steps);
    if (m.wave.is_present()) put(m.wave, *wire.mutable_wave());
    if (!m.torque_on_tool_newton_m.isZero(0.0)) {
      put(m.torque_on_tool_newton_m, *wire.mutable_torque_on_tool_newton_m());
    }
    const std::size_t count = std::min<std::size_t>(m.listed_count, kMaxContacts);
    for (std::size_t i = 0; i < count; ++i) put_contact(m.contacts[i], *wire.add_contacts());
    if (m.surface.store_id != 0) put(m.surface, *wire.mutable_surface());
    if (m.elastic.store_id != 0) put(m.elastic, *wire.mutable_elastic());
  }

  static void check(const v1::Interaction& wire, Verdict& verdict) {
    verdict.stamp(wire.has_answers(), wire.answers());
    verdict.vector(wire.has_tool_position_world_m(), wire.tool_position_world_m(), kMaxPositionM);
    verdict.orientation(wire.has_tool_orientation_world(), wire.tool_orientation_world());
    verdict.vector(wire.has_force_on_tool_newton(), wire.force_on_tool_newton(),
                   kMaxTissueForceNewton);
    verdict.number(wire.stored_energy_joule(), 0.0, kMaxStoredEnergyJoule);
    verdict.expect(wire.physics_term() <= kMaxPhysicsTerm);
    verdict.time(wire.scene_ahead_ns());
    if (wire.has_wave()) check_wave(wire.wave(), verdict);
    if (wire.has_torque_on_tool_newton_m()) {
      verdict.vector(true, wire.torque_on_tool_newton_m(), kMaxTissueForceNewton);
    }
    // contacts that touch are listed first, as far as there is room; then near ones
    const auto listed = static_cast<std::uint32_t>(wire.contacts_size());
    const auto touching = static_cast<std::uint32_t>(
        std::count_if(wire.contacts().begin(), wire.contacts().end(),
                      [](const v1::Contact& one) { return one.penetration_m() > 0.0; }));
    verdict.expect(listed <= kMaxContacts);
    verdict.expect(touching == std::min<std::uint32_t>(wire.contact_count(), kMaxContacts));
    for (const v1::Contact& one : wire.contacts()) check_contact(one, verdict);
    if (wire.has_surface()) check_surface(wire.surface(), verdict);
    if (wire.has_elastic()) {
      check_elastic(wire.elastic(), verdict);
      verdict.expect(listed <= kMaxContactsWithElastic && !wire.surface().has_description() &&
                     wire.surface().tiles_size() == 0);
    }
  }

  static void read(const v1::Interaction& wire, Interaction& m) {
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
      m.contacts[i] = contact_of(wire.contacts(static_cast<int>(i)));
    }
    m.physics_term = wire.physics_term();
    m.scene_ahead = Duration(wire.scene_ahead_ns());
    m.steps = wire.steps();
    m.wave = wire.has_wave() ? wave(wire.wave()) : Wave{};
    m.torque_on_tool_newton_m = vector(wire.torque_on_tool_newton_m());
    m.surface.store_id = 0;
    if (wire.has_surface()) read_surface(wire.surface(), m.surface);
    m.elastic.store_id = m.elastic.number = 0;
    if (wire.has_elastic()) read_elastic(wire.elastic(), m.elastic);
  }
};
template class Codec<Interaction>;

}  // namespace palpate
