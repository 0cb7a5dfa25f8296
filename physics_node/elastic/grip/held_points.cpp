// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/grip/held_points.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::elastic {
namespace {

constexpr double kMostChange = 3.0;

/// At most so many of these, spread evenly over the surface on which they lie: each the farthest
/// from all that have been taken. The two faces of a cut, which lie on each other in the body at
/// rest, are as far apart as the blade reaches. So the part of the surface that a blade holds does
/// not depend on how many points the mesh has there.
/// @param near  distance from the edge and index of the point, by distance
std::vector<std::size_t> spread_over(const std::vector<std::pair<double, std::size_t>>& near,
                                     const std::vector<SurfacePoint>& points, const double* rest_m,
                                     double reach_m, std::size_t most) {
  std::vector<std::size_t> taken;
  if (near.size() <= most) {
    for (const auto& [distance_m, i] : near) taken.push_back(i);
    return taken;
  }
  using Place = Eigen::Matrix<double, 6, 1>;
  std::vector<Place> places(near.size());
  for (std::size_t i = 0; i < near.size(); ++i) {
    const SurfacePoint& point = points[near[i].second];
    places[i] << point.position_m(rest_m), 0.5 * reach_m * point.outward(rest_m);
  }
  std::vector<double> away2_m2(near.size(), std::numeric_limits<double>::infinity());
  std::size_t next = 0;
  while (taken.size() < most) {
    taken.push_back(near[next].second);
    const Place& last = places[next];
    for (std::size_t i = 0; i < near.size(); ++i) {
      away2_m2[i] = std::min(away2_m2[i], (places[i] - last).squaredNorm());
      if (away2_m2[i] > away2_m2[next]) next = i;
    }
  }
  return taken;
}

}  // namespace

std::size_t HeldPoints::take_beside(const std::vector<SurfacePoint>& points, const double* rest_m,
                                    const std::array<Vector3d, 2>& edge_m, double reach_m,
                                    std::size_t most, double newton_per_m,
                                    const Vector3d& origin_m) {
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double distance_m = distance_to_edge_m(points[i].position_m(rest_m), edge_m);
    if (distance_m <= reach_m) near.emplace_back(distance_m, i);
  }
  if (near.empty()) return 0;
  std::sort(near.begin(), near.end());
  held_.clear();
  for (const std::size_t i : spread_over(near, points, rest_m, reach_m, most)) {
    held_.push_back(
        {.point = points[i], .index = i, .away_m = points[i].position_m(rest_m) - origin_m});
  }
  newton_per_m_ = newton_per_m / static_cast<double>(held_.size());
  return held_.size();
}

void HeldPoints::take(const std::vector<SurfacePoint>& points, const double* x_m,
                      const Vector3d& at_m, double reach_m, std::size_t most, double newton_per_m,
                      const double* rest_m) {
  held_.clear();
  at_m_ = at_m;
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double distance_m = (points[i].position_m(x_m) - at_m).norm();
    if (distance_m <= reach_m) near.emplace_back(distance_m, i);
  }
  std::sort(near.begin(), near.end());
  near.resize(std::min(near.size(), most));
  for (const auto& [distance_m, i] : near) {
    held_.push_back({.point = points[i], .index = i, .away_m = points[i].position_m(x_m) - at_m});
  }
  newton_per_m_ = newton_per_m / static_cast<double>(std::max<std::size_t>(1, held_.size()));
  if (rest_m == nullptr) return;
  const Vector3d moved = moved_m(x_m, rest_m);
  for (Held& one : held_) one.away_m = one.point.position_m(rest_m) + moved - at_m;
}

Vector3d HeldPoints::moved_m(const double* x_m, const double* rest_m) const noexcept {
  Vector3d sum = Vector3d::Zero();
  for (const Held& one : held_) sum += one.point.position_m(x_m) - one.point.position_m(rest_m);
  return sum / static_cast<double>(std::max<std::size_t>(1, held_.size()));
}

void HeldPoints::continue_as(const HeldPoints& other, const std::vector<SurfacePoint>& points,
                             const std::vector<std::int32_t>& old_points) {
  *this = other;
  held_.clear();
  for (const Held& one : other.held_) {
    const auto at =
        std::find(old_points.begin(), old_points.end(), static_cast<std::int32_t>(one.index));
    if (at == old_points.end()) continue;
    const auto index = static_cast<std::size_t>(at - old_points.begin());
    held_.push_back({.point = points[index], .index = index, .away_m = one.away_m});
  }
}

Vector3d HeldPoints::add_forces_on_body(const double* x_m,
                                        std::span<Vector3d> forces_newton) const noexcept {
  Vector3d sum = Vector3d::Zero();
  for (const Held& one : held_) {
    const Vector3d pull = newton_per_m_ * stretch_m(one, x_m);
    forces_newton[one.index] -= pull;
    sum += pull;
  }
  return sum;
}

double HeldPoints::stored_joule(const double* x_m) const noexcept {
  double joule = 0.0;
  for (const Held& one : held_) {
    joule += 0.5 * newton_per_m_ * stretch_m(one, x_m).squaredNorm();
  }
  return joule;
}

double HeldPoints::add_gradient(const double* x_m, double* gradient) const noexcept {
  double joule = 0.0;
  for (const Held& one : held_) {
    const Vector3d stretched_m = stretch_m(one, x_m);
    joule += 0.5 * newton_per_m_ * stretched_m.squaredNorm();
    for (std::size_t a = 0; a < static_cast<std::size_t>(one.point.count); ++a) {
      Eigen::Map<Vector3d>(gradient + 3 * std::size_t{one.point.nodes[a]}) +=
          newton_per_m_ * one.point.weights[a] * stretched_m;
    }
  }
  return joule;
}

void HeldPoints::add_stiffness(const BlockPattern& pattern, BlockValues& values) const {
  for (const Held& one : held_) {
    const SurfacePoint& point = one.point;
    for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
      const std::int32_t row = pattern.row_of[point.nodes[a]];
      if (row < 0) continue;
      for (std::size_t b = 0; b < static_cast<std::size_t>(point.count); ++b) {
        const std::int32_t column = pattern.row_of[point.nodes[b]];
        if (column < 0 || column > row) continue;
        const std::size_t block = std::size_t{9} * pattern.slot(static_cast<std::uint32_t>(row),
                                                                static_cast<std::uint32_t>(column));
        const double k = newton_per_m_ * point.weights[a] * point.weights[b];
        for (std::size_t i = 0; i < 3; ++i) values[block + 4 * i] += k;
      }
    }
  }
}

std::vector<Eigen::Matrix3d> grip_stiffness_newton_per_m(SurfaceCompliance& compliance,
                                                         std::span<const HeldPoints> tools,
                                                         std::size_t own) {
  struct Row {
    const SurfacePoint* point;
    double give_m_per_newton;
    std::size_t tool;
  };
  std::vector<Row> rows;
  std::vector<std::uint32_t> nodes;
  for (std::size_t tool = 0; tool < tools.size(); ++tool) {
    for (const HeldPoints::Held& held : tools[tool].held()) {
      rows.push_back({.point = &held.point,
                      .give_m_per_newton = 1.0 / tools[tool].newton_per_m(),
                      .tool = tool});
      held.point.add_nodes_to(nodes);
    }
  }
  const SurfaceCompliance::Required columns = compliance.require(nodes);

  const auto first_of = [](std::size_t row) { return static_cast<Eigen::Index>(3 * row); };
  const Eigen::Index size = first_of(rows.size());
  Eigen::MatrixXd give = Eigen::MatrixXd::Zero(size, size);
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(size, 3);  // a way of the tool, of its own points
  for (std::size_t j = 0; j < rows.size(); ++j) {
    if (rows[j].tool == own) moved.block<3, 3>(first_of(j), 0).setIdentity();
    for (std::size_t i = 0; i <= j; ++i) {
      Eigen::Matrix3d block = compliance.give(*rows[i].point, *rows[j].point, columns);
      if (i == j) block.diagonal().array() += rows[i].give_m_per_newton;
      give.block<3, 3>(first_of(i), first_of(j)) = block;
    }
  }
  // on the points, for that way
  const Eigen::MatrixXd forces = give.selfadjointView<Eigen::Upper>().llt().solve(moved);
  std::vector<Eigen::Matrix3d> stiffness(tools.size(), Eigen::Matrix3d::Zero());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    stiffness[rows[i].tool] += forces.block<3, 3>(first_of(i), 0).transpose();
  }
  stiffness[own] = 0.5 * (stiffness[own] + stiffness[own].transpose()).eval();
  return stiffness;
}

Eigen::Matrix3d updated_stiffness(const Eigen::Matrix3d& stiffness, const Vector3d& way_m,
                                  const Vector3d& fell_newton) {
  if (!(way_m.norm() > kShortestWay_m)) return stiffness;
  const Vector3d expected = stiffness * way_m;
  const double expected_joule = way_m.dot(expected);
  const double joule = way_m.dot(fell_newton);
  if (!(joule > expected_joule / kMostChange && joule < expected_joule * kMostChange)) {
    return stiffness;
  }
  const Eigen::Matrix3d updated = stiffness - expected * expected.transpose() / expected_joule +
                                  fell_newton * fell_newton.transpose() / joule;
  const Eigen::Matrix3d symmetric = 0.5 * (updated + updated.transpose());
  return Eigen::LLT<Eigen::Matrix3d>(symmetric).info() == Eigen::Success ? symmetric : stiffness;
}

}  // namespace palpate::elastic
