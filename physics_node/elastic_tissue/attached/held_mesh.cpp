// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/attached/held_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "common/contact/facet.h"
#include "common/core/check.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/mesh_place.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/surfaces/box_tree.h"

namespace palpate::physics {
namespace {

constexpr std::size_t kTiedLeafTriangles = 4;
// A face is tied if it looks at the other surface within about 60°.
constexpr double kTiedFacing = -0.5;
// Springs are at most so many moduli of the softer body over the distance of the nodes: the passes
// in which two bodies are solved come together, and the tolerance of a position is not that of much
// force.
constexpr double kMostTieModuli = 20.0;

/// Another surface, from near.
class NearSurface {
 public:
  NearSurface(const TiedSurface& surface, double gap_m)
      : surface_(surface), gap_m_(gap_m), tree_(items_of(surface), kTiedLeafTriangles) {}

  /// None: it is farther than within_m from there.
  [[nodiscard]] std::optional<TiedPlace> place_of(
      const Vector3& point_m, double within_m = std::numeric_limits<double>::infinity()) const {
    std::optional<TiedPlace> found;
    double limit = within_m * within_m;
    tree_.visit_nearest(point_m, limit, [&](std::uint32_t place) {
      const std::uint32_t t = tree_.order()[place];
      const auto& [a, b, c] = corners_of(t);
      const FacetFoot foot = foot_on_facet(a, b, c, point_m);
      if (foot.squared_distance > limit || (found && foot.squared_distance == limit)) return limit;
      limit = foot.squared_distance;
      const Vector3 twice_area = (b - a).cross(c - a);
      const Vector3 way_m = foot.point_m - a;
      const double second = twice_area.dot(way_m.cross(c - a)) / twice_area.squaredNorm();
      const double third = twice_area.dot((b - a).cross(way_m)) / twice_area.squaredNorm();
      found = TiedPlace{.tissue = surface_.tissue,
                        .triangle = surface_.triangles[t],
                        .weights = {1.0 - second - third, second, third},
                        .offset_m = point_m - foot.point_m,
                        .normal = twice_area.normalized()};
      return limit;
    });
    return found;
  }

  /// Its corners are within the gap, and it looks at what is nearest to its centre.
  [[nodiscard]] bool has_face(const elastic::Mesh& mesh, const elastic::Face& face) const {
    const Vector3& a = mesh.nodes_m[face.nodes[0]];
    const Vector3& b = mesh.nodes_m[face.nodes[1]];
    const Vector3& c = mesh.nodes_m[face.nodes[2]];
    for (const Vector3& corner : {a, b, c}) {
      if (!place_of(corner, gap_m_)) return false;
    }
    return (b - a).cross(c - a).normalized().dot(place_of((a + b + c) / 3.0)->normal) < kTiedFacing;
  }

  /// Why no face is tied.
  [[nodiscard]] std::string missed(const elastic::Mesh& mesh,
                                   const std::vector<elastic::Face>& faces) const {
    double least_m = std::numeric_limits<double>::infinity();
    for (const elastic::Face& face : faces) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto found = place_of(mesh.nodes_m[face.nodes[k]]);
        least_m = std::min(least_m, found->offset_m.norm());
      }
    }
    char text[240];  // NOLINT: for snprintf
    std::snprintf(
        text, sizeof text,
        "tissue: no face of the surface that lies in `where` and looks at the other one is within "
        "gap_m, %.3g mm; the nearest node is %.3g mm away; move one of the two, give a "
        "larger gap_m, or correct where",
        1e3 * gap_m_, 1e3 * least_m);
    return text;
  }

  /// Why the bodies cannot be solved with springs that are as stiff as that; "": they can.
  /// @param places  the last `count` are those of the springs
  [[nodiscard]] std::string too_stiff(double k_pa_per_m, double young_pa,
                                      const std::vector<TiedPlace>& places,
                                      std::size_t count) const {
    double area_m2 = 0.0;
    for (auto place = places.end() - static_cast<std::ptrdiff_t>(count); place != places.end();
         ++place) {
      area_m2 += place->area_m2 / static_cast<double>(count);
    }
    const double edge_m = std::sqrt(area_m2);
    const double softer_pa = std::min(young_pa, surface_.young_pa);
    if (count == 0 || k_pa_per_m * edge_m <= kMostTieModuli * softer_pa) return "";
    char text[300];  // NOLINT: for snprintf
    std::snprintf(
        text, sizeof text,
        "stiffness_pa_per_m = %.3g: must be at most %.0f × young_pa of the softer of the "
        "two over the distance of the nodes, %.2g Pa over %.2g mm; stiffer springs hold no "
        "better, and are not solved well; give %.2g or less",
        k_pa_per_m, kMostTieModuli, softer_pa, 1e3 * edge_m, kMostTieModuli * softer_pa / edge_m);
    return text;
  }

 private:
  static std::array<Vector3, 3> corners_of(const TiedSurface& surface, std::uint32_t triangle) {
    const auto& [a, b, c] = surface.triangles[triangle];
    return {surface.nodes_m[a], surface.nodes_m[b], surface.nodes_m[c]};
  }
  [[nodiscard]] std::array<Vector3, 3> corners_of(std::uint32_t triangle) const {
    return corners_of(surface_, triangle);
  }
  static std::vector<BoxTree::Item> items_of(const TiedSurface& surface) {
    std::vector<BoxTree::Item> items;
    for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
      const std::array<Vector3, 3> corners = corners_of(surface, t);
      items.push_back({bounds_of(corners), corners[0] + corners[1] + corners[2], t});
    }
    return items;
  }

  const TiedSurface& surface_;
  double gap_m_;
  BoxTree tree_;
};

}  // namespace

elastic::Mesh mesh_of(const TetrahedralMesh& read, const FileGeometry& geometry,
                      const ElasticMaterial& material) {
  elastic::Mesh mesh;
  for (const Vector3& node_m : read.nodes_m) {
    mesh.nodes_m.emplace_back(geometry.position_m + geometry.rotation * node_m);
  }
  for (const auto& corners : read.tetrahedra) {
    mesh.elements.insert(mesh.elements.end(), corners.begin(), corners.end());
  }
  mesh.regions.resize(read.tetrahedra.size(), 0);
  for (std::size_t i = 0; i < material.parts.size(); ++i) {
    const MeshPlace place(material.parts[i].where, read, mesh);
    for (std::size_t e = 0; e < read.tetrahedra.size(); ++e) {
      if (place.has_element(e)) mesh.regions[e] = static_cast<std::uint8_t>(i + 1);
    }
  }
  return material.is_linear ? mesh : elastic::quadratic(mesh);
}

TiedSurface tied_surface_of(const SceneConfig& scene, std::size_t tissue) {
  const TissueConfig& other = scene.tissues.at(tissue);
  const auto& geometry = std::get<FileGeometry>(other.geometry);
  elastic::Mesh mesh =
      mesh_of(load_tetrahedral_mesh(geometry), geometry, std::get<ElasticMaterial>(other.material));
  TiedSurface surface{.tissue = static_cast<std::uint32_t>(tissue),
                      .young_pa = std::get<ElasticMaterial>(other.material).young_pa};
  surface.triangles = triangles_of(mesh, elastic::surface_of(mesh));
  surface.nodes_m = std::move(mesh.nodes_m);
  return surface;
}

std::string idle_place(const char* field, std::size_t index, const char* what) {
  return "elastic." + std::string(field) + "[" + std::to_string(index) + "] " + what +
         "; correct the place, in metres in W, or leave it out";
}

std::vector<std::string> hold(const TetrahedralMesh& read, const ElasticMaterial& material,
                              const std::vector<TiedSurface>& others,
                              elastic::BodyDescription& body, std::vector<TiedPlace>& places) {
  const elastic::Mesh& mesh = body.mesh;
  std::vector<std::string> idle;
  std::vector<bool> is_fixed(mesh.nodes_m.size(), false);
  for (std::size_t i = 0; i < material.fixed.size(); ++i) {
    const std::vector<std::uint32_t> nodes = MeshPlace(material.fixed[i], read, mesh).nodes();
    for (const std::uint32_t node : nodes) is_fixed[node] = true;
    if (nodes.empty()) idle.push_back(idle_place("fixed", i, "holds nothing: no node lies there"));
  }
  for (std::uint32_t node = 0; node < is_fixed.size(); ++node) {
    if (is_fixed[node]) body.fixed_nodes.push_back(node);
  }
  if (material.attached.empty()) return idle;
  const std::vector<elastic::Face> faces = elastic::surface_of(mesh);
  // thirds of a face's area, at its corners or, of quadratic elements, in the middle of its edges,
  // which is exact for linear displacements
  const std::size_t first = mesh.nodes_per_element == 4 ? 0 : 3;
  std::vector<double> of_nodes(mesh.nodes_m.size(), 0.0);  // N/m
  std::vector<elastic::Attachment> ties;
  std::vector<elastic::Attachment> tearing;
  auto other = others.begin();
  for (std::size_t i = 0; i < material.attached.size(); ++i) {
    const bool is_tie = material.attached[i].tissue.has_value();
    const std::optional<NearSurface> near =
        is_tie ? std::optional<NearSurface>(std::in_place, *other++, material.attached[i].gap_m)
               : std::nullopt;
    const MeshPlace place(material.attached[i].where, read, mesh);
    const double k_pa_per_m = material.attached[i].stiffness_pa_per_m;
    const double toughness = material.attached[i].toughness_joule_per_m2;
    struct Patch {
      double area_m2 = 0.0;
      Vector3 normal_m2 = Vector3::Zero();
    };
    std::map<std::uint32_t, Patch> patches;  // of what tears, by node
    bool has_face = false;
    bool has_free_node = false;
    for (const elastic::Face& face : faces) {
      if (!material.attached[i].is_anywhere && !place.has_face(face)) continue;
      if (near && !near->has_face(mesh, face)) continue;
      has_face = true;
      const Vector3& corner_m = mesh.nodes_m[face.nodes[0]];
      const Vector3 area_m2 =
          0.5 *
          (mesh.nodes_m[face.nodes[1]] - corner_m).cross(mesh.nodes_m[face.nodes[2]] - corner_m);
      for (std::size_t k = first; k < first + 3; ++k) {
        const std::uint32_t node = face.nodes[k];
        if (is_fixed[node]) continue;
        has_free_node = true;
        if (toughness > 0.0 || is_tie) {
          patches[node].area_m2 += area_m2.norm() / 3.0;
          patches[node].normal_m2 += area_m2;
        } else {
          of_nodes[node] += k_pa_per_m * area_m2.norm() / 3.0;
        }
      }
    }
    for (const auto& [node, patch] : patches) {
      const double newton_per_m = k_pa_per_m * patch.area_m2;
      std::int32_t tie = -1;
      if (near) {
        tie = static_cast<std::int32_t>(places.size());
        places.push_back(*near->place_of(mesh.nodes_m[node]));
        places.back().area_m2 = patch.area_m2;
      }
      if (!(toughness > 0.0)) {
        ties.push_back({.node = node,
                        .stiffness_newton_per_m = newton_per_m,
                        .outward = patch.normal_m2.normalized(),
                        .tie = tie});
        continue;
      }
      tearing.push_back({.node = node,
                         .stiffness_newton_per_m = newton_per_m,
                         .intact_newton_per_m = newton_per_m,
                         .softens_at_m = std::sqrt(toughness / k_pa_per_m),
                         .outward = patch.normal_m2.normalized(),
                         .index = static_cast<std::uint32_t>(tearing.size()),
                         .tie = tie});
    }
    if (near) {
      const std::string complaint =
          has_face ? near->too_stiff(k_pa_per_m, material.young_pa, places, patches.size())
                   : near->missed(mesh, faces);
      if (!complaint.empty()) {
        throw SetupError("elastic.attached[" + std::to_string(i) + "]." + complaint);
      }
    }
    if (!has_face) {
      idle.push_back(idle_place("attached", i, "holds nothing: no face of the surface lies there"));
    } else if (!has_free_node) {
      idle.push_back(idle_place("attached", i, "holds nothing that elastic.fixed does not hold"));
    }
  }
  for (std::uint32_t node = 0; node < of_nodes.size(); ++node) {
    if (of_nodes[node] > 0.0) body.attachments.push_back({node, of_nodes[node]});
  }
  body.attachments.insert(body.attachments.end(), ties.begin(), ties.end());
  body.attachments.insert(body.attachments.end(), tearing.begin(), tearing.end());
  return idle;
}

}  // namespace palpate::physics
