// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/ablation/ablated_body.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include "common/core/check.h"
#include "physics_node/elastic/support.h"
#include "physics_node/elastic_tissue/ablation/heat.h"

namespace palpate::physics {
namespace {

constexpr std::int32_t kGone = -1;
constexpr std::size_t kMostRegions = 256;  // of a mesh

/// The mesh of these elements, and which of all nodes they are.
struct Remainder {
  elastic::Mesh mesh;
  std::vector<std::uint32_t> nodes;
};

Remainder remainder_of(const elastic::Mesh& whole, const std::vector<std::uint32_t>& elements) {
  Remainder left{.mesh = {.nodes_m = {},
                          .nodes_per_element = whole.nodes_per_element,
                          .elements = {},
                          .regions = {}},
                 .nodes = {}};
  std::vector<std::int32_t> place(whole.nodes_m.size(), kGone);
  for (const std::uint32_t e : elements) {
    for (const std::uint32_t node : whole.element(e)) place[node] = 0;
  }
  for (std::uint32_t node = 0; node < place.size(); ++node) {
    if (place[node] == kGone) continue;
    place[node] = static_cast<std::int32_t>(left.nodes.size());
    left.nodes.push_back(node);
    left.mesh.nodes_m.push_back(whole.nodes_m[node]);
  }
  for (const std::uint32_t e : elements) {
    for (const std::uint32_t node : whole.element(e)) {
      left.mesh.elements.push_back(static_cast<std::uint32_t>(place[node]));
    }
    left.mesh.regions.push_back(whole.regions[e]);
  }
  return left;
}

/// By node of the whole body: its index among these.
std::vector<std::int32_t> places_of(const std::vector<std::uint32_t>& nodes, std::size_t all) {
  std::vector<std::int32_t> places(all, kGone);
  for (std::size_t i = 0; i < nodes.size(); ++i) places[nodes[i]] = static_cast<std::int32_t>(i);
  return places;
}

/// Those of these nodes of the whole body that are left.
std::vector<std::uint32_t> left_of(const std::vector<std::uint32_t>& nodes,
                                   const std::vector<std::int32_t>& places) {
  std::vector<std::uint32_t> left;
  for (const std::uint32_t node : nodes) {
    if (places[node] != kGone) left.push_back(static_cast<std::uint32_t>(places[node]));
  }
  return left;
}

std::vector<std::uint32_t> held_nodes_of(const elastic::BodyDescription& body,
                                         std::span<const double> attached) {
  std::vector<std::uint32_t> held = body.fixed_nodes;
  for (const elastic::Attachment& one : body.attachments) {
    if (!one.tears() || attached[one.index] > 0.0) held.push_back(one.node);
  }
  return held;
}

/// Takes elements out of `elements` until each is held by the rest. @return how many
std::size_t drop_loose(const elastic::BodyDescription& whole, std::vector<std::uint32_t>& elements,
                       std::span<const double> attached) {
  const std::vector<std::uint32_t> held = held_nodes_of(whole, attached);
  const std::size_t all = whole.mesh.nodes_m.size();
  std::size_t dropped = 0;
  while (!elements.empty()) {
    const Remainder left = remainder_of(whole.mesh, elements);
    std::vector<std::uint32_t> loose = elastic::hinged_elements(left.mesh);
    if (loose.empty()) {
      loose = elastic::loose_elements(left.mesh, left_of(held, places_of(left.nodes, all)));
    }
    if (loose.empty()) break;
    dropped += loose.size();
    for (auto e = loose.rbegin(); e != loose.rend(); ++e) {
      elements.erase(elements.begin() + static_cast<std::ptrdiff_t>(*e));
    }
  }
  return dropped;
}

/// 3 numbers per node of the whole body, of these nodes.
elastic::VectorXd values_at(const elastic::VectorXd& all, const std::vector<std::uint32_t>& nodes) {
  if (all.size() == 0) return {};
  elastic::VectorXd values(3 * static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    values.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        all.segment<3>(3 * Eigen::Index{nodes[i]});
  }
  return values;
}

/// The description of what is left, its materials in stages.
elastic::BodyDescription description_of(const ElasticBody& whole, Remainder left,
                                        const std::vector<std::uint32_t>& elements,
                                        std::span<const std::uint8_t> stages, double softest_ratio,
                                        std::span<const double> attached) {
  const elastic::BodyDescription& all = whole.body->description();
  const std::vector<std::int32_t> places = places_of(left.nodes, all.mesh.nodes_m.size());
  elastic::BodyDescription body{.mesh = std::move(left.mesh),
                                .materials = {},
                                .law = all.law,
                                .fixed_nodes = left_of(all.fixed_nodes, places),
                                .gravity_m_per_s2 = all.gravity_m_per_s2,
                                .more_load_newton = values_at(all.more_load_newton, left.nodes),
                                .branches = all.branches};
  for (elastic::Attachment one : all.attachments) {
    if (places[one.node] == kGone) continue;
    one.node = static_cast<std::uint32_t>(places[one.node]);
    if (one.tears()) one.stiffness_newton_per_m = one.intact_newton_per_m * attached[one.index];
    if (one.stiffness_newton_per_m > 0.0) body.attachments.push_back(one);
  }
  const std::size_t parts = whole.part_count + 1;
  const std::size_t most_stages = std::min<std::size_t>(kHeatStages, kMostRegions / parts);
  for (std::size_t stage = 0; stage < most_stages; ++stage) {
    for (std::size_t part = 0; part < parts; ++part) {
      elastic::Material material = all.materials[part];
      material.young_modulus_pa *= stiffness_ratio(static_cast<std::uint8_t>(stage), softest_ratio);
      body.materials.push_back(material);
    }
  }
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const std::size_t stage = std::min<std::size_t>(stages[elements[i]], most_stages - 1);
    body.mesh.regions[i] = static_cast<std::uint8_t>(stage * parts + body.mesh.regions[i]);
  }
  return body;
}

/// By face of the whole body, 4 per element: where the points of the contact on it begin.
std::vector<std::int32_t> points_of_faces(const AblatedBody& ablated, std::size_t all_elements) {
  std::vector<std::int32_t> first(4 * all_elements, kGone);
  const ElasticBody& body = *ablated.body();
  const elastic::Mesh& mesh = body.body->mesh();
  std::size_t point = 0;
  for (const elastic::Face& face : body.faces) {
    const auto corners = mesh.element(face.element).first(4);
    const auto opposite = std::find_if(corners.begin(), corners.end(), [&](std::uint32_t node) {
      return std::find(face.nodes.begin(), face.nodes.begin() + 3, node) == face.nodes.begin() + 3;
    });
    first[std::size_t{4} * ablated.elements[face.element] +
          static_cast<std::size_t>(opposite - corners.begin())] = static_cast<std::int32_t>(point);
    while (point < body.points.size() && body.points[point].nodes == face.nodes) ++point;
  }
  return first;
}

/// The points of a face are the same in both bodies: its shape in the mesh is.
std::vector<std::int32_t> old_points_of(const AblatedBody& before, const AblatedBody& after,
                                        std::size_t all_elements) {
  const std::vector<std::int32_t> old = points_of_faces(before, all_elements);
  const std::vector<std::int32_t> now = points_of_faces(after, all_elements);
  const std::vector<elastic::SurfacePoint>& points = after.body()->points;
  std::vector<std::int32_t> old_points(points.size(), kGone);
  for (std::size_t face = 0; face < now.size(); ++face) {
    if (old[face] == kGone || now[face] == kGone) continue;
    const auto first = static_cast<std::size_t>(now[face]);
    for (std::size_t i = first; i < points.size() && points[i].nodes == points[first].nodes; ++i) {
      old_points[i] = old[face] + static_cast<std::int32_t>(i - first);
    }
  }
  return old_points;
}

}  // namespace

double share_in_reach(const ElasticBody& body, const ElectrodeConfig& electrode,
                      double tip_radius_m) {
  const elastic::Mesh& mesh = body.body->mesh();
  double in_reach_m2 = 0.0;
  double all_m2 = 0.0;
  const auto node_m = [&](std::uint32_t node) -> Vector3 {
    return body.start_m.segment<3>(3 * Eigen::Index{node});
  };
  for (const elastic::Face& face : body.faces) {
    const Vector3 a = node_m(face.nodes[0]);
    const Vector3 b = node_m(face.nodes[1]);
    const Vector3 c = node_m(face.nodes[2]);
    const Vector3 twice_area = (b - a).cross(c - a);
    Vector3 centroid_m = Vector3::Zero();
    for (const std::uint32_t corner : mesh.element(face.element).first(4)) {
      centroid_m += 0.25 * node_m(corner);
    }
    const Vector3 tip_m = (a + b + c) / 3.0 + tip_radius_m * twice_area.normalized();
    all_m2 += 0.5 * twice_area.norm();
    if ((centroid_m - tip_m).norm() < electrode.reach_m) in_reach_m2 += 0.5 * twice_area.norm();
  }
  return in_reach_m2 / all_m2;
}

AblatedBody whole_body(std::shared_ptr<BodyCompliance> shared) {
  AblatedBody whole{.shared = std::move(shared)};
  whole.nodes.resize(whole.body()->body->node_count());
  whole.elements.resize(whole.body()->body->mesh().element_count());
  std::iota(whole.nodes.begin(), whole.nodes.end(), 0U);
  std::iota(whole.elements.begin(), whole.elements.end(), 0U);
  return whole;
}

std::shared_ptr<const AblatedBody> ablated_body(const ElasticBody& whole, const AblatedBody& before,
                                                std::span<const std::uint8_t> stages,
                                                double softest_ratio,
                                                std::span<const std::uint32_t> near,
                                                std::span<const double> attached) {
  const elastic::BodyDescription& all = whole.body->description();
  auto after = std::make_shared<AblatedBody>();
  std::copy_if(before.elements.begin(), before.elements.end(), std::back_inserter(after->elements),
               [&](std::uint32_t e) { return stages[e] < kHeatStages; });
  const auto& held_before = before.body()->body->description().attachments;
  const bool has_torn = std::any_of(
      held_before.begin(), held_before.end(),
      [&](const elastic::Attachment& one) { return one.tears() && !(attached[one.index] > 0.0); });
  if (has_torn || after->elements.size() < before.elements.size()) {
    after->loose = drop_loose(all, after->elements, attached);
  }
  const bool has_same_elements = after->elements.size() == before.elements.size();
  if (after->elements.empty()) throw SetupError("nothing is left of it that is held");

  Remainder left = remainder_of(all.mesh, after->elements);
  after->nodes = left.nodes;
  const std::vector<std::int32_t> places = places_of(before.nodes, all.mesh.nodes_m.size());
  after->change.old_nodes = left_of(after->nodes, places);
  elastic::VectorXd start_m;
  if (whole.body->load_newton().size() > 0) {
    start_m = values_at(before.body()->start_m, after->change.old_nodes);
  }
  after->shared = std::make_shared<BodyCompliance>(remade_elastic_body(
      whole,
      description_of(whole, std::move(left), after->elements, stages, softest_ratio, attached),
      start_m, has_same_elements ? before.body()->body.get() : nullptr));
  after->change.old_points = old_points_of(before, *after, all.mesh.element_count());

  // the first steps of a tool that is there shall not wait for them
  const std::vector<std::int32_t> here = places_of(after->nodes, all.mesh.nodes_m.size());
  std::vector<std::uint32_t> columns;
  for (const std::uint32_t node : near) {
    if (here[node] == kGone) continue;
    const auto place = static_cast<std::uint32_t>(here[node]);
    if (after->shared->compliance().row_of(place) >= 0) columns.push_back(place);
  }
  if (!columns.empty()) static_cast<void>(after->shared->compliance().require(columns));
  return after;
}

}  // namespace palpate::physics
