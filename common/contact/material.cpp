// SPDX-License-Identifier: Apache-2.0
#include "common/contact/material.h"

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"

namespace palpate {
namespace {

/// k and b at one position, with inclusions.
struct LocalStiffness {
  double k = 0.0;
  double b = 0.0;
  Vector3 gradient_of_k = Vector3::Zero();
  Matrix3 hessian_of_k = Matrix3::Zero();
  double trust_radius_m = kMaxTrustRadiusM;
};

/// The share of an inclusion is 1 inside, 0 outside and s² (3 − 2s) in its shell.
LocalStiffness stiffness_at(const KelvinVoigtMaterial& material, const Vector3& point_m) noexcept {
  LocalStiffness here{.k = material.stiffness_newton_per_m, .b = material.damping_newton_s_per_m};
  for (const InclusionConfig& inclusion : material.inclusions) {
    const Vector3 from_center = point_m - inclusion.center_m;
    const double r = from_center.norm();
    const double h = inclusion.transition_m;
    const double to_shell_m = std::abs(r - inclusion.radius_m) - 0.5 * h;
    here.trust_radius_m = std::min(here.trust_radius_m, std::max(0.125 * h, to_shell_m));
    const double s = std::clamp(0.5 - (r - inclusion.radius_m) / h, 0.0, 1.0);
    if (s == 0.0) continue;

    const double share = s * s * (3.0 - 2.0 * s);
    const double k_change = inclusion.stiffness_newton_per_m - material.stiffness_newton_per_m;
    here.k += share * k_change;
    here.b += share * (inclusion.damping_newton_s_per_m - material.damping_newton_s_per_m);
    if (s == 1.0 || r == 0.0) continue;
    const Vector3 outwards = from_center / r;
    const Matrix3 radial = outwards * outwards.transpose();
    const double slope = -k_change * 6.0 * s * (1.0 - s) / h;
    const double bend = k_change * (6.0 - 12.0 * s) / (h * h);
    here.gradient_of_k += slope * outwards;
    here.hessian_of_k += bend * radial + slope / r * (Matrix3::Identity() - radial);
  }
  return here;
}

}  // namespace

Contact describe(const KelvinVoigtMaterial& material, const SurfaceView& surface,
                 double penetration_m, double relaxed_m, const Vector3& point_m) noexcept {
  const double p = penetration_m;
  const Vector3& n = surface.normal;
  const Matrix3 nn = n * n.transpose();
  Contact contact;
  contact.penetration_m = p;
  contact.normal_world = n;
  contact.curvature_per_m = surface.curvature_per_m;
  contact.trust_radius_m = surface.trust_radius_m;
  contact.is_adhesive = material.is_adhesive;

  // local factor from the stiffness map of a cloud
  const double ratio = surface.stiffness_ratio;
  if (material.exponent > 0.0) {
    contact.hunt_crossley_exponent = material.exponent;
    contact.hunt_crossley_depth_m = material.exponent_depth_m;
    contact.hunt_crossley_stiffness_newton_per_m = ratio * material.stiffness_newton_per_m;
    contact.hunt_crossley_damping_newton_s_per_m = material.damping_newton_s_per_m;
    const HuntCrossleyForce law = hunt_crossley(contact, p);
    contact.elastic_force_on_tool_newton = law.elastic_newton * n;
    contact.d_force_d_position = -law.stiffness_newton_per_m * nn;
    contact.d_force_d_velocity = -law.damping_newton_s_per_m * nn;
    contact.stored_energy_joule = law.stored_energy_joule;
    return contact;
  }
  double k = ratio * material.stiffness_newton_per_m;
  double b = material.damping_newton_s_per_m;
  if (!material.inclusions.empty()) {
    const LocalStiffness here = stiffness_at(material, point_m);
    k = ratio * here.k;
    b = here.b;
    contact.trust_radius_m = std::min(contact.trust_radius_m, here.trust_radius_m);
    if (p > 0.0) {
      contact.elastic_force_on_tool_newton = -0.5 * p * p * ratio * here.gradient_of_k;
      contact.d_force_d_position =
          ratio * (p * (n * here.gradient_of_k.transpose() + here.gradient_of_k * n.transpose()) -
                   0.5 * p * p * here.hessian_of_k);
    }
  }

  // along the normal
  double N = k * p;
  double slope = k;
  contact.stored_energy_joule = 0.5 * k * p * p;
  if (const double k1 = material.relaxing_stiffness_newton_per_m; k1 > 0.0) {
    const double stretch_m = p - relaxed_m;
    N += k1 * stretch_m;
    slope += k1;
    contact.stored_energy_joule += 0.5 * k1 * stretch_m * stretch_m;
  }
  if (const double k3 = material.stiffening_newton_per_m3; k3 > 0.0) {
    N += k3 * p * p * p;
    slope += 3.0 * k3 * p * p;
    contact.stiffening_newton_per_m2 = 3.0 * k3 * p;
    contact.stiffening_newton_per_m3 = k3;
    contact.stored_energy_joule += 0.25 * k3 * p * p * p * p;
  }
  contact.elastic_force_on_tool_newton += N * n;
  contact.d_force_d_position -= slope * nn;

  if (b > 0.0) {
    contact.d_force_d_velocity =
        material.is_damping_isotropic ? Matrix3(-b * Matrix3::Identity()) : Matrix3(-b * nn);
  }
  return contact;
}

}  // namespace palpate
