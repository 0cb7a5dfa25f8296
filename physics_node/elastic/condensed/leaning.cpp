// SPDX-License-Identifier: Apache-2.0
// The compliance of a body that leans on something.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "common/contact/tissue_motion.h"
#include "physics_node/elastic/condensed/condensed_contact.h"

namespace palpate::elastic {
namespace {

// Rounding of the columns, relative to the diagonal of W.
constexpr double kRounding = 1e-3;

using RowMajor3f = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;

/// How a node of the surface moves under a unit force on a point.
Vector3d moved_m(const SurfaceCompliance& compliance, std::uint32_t node, const SurfacePoint& under,
                 const Vector3d& direction, const SurfaceCompliance::Required& columns) {
  const auto row = static_cast<std::size_t>(compliance.row_of(node));
  Vector3d sum = Vector3d::Zero();
  for (std::size_t b = 0; b < static_cast<std::size_t>(under.count); ++b) {
    const Eigen::Map<const RowMajor3f> give(columns.of(under.nodes[b]) + 9 * row);
    sum += under.weights[b] * (give.cast<double>() * direction);
  }
  return sum;
}

void sort_out(std::vector<std::uint32_t>& nodes) {
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
}

/// The motions of supports, each with how far it moves the supports along their directions.
std::vector<std::pair<palpate::TissueMotionConfig, Eigen::VectorXd>> motions_of(
    const std::vector<Support>& supports) {
  std::vector<std::pair<palpate::TissueMotionConfig, Eigen::VectorXd>> motions;
  for (std::size_t s = 0; s < supports.size(); ++s) {
    const palpate::TissueMotionConfig& motion = supports[s].motion;
    if (!palpate::is_moving(motion)) continue;
    auto found = std::find_if(motions.begin(), motions.end(), [&](const auto& one) {
      return one.first.frequency_hz == motion.frequency_hz &&
             one.first.phase_rad == motion.phase_rad;
    });
    if (found == motions.end()) {
      motions.emplace_back(motion,
                           Eigen::VectorXd::Zero(static_cast<Eigen::Index>(supports.size())));
      found = std::prev(motions.end());
    }
    found->second[static_cast<Eigen::Index>(s)] = supports[s].direction.dot(motion.amplitude_m);
  }
  return motions;
}

/// What the others give way where they are leant on, along the directions of the supports.
void add_others(const std::vector<Support>& supports, Eigen::MatrixXd& among) {
  std::vector<SurfaceCompliance*> others;
  for (const Support& one : supports) {
    if (one.other != nullptr &&
        std::find(others.begin(), others.end(), one.other) == others.end()) {
      others.push_back(one.other);
    }
  }
  for (SurfaceCompliance* const other : others) {
    std::vector<std::uint32_t> nodes;
    for (const Support& one : supports) {
      if (one.other == other) one.other_point.add_nodes_to(nodes);
    }
    sort_out(nodes);
    const SurfaceCompliance::Required columns = other->require(nodes);
    std::vector<Vector3d> moved(nodes.size());
    for (Eigen::Index s = 0; s < among.cols(); ++s) {
      const Support& under = supports[static_cast<std::size_t>(s)];
      if (under.other != other) continue;
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        moved[i] = moved_m(*other, nodes[i], under.other_point, under.direction, columns);
      }
      for (Eigen::Index t = 0; t < among.rows(); ++t) {
        const Support& at = supports[static_cast<std::size_t>(t)];
        if (at.other != other) continue;
        for (std::size_t a = 0; a < static_cast<std::size_t>(at.other_point.count); ++a) {
          const auto place =
              std::lower_bound(nodes.begin(), nodes.end(), at.other_point.nodes[a]) - nodes.begin();
          among(t, s) +=
              at.other_point.weights[a] * at.direction.dot(moved[static_cast<std::size_t>(place)]);
        }
      }
    }
  }
}

}  // namespace

/// @see leaning_ratio; before C is changed   @param less  Y
double CondensedContact::ratio_with(const Eigen::MatrixXd& less) const {
  const Eigen::Index size = 3 * Eigen::Index{count_};
  Eigen::VectorXd force = Eigen::VectorXd::Zero(size);
  for (Eigen::Index j = 0; j < count_; ++j) {
    force.segment<3>(3 * j) = forces_newton_[static_cast<std::size_t>(j)];
  }
  if (force.isZero(0.0)) force.head<3>() = along_.isZero(0.0) ? Vector3d::UnitZ() : along_;
  const Eigen::Map<const Eigen::MatrixXf, 0, Eigen::OuterStride<>> among(
      among_->data(), size, size, Eigen::OuterStride<>(static_cast<Eigen::Index>(stride_)));
  const double free = force.dot(among.cast<double>() * force);
  const double leaning = free - (less * force).squaredNorm();
  return leaning > 0.0 ? free / leaning : std::numeric_limits<double>::infinity();
}

/// @param pushed_m  of the points, by the motion's amplitude
void CondensedContact::be_carried(const palpate::TissueMotionConfig& motion,
                                  const Eigen::VectorXd& pushed_m) {
  Vector3d carried_m = pushed_m.head<3>();  // of the nearest point
  double sum_newton = 0.0;
  Vector3d sum = Vector3d::Zero();
  for (std::size_t j = 0; j < chosen_.size(); ++j) {
    const double newton = forces_newton_[j].norm();
    sum += newton * pushed_m.segment<3>(3 * static_cast<Eigen::Index>(j));
    sum_newton += newton;
  }
  if (sum_newton > 0.0) carried_m = sum / sum_newton;
  carried_.push_back({.amplitude_m = carried_m,
                      .frequency_hz = motion.frequency_hz,
                      .phase_rad = motion.phase_rad});
}

void CondensedContact::lean_on(std::vector<Support> supports,
                               const std::vector<SurfacePoint>& points, const VectorXd& x_m,
                               const Vector3d& centre_m, std::vector<TiePoint> ties) {
  if (supports.empty() && ties.empty()) return;
  if (supports.size() > kMostSupports) {
    const auto distance_m = [&](const Support& one) {
      return (one.point.position_m(x_m.data()) - centre_m).squaredNorm();
    };
    std::stable_sort(supports.begin(), supports.end(), [&](const Support& a, const Support& b) {
      return distance_m(a) < distance_m(b);
    });
    supports.resize(kMostSupports);
  }
  if (!ties.empty()) {
    const auto size = static_cast<Eigen::Index>(supports.size());
    Eigen::MatrixXd give = Eigen::MatrixXd::Zero(size, size);
    add_others(supports, give);
    be_tied(std::move(ties), supports, give, motions_of(supports), points, x_m, centre_m);
    return;
  }
  std::vector<std::uint32_t> under;  // nodes of supports
  for (const Support& one : supports) one.point.add_nodes_to(under);
  sort_out(under);
  const SurfaceCompliance::Required columns = compliance_->require(under);

  // how nodes move under each support: of the supports, and of the points
  std::vector<std::uint32_t> nodes = under;
  for (const std::size_t point : chosen_) points[point].add_nodes_to(nodes);
  sort_out(nodes);
  const auto place_of = [&](std::uint32_t node) {
    return 3 * (std::lower_bound(nodes.begin(), nodes.end(), node) - nodes.begin());
  };
  const auto count = static_cast<Eigen::Index>(supports.size());
  Eigen::MatrixXd moved(3 * static_cast<Eigen::Index>(nodes.size()), count);
  for (Eigen::Index s = 0; s < count; ++s) {
    const Support& one = supports[static_cast<std::size_t>(s)];
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      moved.block<3, 1>(3 * static_cast<Eigen::Index>(i), s) =
          moved_m(*compliance_, nodes[i], one.point, one.direction, columns);
    }
  }
  Eigen::MatrixXd onto_points = Eigen::MatrixXd::Zero(3 * Eigen::Index{count_}, count);
  for (std::size_t j = 0; j < chosen_.size(); ++j) {
    const SurfacePoint& at = points[chosen_[j]];
    for (std::size_t a = 0; a < static_cast<std::size_t>(at.count); ++a) {
      onto_points.middleRows<3>(3 * static_cast<Eigen::Index>(j)) +=
          at.weights[a] * moved.middleRows<3>(place_of(at.nodes[a]));
    }
  }
  Eigen::MatrixXd among(count, count);
  for (Eigen::Index t = 0; t < count; ++t) {
    const Support& at = supports[static_cast<std::size_t>(t)];
    among.row(t).setZero();
    for (std::size_t a = 0; a < static_cast<std::size_t>(at.point.count); ++a) {
      among.row(t) += at.point.weights[a] * at.direction.transpose() *
                      moved.middleRows<3>(place_of(at.point.nodes[a]));
    }
  }
  add_others(supports, among);
  among = (0.5 * (among + among.transpose())).eval();
  among.diagonal() *= 1.0 + kRounding;
  const Eigen::LLT<Eigen::MatrixXd> factor(among);
  if (factor.info() != Eigen::Success) return;
  // B (W + D)⁻¹ Bᵀ = Y Yᵀ, so that it is symmetric
  const Eigen::MatrixXd less = factor.matrixL().solve(onto_points.transpose());
  if (!less.allFinite()) return;
  carried_.clear();
  for (const auto& [motion, ways_m] : motions_of(supports)) {
    be_carried(motion, less.transpose() * factor.matrixL().solve(ways_m));
  }
  leaning_ratio_ = ratio_with(less);
  const Eigen::MatrixXf taken = (less.transpose() * less).cast<float>();
  std::vector<float>& all = own_among();
  for (Eigen::Index column = 0; column < taken.cols(); ++column) {
    float* to = all.data() + static_cast<std::size_t>(column) * stride_;
    for (Eigen::Index row = 0; row < taken.rows(); ++row) to[row] -= taken(row, column);
  }
}

}  // namespace palpate::elastic
