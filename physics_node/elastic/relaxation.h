// SPDX-License-Identifier: Apache-2.0
// relaxation.h — the memory of a body whose stress relaxes: Maxwell branches beside its springs.
//
//   E(t) = E∞ (1 + Σ γᵢ exp(−t/τᵢ)),  γᵢ = shareᵢ / (1 − Σ share)
//
// Every stress relaxes in the same proportion, so the branches act on the forces of the nodes,
//   f = f∞(x) + Σ γᵢ hᵢ,  ḣᵢ + hᵢ/τᵢ = ḟ∞  (quasi-linear viscoelasticity [Fung93]),
// and on the ways of the nodes in the same manner, for the condensed contact. Over a step of length
// h in which f∞ changes evenly,
//   hᵢ ← aᵢ hᵢ + bᵢ Δf∞,  aᵢ = exp(−h/τᵢ),  bᵢ = (1 − aᵢ) τᵢ/h.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "physics_node/elastic/material.h"

namespace palpate::elastic {

using Eigen::VectorXd;

/// γ, a and b of the branches in a step of this length; no allocation.
struct BranchStep {
  double stiffness = 0.0;  ///< γ, over that at rest
  double kept = 0.0;       ///< a
  double gained = 0.0;     ///< b
};
/// @param step_s > 0   @param branches  shares sum to less than 1
[[nodiscard]] BranchStep branch_step(const std::vector<Branch>& branches, std::size_t branch,
                                     double step_s) noexcept;

/// Σ γ b: by how much the branches stiffen a step of this length, over the stiffness at rest.
[[nodiscard]] double stiffening_of(const std::vector<Branch>& branches, double step_s) noexcept;

/// The history of all nodes; one thread. Without branches it is empty and does nothing.
class Relaxation {
 public:
  Relaxation(const std::vector<Branch>& branches, Eigen::Index size);

  [[nodiscard]] bool is_there() const noexcept { return !forces_.empty(); }

  /// Prepares a step of this length, from where the springs have this force: stiffening() and
  /// pull_newton() of it.
  void begin(double step_s, const VectorXd& spring_newton);
  /// Σ γ b: the springs act with 1 + this in the step.
  [[nodiscard]] double stiffening() const noexcept { return stiffening_; }
  /// Σ γ (a h − b f∞): constant forces besides. 3 per node [N], as a gradient.
  [[nodiscard]] const VectorXd& pull_newton() const noexcept { return pull_; }
  /// The step has ended: changes of the springs' forces and of the places.
  void end(double step_s, const VectorXd& spring_change_newton, const VectorXd& way_m);
  /// All has relaxed.
  void forget();
  /// That of some of the nodes.
  [[nodiscard]] Relaxation of(const std::vector<std::uint32_t>& nodes) const;

  /// Σ γ h of the places: where the body would come to rest under its forces, from where it is.
  [[nodiscard]] const VectorXd& creep_m() const noexcept { return creep_; }
  /// h of the places, by branch.
  [[nodiscard]] const std::vector<VectorXd>& ways_m() const noexcept { return ways_; }

 private:
  std::vector<Branch> branches_;
  std::vector<VectorXd> forces_;  // h of the springs' forces
  std::vector<VectorXd> ways_;
  VectorXd creep_;
  VectorXd pull_;
  double stiffening_ = 0.0;
};

}  // namespace palpate::elastic
