// SPDX-License-Identifier: Apache-2.0
// The compliance of a body that springs tie to another one, which gives way too.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "physics_node/elastic/condensed/condensed_contact.h"

namespace palpate::elastic {
namespace {

// Of the columns, relative to the diagonal, where the body leans on something.
constexpr double kTiedRounding = 1e-3;

using TiedBlock = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;

/// How points move under unit forces on others: 3 rows for each point, 3 columns for each other.
Eigen::MatrixXd give_of(SurfaceCompliance& compliance, const std::vector<SurfacePoint>& at,
                        const std::vector<SurfacePoint>& under) {
  std::vector<std::uint32_t> nodes;
  for (const SurfacePoint& one : under) one.add_nodes_to(nodes);
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  const SurfaceCompliance::Required columns = compliance.require(nodes);
  Eigen::MatrixXd give = Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(at.size()),
                                               3 * static_cast<Eigen::Index>(under.size()));
  for (std::size_t u = 0; u < under.size(); ++u) {
    for (std::size_t b = 0; b < static_cast<std::size_t>(under[u].count); ++b) {
      const float* const column = columns.of(under[u].nodes[b]);
      for (std::size_t p = 0; p < at.size(); ++p) {
        auto block =
            give.block<3, 3>(3 * static_cast<Eigen::Index>(p), 3 * static_cast<Eigen::Index>(u));
        for (std::size_t a = 0; a < static_cast<std::size_t>(at[p].count); ++a) {
          const auto row = static_cast<std::size_t>(compliance.row_of(at[p].nodes[a]));
          block += under[u].weights[b] * at[p].weights[a] *
                   Eigen::Map<const TiedBlock>(column + 9 * row).cast<double>();
        }
      }
    }
  }
  return give;
}

template <class Item>
std::vector<SurfacePoint> points_of(const std::vector<Item>& items, SurfacePoint Item::*point) {
  std::vector<SurfacePoint> points;
  for (const Item& one : items) points.push_back(one.*point);
  return points;
}

/// The force on this body by the ties, as they act on it besides the springs in its own stiffness,
/// is −S times the way of their points. With the stiffness k of the springs and the compliance L of
/// the other body at their other ends
///
///   S = −√k (I − (I + √k L √k)⁻¹) √k     of a body that has the springs in its own stiffness
///   S = √k (I − √k L √k) √k              of one tied to a body that has them in its own, in L
Eigen::MatrixXd stiffness_of_ties(const std::vector<TiePoint>& ties) {
  const auto size = 3 * static_cast<Eigen::Index>(ties.size());
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(size, size);
  std::vector<char> is_done(ties.size(), 0);
  for (std::size_t first = 0; first < ties.size(); ++first) {
    if (is_done[first] != 0) continue;
    std::vector<Eigen::Index> places;
    std::vector<SurfacePoint> ends;
    std::vector<double> roots;
    for (std::size_t i = first; i < ties.size(); ++i) {
      if (ties[i].other != ties[first].other || ties[i].is_in_body != ties[first].is_in_body) {
        continue;
      }
      is_done[i] = 1;
      ends.push_back(ties[i].other_point);
      for (Eigen::Index k = 0; k < 3; ++k) {
        places.push_back(3 * static_cast<Eigen::Index>(i) + k);
        roots.push_back(std::sqrt(ties[i].newton_per_m));
      }
    }
    const auto root =
        Eigen::Map<const Eigen::VectorXd>(roots.data(), static_cast<Eigen::Index>(roots.size()));
    Eigen::MatrixXd give = give_of(*ties[first].other, ends, ends);
    give = (0.5 * root.asDiagonal() * (give + give.transpose()) * root.asDiagonal()).eval();
    const auto one = Eigen::MatrixXd::Identity(give.rows(), give.cols());
    const Eigen::MatrixXd share = ties[first].is_in_body
                                      ? Eigen::MatrixXd((one + give).llt().solve(one) - one)
                                      : Eigen::MatrixXd(one - give);
    stiffness(places, places) = root.asDiagonal() * share * root.asDiagonal();
  }
  return stiffness;
}

}  // namespace

void CondensedContact::be_tied(std::vector<TiePoint> ties, const std::vector<Support>& supports,
                               const Eigen::MatrixXd& supports_give, const Motions& motions,
                               const std::vector<SurfacePoint>& points, const VectorXd& x_m,
                               const Vector3d& centre_m) {
  const auto distance_m = [&](const TiePoint& one) {
    return (one.point.position_m(x_m.data()) - centre_m).squaredNorm();
  };
  if (ties.size() > kMostTies) {
    std::stable_sort(ties.begin(), ties.end(), [&](const TiePoint& a, const TiePoint& b) {
      return distance_m(a) < distance_m(b);
    });
    ties.resize(kMostTies);
  }
  std::vector<SurfacePoint> chosen;
  for (const std::size_t point : chosen_) chosen.push_back(points[point]);
  // directions of supports first, then those of the ties
  std::vector<SurfacePoint> under = points_of(supports, &Support::point);
  const std::vector<SurfacePoint> tied = points_of(ties, &TiePoint::point);
  under.insert(under.end(), tied.begin(), tied.end());
  const auto count = static_cast<Eigen::Index>(supports.size());
  const auto size = count + 3 * static_cast<Eigen::Index>(ties.size());
  Eigen::MatrixXd along = Eigen::MatrixXd::Zero(3 * static_cast<Eigen::Index>(under.size()), size);
  for (Eigen::Index s = 0; s < count; ++s) {
    along.block<3, 1>(3 * s, s) = supports[static_cast<std::size_t>(s)].direction;
  }
  along.bottomRightCorner(size - count, size - count).setIdentity();
  const Eigen::MatrixXd onto_points = give_of(*compliance_, chosen, under) * along;
  Eigen::MatrixXd among = along.transpose() * give_of(*compliance_, under, under) * along;
  among.topLeftCorner(count, count) += supports_give;
  among = (0.5 * (among + among.transpose())).eval();
  among.diagonal().head(count) *= 1.0 + kTiedRounding;

  // the ways λ of supports and µ of ties that the forces leave: Δu = −B (λ, S µ)
  const Eigen::MatrixXd stiffness = stiffness_of_ties(ties);
  Eigen::MatrixXd system = among;
  system.rightCols(size - count) = among.rightCols(size - count) * stiffness;
  system.diagonal().tail(size - count).array() += 1.0;
  const Eigen::PartialPivLU<Eigen::MatrixXd> factor(system);
  Eigen::MatrixXd ways = factor.solve(onto_points.transpose());
  ways.bottomRows(size - count) = (stiffness * ways.bottomRows(size - count)).eval();
  Eigen::MatrixXd taken = onto_points * ways;
  taken = (0.5 * (taken + taken.transpose())).eval();
  if (!taken.allFinite()) return;
  carried_.clear();
  for (const auto& [motion, ways_m] : motions) {
    Eigen::VectorXd pushes = Eigen::VectorXd::Zero(size);
    pushes.head(count) = ways_m;
    pushes = factor.solve(pushes).eval();
    pushes.tail(size - count) = (stiffness * pushes.tail(size - count)).eval();
    be_carried(motion, onto_points * pushes);
  }
  take(taken);
}

/// C becomes C − this; the place that is pressed has a leaning_ratio() then.
void CondensedContact::take(const Eigen::MatrixXd& taken) {
  const auto rows = 3 * Eigen::Index{count_};
  Eigen::VectorXd force = Eigen::VectorXd::Zero(rows);
  for (std::size_t j = 0; j < chosen_.size(); ++j) {
    force.segment<3>(3 * static_cast<Eigen::Index>(j)) = forces_newton_[j];
  }
  if (force.isZero(0.0)) force.head<3>() = along_.isZero(0.0) ? Vector3d::UnitZ() : along_;
  std::vector<float>& all = own_among();
  double free = 0.0;
  for (Eigen::Index column = 0; column < rows; ++column) {
    float* to = all.data() + static_cast<std::size_t>(column) * stride_;
    for (Eigen::Index row = 0; row < rows; ++row) {
      free += force[row] * static_cast<double>(to[row]) * force[column];
      to[row] -= static_cast<float>(taken(row, column));
    }
  }
  const double left = free - force.dot(taken * force);
  leaning_ratio_ = left > 0.0 ? free / left : std::numeric_limits<double>::infinity();
}

}  // namespace palpate::elastic
