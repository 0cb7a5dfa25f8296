// SPDX-License-Identifier: Apache-2.0
// slow_modes.h — the slowest motions of an elastic body about its undeformed shape. A condensed
// contact lets them swing by themselves, because a thin body has no time to bend between two full
// solutions; the rest of the compliance gives way at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "physics_node/elastic/sphere_contact.h"
#include "physics_node/elastic/warped_factor.h"

namespace palpate::elastic {

/// K φ = ω² M φ, φᵀ M φ = 1; a column or an entry per mode.
struct SlowModes {
  Eigen::MatrixXd shapes;         ///< φ, 3 rows per node of the body
  Eigen::MatrixXd weighted;       ///< M φ
  Eigen::VectorXd rates_per_s2;   ///< ω², ascending
  Eigen::VectorXd damping_per_s;  ///< of q̇
  Eigen::MatrixXd slowest;        ///< about the slowest, whether they count or not
  [[nodiscard]] Eigen::Index count() const noexcept { return rates_per_s2.size(); }
};

/// The slowest, at most so many, with a period of at least `shortest_s`, that let a node give way
/// by at least `least_give_m_per_newton` under a force on it: the best in a Krylov space of K⁻¹M.
/// They need not have converged: Σ φφᵀ/ω² is never more than K⁻¹. Allocates; about five solutions
/// per mode, kTogether at a time; fewer with a start.
/// @param before, old_nodes  of a body that is much the same, and by node: which of that one it is
/// @param factor  in double precision: a slow mode gives way so much more than a single point does
///     that rounding would leave nothing of that. It is made anew, of the undeformed body
/// @return  none if the stiffness cannot be factorised
[[nodiscard]] SlowModes slow_modes_of(const Body& body, WarpedFactor& factor, double shortest_s,
                                      double least_give_m_per_newton, Eigen::Index most,
                                      const SlowModes* before = nullptr,
                                      std::span<const std::uint32_t> old_nodes = {});

/// The motion of these modes from a full solution on, under forces at some points of the surface:
/// q̈ + d q̇ + ω² q = φᵀ f + g, with g what the solution leaves.
class ModalMotion {
 public:
  /// No modes: nothing else may be called.
  ModalMotion() = default;
  /// @param modes, from_m  must outlive it; q is 0 at from_m   @param chosen  of the points
  /// @param x_m, v_m_per_s, a_m_per_s2  the full solution, 3 per node
  /// @param forces_newton  in it, on the chosen points
  ModalMotion(const SlowModes& modes, const std::vector<SurfacePoint>& points,
              const std::vector<std::size_t>& chosen, const VectorXd& from_m, const VectorXd& x_m,
              const VectorXd& v_m_per_s, const VectorXd& a_m_per_s2,
              const std::vector<Vector3d>& forces_newton);

  [[nodiscard]] bool is_empty() const noexcept { return modes_ == nullptr; }
  /// Of the whole body, of a state or a velocity.
  [[nodiscard]] Eigen::VectorXd amount_in(const VectorXd& x_m) const;
  [[nodiscard]] Eigen::VectorXd rate_in(const VectorXd& v_m_per_s) const;
  [[nodiscard]] Vector3d at(std::size_t point, const Eigen::VectorXd& amount) const noexcept;
  /// A compliance of the points loses φ φᵀ/ω²; columns are `stride` long.
  void take_from(std::vector<float>& compliance, std::size_t stride) const;

  // --- no allocation, no throw ---

  /// The next steps are that long; 0: at their end the modes rest. False: as the last one.
  bool set_step(double step_s) noexcept;
  /// compliance + φ φᵀ times what a force during the step moves a mode, over `pace`.
  void add_to(const std::vector<float>& compliance, std::size_t stride, double pace,
              std::vector<float>& sum) const noexcept;
  [[nodiscard]] const Eigen::VectorXd& amount() const noexcept { return q_; }
  /// At the end of a step under these forces.
  const Eigen::VectorXd& amount_after(const std::vector<Vector3d>& forces_newton) noexcept;
  /// Makes that step.
  void move(const std::vector<Vector3d>& forces_newton) noexcept;

 private:
  const SlowModes* modes_ = nullptr;
  const VectorXd* from_m_ = nullptr;
  Eigen::MatrixXd shapes_;  // at the points, 3 rows each
  Eigen::VectorXd left_;    // g
  Eigen::VectorXd q_;
  Eigen::VectorXd rate_;
  Eigen::VectorXd push_;  // φᵀ f + g
  Eigen::VectorXd next_;
  double step_s_ = -1.0;
  // of a step: q₁ = a q + b q̇ + c push, q̇₁ = a′ q + b′ q̇ + c′ push
  struct Gains {
    double a = 0.0, b = 0.0, c = 0.0;
    double rate_a = 0.0, rate_b = 0.0, rate_c = 0.0;
  };
  std::vector<Gains> gains_;
};

}  // namespace palpate::elastic
