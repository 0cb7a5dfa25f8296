// SPDX-License-Identifier: Apache-2.0
#include "physics_node/foreign/contact_estimator.h"

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"

namespace palpate::physics {
namespace {

constexpr double kLeastNewton = 1e-3;     // below: no touch
constexpr double kPlace_m = 0.5e-3;       // least distance of two places that are compared
constexpr double kDepthMemory_m = 5e-3;   // forgetting, per depth …
constexpr double kSlideMemory_m = 50e-3;  // … and per way along the surface
constexpr double kTurnMemory_m = 20e-3;   // of the curvature
constexpr double kTurnRidge_m2 = 1e-6;    // curvature 0, unless the tool has slid 1 mm
constexpr double kRidge = 0.02;           // weight of the first guess: of a depth of 0.14 mm
constexpr double kDepthUnit_m = 1e-3;
constexpr double kSpeedUnit_m_per_s = 1e-2;
constexpr double kErrorWeight = 0.2;     // of the latest comparison in s²
constexpr double kLeastStiffness = 1.0;  // bounds of k [N/m]
constexpr double kMostStiffness = 2e4;
constexpr double kMostDamping = 500.0;    // [N·s/m]
constexpr double kMostCurvature = 200.0;  // [1/m]
constexpr double kTrustedError = 0.3;     // of the mean force, at the trust radius
constexpr double kLeastTrust_m = 0.5e-3;
constexpr double kMostTrust_m = 20e-3;
constexpr double kNoModel = 0.7;         // s / k beyond which the force is held
constexpr std::uint64_t kProbation = 3;  // comparisons before that is judged
constexpr double kOnePatch = 0.5;        // cosine of the turn of the normal in one step
constexpr double kExpected_m = 30e-3;    // how far from the last touch its surface is expected

/// The force of the observation whatever the tool does.
Contact held_contact(const Vector3& force_newton) noexcept {
  return {.penetration_m = 1.0,
          .normal_world = force_newton.normalized(),
          .elastic_force_on_tool_newton = force_newton,
          .is_adhesive = true,
          .trust_radius_m = 1.0,
          .force_on_tool_newton = force_newton};
}

struct Sphere {
  double penetration_m = 0.0;
  Vector3 normal = Vector3::UnitZ();
};
/// The circle of curvature of contact_model.h, seen from a place displaced by d.
Sphere seen_from(const Vector3& d, double penetration_m, const Vector3& normal,
                 double curvature_per_m) noexcept {
  const double a = normal.dot(d);
  const Vector3 t = d - a * normal;
  const Vector3 gradient = (1.0 + curvature_per_m * a) * normal + curvature_per_m * t;
  const double length = gradient.norm();
  return {penetration_m - (2.0 * a + curvature_per_m * d.squaredNorm()) / (1.0 + length),
          length > 0.0 ? Vector3(gradient / length) : normal};
}

}  // namespace

double ContactEstimator::slope_error_newton_per_m() const noexcept { return std::sqrt(error2_); }

std::optional<Contact> ContactEstimator::step(const Observation& seen) noexcept {
  const double magnitude = seen.force_on_tool_newton.norm();
  const bool is_felt = magnitude > kLeastNewton;
  if (!is_felt) return expect(seen);
  const Vector3 normal = seen.normal.value_or(seen.force_on_tool_newton / magnitude);
  const double newton = normal.dot(seen.force_on_tool_newton);
  // pulled into the tissue, or across it only: nothing that this law knows
  if (newton <= 0.5 * magnitude) {
    is_touching_ = false;
    return held_contact(seen.force_on_tool_newton);
  }
  return touch(seen, normal, newton);
}

std::optional<Contact> ContactEstimator::touch(const Observation& seen, const Vector3& normal,
                                               double newton) noexcept {
  if (is_touching_ && normal.dot(last_.normal) < kOnePatch) is_touching_ = false;  // over an edge
  const bool is_first = !is_touching_;
  if (is_first) begin(seen, normal, newton);

  Place here{.position_m = seen.position_m,
             .normal = normal,
             .depth_m = last_.depth_m,
             .approach_m_per_s = -normal.dot(seen.velocity_m_per_s),
             .newton = newton,
             .model = {}};
  if (!is_first) {
    const Vector3 mean_normal = (normal + last_.normal).normalized();
    here.depth_m -= mean_normal.dot(seen.position_m - last_.position_m);
    if ((seen.position_m - place_.position_m).norm() >= kPlace_m) compare(seen, here);
  }
  if (seen.law) adopt(*seen.law);
  const bool is_compared = is_first || place_.position_m == here.position_m;

  // the model, through what was observed; what damping does not explain is elastic
  const double elastic = std::max(newton - b_ * here.approach_m_per_s, 0.02 * newton);
  Contact contact = model(normal, elastic / k_);
  contact.elastic_force_on_tool_newton =
      seen.force_on_tool_newton + b_ * normal.dot(seen.velocity_m_per_s) * normal;
  contact.force_on_tool_newton = seen.force_on_tool_newton;
  contact.trust_radius_m = trust_radius_m();
  here.model = contact;
  has_surface_ = true;
  last_ = here;
  if (is_compared) place_ = here;
  free_at_m_.reset();
  return contact;
}

/// A touch begins: of the surface that was expected, or of one that nothing is known of.
void ContactEstimator::begin(const Observation& seen, const Vector3& normal,
                             double newton) noexcept {
  is_touching_ = true;
  if (k_ == 0.0) {
    double depth_m = seen.penetration_m.value_or(0.0);
    if (!(depth_m > 0.0) && free_at_m_) depth_m = -0.5 * normal.dot(seen.position_m - *free_at_m_);
    first_k_ = std::clamp(newton / std::max(depth_m, 1e-6), kLeastStiffness, kMostStiffness);
    k_ = first_k_;
    error2_ = 0.25 * k_ * k_;
  }
  if (mean_newton_ == 0.0) mean_newton_ = newton;
  last_.depth_m = newton / k_;
}

/// What has changed since the last place, as an equation for the law, and the error of its model.
void ContactEstimator::compare(const Observation& seen, const Place& here) noexcept {
  const Vector3 moved = here.position_m - place_.position_m;
  const Vector3 mean_normal = (here.normal + place_.normal).normalized();
  const Vector3 slid = moved - mean_normal.dot(moved) * mean_normal;
  const double deeper_m = here.depth_m - place_.depth_m;

  place_.model.trust_radius_m = moved.norm();  // the law itself, however far
  const ModelForce predicted = evaluate(place_.model, moved, seen.velocity_m_per_s, 0.0);
  const double error = (seen.force_on_tool_newton - predicted.force_on_tool_newton).squaredNorm() /
                       moved.squaredNorm();
  // the first one replaces the guess
  const double weight = std::max(kErrorWeight, 1.0 / static_cast<double>(compared_ + 1));
  error2_ += weight * (error - error2_);
  mean_newton_ += weight * (here.newton - mean_newton_);

  const double kept = std::exp(-std::abs(deeper_m) / kDepthMemory_m - slid.norm() / kSlideMemory_m);
  const double p = deeper_m / kDepthUnit_m;
  const double w = (here.approach_m_per_s - place_.approach_m_per_s) / kSpeedUnit_m_per_s;
  const double n = here.newton - place_.newton;
  pp_ = kept * pp_ + p * p;
  pw_ = kept * pw_ + p * w;
  ww_ = kept * ww_ + w * w;
  pn_ = kept * pn_ + p * n;
  wn_ = kept * wn_ + w * n;
  solve();

  const double turn_kept = std::exp(-slid.norm() / kTurnMemory_m);
  turn_ = turn_kept * turn_ + (here.normal - place_.normal).dot(slid);
  slid2_ = turn_kept * slid2_ + slid.squaredNorm();
  curvature_per_m_ = std::clamp(turn_ / (slid2_ + kTurnRidge_m2), -kMostCurvature, kMostCurvature);
  place_ = here;
  ++compared_;
}

/// k and b within their bounds.
void ContactEstimator::solve() noexcept {
  const double prior = first_k_ * kDepthUnit_m;
  const double pp = pp_ + kRidge;
  const double ww = ww_ + kRidge;
  const double pn = pn_ + kRidge * prior;
  const double determinant = pp * ww - pw_ * pw_;  // ≥ kRidge²
  double k = (pn * ww - wn_ * pw_) / determinant;
  double b = (wn_ * pp - pn * pw_) / determinant;
  const double most_b = kMostDamping * kSpeedUnit_m_per_s;
  if (!(b >= 0.0) || b > most_b) {
    b = b > most_b ? most_b : 0.0;
    k = (pn - b * pw_) / pp;
  }
  k_ = std::clamp(k / kDepthUnit_m, kLeastStiffness, kMostStiffness);
  b_ = b / kSpeedUnit_m_per_s;
}

/// k and b as measured instead.
void ContactEstimator::adopt(const ContactLaw& law) noexcept {
  k_ = std::clamp(law.stiffness_newton_per_m, kLeastStiffness, kMostStiffness);
  b_ = std::clamp(law.damping_newton_s_per_m, 0.0, kMostDamping);
}

void ContactEstimator::foresee(const Foreseen& tissue) noexcept {
  k_ = std::clamp(tissue.stiffness_newton_per_m, kLeastStiffness, kMostStiffness);
  if (first_k_ == 0.0) {
    first_k_ = k_;
    mean_newton_ = tissue.newton;
    error2_ = tissue.slope_error_newton_per_m * tissue.slope_error_newton_per_m;
  }
  last_ = {.position_m = tissue.surface_m, .normal = tissue.normal, .model = {}};
  last_.model = model(tissue.normal, 0.0);
  has_surface_ = true;
  is_touching_ = false;
}

void ContactEstimator::foresee_none(const Vector3& as_far_as_m) noexcept {
  const Contact& surface = last_.model;
  const Sphere there = seen_from(as_far_as_m - last_.position_m, surface.penetration_m,
                                 surface.normal_world, curvature_per_m_);
  if (there.penetration_m > 0.0) has_surface_ = false;
}

/// Without force: the surface of the last touch, as it is seen from here.
std::optional<Contact> ContactEstimator::expect(const Observation& seen) noexcept {
  is_touching_ = false;
  free_at_m_ = seen.position_m;
  if (!has_surface_) return std::nullopt;
  Contact& surface = last_.model;
  const Vector3 d = seen.position_m - last_.position_m;
  Sphere here = seen_from(d, surface.penetration_m, surface.normal_world, curvature_per_m_);

  // not as deep as it would be felt: the surface is lower, or the engine says how far it is
  const double withdrawal_m = b_ * here.normal.dot(seen.velocity_m_per_s) / k_;
  double most_m = std::max(0.0, withdrawal_m);
  if (seen.penetration_m) most_m = std::min(most_m, *seen.penetration_m);
  if (here.penetration_m > most_m) {
    surface.penetration_m -= here.penetration_m - most_m;
    here.penetration_m = most_m;
  }
  if (seen.normal) here.normal = *seen.normal;
  if (seen.penetration_m && *seen.penetration_m < 0.0) here.penetration_m = *seen.penetration_m;
  if (d.norm() > kExpected_m && !seen.penetration_m) return std::nullopt;

  Contact contact = model(here.normal, here.penetration_m);
  contact.elastic_force_on_tool_newton = k_ * here.penetration_m * here.normal;
  contact.trust_radius_m = std::abs(here.penetration_m) + trust_radius_m();
  return contact;
}

Contact ContactEstimator::model(const Vector3& normal, double penetration_m) const noexcept {
  const Matrix3 along = normal * normal.transpose();
  return {.penetration_m = penetration_m,
          .normal_world = normal,
          .curvature_per_m = curvature_per_m_ * (Matrix3::Identity() - along),
          .d_force_d_position = -k_ * along,
          .d_force_d_velocity = -b_ * along,
          .stored_energy_joule =
              std::min(0.5 * k_ * penetration_m * penetration_m, kMaxStoredEnergyJoule)};
}

double ContactEstimator::trust_radius_m() const noexcept {
  const double error = slope_error_newton_per_m();
  if (error > kNoModel * k_) return kLeastTrust_m;
  const double newton = std::max(mean_newton_, last_.newton);
  return std::clamp(kTrustedError * newton / std::max(error, 1e-3), kLeastTrust_m, kMostTrust_m);
}

}  // namespace palpate::physics
