// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/elastic_simulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace palpate::physics {
namespace {

// A tip this far from the body may touch it within two steps of the full solution.
constexpr double kNear_m = 0.02;
// A tip that is first seen so far from its proxy appeared inside.
constexpr double kInside_m = 2e-4;
constexpr double kPartRadii = 0.5;  // see step()
// The surface must lie on the sphere within about 80°, in the mean over the force: on an edge it
// may be almost at right angles to it.
constexpr double kLeastFacing = 0.2;
// A body under a sphere that appeared in it comes to rest in a step at least this long, and of so
// many steps: there was no motion on the way.
constexpr double kLeastSettling_s = 0.08;
constexpr double kSettlingPeriods = 4.0;
// A sphere that could not go on tries again after so many steps, or when its tip has come back
// by this factor of the way that was left.
constexpr int kBlockedSteps = 10;
constexpr double kNearer = 0.9;
// Then the body begins again.
constexpr int kMostFailedInARow = 3;

elastic::DynamicsSettings settings(bool is_folded) {
  // backward Euler: one factor serves steps with and without contact
  return {.theta = 1.0,
          .tolerance_m = 2e-6,
          .is_exact = true,
          .most_exact_iterations = 100,
          .most_factors = 4,
          .slow_ratio = 0.9,
          .slow_iterations = 4,
          .other_step_ratio = 16.01,
          .most_rounds = 4,
          .is_folded = is_folded};
}

}  // namespace

double ElasticSimulation::Tips::add_gradient(const double* x_m, double* gradient) const {
  double sum = 0.0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (is_near[i] != 0) sum += contacts[i].add_gradient(x_m, gradient);
  }
  for (const elastic::HeldPoints& one : held) sum += one.add_gradient(x_m, gradient);
  sum += tearing.add_gradient(x_m, gradient);
  sum += rigid.add_gradient(x_m, gradient);
  for (const elastic::ContactPlane& one : neighbors) sum += one.add_gradient(x_m, gradient);
  for (const elastic::Tie& one : ties) sum += one.add_gradient(x_m, gradient);
  for (const auto& [node, newton] : rubbed_newton) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t at = 3 * std::size_t{node} + i;
      sum -= newton[static_cast<int>(i)] * x_m[at];
      gradient[at] -= newton[static_cast<int>(i)];
    }
  }
  return sum;
}

void ElasticSimulation::Tips::add_stiffness(const double* x_m, const elastic::BlockPattern& pattern,
                                            elastic::BlockValues& values) const {
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (is_near[i] != 0) contacts[i].add_stiffness(x_m, pattern, values);
  }
  for (const elastic::HeldPoints& one : held) one.add_stiffness(pattern, values);
  tearing.add_stiffness(x_m, pattern, values);
  rigid.add_stiffness(x_m, pattern, values);
  for (const elastic::ContactPlane& one : neighbors) one.add_stiffness(x_m, pattern, values);
  for (const elastic::Tie& one : ties) one.add_stiffness(x_m, pattern, values);
}

void ElasticSimulation::Tips::add_exact_stiffness(const double* x_m,
                                                  const elastic::BlockPattern& pattern,
                                                  elastic::BlockValues& values) const {
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (is_near[i] != 0) contacts[i].add_exact_stiffness(x_m, pattern, values);
  }
  for (const elastic::HeldPoints& one : held) one.add_stiffness(pattern, values);
  tearing.add_stiffness(x_m, pattern, values);
  rigid.add_stiffness(x_m, pattern, values);
  for (const elastic::ContactPlane& one : neighbors) one.add_stiffness(x_m, pattern, values);
  for (const elastic::Tie& one : ties) one.add_stiffness(x_m, pattern, values);
}

double ElasticSimulation::Tips::longest_correction_m() const {
  double longest_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (is_near[i] != 0) longest_m = std::min(longest_m, contacts[i].longest_correction_m());
  }
  return longest_m;
}

bool ElasticSimulation::Tips::begin_round(const double* x_m, const elastic::BlockPattern& pattern) {
  bool is_begun = rigid.begin_round(x_m, pattern);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (is_near[i] != 0) is_begun = contacts[i].begin_round(x_m, pattern) || is_begun;
  }
  return is_begun;
}

/// But for what the body lies on, while that stands still.
bool ElasticSimulation::Tips::is_still() const {
  return !rigid.is_carried() &&
         std::all_of(is_near.begin(), is_near.end(), [](char near) { return near == 0; }) &&
         std::all_of(held.begin(), held.end(), [](const auto& one) { return one.is_empty(); }) &&
         tearing.is_idle();
}

ElasticSimulation::ElasticSimulation(const ElasticBody& body, std::size_t tools,
                                     double tip_radius_m, double step_s, bool is_folded)
    : body_(body),
      tip_radius_m_(tip_radius_m),
      step_s_(step_s),
      this_step_s_(step_s),
      dynamics_(*body.body, settings(is_folded)),
      tips_(body),
      touches_(tools),
      last_tips_(tools),
      triangles_(triangles_of(body)),
      before_relaxed_(dynamics_.relaxation()),
      before_rigid_(tips_.rigid) {
  for (std::size_t i = 0; i < tools; ++i) {
    tips_.contacts.emplace_back(body.points, body.contact_stiffness_pa_per_m,
                                &body.body->pattern());
    tips_.is_near.push_back(0);
    tips_.held.emplace_back();
  }
  dynamics_.set_state(body.start_m, elastic::VectorXd::Zero(body.start_m.size()));
}

void ElasticSimulation::continue_as(const ElasticSimulation& other) {
  step_s_ = other.step_s_;
  this_step_s_ = other.this_step_s_;
  dynamics_.continue_as(other.dynamics_);
  tips_ = other.tips_;
  touches_ = other.touches_;
  last_tips_ = other.last_tips_;
  time_s_ = other.time_s_;
  carried_s_ = other.carried_s_;
  report_ = other.report_;
  failed_steps_ = other.failed_steps_;
  repaired_steps_ = other.repaired_steps_;
  appeared_ = other.appeared_;
  failed_in_a_row_ = other.failed_in_a_row_;
  elsewhere_joule_ = other.elsewhere_joule_;
}

std::size_t ElasticSimulation::hold(std::size_t tool, const Vector3& at_m, double reach_m,
                                    std::size_t most, double newton_per_m, bool is_as_at_rest) {
  elastic::HeldPoints& held = tips_.held[tool];
  held.take(body_.points, dynamics_.x_m().data(), at_m, reach_m, most, newton_per_m,
            is_as_at_rest ? body_.start_m.data() : nullptr);
  return held.size();
}

std::size_t ElasticSimulation::hold_beside(std::size_t tool, const Vector3& at_m,
                                           const std::array<Vector3, 2>& edge_m, double reach_m,
                                           std::size_t most, double newton_per_m,
                                           const Vector3& origin_m) {
  elastic::HeldPoints& held = tips_.held[tool];
  held.set_place(at_m);
  return held.take_beside(body_.points, body_.start_m.data(), edge_m, reach_m, most, newton_per_m,
                          origin_m);
}

double ElasticSimulation::stored_joule() const noexcept {
  double joule = report_.elastic_joule + report_.gravity_joule;
  for (const elastic::HeldPoints& one : tips_.held) {
    joule += one.stored_joule(dynamics_.x_m().data());
  }
  return joule + tips_.tearing.stored_joule(dynamics_.x_m().data()) + elsewhere_joule_;
}

/// Moves the sphere towards its tip, and looks at the surface on the way, so that each point is
/// seen before it is inside. False: it is not there yet.
bool ElasticSimulation::follow(std::size_t tool, const TipState& tip) {
  Touch& touch = touches_[tool];
  elastic::SphereContact& contact = tips_.contacts[tool];
  const double* x = dynamics_.x_m().data();
  if (!touch.is_near) {
    contact.forget();
    touch.blocked_steps = 0;
    touch.centre_m = tip.place_m;
    contact.set_sphere(touch.centre_m, tip_radius_m_);
    contact.choose_near(x, tip_radius_m_);
    touch.is_arriving = (tip.tip_m - tip.place_m).norm() > kInside_m;
  }
  touch.is_near = true;
  if (touch.blocked_steps > 0) {
    const bool is_nearer =
        touch.blocked_m.dot(tip.tip_m - touch.centre_m) < kNearer * touch.blocked_m.squaredNorm();
    touch.blocked_steps = is_nearer ? 0 : touch.blocked_steps - 1;
    contact.choose_near(x, tip_radius_m_);
    if (touch.blocked_steps > 0) return true;
  }
  double left_m = tip_radius_m_;
  while (left_m > 0.0) {
    const Vector3 way = tip.tip_m - touch.centre_m;
    const double free_m = contact.nearest_m() - 1.5 * tip_radius_m_;
    const double most_m = std::max(std::min(0.5 * tip_radius_m_, left_m), free_m);
    const double length_m = way.norm();
    touch.centre_m += std::min(1.0, most_m / std::max(length_m, 1e-12)) * way;
    contact.set_sphere(touch.centre_m, tip_radius_m_);
    contact.choose_near(x, tip_radius_m_);
    if (length_m <= most_m) return true;
    if (!(free_m >= most_m)) left_m -= most_m;
  }
  return false;
}

/// Solid angle of the surface as seen from there: 4π inside, 0 outside [vanOosterom83].
bool ElasticSimulation::is_inside(const Vector3& place_m) const {
  const elastic::VectorXd& x = dynamics_.x_m();
  double half_angle = 0.0;
  for (const auto& [a, b, c] : triangles_) {
    const Vector3 to_a = x.segment<3>(3 * Eigen::Index{a}) - place_m;
    const Vector3 to_b = x.segment<3>(3 * Eigen::Index{b}) - place_m;
    const Vector3 to_c = x.segment<3>(3 * Eigen::Index{c}) - place_m;
    const double l_a = to_a.norm();
    const double l_b = to_b.norm();
    const double l_c = to_c.norm();
    half_angle +=
        std::atan2(to_a.dot(to_b.cross(to_c)), l_a * l_b * l_c + to_a.dot(to_b) * l_c +
                                                   to_b.dot(to_c) * l_a + to_c.dot(to_a) * l_b);
  }
  return half_angle > std::numbers::pi;
}

/// Spreads the reaction over the pressed points.
void ElasticSimulation::rub(const Touch& touch, const Vector3& friction_on_tool_newton) {
  double pressed_newton = 0.0;
  for (const auto& force : touch.forces_on_body_newton) pressed_newton += force.norm();
  if (!(pressed_newton > 0.0) || friction_on_tool_newton.isZero(0.0)) return;
  for (std::size_t p = 0; p < touch.forces_on_body_newton.size(); ++p) {
    const double share = touch.forces_on_body_newton[p].norm() / pressed_newton;
    if (!(share > 0.0)) continue;
    const elastic::SurfacePoint& point = body_.points[p];
    for (std::size_t i = 0; i < static_cast<std::size_t>(point.count); ++i) {
      tips_.rubbed_newton.emplace_back(point.nodes[i],
                                       -share * point.weights[i] * friction_on_tool_newton);
    }
  }
}

bool ElasticSimulation::step(std::span<const std::optional<TipState>> tips,
                             std::optional<double> step_s) {
  const int parts = parts_of(tips);
  has_torn_ = false;
  this_step_s_ = step_s.value_or(step_s_) / parts;
  bool has_stepped = false;
  const bool is_carried = tips_.rigid.can_move() && time_s_;
  if (is_carried && !carried_s_) be_carried();
  for (int part = 1; part <= parts; ++part) {
    part_tips_.assign(tips.begin(), tips.end());
    const double share = static_cast<double>(part) / parts;
    if (is_carried) part_time_s_ = *carried_s_ + share * (*time_s_ - *carried_s_);
    for (std::size_t i = 0; i < tips.size() && part < parts; ++i) {
      if (!tips[i] || !last_tips_[i]) continue;
      part_tips_[i]->tip_m = last_tips_[i]->tip_m + share * (tips[i]->tip_m - last_tips_[i]->tip_m);
    }
    has_stepped = step_part(part_tips_) || has_stepped;
  }
  if (is_carried) carried_s_ = time_s_;
  can_step_again_ = can_step_again_ && parts == 1;
  last_tips_.assign(touches_.size(), std::nullopt);
  std::copy(tips.begin(), tips.end(), last_tips_.begin());
  return has_stepped;
}

int ElasticSimulation::parts_of(std::span<const std::optional<TipState>> tips) const {
  double parts = 1.0;
  for (std::size_t i = 0; i < tips.size(); ++i) {
    if (!tips[i] || !last_tips_[i] || !touches_[i].is_near) continue;
    const double way_m = (tips[i]->tip_m - last_tips_[i]->tip_m).norm();
    const double free_m = tips_.contacts[i].nearest_m() - 2.0 * tip_radius_m_;
    if (way_m > free_m) parts = std::max(parts, std::ceil(way_m / (kPartRadii * tip_radius_m_)));
  }
  return parts < kMostParts ? static_cast<int>(parts) : kMostParts;
}

bool ElasticSimulation::step_part(std::span<const std::optional<TipState>> tips) {
  const double near_m = tip_radius_m_ + kNear_m;
  const std::vector<Touch> touches_before = touches_;
  const std::vector<elastic::SphereContact> contacts_before = tips_.contacts;
  bool must_settle = false;
  tips_.rubbed_newton.clear();
  for (std::size_t i = 0; i < touches_.size(); ++i) {
    Touch& touch = touches_[i];
    const bool is_holding = !tips_.held[i].is_empty();
    if (is_holding && tips[i]) tips_.held[i].set_place(tips[i]->tip_m - tips[i]->slip_m);
    const bool is_there = !is_holding && i < tips.size() && tips[i] && tips[i]->tip_m.allFinite() &&
                          tips[i]->place_m.allFinite() &&
                          body_.bounds.squared_distance(tips[i]->tip_m) < near_m * near_m;
    if (is_there) {
      rub(touch, tips[i]->friction_on_tool_newton);
      const bool is_new = !touch.is_near;
      const bool has_arrived = follow(i, *tips[i]);
      appeared_ += is_new && touch.is_arriving ? 1U : 0U;
      must_settle = must_settle || touch.is_arriving;
      touch.is_arriving = touch.is_arriving && !has_arrived;
    }
    touch.is_near = is_there;
    tips_.is_near[i] = is_there && tips_.contacts[i].near_count() > 0 ? 1 : 0;
    touch.force_on_tool_newton.setZero();
    touch.forces_on_body_newton.clear();
  }
  can_step_again_ = false;
  if (is_neighbor_moving_) dynamics_.wake();
  if (carried_s_ && dynamics_.is_asleep()) {  // what it lies on may move, or come near
    elastic::RigidContact rigid = tips_.rigid;
    rigid.move_to(part_time_s_);
    rigid.begin_step(dynamics_.x_m().data(), dynamics_.v_m_per_s().data(), this_step_s_);
    if (rigid.is_carried()) {
      dynamics_.wake();
    } else {
      tips_.rigid = std::move(rigid);
    }
  }
  if (tips_.is_still() && dynamics_.is_asleep()) {
    static_cast<void>(dynamics_.step(this_step_s_));
    return false;
  }
  before_m_ = dynamics_.x_m();
  before_relaxed_ = dynamics_.relaxation();
  before_rigid_ = tips_.rigid;
  if (must_settle ? settle() : step_once()) {
    failed_in_a_row_ = 0;
    can_step_again_ = !must_settle;
    return true;
  }
  ++failed_steps_;
  repair(tips, touches_before, contacts_before);
  const bool is_repaired = std::none_of(touches_.begin(), touches_.end(),
                                        [](const Touch& touch) { return touch.has_failed; });
  repaired_steps_ += is_repaired ? 1U : 0U;
  return true;
}

/// After a step that failed: the spheres wait where they were, and if that fails too, the body with
/// them. One that appeared in a wrong place, or waited in vain, begins again.
void ElasticSimulation::repair(std::span<const std::optional<TipState>> tips,
                               const std::vector<Touch>& touches_before,
                               const std::vector<elastic::SphereContact>& contacts_before) {
  const elastic::StepReport failed = report_;
  // between bodies its untouched state may be inside of them by now
  bool can_wait =
      failed_in_a_row_ < kMostFailedInARow || !tips_.neighbors.empty() || !tips_.ties.empty();
  std::vector<std::size_t> there;
  for (std::size_t i = 0; i < touches_.size(); ++i) {
    if (!touches_[i].is_near) continue;
    there.push_back(i);
    can_wait = can_wait && touches_before[i].is_near && !touches_before[i].has_failed;
  }
  tips_.rubbed_newton.clear();
  if (can_wait) {
    ++failed_in_a_row_;
    set_body(before_m_, before_relaxed_);
    tips_.contacts = contacts_before;
    tips_.rigid = before_rigid_;
    for (const std::size_t i : there) {
      Touch& touch = touches_[i];
      touch.centre_m = touches_before[i].centre_m;
      touch.blocked_m = tips[i]->tip_m - touch.centre_m;
      // one that leaves does not wait
      const bool is_leaving = touch.blocked_m.dot(tips[i]->place_m - touch.centre_m) > 0.0;
      touch.blocked_steps = is_leaving ? 0 : kBlockedSteps;
      tips_.contacts[i].choose_near(before_m_.data(), tip_radius_m_);
      tips_.is_near[i] = tips_.contacts[i].near_count() > 0 ? 1 : 0;
    }
    if (!step_once()) {
      // as it was, with the forces of then
      set_body(before_m_, before_relaxed_);
      tips_.contacts = contacts_before;
      tips_.rigid = before_rigid_;
      for (const std::size_t i : there) {
        touches_[i].has_failed = false;
        touches_[i].force_on_tool_newton = touches_before[i].force_on_tool_newton;
        touches_[i].forces_on_body_newton = touches_before[i].forces_on_body_newton;
      }
    }
  } else {
    failed_in_a_row_ = 0;
    begin_again(tips, there);
  }
  report_.search = failed.search;  // it has not converged
}

/// The body from its untouched state, the spheres from their proxies, as far as that goes right.
void ElasticSimulation::begin_again(std::span<const std::optional<TipState>> tips,
                                    const std::vector<std::size_t>& there) {
  set_body(body_.start_m, relaxed());
  tips_.rigid = *body_.resting;
  for (const std::size_t i : there) touches_[i].is_near = false;
  if (carried_s_) be_carried();
  bool are_there = false;
  for (int step = 0; step < kMostRepairSteps && !are_there; ++step) {
    before_m_ = dynamics_.x_m();
    before_relaxed_ = dynamics_.relaxation();
    before_rigid_ = tips_.rigid;
    const std::vector<Touch> touches_before = touches_;
    const std::vector<elastic::SphereContact> contacts_before = tips_.contacts;
    are_there = true;
    for (const std::size_t i : there) {
      are_there = follow(i, *tips[i]) && are_there;
      touches_[i].is_arriving = false;
      tips_.is_near[i] = tips_.contacts[i].near_count() > 0 ? 1 : 0;
    }
    if (step_once()) continue;
    set_body(before_m_, before_relaxed_);
    tips_.contacts = contacts_before;
    tips_.rigid = before_rigid_;
    touches_ = touches_before;
    for (const std::size_t i : there) {
      touches_[i].blocked_steps = kBlockedSteps;
      touches_[i].blocked_m = tips[i]->tip_m - touches_[i].centre_m;
      touches_[i].has_failed = step == 0;
    }
    return;
  }
}

/// A body at rest, in which nothing is left to relax.
elastic::Relaxation ElasticSimulation::relaxed() const {
  return {body_.body->description().branches, body_.body->rest_m().size()};
}

void ElasticSimulation::set_body(const elastic::VectorXd& x_m,
                                 const elastic::Relaxation& relaxation) {
  dynamics_.set_relaxation(relaxation);
  dynamics_.set_state(x_m, elastic::VectorXd::Zero(x_m.size()));
  dynamics_.search().update_rotations(x_m);
}

/// A step so long that nothing moves at its end. False: it has failed.
bool ElasticSimulation::settle() {
  const double step_s =
      std::exchange(this_step_s_, std::max(kLeastSettling_s, kSettlingPeriods * step_s_));
  const bool is_right = step_once();
  this_step_s_ = step_s;
  if (is_right) set_body(elastic::VectorXd(dynamics_.x_m()), dynamics_.relaxation());
  return is_right;
}

/// A step with the spheres where they are. False: it has failed.
bool ElasticSimulation::step_once(bool is_again) {
  if (tips_.rigid.is_there() && !is_again) {
    if (carried_s_) tips_.rigid.move_to(part_time_s_);
    tips_.rigid.begin_step(dynamics_.x_m().data(), dynamics_.v_m_per_s().data(), this_step_s_);
  }
  elastic::Obstacle* const obstacle = tips_.is_idle() ? nullptr : &tips_;
  report_ = is_again ? dynamics_.step_again(this_step_s_, obstacle)
                     : dynamics_.step(this_step_s_, obstacle);
  // between a sphere and bone, or between bodies, there may be no room left for the elements
  const bool may_be_squeezed =
      !tips_.neighbors.empty() || (tips_.rigid.is_there() && !tips_.is_still());
  const bool is_squeezed = may_be_squeezed && body_.body->has_inverted_element(dynamics_.x_m()) &&
                           !body_.body->has_inverted_element(before_m_);
  bool has_failed = is_squeezed;
  for (std::size_t i = 0; i < touches_.size(); ++i) {
    Touch& touch = touches_[i];
    touch.has_failed = false;
    touch.force_on_tool_newton.setZero();
    touch.forces_on_body_newton.clear();
    if (!tips_.held[i].is_empty()) {
      touch.forces_on_body_newton.resize(body_.points.size(), Vector3::Zero());
      touch.force_on_tool_newton =
          tips_.held[i].add_forces_on_body(dynamics_.x_m().data(), touch.forces_on_body_newton);
    }
    if (!touch.is_near) continue;
    elastic::SphereContact& contact = tips_.contacts[i];
    contact.update_multipliers(dynamics_.x_m().data(), body_.body->pattern());
    touch.has_failed = is_wrong(i) || (has_failed && tips_.is_near[i] != 0);
    has_failed = has_failed || touch.has_failed;
    if (touch.has_failed || tips_.is_near[i] == 0) continue;
    touch.force_on_tool_newton = contact.force_on_sphere_newton();
    touch.forces_on_body_newton = contact.forces_on_body_newton();
  }
  report_.search.is_converged = report_.search.is_converged && !has_failed;
  if (tips_.rigid.is_there()) tips_.rigid.end_step(dynamics_.x_m().data());
  if (!has_failed) has_torn_ = tips_.tearing.note(dynamics_.x_m().data()) || has_torn_;
  return !has_failed;
}

/// The surface holds the sphere on the wrong side.
bool ElasticSimulation::is_wrong(std::size_t tool) const {
  return tips_.contacts[tool].facing() < kLeastFacing || is_inside(touches_[tool].centre_m);
}

}  // namespace palpate::physics
