// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/condensed/slow_modes.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "physics_node/elastic/linear/dense_kernels.h"

namespace palpate::elastic {
namespace {

// Vectors of the Krylov space that are found together: so many equal frequencies are told apart.
constexpr Eigen::Index kBlock = kTogether;
// A vector that has so little that is new is left out, relative.
constexpr double kNothingNew = 1e-9;
// From the slowest of a body that is much the same, so many times K⁻¹M.
constexpr Eigen::Index kTimesAgain = 2;
// Besides them, for what is new.
constexpr Eigen::Index kAny = 2;

using Eigen::MatrixXd;

/// M x.
MatrixXd weighted(const Body& body, const MatrixXd& x) {
  MatrixXd product = x;
  for (Eigen::Index node = 0; node < body.mass_kg().size(); ++node) {
    product.middleRows<3>(3 * node) *= body.mass_kg()[node];
  }
  return product;
}

/// 3 rows per node, those of these nodes.
MatrixXd rows_at(const MatrixXd& all, std::span<const std::uint32_t> nodes) {
  MatrixXd rows(3 * static_cast<Eigen::Index>(nodes.size()), all.cols());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    rows.middleRows<3>(3 * static_cast<Eigen::Index>(i)) =
        all.middleRows<3>(3 * Eigen::Index{nodes[i]});
  }
  return rows;
}

/// V, orthonormal with M, and K⁻¹ M V.
class KrylovSpace {
 public:
  KrylovSpace(const Body& body, WarpedFactor& factor, Eigen::Index most)
      : body_(body),
        factor_(factor),
        basis_(body.rest_m().size(), most),
        heavy_(body.rest_m().size(), most),
        given_(body.rest_m().size(), most) {}

  /// With these vectors and any others.
  void begin(const MatrixXd& start) {
    for (Eigen::Index k = 0; k < start.cols(); ++k) add(start.col(k));
    while (found_ < std::min(kBlock, basis_.cols()) && add(any())) {
    }
  }
  /// False: there is nothing more.
  bool grow() {
    const Eigen::Index end = found_;
    std::vector<double*> columns;
    for (Eigen::Index k = solved_; k < end; ++k) {
      given_.col(k) = heavy_.col(k);
      columns.push_back(given_.col(k).data());
    }
    if (columns.empty()) return false;
    factor_.solve_together(columns);
    for (Eigen::Index k = solved_; k < end && found_ < basis_.cols(); ++k) add(given_.col(k));
    solved_ = end;
    return true;
  }

  struct Ritz {
    Eigen::VectorXd gives;  // 1/ω², ascending
    MatrixXd shapes;        // K⁻¹ M V times this has stiffness 1
  };
  /// Among K⁻¹ M V, whose stiffness is that with M V.
  [[nodiscard]] Ritz ritz() const {
    MatrixXd stiffness = given().transpose() * heavy_.leftCols(solved_);
    stiffness = (0.5 * (stiffness + stiffness.transpose())).eval();
    const MatrixXd mass = given().transpose() * weighted(body_, given());
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(mass, stiffness);
    if (solver.info() != Eigen::Success) return {};
    return {.gives = solver.eigenvalues(), .shapes = solver.eigenvectors()};
  }
  [[nodiscard]] Eigen::Ref<const MatrixXd> given() const { return given_.leftCols(solved_); }

 private:
  [[nodiscard]] VectorXd any() {
    VectorXd vector(basis_.rows());
    for (Eigen::Index i = 0; i < vector.size(); ++i) vector[i] = number_(random_);
    for (const std::uint32_t node : body_.description().fixed_nodes) {
      vector.segment<3>(3 * Eigen::Index{node}).setZero();
    }
    return vector;
  }

  /// What is new of it; false: nothing.
  bool add(VectorXd next) {
    const double size_before = std::sqrt(next.dot(weighted(body_, next).col(0)));
    for (int twice = 0; twice < 2; ++twice) {
      next -= basis_.leftCols(found_) * (heavy_.leftCols(found_).transpose() * next);
    }
    const double size_after = std::sqrt(next.dot(weighted(body_, next).col(0)));
    if (!(size_after > kNothingNew * size_before)) return false;
    basis_.col(found_) = next / size_after;
    heavy_.col(found_) = weighted(body_, basis_.col(found_));
    ++found_;
    return true;
  }

  const Body& body_;
  WarpedFactor& factor_;
  MatrixXd basis_;
  MatrixXd heavy_;  // M V
  MatrixXd given_;  // K⁻¹ M V
  Eigen::Index found_ = 0;
  Eigen::Index solved_ = 0;  // of these
  std::mt19937_64 random_{1};
  std::uniform_real_distribution<double> number_{-1.0, 1.0};
};

}  // namespace

SlowModes slow_modes_of(const Body& body, WarpedFactor& factor, double shortest_s,
                        double least_give_m_per_newton, Eigen::Index most, const SlowModes* before,
                        std::span<const std::uint32_t> old_nodes) {
  SlowModes modes;
  if (most <= 0 || !factor.factor(body.rest_m(), no_rotations(body.node_count()), {}, nullptr)) {
    return modes;
  }
  const Eigen::Index size = body.rest_m().size();
  const Eigen::Index free = 3 * static_cast<Eigen::Index>(body.pattern().size());
  MatrixXd start;
  if (before != nullptr) start = rows_at(before->slowest, old_nodes);
  const Eigen::Index wanted = start.cols() > 0 ? kTimesAgain * kBlock : 3 * most + 2 * kBlock;
  KrylovSpace space(body, factor, std::min(wanted, free));
  space.begin(start);
  while (space.grow()) {
  }
  const KrylovSpace::Ritz ritz = space.ritz();
  const Eigen::Index found = ritz.gives.size();
  modes.slowest = space.given() * ritz.shapes.rightCols(std::min(found, kBlock - kAny));
  const double slowest_rate = 2.0 * std::numbers::pi / shortest_s;
  modes.shapes.resize(size, most);
  std::vector<double> gives;
  for (Eigen::Index k = found; k-- > 0 && static_cast<Eigen::Index>(gives.size()) < most;) {
    const double give = ritz.gives[k];
    if (!(give * slowest_rate * slowest_rate > 1.0)) break;
    const VectorXd shape = space.given() * ritz.shapes.col(k) / std::sqrt(give);
    double most_moved = 0.0;
    for (Eigen::Index i = 0; i < size; i += 3) {
      most_moved = std::max(most_moved, shape.segment<3>(i).squaredNorm());
    }
    if (most_moved * give < least_give_m_per_newton) continue;
    modes.shapes.col(static_cast<Eigen::Index>(gives.size())) = shape;
    gives.push_back(give);
  }
  const auto count = static_cast<Eigen::Index>(gives.size());
  modes.shapes.conservativeResize(Eigen::NoChange, count);
  modes.rates_per_s2.resize(count);
  modes.damping_per_s.resize(count);
  const double viscosity_s = body.description().materials.front().stiffness_damping_s;
  for (Eigen::Index k = 0; k < count; ++k) {
    const double give = gives[static_cast<std::size_t>(k)];
    modes.rates_per_s2[k] = 1.0 / give;
    double damping = 0.0;
    for (Eigen::Index node = 0; node < body.mass_kg().size(); ++node) {
      damping += body.mass_damping_kg_per_s()[node] *
                 modes.shapes.col(k).segment<3>(3 * node).squaredNorm();
    }
    modes.damping_per_s[k] = damping + viscosity_s / give;
  }
  modes.weighted = weighted(body, modes.shapes);
  return modes;
}

ModalMotion::ModalMotion(const SlowModes& modes, const std::vector<SurfacePoint>& points,
                         const std::vector<std::size_t>& chosen, const VectorXd& from_m,
                         const VectorXd& x_m, const VectorXd& v_m_per_s, const VectorXd& a_m_per_s2,
                         const std::vector<Vector3d>& forces_newton)
    : modes_(&modes), from_m_(&from_m) {
  const Eigen::Index count = modes.count();
  shapes_.setZero(3 * static_cast<Eigen::Index>(chosen.size()), count);
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const SurfacePoint& point = points[chosen[i]];
    for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
      shapes_.middleRows<3>(3 * static_cast<Eigen::Index>(i)) +=
          point.weights[a] * modes.shapes.middleRows<3>(3 * Eigen::Index{point.nodes[a]});
    }
  }
  q_ = amount_in(x_m);
  rate_ = rate_in(v_m_per_s);
  left_ = Eigen::VectorXd::Zero(count);
  push_ = next_ = left_;
  gains_.resize(static_cast<std::size_t>(count));
  const Eigen::VectorXd needed = rate_in(a_m_per_s2) + modes.damping_per_s.cwiseProduct(rate_) +
                                 modes.rates_per_s2.cwiseProduct(q_);
  amount_after(forces_newton);  // φᵀ f
  left_ = needed - push_;
}

Eigen::VectorXd ModalMotion::amount_in(const VectorXd& x_m) const {
  return modes_->weighted.transpose() * (x_m - *from_m_);
}

Eigen::VectorXd ModalMotion::rate_in(const VectorXd& v_m_per_s) const {
  return modes_->weighted.transpose() * v_m_per_s;
}

Vector3d ModalMotion::at(std::size_t point, const Eigen::VectorXd& amount) const noexcept {
  return shapes_.middleRows<3>(3 * static_cast<Eigen::Index>(point)) * amount;
}

void ModalMotion::take_from(std::vector<float>& compliance, std::size_t stride) const {
  const Eigen::Index size = shapes_.rows();
  const MatrixXd slow =
      shapes_ * modes_->rates_per_s2.cwiseInverse().asDiagonal() * shapes_.transpose();
  Eigen::Map<Eigen::MatrixXf, 0, Eigen::OuterStride<>> all(
      compliance.data(), size, size, Eigen::OuterStride<>(static_cast<Eigen::Index>(stride)));
  all = (all.cast<double>() - slow).cast<float>().eval();
}

bool ModalMotion::set_step(double step_s) noexcept {
  if (step_s == step_s_) return false;
  step_s_ = step_s;
  for (Eigen::Index k = 0; k < modes_->count(); ++k) {
    Gains& gain = gains_[static_cast<std::size_t>(k)];
    const double rate2 = modes_->rates_per_s2[k];
    if (!(step_s > 0.0)) {
      gain = {.c = 1.0 / rate2};
      continue;
    }
    // exact for a force that is constant in the step; waves, or two ways of dying down
    const double decay = 0.5 * modes_->damping_per_s[k];
    const double wave2 = rate2 - decay * decay;
    const double wave = std::sqrt(std::abs(wave2));
    double even = 0.0;  // e^(−decay h) cos(wave h)
    double odd = 0.0;   // e^(−decay h) sin(wave h)/wave
    if (wave * step_s < 1e-6) {
      even = std::exp(-decay * step_s);
      odd = step_s * even;
    } else if (wave2 > 0.0) {
      even = std::exp(-decay * step_s) * std::cos(wave * step_s);
      odd = std::exp(-decay * step_s) * std::sin(wave * step_s) / wave;
    } else {
      const double slow = std::exp((wave - decay) * step_s);
      const double fast = std::exp((-wave - decay) * step_s);
      even = 0.5 * (slow + fast);
      odd = 0.5 * (slow - fast) / wave;
    }
    gain.a = even + decay * odd;
    gain.b = odd;
    gain.c = (1.0 - gain.a) / rate2;
    gain.rate_a = -rate2 * odd;
    gain.rate_b = even - decay * odd;
    gain.rate_c = odd;
  }
  return true;
}

void ModalMotion::add_to(const std::vector<float>& compliance, std::size_t stride, double pace,
                         std::vector<float>& sum) const noexcept {
  std::copy(compliance.begin(), compliance.end(), sum.begin());
  const Eigen::Index size = shapes_.rows();
  for (Eigen::Index column = 0; column < size; ++column) {
    float* to = sum.data() + stride * static_cast<std::size_t>(column);
    for (Eigen::Index k = 0; k < modes_->count(); ++k) {
      const auto amount =
          static_cast<float>(gains_[static_cast<std::size_t>(k)].c * shapes_(column, k) / pace);
      const double* shape = shapes_.col(k).data();
      for (Eigen::Index i = 0; i < size; ++i) to[i] += amount * static_cast<float>(shape[i]);
    }
  }
}

const Eigen::VectorXd& ModalMotion::amount_after(
    const std::vector<Vector3d>& forces_newton) noexcept {
  push_ = left_;
  for (std::size_t i = 0; i < forces_newton.size(); ++i) {
    if (forces_newton[i].isZero(0.0)) continue;
    push_.noalias() +=
        shapes_.middleRows<3>(3 * static_cast<Eigen::Index>(i)).transpose() * forces_newton[i];
  }
  for (Eigen::Index k = 0; k < next_.size(); ++k) {
    const Gains& gain = gains_[static_cast<std::size_t>(k)];
    next_[k] = gain.a * q_[k] + gain.b * rate_[k] + gain.c * push_[k];
  }
  return next_;
}

void ModalMotion::move(const std::vector<Vector3d>& forces_newton) noexcept {
  amount_after(forces_newton);
  for (Eigen::Index k = 0; k < next_.size(); ++k) {
    const Gains& gain = gains_[static_cast<std::size_t>(k)];
    rate_[k] = gain.rate_a * q_[k] + gain.rate_b * rate_[k] + gain.rate_c * push_[k];
    q_[k] = next_[k];
  }
}

}  // namespace palpate::elastic
