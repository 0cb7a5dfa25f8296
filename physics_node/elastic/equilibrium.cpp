// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/equilibrium.h"

#include <algorithm>
#include <cmath>

namespace palpate::elastic {
namespace {

constexpr int kMostHalvings = 40;
constexpr double kArmijo = 1e-4;
// Share of a correction that is thought to be left at least, at rest.
constexpr double kLeastRatioAtRest = 0.01;
// Rounding of the function, relative to its parts.
constexpr double kRounding = 1e-13;

double largest_component(const VectorXd& v) { return v.cwiseAbs().maxCoeff(); }

}  // namespace

EquilibriumSearch::EquilibriumSearch(const Body& body)
    : body_(&body),
      batches_(body.new_batches()),
      before_size_(batches_.before.size()),
      rotations_(no_rotations(body.node_count())) {
  unfold();
}

void EquilibriumSearch::fold() {
  give_back(batches_.before);
  give_back(rotation_work_);
  for (VectorXd* buffer : {&gradient_, &old_gradient_, &direction_, &trial_}) *buffer = {};
  for (int i = 0; i < kMemory; ++i) steps_[i] = changes_[i] = {};
}

void EquilibriumSearch::unfold() {
  const Eigen::Index size = body_->rest_m().size();
  rotation_work_.resize(rotations_.size());
  if (gradient_.size() == size) return;
  batches_.before.resize(before_size_);
  gradient_ = VectorXd::Zero(size);
  old_gradient_ = VectorXd::Zero(size);
  direction_ = VectorXd::Zero(size);
  trial_ = VectorXd::Zero(size);
  for (int i = 0; i < kMemory; ++i) {
    steps_[i] = VectorXd::Zero(size);
    changes_[i] = VectorXd::Zero(size);
  }
}

void EquilibriumSearch::update_rotations(const VectorXd& x_m) {
  rotation_work_.resize(rotations_.size());
  update_node_rotations(batches_, x_m, rotations_, rotation_work_);
}

void EquilibriumSearch::continue_as(const EquilibriumSearch& other) {
  batches_.rotation = other.batches_.rotation;
  batches_.middle_rotation = other.batches_.middle_rotation;
  rotations_ = other.rotations_;
}

double EquilibriumSearch::evaluate(const Goal& goal, const VectorXd& x_m) {
  gradient_.setZero();
  // the viscous part is not to count more often
  const double stiffening = 1.0 + goal.stiffening;
  double value = add_gradient(batches_, x_m.data(), stiffening * goal.step_s, gradient_.data());
  value +=
      body_->add_attachments(x_m.data(), goal.before_m, stiffening * goal.step_s, gradient_.data());
  elastic_joule_ = value;
  if (goal.pull_newton != nullptr) {
    value *= stiffening;
    gradient_ *= stiffening;
    value += goal.pull_newton->dot(x_m);
    gradient_ += *goal.pull_newton;
  }
  magnitude_joule_ = std::abs(value);
  double squares = gradient_.squaredNorm();
  if (goal.obstacle != nullptr) {
    const double more = goal.obstacle->add_gradient(x_m.data(), gradient_.data());
    value += more;
    magnitude_joule_ += std::abs(more);
  }
  const VectorXd& load = body_->load_newton();
  if (load.size() > 0) {
    gradient_ -= load;
    const double work = load.dot(x_m);
    value -= work;
    magnitude_joule_ += std::abs(work);
    squares += load.squaredNorm();
  }
  if (goal.step_s > 0.0) {
    const double per_mass = 1.0 / (goal.step_s * goal.step_s);
    double kinetic = 0.0;
    const VectorXd& mass = body_->mass_kg();
    for (Eigen::Index i = 0; i < mass.size(); ++i) {
      const double m = per_mass * mass[i];
      for (Eigen::Index k = 3 * i; k < 3 * i + 3; ++k) {
        const double away = x_m[k] - goal.inertial_m[k];
        kinetic += m * away * away;
        gradient_[k] += m * away;
        squares += m * away * m * away;
      }
    }
    value += 0.5 * kinetic;
    magnitude_joule_ += 0.5 * kinetic;
    if (body_->has_mass_damping()) {
      double lost = 0.0;
      const VectorXd& damping = body_->mass_damping_kg_per_s();
      for (Eigen::Index i = 0; i < damping.size(); ++i) {
        const double c = damping[i] / goal.step_s;
        for (Eigen::Index k = 3 * i; k < 3 * i + 3; ++k) {
          const double way = x_m[k] - goal.before_m[k];
          lost += c * way * way;
          gradient_[k] += c * way;
        }
      }
      value += 0.5 * lost;
    }
  }
  for (const std::uint32_t node : body_->description().fixed_nodes) {
    gradient_.segment<3>(3 * Eigen::Index{node}).setZero();
  }
  force_scale_ = std::sqrt(squares);
  return value;
}

void EquilibriumSearch::direction(WarpedFactor& factor) {
  // two-loop recursion [Nocedal06] algorithm 7.4, the factor for the first approximation
  double weights[kMemory];  // NOLINT
  trial_ = gradient_;
  for (int k = 0; k < remembered_; ++k) {
    const int i = (newest_ - k + kMemory) % kMemory;
    weights[i] = steps_[i].dot(trial_) / curvatures_[i];
    trial_ -= weights[i] * changes_[i];
  }
  factor.solve(trial_.data(), direction_.data());
  for (int k = remembered_ - 1; k >= 0; --k) {
    const int i = (newest_ - k + kMemory) % kMemory;
    const double weight = changes_[i].dot(direction_) / curvatures_[i];
    direction_ += (weights[i] - weight) * steps_[i];
  }
  direction_ = -direction_;
}

SearchReport EquilibriumSearch::search(const Goal& goal, const SearchLimits& limits,
                                       WarpedFactor& factor, VectorXd& x_m,
                                       const std::function<bool(const VectorXd&)>& refactor) {
  SearchReport report;
  remembered_ = 0;
  double value = evaluate(goal, x_m);
  ++report.evaluations;
  bool is_factor_new = false;
  int slow = 0;               // iterations with this factor
  double ratio_before = 0.0;  // of the residuals, one and two iterations before; 0: another factor
  double ratio_before_that = 0.0;
  const auto renew_factor = [&] {
    if (!refactor(x_m)) return false;
    ++report.factorisations;
    is_factor_new = true;
    slow = 0;
    ratio_before = ratio_before_that = 0.0;
    remembered_ = 0;
    return true;
  };
  if (!factor.is_ready() && !renew_factor()) {
    report.is_finite = std::isfinite(value);
    return report;
  }
  const auto finish = [&] {
    report.value_joule = value;
    report.elastic_joule = elastic_joule_;
    report.residual_ratio = force_scale_ > 0.0 ? gradient_.norm() / force_scale_ : 0.0;
    report.is_finite = std::isfinite(value) && std::isfinite(report.residual_ratio);
  };
  const double longest_m =
      goal.obstacle == nullptr
          ? limits.longest_correction_m
          : std::min(limits.longest_correction_m, goal.obstacle->longest_correction_m());
  double norm = gradient_.norm();
  while (report.iterations < limits.most_iterations) {
    if (norm <= kRounding * force_scale_) {
      report.is_converged = true;
      break;
    }
    ++report.iterations;
    direction(factor);
    double slope = gradient_.dot(direction_);
    if (!(slope < 0.0)) {
      // what was learnt does not fit here
      remembered_ = 0;
      direction(factor);
      slope = gradient_.dot(direction_);
      if (!(slope < 0.0)) break;
    }
    double correction = largest_component(direction_);
    if (correction > longest_m) {
      const double shrink = longest_m / correction;
      direction_ *= shrink;
      slope *= shrink;
      correction = longest_m;
    }
    old_gradient_ = gradient_;
    const double old_value = value;
    const double rounding = kRounding * magnitude_joule_;
    double fraction = 1.0;
    bool is_lower = false;
    for (int halving = 0; halving < kMostHalvings; ++halving) {
      trial_ = x_m + fraction * direction_;
      value = evaluate(goal, trial_);
      ++report.evaluations;
      if (value <= old_value + kArmijo * fraction * slope + rounding) {
        is_lower = true;
        break;
      }
      // the parabola through the two values and the slope, within bounds
      const double bend = value - old_value - fraction * slope;
      const double best = bend > 0.0 ? -0.5 * slope * fraction * fraction / bend : 0.0;
      fraction =
          std::isfinite(best) ? std::clamp(best, 0.1 * fraction, 0.5 * fraction) : 0.1 * fraction;
    }
    if (!is_lower) {
      // no lower place within rounding
      value = evaluate(goal, x_m);
      report.is_converged = correction <= limits.tolerance_m;
      report.remaining_m = correction;
      if (is_factor_new || report.is_converged || !renew_factor()) break;
      continue;
    }
    const double new_norm = gradient_.norm();
    const double ratio = new_norm / norm;
    norm = new_norm;
    x_m = trial_;
    const double moved = fraction * correction;
    // the residual does not shrink evenly: the slowest of three iterations tells how fast
    const double slowest = std::max({ratio, ratio_before, ratio_before_that});
    ratio_before_that = ratio_before;
    ratio_before = ratio;
    // at rest the residual of stiff modes may vanish while a soft one has a way to go
    const double counted = goal.step_s > 0.0 ? slowest : std::max(slowest, kLeastRatioAtRest);
    report.remaining_m =
        slowest < 0.99 && fraction == 1.0 ? moved * counted / (1.0 - slowest) : 100.0 * moved;
    if (report.remaining_m <= limits.tolerance_m) {
      report.is_converged = true;
      break;
    }
    if (ratio > limits.slow_ratio || fraction < 1.0) {
      report.is_factor_stale = true;
      if (slow++ >= limits.slow_iterations && renew_factor()) continue;
      if (!factor.is_ready()) break;  // it could not be renewed, and the old one is gone
    }
    is_factor_new = false;
    // remember what this step told of the curvature
    const int next = (newest_ + 1) % kMemory;
    steps_[next] = fraction * direction_;
    changes_[next] = gradient_ - old_gradient_;
    const double curvature = steps_[next].dot(changes_[next]);
    if (curvature > 1e-12 * steps_[next].norm() * changes_[next].norm()) {
      curvatures_[next] = curvature;
      newest_ = next;
      remembered_ = std::min(remembered_ + 1, kMemory);
    }
  }
  finish();
  return report;
}

SearchReport find_rest(EquilibriumSearch& search, WarpedFactor& factor, const Obstacle* obstacle,
                       const SearchLimits& limits, VectorXd& x_m) {
  const Goal goal{.step_s = 0.0, .obstacle = obstacle};
  return search.search(goal, limits, factor, x_m, [&](const VectorXd& at_m) {
    search.update_rotations(at_m);
    return factor.factor(at_m, search.rotations(), goal.shift(), obstacle);
  });
}

}  // namespace palpate::elastic
