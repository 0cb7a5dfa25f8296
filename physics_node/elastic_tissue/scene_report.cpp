// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/scene_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "common/contact/tissue_motion.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {
namespace {

constexpr double kTouching_m = 1e-6;

/// From the surface of a body as it is placed, to another surface; below 0: inside of it.
double placed_gap_m(const ElasticBody& body, const Surface& other, const Vector3& other_moved_m) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const std::uint32_t node : body.surface_nodes) {
    const Vector3 at_m = body.body->rest_m().segment<3>(3 * Eigen::Index{node});
    least_m = std::min(least_m, other.view(at_m - other_moved_m).distance_m);
  }
  return least_m;
}

TriangleSurface placed_surface(const ElasticBody& body) {
  return TriangleSurface(surface_mesh(body, body.body->rest_m()));
}

std::string touching_line(const std::string& name, const char* how, double friction_coefficient,
                          double gap) {
  char text[160];  // NOLINT: for snprintf
  std::snprintf(text, sizeof text, "\", which %s, friction coefficient %.3g: %s %.2g mm", how,
                friction_coefficient, gap < -kTouching_m ? "overlap" : "gap",
                std::abs(gap) < kTouching_m ? 0.0 : 1e3 * std::abs(gap));
  return "touches \"" + name + text + " at the start";
}

/// Of springs to another body.
std::string tied_line(const ElasticBody& body, std::uint32_t other, const std::string& name) {
  std::size_t nodes = 0;
  double newton_per_m = 0.0;
  double farthest_m = 0.0;
  for (const elastic::Attachment& one : body.body->description().attachments) {
    if (!one.is_tie()) continue;
    const TiedPlace& place = body.ties[static_cast<std::size_t>(one.tie)];
    if (place.tissue != other) continue;
    ++nodes;
    newton_per_m += one.stiffness_newton_per_m;
    farthest_m = std::max(farthest_m, place.offset_m.norm());
  }
  char text[120];  // NOLINT: for snprintf
  std::snprintf(text, sizeof text,
                "\", which gives way too, at %zu nodes with %.3g N/m: gap at most %.2g mm", nodes,
                newton_per_m, 1e3 * farthest_m);
  return "tied to \"" + name + text;
}

/// Mean edge of the faces whose nodes all may tear with this; 0: there is none.
double edge_of_bed_m(const ElasticBody& body, double softens_at_m) {
  const elastic::Mesh& mesh = body.body->mesh();
  std::vector<bool> tears(mesh.nodes_m.size(), false);
  for (const elastic::Attachment& one : body.body->description().attachments) {
    if (one.tears() && one.softens_at_m == softens_at_m) tears[one.node] = true;
  }
  // of quadratic elements the middles of edges are attached
  const std::size_t first = mesh.nodes_per_element == 4 ? 0 : 3;
  double sum_m = 0.0;
  double count = 0.0;
  for (const elastic::Face& face : body.faces) {
    if (!tears[face.nodes[first]] || !tears[face.nodes[first + 1]] ||
        !tears[face.nodes[first + 2]]) {
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      sum_m += (mesh.nodes_m[face.nodes[(k + 1) % 3]] - mesh.nodes_m[face.nodes[k]]).norm();
      count += 1.0;
    }
  }
  return count > 0.0 ? sum_m / count : 0.0;
}

}  // namespace

std::vector<std::string> touching_lines(
    const std::vector<std::shared_ptr<const ElasticBody>>& bodies, const ElasticBody& body,
    const SceneConfig& scene) {
  std::vector<std::string> lines;
  for (const elastic::RigidNeighbor& one : body.rigid) {
    const double gap = placed_gap_m(body, *one.surface, displacement(one.motion, 0.0).position_m);
    lines.push_back(touching_line(
        one.name, is_moving(one.motion) ? "does not give way and moves" : "does not give way",
        one.friction_coefficient, gap));
  }
  for (const auto& other : bodies) {
    if (body.is_tied_to(other->tissue)) {
      lines.push_back(tied_line(body, other->tissue, scene.tissues[other->tissue].name));
    }
    const ElasticNeighbor* const own = body.touched(other->tissue);
    const ElasticNeighbor* const its = other->touched(body.tissue);
    if (own == nullptr && its == nullptr) continue;
    const double gap = std::min(placed_gap_m(body, placed_surface(*other), Vector3::Zero()),
                                placed_gap_m(*other, placed_surface(body), Vector3::Zero()));
    lines.push_back(touching_line(scene.tissues[other->tissue].name, "gives way too",
                                  (own != nullptr ? own : its)->friction_coefficient, gap));
  }
  return lines;
}

std::vector<std::string> tearing_warnings(const ElasticBody& body,
                                          const ElasticMaterial& material) {
  std::vector<std::string> warnings;
  for (std::size_t i = 0; i < material.attached.size(); ++i) {
    const auto& one = material.attached[i];
    if (!(one.toughness_joule_per_m2 > 0.0)) continue;
    const double edge_m =
        edge_of_bed_m(body, std::sqrt(one.toughness_joule_per_m2 / one.stiffness_pa_per_m));
    const double zone_m = material.young_pa / one.stiffness_pa_per_m;
    if (zone_m >= edge_m) continue;
    char text[500];  // NOLINT: for snprintf
    std::snprintf(text, sizeof text,
                  "elastic.attached[%zu] does not keep its toughness_joule_per_m2, %.3g: with "
                  "stiffness_pa_per_m: %.3g it softens over about %.2g mm "
                  "(young_pa/stiffness_pa_per_m), less than an edge of an element there, %.2g mm, "
                  "so that it tears off harder; make stiffness_pa_per_m %.2g or less, or the edges "
                  "%.2g mm or shorter",
                  i, one.toughness_joule_per_m2, one.stiffness_pa_per_m, 1e3 * zone_m, 1e3 * edge_m,
                  material.young_pa / edge_m, 1e3 * zone_m);
    warnings.emplace_back(text);
  }
  return warnings;
}

}  // namespace palpate::physics
