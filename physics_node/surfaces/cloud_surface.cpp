// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/cloud_surface.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>
#include <thread>

#include "common/core/check.h"

namespace palpate::physics {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// A quadric has 6 unknowns; with eight times as many points, noise of a tenth of the spacing leaves
// an error of the normal of 1.5° (24 points: 3°; 64 points: 1.1°, with less detail).
constexpr std::size_t kFitNeighbors = 48;
// The 12th neighbour of evenly spaced points is 2 spacings away, so the reach is 3 spacings and
// some 25 quadrics overlap everywhere.
constexpr std::size_t kReachNeighbor = 12;
constexpr double kReachRatio = 1.5;
// Neighbours whose normal differs by more than 60° belong to another face or sheet.
constexpr double kSameSheetCosine = 0.5;
// Regularises the curvature to 0 where too few points determine it; relative to a full
// neighbourhood.
constexpr double kCurvatureRidge = 1e-4;
constexpr double kSlopeRidge = 1e-8;
constexpr std::size_t kNormalNeighbors = 24;
constexpr std::size_t kOrientNeighbors = 16;
// Within this many reaches the nearest point is exact, beyond to 1 %: from the centre of a sphere
// all points are equally far, and an exact search would visit each.
constexpr float kNearReaches = 16.0F;
constexpr float kFarOvershoot = 0.01F;

/// Calls work(begin, end) for parts of [0, count) in parallel on all processors.
template <class Work>
void share_out(std::size_t count, const Work& work) {
  constexpr std::size_t kWorthAThread = 10000;
  const std::size_t parts = std::clamp<std::size_t>(
      count / kWorthAThread, 1, std::max(1U, std::thread::hardware_concurrency()));
  const auto border = [&](std::size_t part) {
    return static_cast<std::uint32_t>(count * part / parts);
  };
  std::vector<std::jthread> others;
  for (std::size_t part = 1; part < parts; ++part) {
    others.emplace_back([&, part] { work(border(part), border(part + 1)); });
  }
  work(border(0), border(1));
}

Vector3 place_of(const Octree::Point& point) noexcept { return {point.x, point.y, point.z}; }

}  // namespace

// --- construction
// ----------------------------------------------------------------------------------

CloudSurface::CloudSurface(const PointCloud& cloud) {
  const std::size_t count = cloud.points_m.size();
  PALPATE_REQUIRE(count >= kMinPoints);
  PALPATE_REQUIRE(cloud.normals.empty() || cloud.normals.size() == count);
  PALPATE_REQUIRE(cloud.stiffness_ratios.empty() || cloud.stiffness_ratios.size() == count);

  bounds_ = bounds_of(cloud.points_m);
  origin_m_ = bounds_.center_m();
  {
    std::vector<Octree::Point> points;
    points.reserve(count);
    for (const Vector3& point_m : cloud.points_m) {
      const Eigen::Vector3f p = (point_m - origin_m_).cast<float>();
      points.push_back({.x = p.x(), .y = p.y(), .z = p.z()});
    }
    tree_ = Octree(points);
  }
  const std::span<const std::uint32_t> order = tree_.order();

  std::vector<Vector3> normals;
  if (cloud.normals.empty()) {
    normals = estimate_normals();
    orient(normals);
  } else {
    normals.reserve(order.size());
    for (const std::uint32_t i : order) normals.push_back(cloud.normals[i].normalized());
  }
  if (!cloud.stiffness_ratios.empty()) {
    stiffness_ratios_.reserve(order.size());
    for (const std::uint32_t i : order) {
      stiffness_ratios_.push_back(static_cast<float>(cloud.stiffness_ratios[i]));
    }
  }
  tree_.forget_order();

  quadrics_.resize(normals.size());
  std::vector<float> reaches(normals.size());
  share_out(normals.size(), [&](std::uint32_t begin, std::uint32_t end) {
    Octree::Hint hint;
    for (std::uint32_t i = begin; i < end; ++i) fit(i, normals, hint, reaches);
  });
  tree_.set_reaches(reaches);

  // the surface may lie beside its points, and extends beyond their border
  const float longest = *std::max_element(reaches.begin(), reaches.end());
  bounds_.grow(Vector3::Constant(longest));
  std::nth_element(reaches.begin(),
                   reaches.begin() + static_cast<std::ptrdiff_t>(reaches.size() / 2),
                   reaches.end());
  near_m_ = kNearReaches * reaches[reaches.size() / 2];
}

Vector3 CloudSurface::estimate_normal(std::uint32_t point, Octree::Hint& hint) const {
  const std::span<const Octree::Point> points = tree_.points();
  const Vector3 center = place_of(points[point]);
  std::array<Octree::Neighbor, kNormalNeighbors + 1> found;
  const std::size_t count = tree_.nearest(center.cast<float>(), found, hint);

  // the direction in which the neighbours vary least
  Vector3 mean = Vector3::Zero();
  for (std::size_t i = 0; i < count; ++i) mean += place_of(points[found[i].point]) - center;
  mean /= static_cast<double>(count);
  Matrix3 covariance = Matrix3::Zero();
  for (std::size_t i = 0; i < count; ++i) {
    const Vector3 r = place_of(points[found[i].point]) - center - mean;
    covariance += r * r.transpose();
  }
  const double size = covariance.trace();
  if (size > 0.0) covariance /= size;
  Eigen::SelfAdjointEigenSolver<Matrix3> solver;
  solver.computeDirect(covariance);
  return solver.eigenvectors().col(0).normalized();
}

std::vector<Vector3> CloudSurface::estimate_normals() const {
  std::vector<Vector3> normals(tree_.points().size());
  share_out(normals.size(), [&](std::uint32_t begin, std::uint32_t end) {
    Octree::Hint hint;
    for (std::uint32_t i = begin; i < end; ++i) normals[i] = estimate_normal(i, hint);
  });
  return normals;
}

/// Follows the edges between neighbours, those with the best agreement of normals first (a minimum
/// spanning tree), and flips each normal to agree with the previous one. Source: [Hoppe92] §3.3.
void CloudSurface::orient(std::vector<Vector3>& normals) const {
  const std::span<const Octree::Point> points = tree_.points();
  struct Edge {
    double disagreement;
    std::uint32_t from;
    std::uint32_t to;
  };
  const auto is_later = [](const Edge& a, const Edge& b) {
    return a.disagreement != b.disagreement ? a.disagreement > b.disagreement : a.to > b.to;
  };
  std::priority_queue<Edge, std::vector<Edge>, decltype(is_later)> edges(is_later);
  std::vector<bool> is_done(points.size(), false);
  Octree::Hint hint;
  std::array<Octree::Neighbor, kOrientNeighbors + 1> found;
  const auto neighbors_of = [&](std::uint32_t point) {
    const std::size_t count = tree_.nearest(place_of(points[point]).cast<float>(), found, hint);
    return std::span(found).first(count);
  };
  const auto agree = [&](std::uint32_t from, std::uint32_t to) {
    if (normals[from].dot(normals[to]) < 0.0) normals[to] = -normals[to];
  };
  const auto finish = [&](std::uint32_t point) {
    is_done[point] = true;
    for (const Octree::Neighbor& neighbor : neighbors_of(point)) {
      const std::uint32_t next = neighbor.point;
      if (is_done[next]) continue;
      edges.push({1.0 - std::abs(normals[point].dot(normals[next])), point, next});
    }
  };

  // highest first, so that the first of each connected part is its top
  std::vector<std::uint32_t> by_height(points.size());
  std::iota(by_height.begin(), by_height.end(), 0U);
  std::sort(by_height.begin(), by_height.end(), [&](std::uint32_t a, std::uint32_t b) {
    return points[a].z != points[b].z ? points[a].z > points[b].z : a < b;
  });
  for (const std::uint32_t top : by_height) {
    if (is_done[top]) continue;
    if (normals[top].z() < 0.0) normals[top] = -normals[top];
    // a cluster whose points are no other point's neighbours still has neighbours itself
    for (const Octree::Neighbor& neighbor : neighbors_of(top)) {
      if (!is_done[neighbor.point]) continue;
      agree(neighbor.point, top);
      break;
    }
    finish(top);
    while (!edges.empty()) {
      const Edge edge = edges.top();
      edges.pop();
      if (is_done[edge.to]) continue;
      agree(edge.from, edge.to);
      finish(edge.to);
    }
  }
}

void CloudSurface::fit(std::uint32_t point, const std::vector<Vector3>& normals, Octree::Hint& hint,
                       std::vector<float>& reaches) {
  const std::span<const Octree::Point> points = tree_.points();
  const Vector3 center = place_of(points[point]);
  std::array<Octree::Neighbor, kFitNeighbors + 1> found;
  const std::size_t count = tree_.nearest(center.cast<float>(), found, hint);
  const auto distance = [&](std::size_t i) {
    return std::sqrt(static_cast<double>(found[i].squared_distance));
  };
  const double reach_m = kReachRatio * distance(std::min(kReachNeighbor, count - 1));
  reaches[point] = static_cast<float>(reach_m);
  const double L = 1.1 * distance(count - 1);  // length in which the fit is done

  // z = c + b·(u, v) + ½ (a₁ u² + 2 a₂ u v + a₃ v²) over the tangent plane, in two passes: the
  // second over the plane that the first one found
  Vector3 n = normals[point];
  Vector6 x = Vector6::Zero();  // c b₁ b₂ a₁ a₂ a₃ for lengths in L
  for (int pass = 0; pass < 2; ++pass) {
    const Tangents t(n);
    Matrix6 A = Matrix6::Zero();
    Vector6 right = Vector6::Zero();
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t other = found[i].point;
      if (normals[other].dot(normals[point]) < kSameSheetCosine) continue;
      const Vector3 r = (place_of(points[other]) - center) / L;
      const double inside = 1.0 - r.squaredNorm();
      const double w = inside * inside;
      const double u = r.dot(t.first);
      const double v = r.dot(t.second);
      Vector6 row;
      row << 1.0, u, v, 0.5 * u * u, u * v, 0.5 * v * v;
      A.noalias() += (w * row) * row.transpose();
      right += w * r.dot(n) * row;
    }
    const double total = A(0, 0);
    A(1, 1) += kSlopeRidge * total;
    A(2, 2) += kSlopeRidge * total;
    for (int i = 3; i < 6; ++i) A(i, i) += kCurvatureRidge * 0.01 * total;
    x = A.ldlt().solve(right);
    const Vector3 steeper = n - x[1] * t.first - x[2] * t.second;
    const double cosine = 1.0 / steeper.norm();
    x[0] *= cosine;
    if (pass == 0) {
      n = steeper * cosine;
      continue;
    }
    const double most = L / reach_m;  // curvature, in 1/L
    const auto limited = [&](double a) { return std::clamp(a, -most, most) / L; };
    const Matrix3 H =
        -(limited(x[3]) * t.first * t.first.transpose() +
          limited(x[4]) * (t.first * t.second.transpose() + t.second * t.first.transpose()) +
          limited(x[5]) * t.second * t.second.transpose());
    n = steeper * cosine;
    const auto narrow = [](double value) { return static_cast<float>(value); };
    quadrics_[point] = {.normal = {narrow(n.x()), narrow(n.y()), narrow(n.z())},
                        .offset = narrow(x[0] * L),
                        .curvature = {narrow(H(0, 0)), narrow(H(0, 1)), narrow(H(0, 2)),
                                      narrow(H(1, 1)), narrow(H(1, 2)), narrow(H(2, 2))}};
  }
}

// --- queries ----------------------------------------------------------------------------------

Vector3 CloudSurface::normal(std::uint32_t point) const noexcept {
  const std::array<float, 3>& n = quadrics_[point].normal;
  return {n[0], n[1], n[2]};
}

SurfaceView CloudSurface::view(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  const auto nearest = [&](const Vector3& place) -> std::uint32_t {
    const Eigen::Vector3f center = place.cast<float>();
    std::array<Octree::Neighbor, 1> found;
    Octree::Hint leaf{hint.cell};
    if (tree_.nearest(center, found, leaf, near_m_) == 0) {
      // far away a hint would change which of the approximately nearest points is found
      leaf.leaf = 0;
      const std::size_t count =
          tree_.nearest(center, found, leaf, std::numeric_limits<float>::max(), kFarOvershoot);
      hint.octree_cells_visited += leaf.cells_visited;
      if (count == 0) return kNoPoint;
    } else {
      hint.octree_cells_visited += leaf.cells_visited;
    }
    if (leaf.leaf != 0 && leaf.leaf == hint.cell) ++hint.last_cell_hits;
    hint.cell = leaf.leaf;
    return found[0].point;
  };
  return view_with(point_m, nearest, [&](const Vector3& place, const auto& visit) {
    hint.octree_cells_visited += tree_.visit_reaching(
        place.cast<float>(), [&](std::uint32_t point, float) { visit(point); });
  });
}

std::size_t CloudSurface::bytes() const noexcept {
  return tree_.bytes() + quadrics_.capacity() * sizeof(CloudQuadric) +
         stiffness_ratios_.capacity() * sizeof(float);
}

}  // namespace palpate::physics
