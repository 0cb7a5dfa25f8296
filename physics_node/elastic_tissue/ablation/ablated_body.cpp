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

/// Those that are these nodes of the whole body, or copies of them.
/// @param nodes  by node: which of the whole body
std::vector<std::uint32_t> left_of(const std::vector<std::uint32_t>& all_held,
                                   const std::vector<std::uint32_t>& nodes, std::size_t all) {
  std::vector<char> is_held(all, 0);
  for (const std::uint32_t node : all_held) is_held[node] = 1;
  std::vector<std::uint32_t> left;
  for (std::uint32_t i = 0; i < nodes.size(); ++i) {
    if (is_held[nodes[i]] != 0) left.push_back(i);
  }
  return left;
}

/// By node: what it has of all copies of its node of the whole body, by the volume of the elements
/// around each; 1 without copies.
std::vector<double> shares_of(const elastic::SeparatedMesh& left) {
  std::vector<double> shares(left.nodes.size(), 1.0);
  const auto is_copied = [&](std::size_t i) {
    return (i > 0 && left.nodes[i - 1] == left.nodes[i]) ||
           (i + 1 < left.nodes.size() && left.nodes[i + 1] == left.nodes[i]);
  };
  std::vector<double> volume_of(left.nodes.size(), 0.0);
  for (std::size_t e = 0; e < left.mesh.element_count(); ++e) {
    const auto nodes = left.mesh.element(e);
    const Vector3& corner_m = left.mesh.nodes_m[nodes[0]];
    const double volume = (left.mesh.nodes_m[nodes[1]] - corner_m)
                              .dot((left.mesh.nodes_m[nodes[2]] - corner_m)
                                       .cross(left.mesh.nodes_m[nodes[3]] - corner_m));
    for (const std::uint32_t node : nodes) volume_of[node] += volume;
  }
  for (std::size_t begin = 0; begin < shares.size();) {
    std::size_t end = begin + 1;
    double all = volume_of[begin];
    for (; end < shares.size() && left.nodes[end] == left.nodes[begin]; ++end) {
      all += volume_of[end];
    }
    for (std::size_t i = begin; i < end && is_copied(begin); ++i) shares[i] = volume_of[i] / all;
    begin = end;
  }
  return shares;
}

std::vector<std::uint32_t> held_nodes_of(const elastic::BodyDescription& body,
                                         std::span<const double> attached) {
  std::vector<std::uint32_t> held = body.fixed_nodes;
  for (const elastic::Attachment& one : body.attachments) {
    if (!one.tears() || attached[one.index] > 0.0) held.push_back(one.node);
  }
  return held;
}

/// Takes elements out of `elements` until each is held by the rest, `left`. @return how many
std::size_t drop_loose(const elastic::BodyDescription& whole, const elastic::FaceCuts& cuts,
                       std::vector<std::uint32_t>& elements, std::span<const double> attached,
                       elastic::SeparatedMesh& left) {
  const std::vector<std::uint32_t> held = held_nodes_of(whole, attached);
  std::size_t dropped = 0;
  while (!elements.empty()) {
    left = elastic::separated_mesh(whole.mesh, elements, cuts);
    std::vector<std::uint32_t> loose = elastic::hinged_elements(left.mesh);
    if (loose.empty()) {
      loose =
          elastic::loose_elements(left.mesh, left_of(held, left.nodes, whole.mesh.nodes_m.size()));
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
elastic::BodyDescription description_of(const ElasticBody& whole, elastic::SeparatedMesh left,
                                        const std::vector<std::uint32_t>& elements,
                                        std::span<const std::uint8_t> stages, double softest_ratio,
                                        std::span<const double> attached) {
  const elastic::BodyDescription& all = whole.body->description();
  const std::vector<double> shares = shares_of(left);
  elastic::BodyDescription body{
      .mesh = std::move(left.mesh),
      .materials = {},
      .law = all.law,
      .fixed_nodes = left_of(all.fixed_nodes, left.nodes, all.mesh.nodes_m.size()),
      .gravity_m_per_s2 = all.gravity_m_per_s2,
      .more_load_newton = values_at(all.more_load_newton, left.nodes),
      .branches = all.branches};
  for (Eigen::Index i = 0; i < body.more_load_newton.size(); ++i) {
    body.more_load_newton[i] *= shares[static_cast<std::size_t>(i / 3)];
  }
  for (const elastic::Attachment& one : all.attachments) {
    const auto [first, last] = std::equal_range(left.nodes.begin(), left.nodes.end(), one.node);
    for (auto copy = first; copy != last; ++copy) {
      elastic::Attachment own = one;
      own.node = static_cast<std::uint32_t>(copy - left.nodes.begin());
      if (own.tears()) own.stiffness_newton_per_m = own.intact_newton_per_m * attached[own.index];
      own.stiffness_newton_per_m *= shares[own.node];
      if (own.stiffness_newton_per_m > 0.0) body.attachments.push_back(own);
    }
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

/// By node of the body after: which of the body before it is, as a corner of one of its elements.
std::vector<std::uint32_t> old_nodes_of(const AblatedBody& before, const AblatedBody& after,
                                        const elastic::Mesh& mesh, std::size_t all_elements) {
  std::vector<std::uint32_t> place(all_elements, 0);
  for (std::uint32_t i = 0; i < before.elements.size(); ++i) place[before.elements[i]] = i;
  std::vector<std::uint32_t> old_nodes(after.nodes.size(), 0);
  const elastic::Mesh& mesh_before = before.body()->body->mesh();
  for (std::size_t i = 0; i < after.elements.size(); ++i) {
    const auto now = mesh.element(i);
    const auto old = mesh_before.element(place[after.elements[i]]);
    for (std::size_t k = 0; k < now.size(); ++k) old_nodes[now[k]] = old[k];
  }
  return old_nodes;
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
                                                std::span<const double> attached,
                                                const elastic::FaceCuts& cut) {
  const elastic::BodyDescription& all = whole.body->description();
  auto after = std::make_shared<AblatedBody>();
  std::copy_if(before.elements.begin(), before.elements.end(), std::back_inserter(after->elements),
               [&](std::uint32_t e) { return stages[e] < kHeatStages; });
  const auto& held_before = before.body()->body->description().attachments;
  const bool has_torn = std::any_of(
      held_before.begin(), held_before.end(),
      [&](const elastic::Attachment& one) { return one.tears() && !(attached[one.index] > 0.0); });
  const elastic::FaceCuts cuts = elastic::clean_cuts(all.mesh, after->elements, cut);
  elastic::SeparatedMesh left;
  if (has_torn || !cuts.is_cut.empty() || after->elements.size() < before.elements.size()) {
    after->loose = drop_loose(all, cuts, after->elements, attached, left);
  } else {
    left = elastic::separated_mesh(all.mesh, after->elements, cuts);
  }
  if (after->elements.empty()) throw SetupError("nothing is left of it that is held");

  after->cut = elastic::cut_area(all.mesh, after->elements, cuts, left.mesh);
  after->nodes = left.nodes;
  after->change.old_nodes = old_nodes_of(before, *after, left.mesh, all.mesh.element_count());
  elastic::VectorXd start_m;
  if (whole.body->load_newton().size() > 0) {
    start_m = values_at(before.body()->start_m, after->change.old_nodes);
  }
  after->shared = std::make_shared<BodyCompliance>(remade_elastic_body(
      whole,
      description_of(whole, std::move(left), after->elements, stages, softest_ratio, attached),
      start_m, before.body().get(), after->change.old_nodes));
  after->change.old_points = old_points_of(before, *after, all.mesh.element_count());

  // the first steps of a tool that is there shall not wait for them
  std::vector<std::uint32_t> columns;
  for (const std::uint32_t node : near) {
    const auto [first, last] = std::equal_range(after->nodes.begin(), after->nodes.end(), node);
    for (auto copy = first; copy != last; ++copy) {
      const auto place = static_cast<std::uint32_t>(copy - after->nodes.begin());
      if (after->shared->compliance().row_of(place) >= 0) columns.push_back(place);
    }
  }
  if (!columns.empty()) static_cast<void>(after->shared->compliance().require(columns));
  return after;
}

}  // namespace palpate::physics
