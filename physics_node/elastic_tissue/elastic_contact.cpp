// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/elastic_contact.h"

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"

namespace palpate::physics {
namespace {

constexpr double kHertzExponent = 1.5;
constexpr double kLeastForce_newton = 1e-3;
// A tip so many times as deep as the sphere that waits has not pressed its way there.
constexpr double kMostAhead = 4.0;

}  // namespace

double elastic_stiffness(double newton, double penetration_m) noexcept {
  const double k = newton / (penetration_m * std::sqrt(penetration_m / kHertzDepth_m));
  return std::isfinite(k) ? std::clamp(k, 0.0, kMaxStiffnessNewtonPerM) : 0.0;
}

double elastic_depth_m(double newton, double stiffness_newton_per_m) noexcept {
  const double depth_m =
      std::cbrt(kHertzDepth_m * newton / stiffness_newton_per_m * newton / stiffness_newton_per_m);
  return std::isfinite(depth_m) ? std::clamp(depth_m, 0.0, 1.0) : 0.0;
}

Contact elastic_contact(std::uint32_t tissue, const SurfaceView& view, double penetration_m,
                        const Vector3& normal, double stiffness_newton_per_m,
                        double tip_radius_m) noexcept {
  const Matrix3 along_surface = Matrix3::Identity() - normal * normal.transpose();
  // A sphere does not feel sharper edges, and none of those behind the surface.
  const double sharpness_per_m = view.curvature_per_m.norm();
  const double felt = view.distance_m < 0.0 ? 0.0
                      : sharpness_per_m * tip_radius_m > 1.0
                          ? 1.0 / (sharpness_per_m * tip_radius_m)
                          : 1.0;
  const Matrix3 curvature = felt * along_surface * view.curvature_per_m * along_surface;
  Contact contact{
      .tissue = tissue,
      .penetration_m = penetration_m,
      .normal_world = normal,
      .curvature_per_m = 0.5 * (curvature + curvature.transpose()),
      .hunt_crossley_exponent = kHertzExponent,
      .hunt_crossley_depth_m = kHertzDepth_m,
      .hunt_crossley_stiffness_newton_per_m = stiffness_newton_per_m,
      .trust_radius_m = std::min(view.trust_radius_m + tip_radius_m + std::max(0.0, -penetration_m),
                                 kMaxTrustRadiusM)};
  const HuntCrossleyForce law = hunt_crossley(contact, penetration_m);
  contact.elastic_force_on_tool_newton = law.elastic_newton * normal;
  contact.d_force_d_position = -law.stiffness_newton_per_m * normal * normal.transpose();
  contact.stored_energy_joule = law.stored_energy_joule;
  if (penetration_m > 0.0) {
    contact.force_on_tool_newton = contact.elastic_force_on_tool_newton;
    contact.held_m = penetration_m * normal;
  }
  return contact;
}

double force_ratio_ahead(double penetration_m, double further_m) noexcept {
  if (!(further_m > 0.0)) return 1.0;
  const double ratio = penetration_m / std::max(kLeastDepth_m, penetration_m - further_m);
  return ratio > 1.0 && ratio < kMostAhead ? ratio : 1.0;
}

bool TipSide::follow(const Surface& surface, const Bounds& bounds, double tip_radius_m,
                     double reach_m, const Vector3& tip_m, double time_s) noexcept {
  const double near_m = tip_radius_m + reach_m;
  const bool was_known = is_known_;
  is_known_ = bounds.squared_distance(tip_m) <= near_m * near_m;
  if (is_known_ && was_known) {
    move(surface, tip_radius_m, tip_m, std::max(0.0, time_s - time_s_), proxy_);
  } else if (is_known_) {
    proxy_ = begun_at(surface, tip_radius_m, tip_m, proxy_.hint);
  }
  time_s_ = time_s;
  return is_known_;
}

void TipSide::change_to(const Surface& surface) noexcept {
  proxy_.hint = {};
  is_known_ = is_known_ && surface.view(proxy_.place_m).distance_m > 0.0;
}

void Rubbing::settle(const Vector3& tip_m, double friction_coefficient, double shear_newton_per_m,
                     Contact& contact) noexcept {
  if (!(friction_coefficient > 0.0)) return;
  const Vector3& n = contact.normal_world;
  // nothing holds without normal force
  stretch_m_ = is_rubbed_ ? rubbed_stretch(stretch_m_, tip_m - tip_m_, n, friction_coefficient,
                                           shear_newton_per_m, n.dot(contact.force_on_tool_newton))
                          : Vector3::Zero();
  tip_m_ = tip_m;
  is_rubbed_ = contact.penetration_m > 0.0;
  newton_ = -shear_newton_per_m * stretch_m_;
  add_friction(friction_coefficient, shear_newton_per_m, stretch_m_, contact);
  contact.force_on_tool_newton += newton_;
}

Vector3 contact_normal(const Vector3& force_on_tool_newton,
                       const Vector3& surface_normal) noexcept {
  const double newton = force_on_tool_newton.norm();
  if (!(newton > kLeastForce_newton) || !(force_on_tool_newton.dot(surface_normal) > 0.0)) {
    return surface_normal;
  }
  return force_on_tool_newton / newton;
}

}  // namespace palpate::physics
