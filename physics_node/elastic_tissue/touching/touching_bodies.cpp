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
// Of a node that was pressed: a triangle turned farther from its plane is another side.
constexpr double kSameSide = 0.2;
constexpr std::size_t kLeafTriangles = 4;
// Triangles that are turned from each other by less than 45° are one smooth surface.
constexpr double kSmooth = 0.7;
// Triangles that meet at an edge are as near to a point beside it, but for rounding.
constexpr double kSame = 1e-9;
constexpr double kSame_m2 = 1e-20;
constexpr double kOnSurface_m = 1e-6;

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

struct Nearest {
  std::optional<std::uint32_t> triangle{};
  double squared_distance = 0.0;
  Vector3 foot_m = Vector3::Zero();

  void take(std::uint32_t other, const FacetFoot& foot) {
    if (!(foot.squared_distance < squared_distance)) return;
    triangle = other;
    squared_distance = foot.squared_distance;
    foot_m = foot.point_m;
  }
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

Vector3 BodyPair::Touch::slid_m(const elastic::VectorXd& of_node,
                                const elastic::VectorXd& of_triangle) const noexcept {
  const Vector3 way_m =
      at(of_node, node) - triangle_point().position_m(of_triangle.data()) - stuck_m;
  return way_m - normal.dot(way_m) * normal;
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
    std::map<std::pair<bool, std::uint32_t>, const Touch*> before;
    for (const Touch& one : touches_) {
      if (one.multiplier_newton > 0.0) before[{one.is_second, one.node}] = &one;
    }
    for (Touch& one : touches) {
      const auto found = before.find({one.is_second, one.node});
      if (found == before.end()) continue;
      const Touch& then = *found->second;
      one.multiplier_newton = then.multiplier_newton;
      one.friction_newton = then.friction_newton;
      // friction still holds it, along the surface that it meets now
      one.stuck_m += then.friction_newton / then.stiffness_newton_per_m;
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
  std::map<std::uint32_t, const Touch*> before;
  for (const Touch& one : touches_) {
    if (one.is_second == is_second && one.multiplier_newton > 0.0) before[one.node] = &one;
  }
  for (const std::uint32_t node : nodes.body().surface_nodes) {
    const Vector3 point_m = at(nodes.x_m(), node);
    if (around_triangles.squared_distance(point_m) > 0.0) continue;
    const Vector3 outward = own_normals[node].stableNormalized();
    const auto pressed = before.find(node);
    Nearest nearest;  // of all triangles,
    Vector3 normals_there = Vector3::Zero();
    Nearest facing;  // and of those that it looks at, or on the side on which it was pressed
    const double within_m = pressed == before.end() ? margin_m : kMostReach_m;
    facing.squared_distance = nearest.squared_distance = within_m * within_m;
    tree.visit_nearest(point_m, facing.squared_distance, [&](std::uint32_t place) {
      const std::uint32_t triangle = tree.order()[place];
      const auto& [a, b, c] = all[triangle];
      const FacetFoot foot = foot_on_facet(at(x, a), at(x, b), at(x, c), point_m);
      const Vector3 normal = normals.of_triangle(triangle);
      const double same2 = kSame * nearest.squared_distance + kSame_m2;
      if (foot.squared_distance < nearest.squared_distance - same2) normals_there.setZero();
      if (foot.squared_distance < nearest.squared_distance + same2) normals_there += normal;
      nearest.take(triangle, foot);
      if (pressed == before.end() ? outward.dot(normal) < kFacing
                                  : pressed->second->normal.dot(normal) > kSameSide) {
        facing.take(triangle, foot);
      }
      return facing.squared_distance * (1.0 + 2.0 * kSame) + 2.0 * kSame_m2;
    });
    if (!nearest.triangle) continue;
    const Vector3 away_m = point_m - nearest.foot_m;
    const bool is_outside = away_m.dot(normals_there) > 0.0;
    const auto normal_at = [&](const Nearest& one) {
      const auto& [a, b, c] = all[*one.triangle];
      return normals.at_point(*one.triangle,
                              weights_of({at(x, a), at(x, b), at(x, c)}, one.foot_m));
    };
    Nearest met = facing;
    Vector3 normal = met.triangle ? normal_at(met) : Vector3::Zero();
    // beside an edge it is in front of no face: there the plane stands across the way to the edge
    const auto is_beside = [&] {
      const Vector3 way_m = point_m - met.foot_m;
      return way_m.dot(normal) < kSmooth * way_m.norm() - kOnSurface_m;
    };
    if (is_outside && (!met.triangle || is_beside())) {
      met = nearest;
      normal = normal_at(met);
      if (is_beside()) normal = away_m.stableNormalized();
    }
    if (!met.triangle || !normal.allFinite() || normal.isZero(0.0)) continue;
    Touch touch{.is_second = is_second, .node = node, .triangle = all[*met.triangle]};
    const auto& [a, b, c] = touch.triangle;
    const Vector3 foot_m = met.foot_m;
    touch.weights = weights_of({at(x, a), at(x, b), at(x, c)}, foot_m);
    touch.normal = normal;
    touch.stuck_m = point_m - foot_m;
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
    plane.limit_newton = friction_coefficient_ * one.multiplier_newton;
    if (one.is_second == is_second) {
      plane.point = one.node_point();
      plane.normal = one.normal;
      const Vector3 foot_m = one.triangle_point().position_m(of_triangle.data());
      plane.offset_m = one.normal.dot(foot_m);
      plane.anchor_m = foot_m + one.stuck_m;
    } else {
      plane.point = one.triangle_point();
      plane.normal = -one.normal;
      plane.offset_m = -one.normal.dot(at(of_node, one.node));
      plane.anchor_m = at(of_node, one.node) - one.stuck_m;
    }
    planes.push_back(plane);
  }
}

double BodyPair::update(const ElasticSimulation& first, const ElasticSimulation& second) {
  double farthest_m = 0.0;
  for (Touch& one : touches_) {
    const elastic::VectorXd& of_node = one.is_second ? second.x_m() : first.x_m();
    const elastic::VectorXd& of_triangle = one.is_second ? first.x_m() : second.x_m();
    const double gap_m = one.gap_m(of_node, of_triangle);
    const double k = one.stiffness_newton_per_m;
    const double newton = std::max(0.0, one.multiplier_newton - k * gap_m);
    if (newton > 0.0 || one.multiplier_newton > 0.0) {
      farthest_m = std::max(farthest_m, std::abs(newton - one.multiplier_newton) / k);
    }
    one.multiplier_newton = std::min(newton, k * kDeepest_m);
    if (!(friction_coefficient_ > 0.0)) continue;
    const Vector3 friction = limited_to_norm(Vector3(-k * one.slid_m(of_node, of_triangle)),
                                             friction_coefficient_ * one.multiplier_newton);
    farthest_m = std::max(farthest_m, (friction - one.friction_newton).norm() / k);
    one.friction_newton = friction;
  }
  return farthest_m;
}

Vector3 BodyPair::force_on_first_newton() const noexcept {
  Vector3 force = Vector3::Zero();
  for (const Touch& one : touches_) {
    const Vector3 on_node = one.multiplier_newton * one.normal + one.friction_newton;
    force += one.is_second ? -on_node : on_node;
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

}  // namespace palpate::physics
