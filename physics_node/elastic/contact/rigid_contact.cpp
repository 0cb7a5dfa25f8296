// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/contact/rigid_contact.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/contact/tissue_motion.h"

namespace palpate::elastic {
namespace {

// Of the penalty, in Young's moduli over the length of a node's area: what is left after a round.
constexpr double kModuli = 20.0;
// A node so near may touch in the next step, besides the way that it goes in it so many times.
constexpr double kReach_m = 2e-3;
constexpr double kWays = 2.0;
// The multiplier is at most the penalty at this depth: where a body cannot get out of the way.
constexpr double kDeepest_m = 0.01;
// The plane of a node that went in may turn by at most 60° in a step: then it shows another side.
constexpr double kSameSide = 0.5;
constexpr double kSamePlace_m = 1e-9;
// Another round is made where the limit of friction changes by more than this.
constexpr double kOtherLimit = 0.1;
constexpr int kMostRestRounds = 30;

}  // namespace

RigidContact::RigidContact(const Body& body, const std::vector<Face>& faces,
                           std::vector<RigidNeighbor> neighbors)
    : neighbors_(std::move(neighbors)) {
  if (neighbors_.empty()) return;
  if (std::any_of(neighbors_.begin(), neighbors_.end(),
                  [](const RigidNeighbor& one) { return is_moving(one.motion); })) {
    moved_m_.assign(neighbors_.size(), Vector3d::Zero());
    last_way_m_ = moved_m_;
  }
  const double young_pa = body.description().materials.front().young_modulus_pa;
  const std::vector<double> areas = areas_of_nodes_m2(body.mesh(), faces);
  for (std::uint32_t node = 0; node < areas.size(); ++node) {
    if (!(areas[node] > 0.0) || body.pattern().row_of[node] < 0) continue;
    for (std::uint32_t k = 0; k < neighbors_.size(); ++k) {
      One one{.plane = {}, .neighbor = k};
      one.plane.point.nodes[0] = node;
      one.plane.point.weights[0] = 1.0;
      one.plane.point.count = 1;
      one.plane.point.area_m2 = areas[node];
      one.plane.stiffness_newton_per_m =
          contact_stiffness_newton_per_m(young_pa, areas[node], kModuli);
      one.plane.friction_coefficient = neighbors_[k].friction_coefficient;
      one.plane.motion = neighbors_[k].motion;
      ones_.push_back(one);
    }
  }
}

void RigidContact::move_to(double time_s) noexcept { move_towards(time_s, 1.0); }

double RigidContact::way_to_m(double time_s) const noexcept {
  double longest_m = 0.0;
  for (std::size_t k = 0; k < moved_m_.size(); ++k) {
    const Vector3d way_m = displacement(neighbors_[k].motion, time_s).position_m - moved_m_[k];
    longest_m = std::max(longest_m, way_m.norm());
  }
  return longest_m;
}

void RigidContact::move_towards(double time_s, double share) noexcept {
  for (std::size_t k = 0; k < moved_m_.size(); ++k) {
    const Vector3d to_m = displacement(neighbors_[k].motion, time_s).position_m;
    last_way_m_[k] = share * (to_m - moved_m_[k]);
    moved_m_[k] = share == 1.0 ? to_m : Vector3d(moved_m_[k] + last_way_m_[k]);
  }
  if (!can_move()) return;
  for (One& one : ones_) {
    const Vector3d& way_m = last_way_m_[one.neighbor];
    one.plane.offset_m += one.plane.normal.dot(way_m);
    one.plane.anchor_m += way_m;
    one.seen_m += way_m;
  }
}

bool RigidContact::is_carried() const noexcept {
  return can_move() && std::any_of(near_.begin(), near_.end(), [&](std::uint32_t i) {
           return !last_way_m_[ones_[i].neighbor].isZero(0.0);
         });
}

palpate::SurfaceView RigidContact::view(std::uint32_t neighbor, const Vector3d& at_m,
                                        palpate::SurfaceHint& hint) const {
  const palpate::Surface& surface = *neighbors_[neighbor].surface;
  return can_move() ? surface.view(at_m - moved_m_[neighbor], hint) : surface.view(at_m, hint);
}

void RigidContact::look(One& one, const Vector3d& at_m) const {
  const palpate::SurfaceView view = this->view(one.neighbor, at_m, one.hint);
  one.seen_m = at_m;
  one.clear_m = view.distance_m;
  if (!std::isfinite(view.distance_m)) return;
  const bool is_other_side = one.is_near && view.distance_m < 0.0 &&
                             view.normal.dot(one.plane.normal) < kSameSide &&
                             one.plane.normal.dot(at_m) < one.plane.offset_m;
  if (is_other_side) return;
  one.plane.normal = view.normal;
  one.plane.offset_m = view.normal.dot(at_m) - view.distance_m;
}

void RigidContact::begin_step(const double* x_m, const double* v_m_per_s, double step_s) {
  for (One& one : ones_) {
    const Vector3d at_m = one.plane.point.position_m(x_m);
    const double speed = v_m_per_s == nullptr ? 0.0 : one.plane.point.position_m(v_m_per_s).norm();
    one.margin_m = kReach_m + kWays * speed * step_s;
    if (can_move()) one.margin_m += kWays * last_way_m_[one.neighbor].norm();
    const double moved_m = (at_m - one.seen_m).norm();
    if (one.clear_m - moved_m > one.margin_m) {
      one.is_near = false;
    } else {
      if (moved_m > kSamePlace_m || one.clear_m < 0.0 || !one.is_near) look(one, at_m);
      const bool is_near = one.clear_m < one.margin_m;
      if (is_near && !one.is_near) one.plane.anchor_m = at_m;
      one.is_near = is_near;
    }
    if (!one.is_near) one.plane.multiplier_newton = one.plane.limit_newton = 0.0;
  }
  gather();
}

void RigidContact::gather() {
  near_.clear();
  for (std::uint32_t i = 0; i < ones_.size(); ++i) {
    if (ones_[i].is_near) near_.push_back(i);
  }
}

void RigidContact::end_step(const double* x_m) noexcept {
  for (const std::uint32_t i : near_) {
    ones_[i].plane.update_multiplier(x_m, kDeepest_m);
    ones_[i].plane.slip(x_m);
  }
}

double RigidContact::add_gradient(const double* x_m, double* gradient) const {
  double joule = 0.0;
  for (const std::uint32_t i : near_) joule += ones_[i].plane.add_gradient(x_m, gradient);
  return joule;
}

void RigidContact::add_stiffness(const double* x_m, const BlockPattern& pattern,
                                 BlockValues& values) const {
  for (const std::uint32_t i : near_) ones_[i].plane.add_stiffness(x_m, pattern, values);
}

bool RigidContact::begin_round(const double* x_m, const BlockPattern& /*pattern*/) {
  bool is_begun = false;
  seen_.clear();
  for (std::uint32_t i = 0; i < ones_.size(); ++i) {
    const One& one = ones_[i];
    const Vector3d at_m = one.plane.point.position_m(x_m);
    const double moved_m = (at_m - one.seen_m).norm();
    if (!one.is_near && one.clear_m - moved_m > 0.0) continue;
    const double k = one.plane.stiffness_newton_per_m;
    const double newton = one.plane.pressing_newton(x_m);
    if (one.is_near && std::abs(newton - one.plane.multiplier_newton) > k * kClose_m) {
      is_begun = true;
    }
    // friction follows what presses
    const double limit = one.plane.friction_coefficient * newton;
    if (std::abs(limit - one.plane.limit_newton) > kOtherLimit * limit) is_begun = true;
    if (moved_m <= kSamePlace_m) continue;
    One& seen = seen_.emplace_back(one);
    look(seen, at_m);
    if (!one.is_near && seen.clear_m < 0.0) {
      seen.is_near = is_begun = true;
      seen.plane.anchor_m = at_m;
    }
    if (one.is_near && std::abs(seen.plane.gap_m(x_m) - one.plane.gap_m(x_m)) > kClose_m &&
        std::min(seen.plane.gap_m(x_m), one.plane.gap_m(x_m)) < kClose_m) {
      is_begun = true;
    }
  }
  if (!is_begun) return false;
  for (const std::uint32_t i : near_) ones_[i].plane.update_multiplier(x_m, kDeepest_m);
  std::size_t next = 0;
  for (One& one : ones_) {
    if (next == seen_.size()) break;
    One& seen = seen_[next];
    if (seen.plane.point.nodes[0] != one.plane.point.nodes[0] || seen.neighbor != one.neighbor) {
      continue;
    }
    seen.plane.multiplier_newton = one.plane.multiplier_newton;
    seen.plane.limit_newton = one.plane.limit_newton;
    one = seen;
    ++next;
  }
  gather();
  return true;
}

std::vector<ContactPlane> RigidContact::pressed() const {
  std::vector<ContactPlane> planes;
  for (const std::uint32_t i : near_) {
    if (ones_[i].plane.multiplier_newton > 0.0) planes.push_back(ones_[i].plane);
  }
  return planes;
}

Vector3d RigidContact::force_on_body_newton(const double* x_m) const noexcept {
  Vector3d force = Vector3d::Zero();
  for (const std::uint32_t i : near_) force += ones_[i].plane.force_on_body_newton(x_m);
  return force;
}

double RigidContact::deepest_m(const double* x_m) const noexcept {
  double deepest_m = 0.0;
  for (const One& one : ones_) {
    const Vector3d at_m = one.plane.point.position_m(x_m);
    if (one.clear_m - (at_m - one.seen_m).norm() > 0.0) continue;
    palpate::SurfaceHint hint = one.hint;
    deepest_m = std::max(deepest_m, -view(one.neighbor, at_m, hint).distance_m);
  }
  return deepest_m;
}

SearchReport find_rest(EquilibriumSearch& search, WarpedFactor& factor, RigidContact& contact,
                       const SearchLimits& limits, VectorXd& x_m) {
  const Obstacle* const obstacle = contact.is_there() ? &contact : nullptr;
  contact.begin_step(x_m.data(), nullptr, 0.0);
  SearchReport report = find_rest(search, factor, obstacle, limits, x_m);
  for (int round = 1; obstacle != nullptr && round < kMostRestRounds && report.is_converged &&
                      contact.begin_round(x_m.data(), search.body().pattern());
       ++round) {
    report = find_rest(search, factor, obstacle, limits, x_m);
  }
  contact.end_step(x_m.data());
  return report;
}

}  // namespace palpate::elastic
