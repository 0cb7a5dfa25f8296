// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/elastic_reference.h"

#include <algorithm>
#include <array>
#include <limits>
#include <span>
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
                                   double tip_radius_m, double step_s,
                                   const std::optional<GripperConfig>& gripper,
                                   const std::optional<ElectrodeConfig>& electrode)
    : whole_(std::move(bodies)), tip_radius_m_(tip_radius_m), step_s_(step_s), gripper_(gripper) {
  for (const auto& body : whole_) {
    One& one = bodies_.emplace_back();
    one.whole = one.body = body;
    const bool can_be_cut = gripper_ && gripper_->is_blade() && body->pierced;
    one.simulation = std::make_unique<ElasticSimulation>(*one.body, 1, tip_radius_m, step_s);
    one.stiffness_newton_per_m = elastic_stiffness(one.body->hertz_newton, kHertzDepth_m);
    if (gripper_ || electrode) one.compliance = std::make_shared<BodyCompliance>(one.body);
    if (electrode || can_be_cut) {
      one.ablation =
          std::make_unique<Ablation>(one.compliance, electrode, tip_radius_m, 1, false, can_be_cut);
    }
  }
  std::vector<const ElasticBody*> all;
  for (const auto& body : whole_) all.push_back(body.get());
  members_ = Island::of(all);
  for (const std::vector<std::size_t>& members : members_) {
    std::vector<const ElasticBody*> own;
    for (const std::size_t i : members) own.push_back(all[i]);
    islands_.emplace_back(own);
  }
}

void ElasticReference::change_body(One& one) const {
  const auto next = one.ablation->advance(step_s_, one.simulation->x_m());
  if (next == nullptr) return;
  one.simulation =
      std::make_unique<ElasticSimulation>(*next->body(), *one.simulation, next->change, false);
  one.side.change_to(next->body()->shape);
  one.held.change_body(*one.simulation, 0, next->shared->compliance(),
                       gripper_ ? &*gripper_ : nullptr);
  one.compliance = next->shared;
  one.body = next->body();
}

std::uint64_t ElasticReference::failed_steps() const noexcept {
  std::uint64_t failed = 0;
  for (const One& one : bodies_) failed += one.simulation->failed_steps();
  return failed;
}

/// The jaws close around the nearest body.
void ElasticReference::close(const Vector3& tip_m, bool is_closed) {
  const bool closes = is_closed && !is_closed_;
  is_closed_ = is_closed;
  if (is_closed && !closes) return;
  One* nearest = nullptr;
  double least_m = std::numeric_limits<double>::infinity();
  for (One& one : bodies_) {
    one.jaw.set(0);
    if (!closes) continue;
    const double distance_m = one.body->shape.view(tip_m).distance_m;
    if (distance_m < least_m) {
      least_m = distance_m;
      nearest = &one;
    }
  }
  if (closes) ++closings_;
  if (nearest != nullptr) nearest->jaw.set(closings_);
}

void ElasticReference::advance(double time_s, const Vector3& tip_m, SceneForce& sum, bool is_closed,
                               bool is_energised) {
  const bool is_due = !next_s_ || time_s > *next_s_ - 1e-6 * step_s_;
  if (is_due) {
    if (gripper_ && !gripper_->is_needle()) close(tip_m, is_closed);
    for (One& one : bodies_) {
      if (one.ablation) change_body(one);
      prepare(one, tip_m, time_s);
    }
    step();
    for (One& one : bodies_) {
      read(one, tip_m);
      if (one.ablation && is_energised)
        one.ablation->heat(0, one.simulation->x_m(), tip_m, step_s_);
    }
    tip_m_ = tip_m;
    next_s_ = std::max(next_s_.value_or(time_s) + step_s_, time_s);
  }
  for (const One& one : bodies_) {
    Contact acting = one.contact;
    acting.force_on_tool_newton = is_due ? one.full_newton : force_at(one, tip_m);
    if (acting.force_on_tool_newton.isZero(0.0)) continue;
    acting.penetration_m = std::max(acting.penetration_m, 1e-9);
    add_contact(acting, sum);
  }
}

void ElasticReference::step() {
  for (std::size_t i = 0; i < islands_.size(); ++i) {
    std::vector<ElasticSimulation*> bodies;
    std::vector<std::span<const std::optional<TipState>>> tips;
    for (const std::size_t member : members_[i]) {
      bodies.push_back(bodies_[member].simulation.get());
      tips.emplace_back(bodies_[member].tips);
    }
    if (bodies.size() == 1) {
      bodies[0]->step(tips[0]);
    } else {
      islands_[i].step(bodies, tips, {});
    }
  }
}

void ElasticReference::prepare(One& one, const Vector3& tip_m, double time_s) const {
  std::array<std::optional<TipState>, 1>& tips = one.tips;
  tips[0].reset();
  const ElasticBody& body = *one.body;
  one.simulation->set_time(time_s);
  const bool is_near =
      one.side.follow(body.shape, body.bounds, tip_radius_m_, kReach_m, tip_m, time_s);
  // behind the edge of a blade that is through, it touches nothing until it is out
  if (is_near && one.is_leaving) one.is_leaving = one.side.view().distance_m < tip_radius_m_;
  if (one.is_leaving) {
    one.side = {};
  } else if (is_near) {
    tips[0] = {.tip_m = tip_m,
               .place_m = one.side.place_m(),
               .friction_on_tool_newton = one.rubbing.force_on_tool_newton()};
  }
  if (gripper_) {
    if (!tips[0]) tips[0] = {.tip_m = tip_m, .place_m = tip_m};  // what is held comes along
    tips[0]->slip_m = one.jaw.slip_since_m();
    one.held.prepare(*one.simulation, 0, one.compliance->compliance(), *gripper_, one.jaw.command(),
                     tips[0]);
    if (gripper_->is_blade() && one.ablation) {
      EdgeInTissue edge;
      sweep_with(one.held, tips[0]->slip_m, *gripper_, *one.whole, 0, *one.ablation, one.sweep,
                 edge);
      one.held.set_edge(edge);
    }
    if (one.is_leaving) tips[0].reset();
  }
}

void ElasticReference::read(One& one, const Vector3& tip_m) const {
  const ElasticBody& body = *one.body;
  if (one.held.model().is_holding()) return hold(one, tip_m);
  one.full_newton = one.simulation->touch(0).force_on_tool_newton;
  one.contact = {};
  one.velocity_m_per_s.setZero();
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
  pierce(one, tip_m);
}

/// After a touch: the next step holds the tissue.
void ElasticReference::pierce(One& one, const Vector3& tip_m) const {
  const bool is_needle = gripper_ && gripper_->is_needle() && one.body->pierced;
  if (!is_needle || one.jaw.is_closed()) return;
  const Piercing::Laws laws{.tissue = *one.body->pierced, .needle = *gripper_};
  const Vector3 inward = gripper_->is_blade() ? gripper_->blade_facing : -Vector3::UnitZ();
  const ElasticSimulation::Touch& touch = one.simulation->touch(0);
  Vector3 newton = one.full_newton;
  if (touch.blocked_steps > 0) {
    const SurfaceView& view = one.side.view();
    newton *= force_ratio_ahead(tip_radius_m_ - view.distance_m,
                                -view.normal.dot(tip_m - touch.centre_m));
  }
  if (!one.piercing.presses(laws, newton, one.side.place_m(), inward, tip_radius_m_)) return;
  one.jaw.set(++one.punctures);
  NeedleLaw& law = one.jaw.start_needle();
  one.piercing.update(laws, 0.0, law);
  if (!gripper_->is_blade()) return;
  const double length_m = gripper_->needle_width_m;
  fit_blade(laws.tissue,
            {.length_m = length_m, .newton = laws.tissue.toughness_joule_per_m2 * length_m},
            Vector3::UnitZ(), law);
}

void ElasticReference::hold(One& one, const Vector3& tip_m) const {
  one.held.read(*one.simulation, 0, one.compliance->compliance(), step_s_, one.held.changes(),
                true);
  const Vector3 velocity = one.held.model().velocity_m_per_s;
  const bool is_needle = one.jaw.needle().is_there();
  if (is_needle) {
    one.jaw.begin(one.held.model());
    one.piercing.update({.tissue = *one.body->pierced, .needle = *gripper_}, one.jaw.depth_m(),
                        one.jaw.needle());
    if (gripper_->is_blade()) {
      fit_blade(*one.body->pierced, one.held.model().edge, one.jaw.needle().edge_world,
                one.jaw.needle());
    }
  }
  const bool is_through = gripper_->is_blade() && !(one.held.model().edge.length_m > 0.0);
  one.full_newton = one.jaw.act(one.held.model(), *gripper_, tip_m, velocity,
                                one.held.model().relaxation_s / step_s_);
  one.jaw.note_work(one.full_newton, tip_m, true);
  one.rubbing = {};
  one.contact = {};
  if (is_through) {
    one.full_newton.setZero();
    one.side = {};
    one.is_leaving = true;
  }
  if (is_through || !one.jaw.holds(one.held.model())) {
    if (!is_needle) return;
    NeedleLaw& law = one.jaw.needle();
    if (gripper_->is_blade()) {
      law.deepest_m = std::min(law.deepest_m, one.held.model().edge.deepest_m);
    }
    one.piercing.leave(law);
    one.jaw.set(0);
    return;
  }
  one.contact =
      grip_contact(one.held.model(), *gripper_, one.body->tissue, tip_m - one.jaw.slip_since_m(),
                   velocity, one.jaw.slip_m(), Vector3::Zero(), one.jaw.needle());
  one.velocity_m_per_s = velocity;
}

Vector3 ElasticReference::force_at(const One& one, const Vector3& tip_m) const noexcept {
  return evaluate(one.contact, tip_m - tip_m_, one.velocity_m_per_s, 0.0).force_on_tool_newton;
}

Vector3 ElasticReference::force_at(const Vector3& tip_m) const noexcept {
  Vector3 force = Vector3::Zero();
  for (const One& one : bodies_) force += force_at(one, tip_m);
  return force;
}

}  // namespace palpate::physics
