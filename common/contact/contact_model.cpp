// SPDX-License-Identifier: Apache-2.0
#include "common/contact/contact_model.h"

#include <algorithm>
#include <cmath>

namespace palpate {
namespace {

// Normals further apart than this are not one patch of surface: cos 91°.
constexpr double kLeastTurnCosine = -0.0175;

/// The surface as a displaced tool sees it.
struct Place {
  double penetration_m = 0.0;
  Vector3 normal = Vector3::UnitZ();
  Vector3 along_surface_m = Vector3::Zero();  // t
};

Place place_of(const Contact& contact, const Vector3& d) noexcept {
  const Vector3& n0 = contact.normal_world;
  const Matrix3& H = contact.curvature_per_m;
  const double a = n0.dot(d);
  const Vector3 t = d - a * n0;
  const Vector3 Ht = H * t;
  const double Ht2 = Ht.squaredNorm();
  if (!(Ht2 > 0.0)) return {contact.penetration_m - a, n0, t};

  const double kappa = Ht.dot(H * Ht) / Ht2;
  const Vector3 gradient = (1.0 + kappa * a) * n0 + Ht;
  const double length = gradient.norm();
  Place place;
  place.penetration_m =
      contact.penetration_m - (2.0 * a + t.dot(Ht) + kappa * a * a) / (1.0 + length);
  place.normal = length > 0.0 ? Vector3(gradient / length) : n0;
  place.along_surface_m = t;
  return place;
}

/// The smallest rotation that turns `from` into `to`; unit vectors, not opposite.
Matrix3 turn(const Vector3& from, const Vector3& to) noexcept {
  const Vector3 w = from.cross(to);
  Matrix3 cross;
  cross << 0.0, -w.z(), w.y(), w.z(), 0.0, -w.x(), -w.y(), w.x(), 0.0;
  return Matrix3::Identity() + cross + cross * cross / (1.0 + from.dot(to));
}

}  // namespace

Vector3 friction_stretch(const Vector3& wanted_m, double friction_coefficient,
                         double friction_stiffness_newton_per_m, double normal_newton) noexcept {
  if (!(friction_stiffness_newton_per_m > 0.0) || !(normal_newton > 0.0)) return Vector3::Zero();
  const double most_m = friction_coefficient * normal_newton / friction_stiffness_newton_per_m;
  const double length_m = wanted_m.norm();
  if (length_m <= most_m) return wanted_m;
  return std::isfinite(length_m) ? Vector3(most_m / length_m * wanted_m) : Vector3::Zero();
}

Vector3 rubbed_stretch(const Vector3& stretch_m, const Vector3& moved_m, const Vector3& normal,
                       double friction_coefficient, double friction_stiffness_newton_per_m,
                       double normal_newton) noexcept {
  const Vector3 stretched_m = stretch_m + moved_m;
  return friction_stretch(stretched_m - normal.dot(stretched_m) * normal, friction_coefficient,
                          friction_stiffness_newton_per_m, normal_newton);
}

void add_friction(double friction_coefficient, double friction_stiffness_newton_per_m,
                  const Vector3& stretch_m, Contact& contact) noexcept {
  contact.friction_coefficient = friction_coefficient;
  contact.friction_stiffness_newton_per_m = friction_stiffness_newton_per_m;
  contact.stretch_m = stretch_m;
  contact.stored_energy_joule += 0.5 * friction_stiffness_newton_per_m * stretch_m.squaredNorm();
}

HuntCrossleyForce hunt_crossley(const Contact& contact, double penetration_m) noexcept {
  if (!(penetration_m > 0.0)) return {};
  const double n = contact.hunt_crossley_exponent;
  const double ratio = penetration_m / contact.hunt_crossley_depth_m;
  const double secant = contact.hunt_crossley_stiffness_newton_per_m * std::pow(ratio, n - 1.0);
  return {
      .elastic_newton = secant * penetration_m,
      .stiffness_newton_per_m = n * secant,
      .damping_newton_s_per_m = contact.hunt_crossley_damping_newton_s_per_m * std::pow(ratio, n),
      .stored_energy_joule = secant * penetration_m * penetration_m / (n + 1.0)};
}

namespace {

/// The law at a place where the tool touches.
ModelForce law(const Contact& contact, const Place& place, const Vector3& velocity) noexcept {
  const Vector3& n0 = contact.normal_world;
  const Vector3& n = place.normal;
  const double deeper = place.penetration_m - contact.penetration_m;
  const double c2 = contact.stiffening_newton_per_m2;
  const double c3 = contact.stiffening_newton_per_m3;
  const Vector3 moved = place.along_surface_m - deeper * n0;
  const Vector3 Kd = contact.d_force_d_position * moved;

  Vector3 f = contact.elastic_force_on_tool_newton + Kd + (c2 + c3 * deeper) * deeper * deeper * n0;
  Matrix3 B = contact.d_force_d_velocity;
  const bool is_power = contact.hunt_crossley_exponent > 0.0;
  const HuntCrossleyForce power =
      is_power ? hunt_crossley(contact, place.penetration_m) : HuntCrossleyForce{};
  if (is_power) {
    f = power.elastic_newton * n0;
    B = -power.damping_newton_s_per_m * n0 * n0.transpose();
  }
  double stretched = 0.0;
  if (contact.friction_coefficient > 0.0) {
    const Vector3 s =
        friction_stretch(contact.stretch_m + place.along_surface_m, contact.friction_coefficient,
                         contact.friction_stiffness_newton_per_m, n0.dot(f));
    f -= contact.friction_stiffness_newton_per_m * s;
    stretched = 0.5 * contact.friction_stiffness_newton_per_m *
                (s.squaredNorm() - contact.stretch_m.squaredNorm());
  }
  if (n == n0) {
    f += B * velocity;
  } else {
    const Matrix3 Q = turn(n0, n);
    f = Q * (f + B * (Q.transpose() * velocity));
  }
  const double along_normal = n.dot(f);
  if (along_normal < 0.0 && !contact.is_adhesive) f -= along_normal * n;

  double elastic = contact.stored_energy_joule -
                   moved.dot(contact.elastic_force_on_tool_newton + 0.5 * Kd) +
                   (c2 / 3.0 + 0.25 * c3 * deeper) * deeper * deeper * deeper;
  if (is_power) {
    elastic = power.stored_energy_joule;
    if (contact.friction_coefficient > 0.0) {
      elastic += 0.5 * contact.friction_stiffness_newton_per_m * contact.stretch_m.squaredNorm();
    }
  }
  return {f, std::max(0.0, elastic + stretched), true};
}

ModelForce without_arm(const Contact& contact, const Vector3& displacement_m,
                       const Vector3& velocity_m_per_s, double age_s) noexcept {
  const Vector3 d = displacement_m - age_s * contact.surface_velocity_world_m_per_s;
  const Vector3 v = velocity_m_per_s - contact.surface_velocity_world_m_per_s;
  const Place place = place_of(contact, d);
  if (!(place.penetration_m > 0.0)) return {};
  if (contact.normal_world.dot(place.normal) < kLeastTurnCosine) return {};
  const double distance_m = d.norm();
  if (distance_m <= contact.trust_radius_m) return law(contact, place, v);

  // beyond: as at the edge, and no harder than the surface would let it
  const Place edge = place_of(contact, contact.trust_radius_m / distance_m * d);
  if (!(edge.penetration_m > 0.0)) return {};
  ModelForce force = law(contact, edge, v);
  const double share = std::min(1.0, place.penetration_m / edge.penetration_m);
  force.force_on_tool_newton *= share;
  force.stored_energy_joule *= share * share;
  return force;
}

}  // namespace

ModelForce evaluate(const Contact& contact, const Vector3& displacement_m,
                    const ToolVelocity& velocity, double age_s) noexcept {
  ModelForce force = without_arm(contact, displacement_m, velocity.at(contact.arm_m), age_s);
  force.torque_on_tool_newton_m = contact.arm_m.cross(force.force_on_tool_newton);
  return force;
}

ModelForce evaluate(const Interaction& interaction, const Vector3& tool_position_world_m,
                    const ToolVelocity& tool_velocity_world, double age_s,
                    std::span<const TissueShare> shares) noexcept {
  const Vector3 d = tool_position_world_m - interaction.tool_position_world_m;
  ModelForce sum;
  const bool is_all_listed = interaction.contact_count <= interaction.listed_count;
  if (!is_all_listed) sum = held(interaction);
  for (std::uint32_t i = 0; i < interaction.listed_count; ++i) {
    const Contact& contact = interaction.contacts[i];
    const auto other = std::find_if(shares.begin(), shares.end(), [&](const TissueShare& share) {
      return share.tissue == contact.tissue;
    });
    const bool is_held = contact.grip.number != 0;
    const double weight = is_held ? 0.0 : other != shares.end() ? 1.0 - other->share : 1.0;
    if (weight > 0.0) {
      sum.add(weight, evaluate(contact, d, tool_velocity_world, age_s));
    }
    if (!is_all_listed) {
      sum.force_on_tool_newton -= contact.force_on_tool_newton;
      sum.torque_on_tool_newton_m -= contact.arm_m.cross(contact.force_on_tool_newton);
    }
    if (!is_all_listed && contact.penetration_m > 0.0) {
      sum.stored_energy_joule -= contact.stored_energy_joule;
    }
  }
  sum.stored_energy_joule = std::max(0.0, sum.stored_energy_joule);
  if (!sum.force_on_tool_newton.allFinite() || !std::isfinite(sum.stored_energy_joule) ||
      !sum.torque_on_tool_newton_m.allFinite()) {
    return {};
  }
  return sum;
}

ModelForce evaluate_tissue(const Interaction& interaction, std::uint32_t tissue,
                           const Vector3& tool_position_world_m,
                           const ToolVelocity& tool_velocity_world, double age_s) noexcept {
  const Vector3 d = tool_position_world_m - interaction.tool_position_world_m;
  ModelForce sum;
  for (std::uint32_t i = 0; i < interaction.listed_count; ++i) {
    if (interaction.contacts[i].tissue != tissue || interaction.contacts[i].grip.number != 0) {
      continue;
    }
    sum.add(1.0, evaluate(interaction.contacts[i], d, tool_velocity_world, age_s));
  }
  return sum;
}

ModelForce held(const Interaction& interaction) noexcept {
  return {interaction.force_on_tool_newton, interaction.stored_energy_joule,
          interaction.contact_count > 0, interaction.torque_on_tool_newton_m};
}

}  // namespace palpate
