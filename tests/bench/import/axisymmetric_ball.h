// SPDX-License-Identifier: Apache-2.0
// axisymmetric_ball.h — a ball pressed by a rigid ball from above, both around one axis: finite
// elements in the half plane (r, z), of nine nodes, which share nothing with those of elastic/ but
// the law of the material. A reference that costs seconds where a mesh of tetrahedra costs hours.
#pragma once

#include <Eigen/LU>
#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "common/core/check.h"

namespace palpate::bench {

/// The upper half of the ball is free, the lower one is held, as in SlowTouch. Stable neo-Hookean
/// [Smith18]; no friction.
struct AxisymmetricBall {
  double radius_m = 0.03;
  double tip_radius_m = 0.006;
  double young_pa = 5200.0;
  double poisson_ratio = 0.45;
  // of a ball on the axis
  double lesion_young_pa = 5200.0;
  double lesion_radius_m = 0.0;  ///< 0: none
  double lesion_z_m = 0.0;       ///< of its centre, from that of the ball
};

class AxisymmetricPress {
 public:
  /// @param cell_m  > 0, of the elements below the tip and at the lesion; coarser elsewhere
  AxisymmetricPress(const AxisymmetricBall& ball, double cell_m) : ball_(ball) {
    // the nodes of a graded grid in polar coordinates: angle from the axis, and radius
    const double fine_m = 1.2 * ball.tip_radius_m;
    const std::vector<double> along_m =
        graded(cell_m, fine_m, 0.5 * std::numbers::pi * ball.radius_m);
    const double depth_m =
        std::max(fine_m, ball.radius_m - ball.lesion_z_m + 1.1 * ball.lesion_radius_m);
    const std::vector<double> below_m =
        graded(cell_m, ball.lesion_radius_m > 0.0 ? depth_m : fine_m, ball.radius_m);
    columns_ = along_m.size();
    rows_ = below_m.size();
    for (const double down_m : below_m) {
      for (const double arc_m : along_m) {
        const double angle_rad = arc_m / ball.radius_m;
        const double r_m = ball.radius_m - down_m;
        nodes_m_.emplace_back(r_m * std::sin(angle_rad), r_m * std::cos(angle_rad));
      }
    }
    number_unknowns();
    u_m_ = Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(nodes_m_.size()));
  }

  /// The force on the tip, upwards, at this depth below the untouched ball; from the last depth on.
  /// @throws SetupError  no equilibrium was found, or the ball has slipped over the tip: much
  /// deeper
  ///     than the radius of the tip
  double newton_at(double depth_m) {
    constexpr double kStep_m = 0.5e-3;
    const double from_m = depth_m_;
    const int steps =
        std::max(1, static_cast<int>(std::ceil(std::abs(depth_m - from_m) / kStep_m)));
    for (int step = 1; step <= steps; ++step) {
      depth_m_ = from_m + (depth_m - from_m) * step / steps;
      for (const double penalty_pa_per_m : kPenalties_pa_per_m) {
        penalty_pa_per_m_ = penalty_pa_per_m;
        find_rest();
      }
    }
    if (!(force_newton_ >= 0.0)) throw SetupError("axisymmetric ball: too deep");
    return force_newton_;
  }

 private:
  using Vector2 = Eigen::Vector2d;
  // One after the other, so that a deeper tip is not a blow; pressures of some kPa: within a µm.
  static constexpr std::array kPenalties_pa_per_m{1e7, 2e8, 5e9};
  static constexpr double kRound_m = 1e-7;  // of the kink where contact begins

  /// 0 … `all_m`, each element with a node in its middle: fine up to `fine_m`, then coarser.
  static std::vector<double> graded(double cell_m, double fine_m, double all_m) {
    constexpr double kGrowth = 1.15;
    std::vector<double> ends{0.0};
    double size_m = cell_m;
    while (ends.back() + size_m < all_m) {
      ends.push_back(ends.back() + size_m);
      if (ends.back() > fine_m) size_m *= kGrowth;
    }
    for (double& end : ends) end *= all_m / ends.back();
    std::vector<double> nodes{0.0};
    for (std::size_t i = 1; i < ends.size(); ++i) {
      nodes.push_back(0.5 * (ends[i - 1] + ends[i]));
      nodes.push_back(ends[i]);
    }
    return nodes;
  }

  /// Held: the equator, which the centre is part of. On the axis nothing moves sideways.
  void number_unknowns() {
    unknown_.assign(2 * nodes_m_.size(), -1);
    for (std::size_t row = 0; row + 1 < rows_; ++row) {
      for (std::size_t column = 0; column + 1 < columns_; ++column) {
        const std::size_t node = row * columns_ + column;
        if (column > 0) unknown_[2 * node] = unknowns_++;
        unknown_[2 * node + 1] = unknowns_++;
      }
    }
  }

  /// Values and derivatives of three parabolas on [−1, 1].
  static void parabolas(double s, std::array<double, 3>& value, std::array<double, 3>& slope) {
    value = {0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)};
    slope = {s - 0.5, -2.0 * s, s + 0.5};
  }

  struct GaussPoint {
    double s = 0.0;
    double weight = 0.0;
  };
  static std::array<GaussPoint, 3> gauss() {
    const double s = std::sqrt(0.6);
    return {GaussPoint{-s, 5.0 / 9.0}, GaussPoint{0.0, 8.0 / 9.0}, GaussPoint{s, 5.0 / 9.0}};
  }

  [[nodiscard]] int unknown(std::size_t node, Eigen::Index axis) const {
    return unknown_[2 * node + static_cast<std::size_t>(axis)];
  }
  void add(std::size_t node, Eigen::Index axis, std::size_t by_node, Eigen::Index by_axis,
           double value) {
    const int i = unknown(node, axis);
    const int j = unknown(by_node, by_axis);
    if (i >= 0 && j >= 0) entries_.emplace_back(i, j, value);
  }
  void add(std::size_t node, Eigen::Index axis, double value) {
    const int i = unknown(node, axis);
    if (i >= 0) residual_[i] += value;
  }

  /// F = (A, t): A of the plane, t = 1 + u_r / r around the axis; W = ½µ (|A|² + t² − 3)
  /// − µ (J − 1) + ½(λ + µ)(J − 1)², J = t det A.
  void add_element(std::size_t row, std::size_t column) {
    std::array<std::size_t, 9> nodes{};
    for (std::size_t i = 0; i < 9; ++i) nodes[i] = (row + i / 3) * columns_ + column + i % 3;
    std::array<double, 3> down{};
    std::array<double, 3> down_slope{};
    std::array<double, 3> along{};
    std::array<double, 3> along_slope{};
    for (const GaussPoint& p : gauss()) {
      parabolas(p.s, down, down_slope);
      for (const GaussPoint& q : gauss()) {
        parabolas(q.s, along, along_slope);
        std::array<double, 9> N{};
        std::array<Vector2, 9> dN;
        Vector2 place_m = Vector2::Zero();
        Eigen::Matrix2d D = Eigen::Matrix2d::Zero();  // ∂x / ∂(s_down, s_along)
        for (std::size_t i = 0; i < 9; ++i) {
          N[i] = down[i / 3] * along[i % 3];
          dN[i] = {down_slope[i / 3] * along[i % 3], down[i / 3] * along_slope[i % 3]};
          place_m += N[i] * nodes_m_[nodes[i]];
          D += nodes_m_[nodes[i]] * dN[i].transpose();
        }
        const Eigen::Matrix2d inverse = D.inverse();
        Eigen::Matrix2d A = Eigen::Matrix2d::Identity();
        double u_r = 0.0;
        for (std::size_t i = 0; i < 9; ++i) {
          dN[i] = inverse.transpose() * dN[i];
          const Vector2 u = u_m_.segment<2>(2 * static_cast<Eigen::Index>(nodes[i]));
          A += u * dN[i].transpose();
          u_r += N[i] * u.x();
        }
        const double r = place_m.x();
        const double t = 1.0 + u_r / r;
        const double volume =
            2.0 * std::numbers::pi * r * std::abs(D.determinant()) * p.weight * q.weight;
        add_point(nodes, N, dN, A, t, r, volume, place_m);
      }
    }
  }

  void add_point(const std::array<std::size_t, 9>& nodes, const std::array<double, 9>& N,
                 const std::array<Vector2, 9>& dN, const Eigen::Matrix2d& A, double t, double r,
                 double volume, const Vector2& place_m) {
    const bool is_lesion =
        (place_m - Vector2(0.0, ball_.lesion_z_m)).norm() < ball_.lesion_radius_m;
    const double young_pa = is_lesion ? ball_.lesion_young_pa : ball_.young_pa;
    const double mu = 0.5 * young_pa / (1.0 + ball_.poisson_ratio);
    const double bulk = 2.0 * mu * ball_.poisson_ratio / (1.0 - 2.0 * ball_.poisson_ratio) + mu;
    const double d = A.determinant();
    Eigen::Matrix2d cofactor;
    cofactor << A(1, 1), -A(1, 0), -A(0, 1), A(0, 0);
    const double g = bulk * (t * d - 1.0) - mu;
    const Eigen::Matrix2d P = mu * A + g * t * cofactor;
    const double P_t = mu * t + g * d;
    energy_joule_ += volume * (0.5 * mu * (A.squaredNorm() + t * t - 3.0) - mu * (t * d - 1.0) +
                               0.5 * bulk * (t * d - 1.0) * (t * d - 1.0));
    // by the displacement of node i along axis a: δA = e_a dN_iᵀ, δt = N_i / r for a = r
    for (std::size_t i = 0; i < 9; ++i) {
      const Vector2 c_i = cofactor * dN[i];
      for (Eigen::Index a = 0; a < 2; ++a) {
        const double t_i = a == 0 ? N[i] / r : 0.0;
        add(nodes[i], a, volume * (P.row(a).dot(dN[i]) + P_t * t_i));
        const double J_i = t * c_i[a] + d * t_i;
        for (std::size_t j = 0; j < 9; ++j) {
          const Vector2 c_j = cofactor * dN[j];
          const double cross = dN[i].x() * dN[j].y() - dN[i].y() * dN[j].x();
          for (Eigen::Index b = 0; b < 2; ++b) {
            const double t_j = b == 0 ? N[j] / r : 0.0;
            const double J_j = t * c_j[b] + d * t_j;
            const double J_ij =
                (a == b ? 0.0 : (a == 0 ? t : -t) * cross) + c_i[a] * t_j + c_j[b] * t_i;
            const double W_ij = (a == b ? mu * dN[i].dot(dN[j]) : 0.0) + mu * t_i * t_j +
                                bulk * J_i * J_j + g * J_ij;
            add(nodes[i], a, nodes[j], b, volume * W_ij);
          }
        }
      }
    }
  }

  /// The tip as a penalty on the outer edge of an element.
  void add_edge(std::size_t column) {
    const Vector2 centre_m(0.0, ball_.radius_m + ball_.tip_radius_m - depth_m_);
    std::array<double, 3> N{};
    std::array<double, 3> slope{};
    for (const GaussPoint& q : gauss()) {
      parabolas(q.s, N, slope);
      Vector2 place_m = Vector2::Zero();
      Vector2 tangent = Vector2::Zero();
      Vector2 now_m = Vector2::Zero();
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t node = column + i;
        place_m += N[i] * nodes_m_[node];
        tangent += slope[i] * nodes_m_[node];
        now_m += N[i] * (nodes_m_[node] + u_m_.segment<2>(2 * static_cast<Eigen::Index>(node)));
      }
      const double area = 2.0 * std::numbers::pi * place_m.x() * tangent.norm() * q.weight;
      const Vector2 way_m = now_m - centre_m;
      const double distance_m = way_m.norm();
      const double inside_m = ball_.tip_radius_m - distance_m;
      const Vector2 n = way_m / distance_m;
      const double root_m = std::hypot(inside_m, kRound_m);
      const double pressure = 0.5 * penalty_pa_per_m_ * (inside_m + root_m);
      const double stiffness = pressure / root_m;
      force_newton_ -= area * pressure * n.y();
      const double sum_m =
          inside_m > 0.0 ? inside_m + root_m : kRound_m * kRound_m / (root_m - inside_m);
      energy_joule_ += area * 0.25 * penalty_pa_per_m_ *
                       (inside_m * sum_m + kRound_m * kRound_m * std::log(sum_m / kRound_m));
      // without what would make it negative
      const Eigen::Matrix2d K = stiffness * n * n.transpose();
      for (std::size_t i = 0; i < 3; ++i) {
        for (Eigen::Index a = 0; a < 2; ++a) {
          add(column + i, a, -area * pressure * N[i] * n[a]);
          for (std::size_t j = 0; j < 3; ++j) {
            for (Eigen::Index b = 0; b < 2; ++b) {
              add(column + i, a, column + j, b, area * N[i] * N[j] * K(a, b));
            }
          }
        }
      }
    }
  }

  void assemble() {
    residual_ = Eigen::VectorXd::Zero(unknowns_);
    entries_.clear();
    force_newton_ = 0.0;
    energy_joule_ = 0.0;
    for (std::size_t row = 0; row + 2 < rows_; row += 2) {
      for (std::size_t column = 0; column + 2 < columns_; column += 2) add_element(row, column);
    }
    for (std::size_t column = 0; column + 2 < columns_; column += 2) add_edge(column);
  }

  void move(const Eigen::VectorXd& change_m, double share) {
    for (std::size_t i = 0; i < unknown_.size(); ++i) {
      if (unknown_[i] >= 0) u_m_[static_cast<Eigen::Index>(i)] += share * change_m[unknown_[i]];
    }
  }

  /// Newton's method; a step that does not lower the energy is halved.
  void find_rest() {
    constexpr int kMostSteps = 200;
    constexpr double kTolerance_m = 1e-9;
    assemble();
    for (int step = 0; step < kMostSteps; ++step) {
      Eigen::SparseMatrix<double> K(unknowns_, unknowns_);
      K.setFromTriplets(entries_.begin(), entries_.end());
      if (!is_ordered_) solver_.analyzePattern(K);
      is_ordered_ = true;
      // where the energy is not convex, so much is added to the diagonal that the step leads down
      double shift_newton_per_m = 0.0;
      do {
        solver_.setShift(shift_newton_per_m);
        solver_.factorize(K);
        shift_newton_per_m = std::max(1e-2, 4.0 * shift_newton_per_m);
      } while (solver_.info() != Eigen::Success || solver_.vectorD().minCoeff() <= 0.0);
      const Eigen::VectorXd change_m = solver_.solve(-residual_);
      const double before_joule = energy_joule_;
      double share = 1.0;
      move(change_m, share);
      assemble();
      while (!(energy_joule_ <= before_joule) && share > 1e-6) {
        share *= 0.5;
        move(change_m, -share);
        assemble();
      }
      if (change_m.lpNorm<Eigen::Infinity>() < kTolerance_m) return;
    }
    throw SetupError("axisymmetric ball: no equilibrium");
  }

  AxisymmetricBall ball_;
  std::size_t columns_ = 0;  // of nodes, along the surface from the axis
  std::size_t rows_ = 0;     // from the surface to the centre
  std::vector<Vector2> nodes_m_;
  std::vector<int> unknown_;  // of each displacement; −1: held
  int unknowns_ = 0;
  Eigen::VectorXd u_m_;
  Eigen::VectorXd residual_;
  std::vector<Eigen::Triplet<double>> entries_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver_;
  bool is_ordered_ = false;
  double depth_m_ = 0.0;
  double penalty_pa_per_m_ = 0.0;
  double force_newton_ = 0.0;
  double energy_joule_ = 0.0;
};

}  // namespace palpate::bench
