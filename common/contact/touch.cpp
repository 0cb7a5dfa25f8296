// SPDX-License-Identifier: Apache-2.0
#include "common/contact/touch.h"

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"
#include "common/contact/material.h"

namespace palpate {
namespace {

// Least penetration reported for punctured tissue, wherever the tip is in it [m].
constexpr double kLeastPuncture_m = 1e-3;

/// The contact of punctured tissue: a spring, equally stiff in all directions, to where the tip is
/// stuck.
Contact drag(const Touch& touch, const KelvinVoigtMaterial& material) noexcept {
  const double k = material.friction_stiffness_newton_per_m;
  Contact contact;
  contact.penetration_m = std::max(touch.penetration_m(), kLeastPuncture_m);
  contact.normal_world = touch.proxy.surface.normal;
  contact.elastic_force_on_tool_newton = -k * touch.stretch_m;
  contact.d_force_d_position = -k * Matrix3::Identity();
  contact.stored_energy_joule = 0.5 * k * touch.stretch_m.squaredNorm();
  contact.is_adhesive = true;
  // as far as the spring holds: beyond the trust radius the force stays constant
  contact.trust_radius_m = kMinTrustRadiusM;
  if (k > 0.0) {
    const double most_m = material.cutting_newton / k - touch.stretch_m.norm();
    contact.trust_radius_m = std::clamp(most_m, kMinTrustRadiusM, kMaxTrustRadiusM);
  }
  return contact;
}

}  // namespace

void settle(Touch& touch, const Vector3& moved_m, const KelvinVoigtMaterial& material,
            double relaxed_m) noexcept {
  if (touch.is_punctured) {
    touch.stretch_m =
        friction_stretch(touch.stretch_m + moved_m, 1.0, material.friction_stiffness_newton_per_m,
                         material.cutting_newton);
    return;
  }
  const double penetration_m = touch.penetration_m();
  const bool is_touching = penetration_m > 0.0 && std::isfinite(penetration_m);
  const bool may_puncture = material.puncture_newton > 0.0 && !touch.is_shaft;
  if (!is_touching || !(material.friction_coefficient > 0.0 || may_puncture)) {
    touch.is_rubbed = false;
    touch.stretch_m.setZero();
    return;
  }
  const Contact contact =
      describe(material, touch.proxy.surface, penetration_m, relaxed_m, touch.proxy.point_m);
  const Vector3& n = contact.normal_world;
  const double normal_newton = n.dot(contact.elastic_force_on_tool_newton);
  if (may_puncture && normal_newton > material.puncture_newton) {
    touch.is_punctured = true;
    touch.is_rubbed = false;
    touch.stretch_m.setZero();
    touch.proxy.place_m = touch.proxy.point_m;
    return;
  }
  touch.stretch_m = touch.is_rubbed
                        ? rubbed_stretch(touch.stretch_m, moved_m, n, material.friction_coefficient,
                                         material.friction_stiffness_newton_per_m, normal_newton)
                        : Vector3::Zero();
  touch.is_rubbed = true;
}

Contact contact_of(const Touch& touch, const KelvinVoigtMaterial& material,
                   double relaxed_m) noexcept {
  if (touch.is_punctured) return drag(touch, material);
  Contact contact = describe(material, touch.proxy.surface, touch.penetration_m(), relaxed_m,
                             touch.proxy.point_m);
  if (material.friction_coefficient > 0.0) {
    add_friction(material.friction_coefficient, material.friction_stiffness_newton_per_m,
                 touch.stretch_m - contact.normal_world.dot(touch.stretch_m) * contact.normal_world,
                 contact);
  }
  return contact;
}

}  // namespace palpate
