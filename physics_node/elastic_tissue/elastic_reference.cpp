// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/elastic_reference.h"

#include <algorithm>
#include <array>
#include <utility>

#include "common/contact/contact_model.h"
#include "physics_node/elastic_tissue/elastic_contact.h"
#include "physics_node/scene/scene.h"

namespace palpate::physics {
namespace {

// From a tip farther away the body is not described.
constexpr double kReach_m = 0.05;

}  // namespace

ElasticReference::ElasticReference(std::vector<std::shared_ptr<const ElasticBody>> bodies,
                                   double tip_radius_m, double step_s)
    : tip_radius_m_(tip_radius_m), step_s_(step_s) {
  for (auto& body : bodies) {
    One& one = bodies_.emplace_back();
    one.body = std::move(body);
    one.simulation = std::make_unique<ElasticSimulation>(*one.body, 1, tip_radius_m, step_s);
    one.stiffness_newton_per_m = elastic_stiffness(one.body->hertz_newton, kHertzDepth_m);
  }
}

std::vector<std::shared_ptr<const ElasticBody>> ElasticReference::bodies() const {
  std::vector<std::shared_ptr<const ElasticBody>> bodies;
  for (const One& one : bodies_) bodies.push_back(one.body);
  return bodies;
}

std::uint64_t ElasticReference::failed_steps() const noexcept {
  std::uint64_t failed = 0;
  for (const One& one : bodies_) failed += one.simulation->failed_steps();
  return failed;
}

void ElasticReference::advance(double time_s, const Vector3& tip_m, SceneForce& sum) {
  const bool is_due = !next_s_ || time_s > *next_s_ - 1e-6 * step_s_;
  if (is_due) {
    for (One& one : bodies_) step(one, tip_m, time_s);
    tip_m_ = tip_m;
    next_s_ = std::max(next_s_.value_or(time_s) + step_s_, time_s);
  }
  for (const One& one : bodies_) {
    Contact acting = one.contact;
    acting.force_on_tool_newton =
        is_due ? one.full_newton
               : evaluate(one.contact, tip_m - tip_m_, Vector3::Zero(), 0.0).force_on_tool_newton;
    if (acting.force_on_tool_newton.isZero(0.0)) continue;
    acting.penetration_m = std::max(acting.penetration_m, 1e-9);
    add_contact(acting, sum);
  }
}

void ElasticReference::step(One& one, const Vector3& tip_m, double time_s) const {
  std::array<std::optional<TipState>, 1> tips;
  const ElasticBody& body = *one.body;
  if (one.side.follow(body.shape, body.bounds, tip_radius_m_, kReach_m, tip_m, time_s)) {
    tips[0] = {.tip_m = tip_m,
               .place_m = one.side.place_m(),
               .friction_on_tool_newton = one.rubbing.force_on_tool_newton()};
  }
  one.simulation->step(tips);
  one.full_newton = one.simulation->touch(0).force_on_tool_newton;
  one.contact = {};
  if (!one.side.is_known()) {
    one.rubbing = {};
    return;
  }
  const SurfaceView& view = one.side.view();
  const double penetration_m = tip_radius_m_ - view.distance_m;
  const Vector3 normal = contact_normal(one.full_newton, view.normal);
  if (penetration_m > kLeastDepth_m) {
    one.stiffness_newton_per_m =
        elastic_stiffness(std::max(0.0, one.full_newton.dot(normal)), penetration_m);
  }
  one.contact = elastic_contact(body.tissue, view, penetration_m, normal,
                                one.stiffness_newton_per_m, tip_radius_m_);
  one.rubbing.settle(tip_m, body.friction_coefficient, body.shear_newton_per_m, one.contact);
  one.full_newton += one.rubbing.force_on_tool_newton();
}

Vector3 ElasticReference::force_at(const Vector3& tip_m) const noexcept {
  Vector3 force = Vector3::Zero();
  for (const One& one : bodies_) {
    force += evaluate(one.contact, tip_m - tip_m_, Vector3::Zero(), 0.0).force_on_tool_newton;
  }
  return force;
}

}  // namespace palpate::physics
