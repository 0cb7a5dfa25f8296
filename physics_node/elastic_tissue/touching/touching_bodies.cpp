// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/touching/touching_bodies.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "common/contact/facet.h"
#include "physics_node/surfaces/box_tree.h"

namespace palpate::physics {
namespace {

// Of the penalty, in Young's moduli of the softer body over the length of a node's area. Each body
// sees the other one as stiff as this while it is solved: about as stiff as it is, they come
// together fastest.
constexpr double kModuli = 2.0;
// Nodes so near may touch in the next step, besides the way that both go in it so many times.
constexpr double kReach_m = 2e-3;
constexpr double kWays = 2.0;
constexpr double kMostReach_m = 8e-3;
// λ is at most the penalty at this depth.
constexpr double kDeepest_m = 0.05;
// The surfaces look at each other within about 80°.
constexpr double kFacing = -0.17;
constexpr std::size_t kLeafTriangles = 4;
// Triangles that are turned from each other by less than 45° are one smooth surface.
constexpr double kSmooth = 0.7;
// Another pass is made while a force changes by more than the penalty at this depth.
constexpr double kClose_m = 2e-6;

Vector3 at(const elastic::VectorXd& x_m, std::uint32_t node) {
  return x_m.segment<3>(3 * Eigen::Index{node});
}

Bounds bounds_of(const ElasticSimulation& body) {
  const std::vector<std::uint32_t>& nodes = body.body().surface_nodes;
  Bounds bounds{at(body.x_m(), nodes.front()), at(body.x_m(), nodes.front())};
  for (const std::uint32_t node : nodes) bounds.include(at(body.x_m(), node));
  return bounds;
}

double fastest_m_per_s(const ElasticSimulation& body) {
  double fastest2 = 0.0;
  for (const std::uint32_t node : body.body().surface_nodes) {
    fastest2 = std::max(fastest2, at(body.v_m_per_s(), node).squaredNorm());
  }
  return std::sqrt(fastest2);
}

/// Sums of the triangles' normals, weighted by their areas. By node.
std::vector<Vector3> normals_of(const ElasticSimulation& body,
                                const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::vector<Vector3> normals(body.body().body->node_count(), Vector3::Zero());
  for (const auto& [a, b, c] : triangles) {
    const Vector3 from = at(body.x_m(), a);
    const Vector3 normal = (at(body.x_m(), b) - from).cross(at(body.x_m(), c) - from);
    for (const std::uint32_t node : {a, b, c}) normals[node] += normal;
  }
  return normals;
}

/// The normal at the corners of a triangle: those of the triangles around a corner that are turned
/// from it by less than an edge, weighted by their areas.
class SmoothNormals {
 public:
  SmoothNormals(const ElasticSimulation& body,
                const std::vector<std::array<std::uint32_t, 3>>& triangles)
      : triangles_(triangles), starts_(body.body().body->node_count() + 1, 0) {
    for (const auto& triangle : triangles_) {
      for (const std::uint32_t node : triangle) ++starts_[node + 1];
    }
    std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
    around_.resize(starts_.back());
    std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
    for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
      const auto& [a, b, c] = triangles_[t];
      const Vector3 from = at(body.x_m(), a);
      areas_.emplace_back((at(body.x_m(), b) - from).cross(at(body.x_m(), c) - from));
      for (const std::uint32_t node : triangles_[t]) around_[next[node]++] = t;
    }
  }

  [[nodiscard]] Vector3 of_triangle(std::uint32_t triangle) const {
    return areas_[triangle].stableNormalized();
  }
  [[nodiscard]] Vector3 at_point(std::uint32_t triangle, const Vector3& weights) const {
    const Vector3 own = of_triangle(triangle);
    Vector3 sum = Vector3::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t node = triangles_[triangle][k];
      Vector3 corner = Vector3::Zero();
      for (std::uint32_t i = starts_[node]; i < starts_[node + 1]; ++i) {
        const Vector3& area = areas_[around_[i]];
        if (area.dot(own) > kSmooth * area.norm()) corner += area;
      }
      sum += weights[static_cast<Eigen::Index>(k)] * corner.stableNormalized();
    }
    return sum.stableNormalized();
  }

 private:
  const std::vector<std::array<std::uint32_t, 3>>& triangles_;
  std::vector<std::uint32_t> starts_;  // of each node in around_
  std::vector<std::uint32_t> around_;  // triangles
  std::vector<Vector3> areas_;         // twice
};

/// Of a point of the triangle's plane.
Vector3 weights_of(const std::array<Vector3, 3>& corners, const Vector3& point_m) {
  const Vector3 u = corners[1] - corners[0];
  const Vector3 v = corners[2] - corners[0];
  const Vector3 w = point_m - corners[0];
  const double uu = u.dot(u);
  const double uv = u.dot(v);
  const double vv = v.dot(v);
  const double scale = uu * vv - uv * uv;
  if (!(scale > 0.0)) return {1.0, 0.0, 0.0};
  const double second = std::clamp((vv * w.dot(u) - uv * w.dot(v)) / scale, 0.0, 1.0);
  const double third = std::clamp((uu * w.dot(v) - uv * w.dot(u)) / scale, 0.0, 1.0 - second);
  return {1.0 - second - third, second, third};
}

/// In the session, one touches the other.
bool names(const ElasticBody& one, const ElasticBody& other) {
  const std::vector<std::uint32_t>& touches = one.touches;
  return std::find(touches.begin(), touches.end(), other.tissue) != touches.end();
}

double young_pa(const ElasticBody& body) {
  return body.body->description().materials.front().young_modulus_pa;
}

}  // namespace

elastic::SurfacePoint BodyPair::Touch::node_point() const noexcept {
  elastic::SurfacePoint point{.count = 1};
  point.nodes[0] = node;
  point.weights[0] = 1.0;
  return point;
}

elastic::SurfacePoint BodyPair::Touch::triangle_point() const noexcept {
  elastic::SurfacePoint point{.count = 3};
  for (std::size_t i = 0; i < 3; ++i) {
    point.nodes[i] = triangle[i];
    point.weights[i] = weights[static_cast<Eigen::Index>(i)];
  }
  return point;
}

double BodyPair::Touch::gap_m(const elastic::VectorXd& of_node,
                              const elastic::VectorXd& of_triangle) const noexcept {
  return normal.dot(at(of_node, node) - triangle_point().position_m(of_triangle.data()));
}

void BodyPair::look(const ElasticSimulation& first, const ElasticSimulation& second,
                    double step_s) {
  const double margin_m = std::min(
      kMostReach_m, kReach_m + kWays * step_s * (fastest_m_per_s(first) + fastest_m_per_s(second)));
  std::vector<Touch> touches;
  Bounds grown = bounds_of(first);
  grown.grow(Vector3::Constant(margin_m));
  if (grown.meets(bounds_of(second))) {
    look(first, second, false, margin_m, touches);
    look(second, first, true, margin_m, touches);
  }
  // what pressed before goes on
  if (of_[0] == &first.body() && of_[1] == &second.body()) {
    std::map<std::pair<bool, std::uint32_t>, double> before;
    for (const Touch& one : touches_) {
      if (one.multiplier_newton > 0.0) before[{one.is_second, one.node}] = one.multiplier_newton;
    }
    for (Touch& one : touches) {
      const auto found = before.find({one.is_second, one.node});
      if (found != before.end()) one.multiplier_newton = found->second;
    }
  }
  of_ = {&first.body(), &second.body()};
  touches_ = std::move(touches);
}

void BodyPair::look(const ElasticSimulation& nodes, const ElasticSimulation& triangles,
                    bool is_second, double margin_m, std::vector<Touch>& touches) const {
  Bounds around_nodes = bounds_of(nodes);
  Bounds around_triangles = bounds_of(triangles);
  around_nodes.grow(Vector3::Constant(margin_m));
  around_triangles.grow(Vector3::Constant(margin_m));
  const std::vector<std::array<std::uint32_t, 3>> all = triangles_of(triangles.body());
  std::vector<BoxTree::Item> items;
  const elastic::VectorXd& x = triangles.x_m();
  for (std::uint32_t t = 0; t < all.size(); ++t) {
    const std::array<Vector3, 3> corners{at(x, all[t][0]), at(x, all[t][1]), at(x, all[t][2])};
    const Bounds bounds = palpate::bounds_of(corners);
    if (bounds.meets(around_nodes)) {
      items.push_back({bounds, corners[0] + corners[1] + corners[2], t});
    }
  }
  if (items.empty()) return;
  const BoxTree tree(std::move(items), kLeafTriangles);
  const SmoothNormals normals(triangles, all);
  const std::vector<Vector3> own_normals = normals_of(nodes, triangles_of(nodes.body()));
  const std::vector<double> areas =
      elastic::areas_of_nodes_m2(nodes.body().body->mesh(), nodes.body().faces);
  const double softer_pa = std::min(young_pa(nodes.body()), young_pa(triangles.body()));
  for (const std::uint32_t node : nodes.body().surface_nodes) {
    const Vector3 point_m = at(nodes.x_m(), node);
    if (around_triangles.squared_distance(point_m) > 0.0) continue;
    double nearest2 = margin_m * margin_m;
    std::optional<std::uint32_t> nearest;
    Vector3 foot_m = Vector3::Zero();
    const Vector3 outward = own_normals[node].stableNormalized();
    tree.visit_nearest(point_m, nearest2, [&](std::uint32_t place) {
      const std::uint32_t triangle = tree.order()[place];
      const auto& [a, b, c] = all[triangle];
      const FacetFoot foot = foot_on_facet(at(x, a), at(x, b), at(x, c), point_m);
      // a node at a rim may be as near to a side that it does not look at
      if (foot.squared_distance < nearest2 &&
          outward.dot(normals.of_triangle(triangle)) < kFacing) {
        nearest2 = foot.squared_distance;
        nearest = triangle;
        foot_m = foot.point_m;
      }
      return nearest2;
    });
    if (!nearest) continue;
    Touch touch{.is_second = is_second, .node = node, .triangle = all[*nearest]};
    const auto& [a, b, c] = touch.triangle;
    touch.weights = weights_of({at(x, a), at(x, b), at(x, c)}, foot_m);
    touch.normal = normals.at_point(*nearest, touch.weights);
    if (!touch.normal.allFinite() || touch.normal.isZero(0.0)) continue;
    touch.stiffness_newton_per_m =
        elastic::contact_stiffness_newton_per_m(softer_pa, areas[node], kModuli);
    touches.push_back(touch);
  }
}

void BodyPair::add_planes(const ElasticSimulation& first, const ElasticSimulation& second,
                          bool is_second, std::vector<elastic::ContactPlane>& planes) const {
  for (const Touch& one : touches_) {
    const elastic::VectorXd& of_node = one.is_second ? second.x_m() : first.x_m();
    const elastic::VectorXd& of_triangle = one.is_second ? first.x_m() : second.x_m();
    elastic::ContactPlane plane;
    plane.stiffness_newton_per_m = one.stiffness_newton_per_m;
    plane.multiplier_newton = one.multiplier_newton;
    if (one.is_second == is_second) {
      plane.point = one.node_point();
      plane.normal = one.normal;
      plane.offset_m = one.normal.dot(one.triangle_point().position_m(of_triangle.data()));
    } else {
      plane.point = one.triangle_point();
      plane.normal = -one.normal;
      plane.offset_m = -one.normal.dot(at(of_node, one.node));
    }
    planes.push_back(plane);
  }
}

double BodyPair::update(const ElasticSimulation& first, const ElasticSimulation& second) {
  double farthest_m = 0.0;
  for (Touch& one : touches_) {
    const double gap_m = one.gap_m(one.is_second ? second.x_m() : first.x_m(),
                                   one.is_second ? first.x_m() : second.x_m());
    const double k = one.stiffness_newton_per_m;
    const double newton = std::max(0.0, one.multiplier_newton - k * gap_m);
    if (newton > 0.0 || one.multiplier_newton > 0.0) {
      farthest_m = std::max(farthest_m, std::abs(newton - one.multiplier_newton) / k);
    }
    one.multiplier_newton = std::min(newton, k * kDeepest_m);
  }
  return farthest_m;
}

Vector3 BodyPair::force_on_first_newton() const noexcept {
  Vector3 force = Vector3::Zero();
  for (const Touch& one : touches_) {
    force += (one.is_second ? -one.multiplier_newton : one.multiplier_newton) * one.normal;
  }
  return force;
}

double BodyPair::deepest_m(const ElasticSimulation& first, const ElasticSimulation& second) const {
  double deepest_m = 0.0;
  for (const Touch& one : touches_) {
    deepest_m = std::max(deepest_m, -one.gap_m(one.is_second ? second.x_m() : first.x_m(),
                                               one.is_second ? first.x_m() : second.x_m()));
  }
  return deepest_m;
}

std::vector<std::vector<std::size_t>> Island::of(std::span<const ElasticBody* const> bodies) {
  std::vector<std::size_t> island_of(bodies.size());
  std::iota(island_of.begin(), island_of.end(), std::size_t{0});
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    for (std::size_t j = 0; j < bodies.size(); ++j) {
      if (!names(*bodies[i], *bodies[j])) continue;
      const std::size_t from = std::max(island_of[i], island_of[j]);
      const std::size_t to = std::min(island_of[i], island_of[j]);
      std::replace(island_of.begin(), island_of.end(), from, to);
    }
  }
  std::vector<std::vector<std::size_t>> islands;
  for (std::size_t first = 0; first < bodies.size(); ++first) {
    if (island_of[first] != first) continue;
    islands.emplace_back();
    for (std::size_t i = first; i < bodies.size(); ++i) {
      if (island_of[i] == first) islands.back().push_back(i);
    }
  }
  return islands;
}

Island::Island(std::span<const ElasticBody* const> bodies) {
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    for (std::size_t j = i + 1; j < bodies.size(); ++j) {
      if (names(*bodies[i], *bodies[j]) || names(*bodies[j], *bodies[i])) {
        pairs_.emplace_back(i, j);
      }
    }
  }
}

std::vector<elastic::Support> Island::supports_of(
    std::size_t body, std::span<elastic::SurfaceCompliance* const> compliances) const {
  std::vector<elastic::Support> supports;
  for (const BodyPair& pair : pairs_) {
    const auto [first, second] = pair.members();
    if (first != body && second != body) continue;
    elastic::SurfaceCompliance* const other = compliances[first == body ? second : first];
    for (const BodyPair::Touch& one : pair.touches()) {
      if (!(one.multiplier_newton > 0.0)) continue;
      const bool is_own_node = one.is_second == (second == body);
      supports.push_back({.point = is_own_node ? one.node_point() : one.triangle_point(),
                          .direction = one.normal,
                          .other = other,
                          .other_point = is_own_node ? one.triangle_point() : one.node_point()});
    }
  }
  return supports;
}

std::vector<char> Island::step(std::span<ElasticSimulation* const> bodies,
                               std::span<const std::span<const std::optional<TipState>>> tips,
                               std::optional<double> step_s) {
  std::vector<char> has_stepped(bodies.size(), 0);
  for (BodyPair& pair : pairs_) {
    ElasticSimulation& first = *bodies[pair.members()[0]];
    ElasticSimulation& second = *bodies[pair.members()[1]];
    if (first.is_asleep() && second.is_asleep()) continue;
    pair.look(first, second, step_s.value_or(first.step_s()));
  }
  const auto give_planes = [&](std::size_t i) {
    std::vector<elastic::ContactPlane> planes;
    bool is_moving = false;  // something that it touches
    for (const BodyPair& pair : pairs_) {
      const auto [first, second] = pair.members();
      if ((first != i && second != i) || !pair.is_near()) continue;
      pair.add_planes(*bodies[first], *bodies[second], second == i, planes);
      is_moving = is_moving || !bodies[first == i ? second : first]->is_asleep();
    }
    bodies[i]->set_neighbors(std::move(planes), is_moving);
  };
  // one that wakes up in this step wakes the others in the next
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    give_planes(i);
    has_stepped[i] = bodies[i]->step(tips[i], step_s) ? 1 : 0;
  }
  const auto update = [&] {
    double farthest_m = 0.0;
    for (BodyPair& pair : pairs_) {
      const auto [first, second] = pair.members();
      if (has_stepped[first] == 0 && has_stepped[second] == 0) continue;
      farthest_m = std::max(farthest_m, pair.update(*bodies[first], *bodies[second]));
    }
    return farthest_m;
  };
  double farthest_m = update();
  for (int pass = 1; pass < kMostPasses && farthest_m > kClose_m; ++pass) {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (has_stepped[i] == 0) continue;
      give_planes(i);
      bodies[i]->step_again();
    }
    farthest_m = update();
  }
  return has_stepped;
}

}  // namespace palpate::physics
