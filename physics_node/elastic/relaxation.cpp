// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/relaxation.h"

#include <cmath>

namespace palpate::elastic {

BranchStep branch_step(const std::vector<Branch>& branches, std::size_t branch,
                       double step_s) noexcept {
  double rest = 1.0;
  for (const Branch& one : branches) rest -= one.share;
  const double steps = step_s / branches[branch].tau_s;
  return {.stiffness = branches[branch].share / rest,
          .kept = std::exp(-steps),
          .gained = steps > 0.0 ? -std::expm1(-steps) / steps : 1.0};
}

double stiffening_of(const std::vector<Branch>& branches, double step_s) noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < branches.size(); ++i) {
    const BranchStep step = branch_step(branches, i, step_s);
    sum += step.stiffness * step.gained;
  }
  return sum;
}

Relaxation::Relaxation(const std::vector<Branch>& branches, Eigen::Index size)
    : branches_(branches),
      forces_(branches.size(), VectorXd::Zero(size)),
      ways_(branches.size(), VectorXd::Zero(size)) {
  if (branches.empty()) return;
  creep_ = VectorXd::Zero(size);
  pull_ = VectorXd::Zero(size);
}

void Relaxation::begin(double step_s, const VectorXd& spring_newton) {
  if (!is_there()) return;
  stiffening_ = stiffening_of(branches_, step_s);
  pull_.setZero();
  for (std::size_t i = 0; i < branches_.size(); ++i) {
    const BranchStep step = branch_step(branches_, i, step_s);
    pull_ += step.stiffness * step.kept * forces_[i];
  }
  pull_ -= stiffening_ * spring_newton;
}

void Relaxation::end(double step_s, const VectorXd& spring_change_newton, const VectorXd& way_m) {
  if (!is_there()) return;
  creep_.setZero();
  for (std::size_t i = 0; i < branches_.size(); ++i) {
    const BranchStep step = branch_step(branches_, i, step_s);
    forces_[i] = step.kept * forces_[i] + step.gained * spring_change_newton;
    ways_[i] = step.kept * ways_[i] + step.gained * way_m;
    creep_ += step.stiffness * ways_[i];
  }
}

void Relaxation::forget() {
  for (VectorXd& force : forces_) force.setZero();
  for (VectorXd& way : ways_) way.setZero();
  if (is_there()) creep_.setZero();
}

Relaxation Relaxation::of(const std::vector<std::uint32_t>& nodes) const {
  Relaxation part(branches_, 3 * static_cast<Eigen::Index>(nodes.size()));
  const auto take = [&](const VectorXd& from, VectorXd& to) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      to.segment<3>(3 * static_cast<Eigen::Index>(i)) = from.segment<3>(3 * Eigen::Index{nodes[i]});
    }
  };
  for (std::size_t i = 0; i < branches_.size(); ++i) {
    take(forces_[i], part.forces_[i]);
    take(ways_[i], part.ways_[i]);
  }
  if (is_there()) take(creep_, part.creep_);
  return part;
}

}  // namespace palpate::elastic
