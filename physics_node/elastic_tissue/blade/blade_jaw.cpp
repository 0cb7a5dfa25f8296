// SPDX-License-Identifier: Apache-2.0
// A blade in full solutions: the points beside its edge, the next body, and its books of energy.
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "physics_node/elastic_tissue/blade/blade_sweep.h"
#include "physics_node/elastic_tissue/jaw.h"

namespace palpate::physics {
namespace {

// What a sphere that is pressed in by w with the force F has stored is about so much of F w.
constexpr double kPressedShare = 0.4;
// What it has cut unpaid is taken back on such a way, by so much of the force at most.
constexpr double kPaidBack_m = 2e-3;
constexpr double kMostPaidBack = 0.25;
// Losses count against that only as far as those of cutting such a way.
constexpr double kMostCredit_m = 1e-3;
// What a next body releases pushes it as far as the blade is with this time constant, by such a
// share.
constexpr double kRegainedShare = 0.8;
constexpr double kRegained_s = 0.04;
// Of the stiffness at rest, in any direction: what the changes of the force say of it.
constexpr double kMostOther = 4.0;

}  // namespace

bool is_like_at_rest(const Matrix3& stiffness_newton_per_m, const Matrix3& at_rest_newton_per_m) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix3> ratios(
      stiffness_newton_per_m, at_rest_newton_per_m, Eigen::EigenvaluesOnly | Eigen::Ax_lBx);
  return ratios.info() == Eigen::Success && ratios.eigenvalues()[0] > 1.0 / kMostOther &&
         ratios.eigenvalues()[2] < kMostOther;
}

/// The edge pushes as far as the energy goes that the tip has stored by pressing. For the rest it
/// is short: it is longer than the tip was wide, so that the same way would take more.
void Jaw::begin_blade(ElasticSimulation& simulation, std::size_t tool,
                      elastic::SurfaceCompliance& compliance, const GripperConfig& gripper,
                      const JawCommand& command, const TipState& tip) {
  const Vector3 facing = command.inward();
  blade_ = {.from_m = tip.place_m + simulation.tip_radius_m() * facing,
            .facing = facing,
            .along = command.edge(),
            .length_m = gripper.blade_length_m};
  const Vector3 way_m = tip.tip_m - tip.place_m;
  deepest_m_ = command.deepest_m;
  behind_m_ = unpaid_m_ = 0.0;
  books_ = {.home_m = facing.dot(tip.place_m),
            .deepest_m = command.deepest_m,
            .tip_m = tip.tip_m,
            .tip_before_m = tip.tip_m,
            .elements = simulation.body().body->mesh().element_count()};
  const double pressed_joule =
      kPressedShare * std::max(0.0, -simulation.touch(tool).force_on_tool_newton.dot(way_m));
  books_.rest_joule = simulation.stored_joule() - pressed_joule;
  books_.left_joule = pressed_joule;
  model_.points = static_cast<std::uint32_t>(
      hold_beside(simulation, tool, gripper, tip.tip_m - tip.slip_m, tip.slip_m,
                  tip.place_m + way_m - way_m.dot(facing) * facing));
  if (model_.points == 0) return;
  const Matrix3 K = elastic::grip_stiffness_newton_per_m(compliance, simulation.held(), tool)[tool];
  const double stiff = facing.dot(K * facing);
  books_.short_m =
      std::max(0.0, way_m.dot(facing) - std::sqrt(2.0 * pressed_joule / std::max(stiff, 1e-9)));
  simulation.shift(tool, -books_.short_m * facing);
  model_.start_m = books_.short_m;
}

/// The points beside the edge of a blade that has slipped so far.
std::size_t Jaw::hold_beside(ElasticSimulation& simulation, std::size_t tool,
                             const GripperConfig& gripper, const Vector3& at_m,
                             const Vector3& slip_m, const Vector3& origin_m) const {
  const Vector3 from_m = blade_.from_m + slip_m;
  return simulation.hold_beside(tool, at_m, {from_m, from_m + blade_.length_m * blade_.along},
                                gripper.reach_m, gripper.most_points,
                                gripper.stiffness_newton_per_m, origin_m);
}

/// What it held comes to rest, and what is beside the edge now is pushed with at most the same
/// energy: an edge that goes on takes its strain with it. In its direction it pushes no farther
/// than it is from where it went in, less its way through the tissue; across, it is as far in the
/// tissue as it was.
void Jaw::move_beside(ElasticSimulation& simulation, std::size_t tool,
                      elastic::SurfaceCompliance& compliance, const GripperConfig& gripper) {
  // what has vanished took its energy and its weight with it
  const std::size_t elements = simulation.body().body->mesh().element_count();
  if (std::exchange(books_.elements, elements) != elements) {
    books_.is_known = false;
    books_.rest_joule = -std::numeric_limits<double>::infinity();
  }
  const Vector3 at_m = simulation.held()[tool].place_m();
  const Vector3 way_m = at_m - simulation.origin_m(tool);
  const double twice_joule = this->twice_joule(way_m, tool);
  if (hold_beside(simulation, tool, gripper, at_m, slip_in_tissue_m(books_.slip_m), at_m) == 0) {
    return;
  }
  const Matrix3 K = elastic::grip_stiffness_newton_per_m(compliance, simulation.held(), tool)[tool];
  // wᵀ K w is that, with w = q + t f and q the way in the plane at right angles to f
  const Vector3& f = blade_.facing;
  const Vector3 q = way_m - way_m.dot(f) * f;
  const double stiff = f.dot(K * f);
  const double softest = -f.dot(K * q) / stiff;
  const Vector3 least_m = q + softest * f;
  const double least_joule = least_m.dot(K * least_m);
  const double more_m = std::sqrt(std::max(0.0, twice_joule - least_joule) / stiff);
  Vector3 now_m = least_m - std::copysign(more_m, last_.force_on_tool_newton.dot(f)) * f;
  if (least_joule > twice_joule) now_m *= std::sqrt(twice_joule / least_joule);
  const double pushed_m = now_m.dot(f);
  const double most_m = f.dot(at_m) + behind_m_ - books_.home_m;
  if (pushed_m * most_m > 0.0 && std::abs(pushed_m) > std::abs(most_m)) {
    now_m += (most_m - pushed_m) * f;
  }
  books_.lost_joule += std::min(0.0, books_.released_joule);
  books_.released_joule = std::max(0.0, books_.released_joule);
  books_.short_m = most_m - now_m.dot(f);
  books_.released_s = kReleased_s;
  if (now_m.allFinite()) simulation.shift(tool, now_m);
}

/// Twice what the blade has stored in the body, as the stiffness at rest counts it. A body that is
/// strained far stores more than that or less, and one with other points less if it does.
double Jaw::twice_joule(const Vector3& way_m, std::size_t tool) const {
  if (stiffness_with_.empty()) return 0.0;
  const double at_rest = way_m.dot(stiffness_with_[tool] * way_m);
  if (!books_.is_alone || !books_.is_known) return at_rest;
  return std::min(at_rest, 2.0 * std::max(0.0, last_.stored_joule - books_.rest_joule));
}

/// What a blade has cut unpaid makes the way after it harder.
void Jaw::set_edge(const EdgeInTissue& edge) noexcept {
  model_.edge = edge;
  books_.cut_joule = edge.cut_joule;
  if (books_.lost_joule < 0.0) {
    model_.edge.newton += std::min(-books_.lost_joule / kPaidBack_m, kMostPaidBack * edge.newton);
  }
}

/// What the last next body has released pushes it as far as the blade is. @return  that way
double Jaw::regain(double step_s) {
  const Vector3& f = blade_.facing;
  const double push_newton = -last_.force_on_tool_newton.dot(f);
  if (!(books_.short_m > 0.0 && push_newton > 0.0 && books_.released_joule > 0.0)) return 0.0;
  const double stiff = f.dot(model_.stiffness_newton_per_m * f);
  double way_m = books_.short_m * step_s / (step_s + kRegained_s);
  // p w + ½ k w² ≤ what there is
  way_m = std::min(
      way_m,
      (std::sqrt(push_newton * push_newton + 2.0 * stiff * books_.released_joule) - push_newton) /
          stiff);
  if (!std::isfinite(way_m)) return 0.0;
  books_.pushed_joule = push_newton * way_m + 0.5 * stiff * way_m * way_m;
  books_.released_joule -= books_.pushed_joule;
  books_.short_m -= way_m;
  return way_m;
}

/// The steps of the tool know of the body what an earlier solution says of it. Of the slip beyond
/// what it has cut, a blade follows so much as the solutions explain: until its push is no more
/// than what cutting takes, as an implicit step. For the rest its edge stays behind, and pushes the
/// more, until they do. What the hand has not paid for is slip that neither cuts nor pushes: that
/// of a blade of which mofc_node does not know yet, and later as much as it takes until what
/// has been cut is paid for.
void Jaw::follow_slip(ElasticSimulation& simulation, std::size_t tool, const JawCommand& command,
                      const TipState& tip) {
  const Vector3& f = blade_.facing;
  const double depth_m = tip.slip_m.dot(f) - unpaid_m_;
  books_.paid_joule = command.paid_joule;
  const ElasticMaterial::Pierced& tissue = *simulation.body().pierced;
  const double rubs_newton = tissue.spreading_ratio * model_.edge.newton +
                             tissue.friction_newton_per_m * model_.edge.length_m;
  books_.rubbed_joule = rubs_newton * (tip.slip_m - books_.slip_m).norm();
  books_.tip_m = tip.tip_m;
  books_.slip_m = tip.slip_m;
  double more_m = regain(simulation.step_s());
  if (depth_m > books_.deepest_m) {
    const double free_m = std::min(depth_m - behind_m_, books_.deepest_m);  // in its cut
    const double asked_m = depth_m - free_m;
    // with none of it
    const Vector3 at_m = tip.tip_m - tip.slip_m + (asked_m - behind_m_ + more_m) * f;
    const double allowed_m = explained_m(simulation, tool, at_m);
    const double behind_m = std::max(0.0, asked_m - allowed_m);
    more_m += behind_m - behind_m_;
    behind_m_ = behind_m;
    const double cut_m = std::max(0.0, depth_m - behind_m_ - books_.deepest_m);
    double unpaid_m = command.is_felt ? 0.0 : cut_m;
    if (books_.left_joule < 0.0) {
      unpaid_m = std::max(unpaid_m, std::min(cut_m, -books_.left_joule / model_.edge.newton));
    }
    unpaid_m_ += unpaid_m;
    books_.deepest_m += cut_m - unpaid_m;
  }
  if (more_m == 0.0) return;
  simulation.shift(tool, more_m * f);
  // as if it had been so far back before
  model_.place_m -= more_m * f;
  last_.place_m -= more_m * f;
  explained_.place_m -= more_m * f;
}

/// How far a blade cuts that is there, less its slip. It pushes on the points that it holds with
/// springs k, and behind those are the stiffness K and the viscosity β K of the body. In a step h
/// without slip the force changes with k ∥ K (1 + β/h), and creeps towards what is elastic.
double Jaw::explained_m(const ElasticSimulation& simulation, std::size_t tool,
                        const Vector3& at_m) const noexcept {
  const Vector3& f = blade_.facing;
  const elastic::HeldPoints& held = simulation.held()[tool];
  const double springs = held.newton_per_m() * static_cast<double>(held.size());
  const double at_rest = f.dot(model_.stiffness_newton_per_m * f);
  const double of_body = 1.0 / std::max(1e-9, 1.0 / at_rest - 1.0 / springs);
  const double lag = simulation.body().viscosity_s / simulation.step_s();
  const double push_before = -last_.force_on_tool_newton.dot(f);
  const double way_m = f.dot(at_m - last_.place_m);  // since the solution
  const double stiff = springs * of_body * (1.0 + lag) / (springs + of_body * (1.0 + lag));
  // what has crept meanwhile, at its own pace
  const double elastic_newton = -model_.elastic_force_on_tool_newton.dot(f);
  const double creeps = springs * (push_before - std::min(push_before, elastic_newton)) /
                        (springs + of_body * (1.0 + lag));
  const double push = push_before - creeps + stiff * way_m;
  const double allowed_m = (push - model_.edge.newton) / stiff;
  return std::isfinite(allowed_m) ? std::max(0.0, allowed_m) : 0.0;
}

/// After a solution.
void Jaw::keep_books(const Seen& now, double step_s, bool is_alone) noexcept {
  const Vector3 way_m = books_.tip_m - std::exchange(books_.tip_before_m, books_.tip_m);
  const bool is_known = std::exchange(books_.is_known, true);
  const double rubbed_joule = std::exchange(books_.rubbed_joule, 0.0);
  const double pushed_joule = std::exchange(books_.pushed_joule, 0.0);
  const double cut_joule = std::exchange(books_.cut_joule, 0.0);
  // of the work of the hand more may be left than the body has stored by a little only
  books_.left_joule +=
      books_.paid_joule - std::exchange(books_.paid_before_joule, books_.paid_joule);
  books_.left_joule -= rubbed_joule + cut_joule;
  const double most_credit_joule = kMostCredit_m * model_.edge.newton;
  books_.left_joule = std::min(
      books_.left_joule, most_credit_joule + std::max(0.0, now.stored_joule - books_.rest_joule));
  books_.is_alone = is_alone;
  if (!is_known || !is_alone) return;
  // the hand does not push harder than what cuts, however late the solution is
  const Vector3 mean_newton = 0.5 * (last_.force_on_tool_newton + now.force_on_tool_newton);
  const double unfelt_newton = std::max(0.0, -mean_newton.dot(blade_.facing) - model_.edge.newton);
  const double work_joule = -mean_newton.dot(way_m) -
                            unfelt_newton * std::max(0.0, way_m.dot(blade_.facing)) + pushed_joule;
  double lost_joule = work_joule - (now.stored_joule - last_.stored_joule) - cut_joule;
  if (!std::isfinite(lost_joule)) return;
  if (books_.released_s > 0.5 * step_s) {
    books_.released_s -= step_s;
    books_.released_joule += kRegainedShare * (lost_joule - rubbed_joule);
    lost_joule = 0.0;
  } else if (books_.released_joule < 0.0) {
    lost_joule += std::exchange(books_.released_joule, 0.0);
  }
  books_.lost_joule = std::min(books_.lost_joule + lost_joule, most_credit_joule);
}

}  // namespace palpate::physics
