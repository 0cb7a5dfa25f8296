#include "physics_node/elastic/condensed_contact.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "physics_node/elastic/linear/dense_kernels.h"

namespace palpate::elastic {

SurfaceCompliance::SurfaceCompliance(const Body& body, WarpedFactor& factor,
                                     std::vector<std::uint32_t> surface_nodes)
    : body_(body), factor_(factor), nodes_(std::move(surface_nodes)) {
  row_of_.assign(body.node_count(), -1);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    row_of_[nodes_[i]] = static_cast<std::int32_t>(i);
  }
  load_ = VectorXd::Zero(body.rest_m().size());
  answer_ = load_;
}

void SurfaceCompliance::clear() { columns_.clear(); }

void SurfaceCompliance::require(std::uint32_t node) {
  const auto [entry, is_new] = columns_.try_emplace(node);
  if (!is_new) return;
  std::vector<float>& values = entry->second;
  values.assign(9 * nodes_.size(), 0.0F);
  if (body_.pattern().row_of[node] < 0) return;  // a fixed node gives way to nothing
  ++made_;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    load_[3 * Eigen::Index{node} + axis] = 1.0;
    factor_.solve(load_.data(), answer_.data());
    load_[3 * Eigen::Index{node} + axis] = 0.0;
    for (std::size_t row = 0; row < nodes_.size(); ++row) {
      for (std::size_t i = 0; i < 3; ++i) {
        values[9 * row + 3 * i + static_cast<std::size_t>(axis)] = static_cast<float>(
            answer_[3 * Eigen::Index{nodes_[row]} + static_cast<Eigen::Index>(i)]);
      }
    }
  }
}

CondensedContact::CondensedContact(SurfaceCompliance& compliance, double friction_coefficient)
    : compliance_(compliance), friction_coefficient_(friction_coefficient) {}

void CondensedContact::prepare(const std::vector<SurfacePoint>& points, const VectorXd& x_m,
                               const std::vector<Vector3d>& forces_on_body_newton,
                               const Vector3d& centre_m, int most_points) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::vector<double> distances;
  for (const SurfacePoint& point : points) {
    distances.push_back((point.position_m(x_m.data()) - centre_m).norm());
  }
  const std::size_t count = std::min({points.size(), static_cast<std::size_t>(most_points),
                                      static_cast<std::size_t>(kMostPoints)});
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
                    [&](std::size_t a, std::size_t b) { return distances[a] < distances[b]; });
  order.resize(count);
  chosen_ = order;
  count_ = static_cast<int>(count);
  stride_ = static_cast<std::size_t>(padded(3 * count_));
  const std::size_t surface = compliance_.surface_nodes().size();
  surface_stride_ = static_cast<std::size_t>(padded(static_cast<int>(3 * surface)));
  among_.assign(stride_ * 3 * count, 0.0F);
  onto_surface_.assign(surface_stride_ * 3 * count, 0.0F);
  displacements_m_.assign(stride_, 0.0F);
  positions_m_.clear();
  full_forces_newton_.clear();
  for (std::size_t j = 0; j < count; ++j) {
    const SurfacePoint& at = points[chosen_[j]];
    positions_m_.push_back(at.position_m(x_m.data()));
    full_forces_newton_.push_back(
        forces_on_body_newton.empty() ? Vector3d::Zero() : forces_on_body_newton[chosen_[j]]);
    for (std::size_t b = 0; b < static_cast<std::size_t>(at.count); ++b) {
      compliance_.require(at.nodes[b]);
      const float* columns = compliance_.columns(at.nodes[b]);
      const auto weight = static_cast<float>(at.weights[b]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        float* to = onto_surface_.data() + (3 * j + axis) * surface_stride_;
        for (std::size_t row = 0; row < surface; ++row) {
          for (std::size_t i = 0; i < 3; ++i) {
            to[3 * row + i] += weight * columns[9 * row + 3 * i + axis];
          }
        }
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      const SurfacePoint& on = points[chosen_[i]];
      for (std::size_t a = 0; a < static_cast<std::size_t>(on.count); ++a) {
        const auto row = static_cast<std::size_t>(compliance_.row_of(on.nodes[a]));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const float* from = onto_surface_.data() + (3 * j + axis) * surface_stride_ + 3 * row;
          float* to = among_.data() + (3 * j + axis) * stride_ + 3 * i;
          for (std::size_t k = 0; k < 3; ++k) to[k] += static_cast<float>(on.weights[a]) * from[k];
        }
      }
    }
  }
  forces_newton_ = full_forces_newton_;
  has_centre_ = false;
}

CondensedReport CondensedContact::step(const Vector3d& centre_m, double radius_m, int most_sweeps,
                                       double tolerance_m) noexcept {
  CondensedReport report;
  const Vector3d way = has_centre_ ? Vector3d(centre_m - centre_m_) : Vector3d(Vector3d::Zero());
  const bool has_friction = friction_coefficient_ > 0.0;
  centre_m_ = centre_m;
  has_centre_ = true;
  // where the points were at the end of the last step: friction acts on what they slide since
  std::array<Vector3d, kMostPoints> before;
  for (std::size_t i = 0; has_friction && i < static_cast<std::size_t>(count_); ++i) {
    before[i] = Eigen::Map<const Eigen::Vector3f>(displacements_m_.data() + 3 * i).cast<double>();
  }
  for (; report.sweeps < most_sweeps; ++report.sweeps) {
    double largest_m = 0.0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
      const Vector3d moved =
          Eigen::Map<const Eigen::Vector3f>(displacements_m_.data() + 3 * i).cast<double>();
      const Vector3d away = positions_m_[i] + moved - centre_m;
      const double distance = away.norm();
      const double gap = distance - radius_m;
      Vector3d& force = forces_newton_[i];
      if (gap > 0.0 && force.isZero(0.0)) continue;
      const Vector3d normal = away / std::max(distance, 1e-9);
      Eigen::Matrix3d own;
      for (Eigen::Index k = 0; k < 3; ++k) {
        own.col(k) = Eigen::Map<const Eigen::Vector3f>(
                         among_.data() + (3 * i + static_cast<std::size_t>(k)) * stride_ + 3 * i)
                         .cast<double>();
      }
      const double give = normal.dot(own * normal);
      const double press = std::max(0.0, force.dot(normal) - gap / give);
      Vector3d wanted = press * normal;
      if (has_friction && press > 0.0) {
        const Vector3d slide = moved - before[i] - way;
        Vector3d tangential = force - force.dot(normal) * normal;
        const Vector3d sliding = slide - slide.dot(normal) * normal;
        tangential -= sliding / std::max(1e-30, own.trace() / 3.0);
        const double limit = friction_coefficient_ * press;
        const double size = tangential.norm();
        wanted += size > limit ? Vector3d(tangential * (limit / size)) : tangential;
      }
      const Vector3d change = wanted - force;
      if (change.isZero(0.0)) continue;
      force = wanted;
      largest_m = std::max(largest_m, give * change.norm());
      for (std::size_t k = 0; k < 3; ++k) {
        const auto amount = static_cast<float>(change[static_cast<Eigen::Index>(k)]);
        const float* column = among_.data() + (3 * i + k) * stride_;
        for (std::size_t r = 0; r < stride_; ++r) displacements_m_[r] += amount * column[r];
      }
    }
    if (largest_m <= tolerance_m) break;
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    const Vector3d moved =
        Eigen::Map<const Eigen::Vector3f>(displacements_m_.data() + 3 * i).cast<double>();
    report.deepest_m =
        std::max(report.deepest_m, radius_m - (positions_m_[i] + moved - centre_m).norm());
    report.touching += forces_newton_[i].isZero(0.0) ? 0 : 1;
    report.force_on_sphere_newton -= forces_newton_[i];
  }
  return report;
}

void CondensedContact::move_surface(float* displacements_m) const noexcept {
  // the columns of the points that press, as one dense product
  std::array<float, std::size_t{3} * kMostPoints> change{};
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    const Vector3d more = forces_newton_[i] - full_forces_newton_[i];
    for (std::size_t k = 0; k < 3; ++k) {
      change[3 * i + k] = static_cast<float>(more[static_cast<Eigen::Index>(k)]);
    }
  }
  multiply(onto_surface_.data(), static_cast<int>(3 * compliance_.surface_nodes().size()),
           3 * count_, change.data(), displacements_m);
}

}  // namespace palpate::elastic
