// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "physics_node/elastic/condensed/condensed_contact.h"

namespace palpate::elastic {
namespace {

using RowMajor3f = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;

}  // namespace

SurfaceCompliance::SurfaceCompliance(const Body& body, WarpedFactor& factor,
                                     std::vector<std::uint32_t> surface_nodes,
                                     std::size_t most_floats)
    : body_(body), factor_(factor), nodes_(std::move(surface_nodes)), most_floats_(most_floats) {
  row_of_.assign(body.node_count(), -1);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    row_of_[nodes_[i]] = static_cast<std::int32_t>(i);
  }
}

std::size_t SurfaceCompliance::columns_made() const {
  const std::scoped_lock lock(mutex_);
  return made_;
}

bool SurfaceCompliance::has_columns(std::uint32_t node) const {
  const std::scoped_lock lock(mutex_);
  return columns_.contains(node);
}

/// For those of one node more; those that were not required since then may go.
void SurfaceCompliance::make_room(std::uint64_t since) {
  while (columns_.size() > 1 && (columns_.size() + 1) * 9 * nodes_.size() > most_floats_) {
    // those of a file that were never required go first
    const auto oldest = std::min_element(
        columns_.begin(), columns_.end(),
        [&](const auto& a, const auto& b) { return required_[a.first] < required_[b.first]; });
    if (required_[oldest->first] > since) break;
    required_.erase(oldest->first);
    columns_.erase(oldest);
  }
}

/// That of the undeformed body, unless it is there.
bool SurfaceCompliance::has_factor() {
  if (!factor_.is_ready() && !has_no_factor_) {
    has_no_factor_ = !factor_.factor(body_.rest_m(), no_rotations(body_.node_count()), {}, nullptr);
  }
  return !has_no_factor_;
}

bool SurfaceCompliance::confirms(const Columns& columns, std::span<const std::uint32_t> nodes) {
  const std::scoped_lock lock(mutex_);
  constexpr float kRounding = 1e-3F;  // of float, on another processor
  std::vector<std::uint32_t> free;
  for (const std::uint32_t node : nodes) {
    const std::vector<float>& values = *columns.at(node);
    if (body_.pattern().row_of[node] >= 0) {
      free.push_back(node);
    } else if (std::any_of(values.begin(), values.end(), [](float x) { return x != 0.0F; })) {
      return false;
    }
  }
  if (free.empty()) return true;
  if (!has_factor()) return false;
  std::vector<std::vector<float>> own(free.size(), std::vector<float>(9 * nodes_.size()));
  std::array<float*, WarpedFactor::kMostColumns> values{};
  std::transform(own.begin(), own.end(), values.begin(), [](auto& one) { return one.data(); });
  factor_.columns(free, nodes_, {values.data(), own.size()});
  for (std::size_t i = 0; i < free.size(); ++i) {
    const std::vector<float>& given = *columns.at(free[i]);
    float largest = 0.0F;
    for (const float x : own[i]) largest = std::max(largest, std::abs(x));
    for (std::size_t k = 0; k < given.size(); ++k) {
      if (!(std::abs(given[k] - own[i][k]) <= kRounding * largest)) return false;
    }
  }
  return true;
}

SurfaceCompliance::Required SurfaceCompliance::require(std::span<const std::uint32_t> nodes) {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t since = requires_;
  for (const std::uint32_t node : nodes) required_[node] = ++requires_;
  std::array<std::uint32_t, WarpedFactor::kMostColumns> together{};
  std::array<float*, WarpedFactor::kMostColumns> values{};
  std::size_t count = 0;
  const auto solve = [&] {
    made_ += count;
    factor_.columns({together.data(), count}, nodes_, {values.data(), count});
    count = 0;
  };
  for (const std::uint32_t node : nodes) {
    if (columns_.contains(node)) continue;
    if (!has_factor()) {
      throw std::runtime_error("elastic body: the stiffness at rest is not positive definite");
    }
    make_room(since);
    auto room = std::make_shared<std::vector<float>>(9 * nodes_.size(), 0.0F);
    columns_[node] = room;
    if (body_.pattern().row_of[node] < 0) continue;  // a fixed node gives way to nothing
    together[count] = node;
    values[count++] = room->data();
    if (count == together.size()) solve();
  }
  if (count > 0) solve();
  Required required;
  for (const std::uint32_t node : nodes) required.columns_.emplace(node, columns_.at(node));
  return required;
}

Vector3d SurfaceCompliance::moved_m(const SurfacePoint& at, const std::vector<SurfacePoint>& points,
                                    const std::vector<Vector3d>& forces_newton) {
  std::vector<std::uint32_t> nodes;
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (!forces_newton[p].isZero(0.0)) points[p].add_nodes_to(nodes);
  }
  const Required columns = require(nodes);
  Vector3d sum = Vector3d::Zero();
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (forces_newton[p].isZero(0.0)) continue;
    const SurfacePoint& from = points[p];
    for (std::size_t b = 0; b < static_cast<std::size_t>(from.count); ++b) {
      for (std::size_t a = 0; a < static_cast<std::size_t>(at.count); ++a) {
        const auto row = static_cast<std::size_t>(row_of(at.nodes[a]));
        const Eigen::Map<const RowMajor3f> give(columns.of(from.nodes[b]) + 9 * row);
        sum += at.weights[a] * from.weights[b] * (give.cast<double>() * forces_newton[p]);
      }
    }
  }
  return sum;
}

Eigen::Matrix3d SurfaceCompliance::give(const SurfacePoint& at, const SurfacePoint& under,
                                        const Required& columns) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t b = 0; b < static_cast<std::size_t>(under.count); ++b) {
    const float* column = columns.of(under.nodes[b]);
    for (std::size_t a = 0; a < static_cast<std::size_t>(at.count); ++a) {
      const auto row = static_cast<std::size_t>(row_of(at.nodes[a]));
      sum += at.weights[a] * under.weights[b] *
             Eigen::Map<const RowMajor3f>(column + 9 * row).cast<double>();
    }
  }
  return sum;
}

}  // namespace palpate::elastic
