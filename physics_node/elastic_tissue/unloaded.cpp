// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/unloaded.h"

#include <Eigen/QR>
#include <algorithm>
#include <deque>
#include <memory>

#include "physics_node/elastic/equilibrium.h"

namespace palpate::elastic {
namespace {

constexpr double kNear_m = 1e-5;  // of a corner from its place, under load
constexpr int kMostSolutions = 60;
constexpr std::size_t kMemory = 5;  // of Anderson's mixing
constexpr int kMostHalvings = 6;
constexpr SearchLimits kLimits{.tolerance_m = 1e-7, .most_iterations = 1000, .slow_iterations = 8};

std::vector<char> corners_of(const Mesh& mesh) {
  std::vector<char> is_corner(mesh.nodes_m.size(), 0);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    for (std::size_t k = 0; k < 4; ++k) is_corner[mesh.element(e)[k]] = 1;
  }
  return is_corner;
}

/// Corners go there, the other nodes into the middle of their edges.
void move_to(const VectorXd& corners_m, const std::vector<char>& is_corner, Mesh& mesh) {
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    if (is_corner[i] != 0) {
      mesh.nodes_m[i] = corners_m.segment<3>(3 * static_cast<Eigen::Index>(i));
    }
  }
  if (mesh.nodes_per_element != 10) return;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.element(e);
    for (std::size_t edge = 0; edge < 6; ++edge) {
      mesh.nodes_m[nodes[4 + edge]] =
          0.5 * (mesh.nodes_m[nodes[static_cast<std::size_t>(kEdges[edge][0])]] +
                 mesh.nodes_m[nodes[static_cast<std::size_t>(kEdges[edge][1])]]);
    }
  }
}

/// With all of its load, from where it rests under gravity alone: so that only a stable shape is
/// found.
void settle(const VectorXd& given, BodyDescription loaded, const Body& alike,
            UnloadedShape& shape) {
  loaded.mesh = shape.mesh;
  loaded.more_load_newton = shape.more_load_newton;
  const Body body(std::move(loaded), &alike);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  const SearchReport report = find_rest(search, factor, nullptr, kLimits, shape.loaded_m);
  shape.is_converged = report.is_finite && report.is_converged;
  for (Eigen::Index i = 0; i < given.size(); i += 3) {
    shape.away_m = std::max(shape.away_m, (given - shape.loaded_m).segment<3>(i).norm());
  }
}

}  // namespace

UnloadedShape find_unloaded_shape(const BodyDescription& loaded) {
  UnloadedShape shape{.mesh = loaded.mesh, .loaded_m = {}, .more_load_newton = {}};
  const std::vector<char> is_corner = corners_of(loaded.mesh);
  auto body = std::make_unique<Body>(loaded);
  const VectorXd given = body->rest_m();
  VectorXd x = given;
  VectorXd unloaded = given;
  std::deque<VectorXd> places;  // tried, newest last,
  std::deque<VectorXd> gaps;    // and how far the loaded corners were from their places
  while (shape.solutions < kMostSolutions) {
    ++shape.solutions;
    EquilibriumSearch search(*body);
    WarpedFactor factor(*body, Precision::kDouble);
    for (const std::uint32_t node : loaded.fixed_nodes) {
      x.segment<3>(3 * Eigen::Index{node}) = body->rest_m().segment<3>(3 * Eigen::Index{node});
    }
    const SearchReport report = find_rest(search, factor, nullptr, kLimits, x);
    if (!report.is_finite || !report.is_converged) return shape;
    VectorXd gap = given - x;
    for (std::size_t i = 0; i < is_corner.size(); ++i) {
      if (is_corner[i] == 0) gap.segment<3>(3 * static_cast<Eigen::Index>(i)).setZero();
    }
    if (gap.cwiseAbs().maxCoeff() < kNear_m) {
      search.evaluate({}, given);
      shape.more_load_newton = search.gradient();
      shape.loaded_m = x;
      settle(given, loaded, *body, shape);
      return shape;
    }
    places.push_back(unloaded);
    gaps.push_back(gap);
    if (places.size() > kMemory) {
      places.pop_front();
      gaps.pop_front();
    }
    // the mixture of what was tried whose gap is the least, and its gap
    VectorXd step = gap;
    const auto differences = static_cast<Eigen::Index>(places.size()) - 1;
    if (differences > 0) {
      Eigen::MatrixXd of_gaps(gap.size(), differences);
      for (Eigen::Index k = 0; k < differences; ++k) {
        of_gaps.col(k) = gaps[static_cast<std::size_t>(k) + 1] - gaps[static_cast<std::size_t>(k)];
      }
      const VectorXd weights = of_gaps.colPivHouseholderQr().solve(gap);
      for (Eigen::Index k = 0; k < differences; ++k) {
        const auto i = static_cast<std::size_t>(k);
        step -= weights[k] * (places[i + 1] - places[i] + gaps[i + 1] - gaps[i]);
      }
    }
    // less of it where it would turn an element inside out
    const VectorXd from = unloaded;
    for (int halving = 0;; ++halving) {
      unloaded = from + step;
      move_to(unloaded, is_corner, shape.mesh);
      if (quality_of(shape.mesh).inverted == 0) break;
      if (halving == kMostHalvings) return shape;
      step *= 0.5;
    }
    BodyDescription next = loaded;
    next.mesh = shape.mesh;
    body = std::make_unique<Body>(std::move(next), body.get());
  }
  return shape;
}

}  // namespace palpate::elastic
