// SPDX-License-Identifier: Apache-2.0
// equilibrium.h — finds where the forces on a body balance: at rest, or over one implicit step.
#pragma once

#include <functional>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/obstacle.h"
#include "physics_node/elastic/warped_factor.h"

namespace palpate::elastic {

/// The function whose minimum is sought,
///   V(x) − gravity·x + obstacle(x) [+ ½ Σ m |x − x̃|² / h² + dissipation over h],
/// the part in brackets for a step of length h > 0 of backward Euler [Gast15].
struct Goal {
  double step_s = 0.0;                 ///< h; 0: the static balance
  const double* inertial_m = nullptr;  ///< x̃ = x₀ + h v₀, where inertia alone would lead
  const double* before_m = nullptr;    ///< x₀; needed with damping or viscosity
  const Obstacle* obstacle = nullptr;
  /// Of a step, with branches: V counts 1 + this times,
  double stiffening = 0.0;
  const VectorXd* pull_newton = nullptr;  ///< and pull·x is added @see Relaxation

  [[nodiscard]] Body::Shift shift() const noexcept {
    if (!(step_s > 0.0)) return {};
    return {.per_mass = 1.0 / (step_s * step_s),
            .per_damping = 1.0 / step_s,
            .per_viscosity = 1.0 / step_s,
            .stiffening = stiffening};
  }
};

struct SearchLimits {
  double tolerance_m = 1e-7;  ///< of the estimated remaining correction of any node
  int most_iterations = 100;
  /// An iteration that leaves more than this share of the residual is slow: so many of them are
  /// tolerated, then the matrix is factorised again. One costs as much as 5 to 70 iterations.
  double slow_ratio = 0.3;
  int slow_iterations = 0;
  double longest_correction_m = 0.1;  ///< of a node in one iteration
};

struct SearchReport {
  int iterations = 0;
  int evaluations = 0;
  int factorisations = 0;
  bool is_converged = false;
  bool is_finite = true;
  bool is_factor_stale = false;  ///< an iteration left more than slow_ratio
  /// Norm of the unbalanced force over the norm of all nodes' internal, inertial and outer forces.
  double residual_ratio = 0.0;
  double remaining_m = 0.0;  ///< estimated correction that is left
  double value_joule = 0.0;  ///< of the function
  double elastic_joule = 0.0;
};

/// Quasi-Newton search (L-BFGS over the warped factor [Liu17], line search on the function): it
/// never ends above where it began. Buffers belong to the object: search() does not allocate unless
/// it factorises or was folded.
class EquilibriumSearch {
 public:
  explicit EquilibriumSearch(const Body& body);

  [[nodiscard]] const Body& body() const noexcept { return *body_; }
  [[nodiscard]] ElementBatches& batches() noexcept { return batches_; }
  [[nodiscard]] std::vector<double>& rotations() noexcept { return rotations_; }
  void update_rotations(const VectorXd& x_m);
  /// The next search goes as the other's would, to the bit. @pre  of the same body
  void continue_as(const EquilibriumSearch& other);
  /// Frees the buffers, which unfold() makes again.
  void fold();
  void unfold();

  /// @param refactor  called when the factor is missing or slow; returns whether there is a new one
  [[nodiscard]] SearchReport search(const Goal& goal, const SearchLimits& limits,
                                    WarpedFactor& factor, VectorXd& x_m,
                                    const std::function<bool(const VectorXd& x_m)>& refactor);

  /// The function at x, its gradient in gradient(). No allocation.
  double evaluate(const Goal& goal, const VectorXd& x_m);
  [[nodiscard]] const VectorXd& gradient() const noexcept { return gradient_; }
  /// Of the last evaluation.
  [[nodiscard]] double elastic_joule() const noexcept { return elastic_joule_; }

 private:
  void direction(WarpedFactor& factor);

  static constexpr int kMemory = 5;
  const Body* body_;
  ElementBatches batches_;
  std::size_t before_size_ = 0;  // of batches_.before
  std::vector<double> rotations_;
  std::vector<double> rotation_work_;
  VectorXd gradient_;
  VectorXd old_gradient_;
  VectorXd direction_;
  VectorXd trial_;
  VectorXd steps_[kMemory];          // NOLINT: ring of s, y of L-BFGS
  VectorXd changes_[kMemory];        // NOLINT
  double curvatures_[kMemory] = {};  // NOLINT
  int remembered_ = 0;
  int newest_ = 0;
  double elastic_joule_ = 0.0;
  double magnitude_joule_ = 0.0;
  double force_scale_ = 0.0;
};

/// Where the body rests. Starts at x and ends there.
[[nodiscard]] SearchReport find_rest(EquilibriumSearch& search, WarpedFactor& factor,
                                     const Obstacle* obstacle, const SearchLimits& limits,
                                     VectorXd& x_m);

}  // namespace palpate::elastic
