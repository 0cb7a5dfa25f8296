// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/elastic_body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>

#include "common/core/check.h"
#include "physics_node/elastic/attached/tearing.h"
#include "physics_node/elastic/equilibrium.h"
#include "physics_node/elastic/support.h"
#include "physics_node/elastic_tissue/attached/held_mesh.h"
#include "physics_node/elastic_tissue/elastic_contact.h"
#include "physics_node/elastic_tissue/mesh_place.h"
#include "physics_node/elastic_tissue/touching/neighbors.h"
#include "physics_node/elastic_tissue/touching/resting_together.h"
#include "physics_node/elastic_tissue/unloaded.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {
namespace {

constexpr double kMostScanError_m = 2e-4;
constexpr double kRestTolerance_m = 1e-7;
constexpr int kMostPointsPerEdge = 16;
// Of quadratic elements: between fewer points a curved face goes into the tip.
constexpr int kLeastPointsPerEdge = 2;
// Of the surface that a point stands for, over the square of the tip's radius.
constexpr double kPointArea = 0.09;

// Of the contact's penalty, in Young's moduli over the radius. With 10 a pressure of several moduli
// outweighs it as the points slide round the sphere: the body folds, and the sphere falls through.
constexpr double kContactStiffness = 100.0;

// Modes that move by themselves between two full solutions have a period of at least so many of
// theirs, and let some node give way by this much of what the material gives way by under the tip:
// a thick body has none.
constexpr double kShortestPeriods = 0.5;
constexpr double kLeastGive = 0.2;
constexpr Eigen::Index kMostSlowModes = 16;

elastic::Law law_of(ElasticMaterial::Law law) {
  switch (law) {
    case ElasticMaterial::Law::kCorotational:
      return elastic::Law::kCorotational;
    case ElasticMaterial::Law::kStVenantKirchhoff:
      return elastic::Law::kStVenantKirchhoff;
    case ElasticMaterial::Law::kNeoHookean:
      break;
  }
  return elastic::Law::kStableNeoHookean;
}

elastic::Material material_of(const ElasticMaterial& given, double young_pa, double poisson_ratio,
                              double density_kg_per_m3) {
  return {.young_modulus_pa = young_pa,
          .poisson_ratio = poisson_ratio,
          .density_kg_per_m3 = density_kg_per_m3,
          .mass_damping_per_s = given.mass_damping_per_s,
          .stiffness_damping_s = given.viscosity_s};
}

/// Points so dense that those of a condensed contact cover half of the tip.
std::vector<elastic::SurfacePoint> contact_points(const elastic::Mesh& mesh,
                                                  const std::vector<elastic::Face>& faces,
                                                  double tip_radius_m) {
  const double area_m2 = kPointArea * tip_radius_m * tip_radius_m;
  std::vector<elastic::SurfacePoint> points;
  for (const elastic::Face& face : faces) {
    const elastic::Vector3d& corner_m = mesh.nodes_m[face.nodes[0]];
    const double face_m2 = 0.5 * (mesh.nodes_m[face.nodes[1]] - corner_m)
                                     .cross(mesh.nodes_m[face.nodes[2]] - corner_m)
                                     .norm();
    const int per_edge =
        std::clamp(static_cast<int>(std::round(std::sqrt(face_m2 / area_m2))),
                   mesh.nodes_per_element == 10 ? kLeastPointsPerEdge : 1, kMostPointsPerEdge);
    const auto more = elastic::surface_points(mesh, {face}, per_edge);
    points.insert(points.end(), more.begin(), more.end());
  }
  return points;
}

/// Ascending.
std::vector<std::uint32_t> nodes_of(const elastic::Mesh& mesh,
                                    const std::vector<elastic::Face>& faces) {
  const auto per_face = static_cast<std::size_t>(mesh.nodes_per_element == 4 ? 3 : 6);
  std::vector<char> is_on(mesh.nodes_m.size(), 0);
  for (const elastic::Face& face : faces) {
    for (std::size_t i = 0; i < per_face; ++i) is_on[face.nodes[i]] = 1;
  }
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t i = 0; i < is_on.size(); ++i) {
    if (is_on[i] != 0) nodes.push_back(i);
  }
  return nodes;
}

/// The surface of the elements of one part.
std::vector<elastic::Face> faces_of_part(const elastic::Mesh& mesh, std::size_t parts,
                                         std::uint8_t region) {
  elastic::Mesh part{.nodes_m = mesh.nodes_m,
                     .nodes_per_element = mesh.nodes_per_element,
                     .elements = {},
                     .regions = {}};
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.element(e);
    if (mesh.regions[e] % (parts + 1) == region) {
      part.elements.insert(part.elements.end(), nodes.begin(), nodes.end());
    }
  }
  return elastic::surface_of(part);
}

void add_parts(const elastic::Mesh& mesh, ElasticBody& body) {
  body.shown_nodes = body.surface_nodes;
  for (std::size_t region = 1; region <= body.part_count; ++region) {
    BodyPart part{.region = static_cast<std::uint8_t>(region)};
    part.faces = faces_of_part(mesh, body.part_count, part.region);
    if (part.faces.empty()) continue;
    const std::vector<std::uint32_t> nodes = nodes_of(mesh, part.faces);
    part.first_node = body.shown_nodes.size();
    part.node_count = nodes.size();
    body.shown_nodes.insert(body.shown_nodes.end(), nodes.begin(), nodes.end());
    body.parts.push_back(std::move(part));
  }
}

/// Of a body that has the shape of the mesh under this gravity. @throws SetupError  it has none
elastic::UnloadedShape unloaded_shape(elastic::BodyDescription loaded, const Vector3& gravity,
                                      const std::string& name) {
  loaded.gravity_m_per_s2 = gravity;
  std::string why;
  try {
    elastic::UnloadedShape found = elastic::find_unloaded_shape(loaded);
    if (found.is_converged && found.away_m <= kMostScanError_m) return found;
    if (found.is_converged) {
      char text[100];  // NOLINT: for snprintf
      std::snprintf(text, sizeof text,
                    " (it is not stable: disturbed, it comes to rest %.2g mm away)",
                    1e3 * found.away_m);
      why = text;
    }
  } catch (const std::invalid_argument& error) {
    throw SetupError(name + error.what());
  }
  throw SetupError(
      name + kNoUnloadedShape + why +
      "; is young_pa in Pa, the mesh in metres (unit_m)? Hold more of it (fixed), give "
      "a stiffer material, or leave out scan_gravity_m_per_s2, which takes the mesh as free of "
      "load");
}

/// Of a body that rests at start_m. @param name  begins the message of a SetupError
void lay_surface(const std::string& name, ElasticBody& made) {
  made.sag_m = 0.0;
  for (Eigen::Index i = 0; i < made.start_m.size(); i += 3) {
    made.sag_m = std::max(made.sag_m,
                          (made.start_m.segment<3>(i) - made.body->rest_m().segment<3>(i)).norm());
  }
  const TriangleMesh surface = surface_mesh(made, made.start_m);
  const std::string complaint = complaint_about(surface);
  if (!complaint.empty()) throw SetupError(name + "its surface: " + complaint);
  made.shape = Shape(PlacedSurface{.surface = std::make_shared<TriangleSurface>(surface)});
  made.bounds = made.shape.bounds().value_or(Bounds{});
}

/// The rest of a body whose constants are known.
/// @param start_m  where the search for its rest position begins; empty: it is in the mesh
/// @param name     begins the message of a SetupError
/// @param before, old_nodes  @see remade_elastic_body
/// @return  the factor of the undeformed body, if it was needed
std::optional<elastic::WarpedFactor> complete(elastic::BodyDescription description,
                                              const elastic::VectorXd& start_m,
                                              const std::string& name, ElasticBody& made,
                                              const ElasticBody* before = nullptr,
                                              std::span<const std::uint32_t> old_nodes = {}) {
  made.faces = elastic::surface_of(description.mesh);
  made.points = contact_points(description.mesh, made.faces, made.tip_radius_m);
  made.surface_nodes = nodes_of(description.mesh, made.faces);
  add_parts(description.mesh, made);
  try {
    made.body = std::make_unique<const elastic::Body>(
        std::move(description), before == nullptr ? nullptr : before->body.get(), old_nodes);
  } catch (const std::invalid_argument& error) {
    throw SetupError(name + error.what());
  }
  const bool has_start = start_m.size() > 0;
  made.start_m = has_start ? start_m : made.body->rest_m();
  made.resting.emplace(*made.body, made.faces, made.rigid);
  if (made.body->load_newton().size() > 0 || has_start || !made.rigid.empty()) {
    elastic::EquilibriumSearch search(*made.body);
    elastic::WarpedFactor factor(*made.body, elastic::Precision::kDouble);
    const elastic::SearchReport report = elastic::find_rest(
        search, factor, *made.resting,
        {.tolerance_m = kRestTolerance_m, .most_iterations = 1000, .slow_iterations = 8},
        made.start_m);
    if (!report.is_converged || !report.is_finite) {
      throw SetupError(name +
                       "finds no rest position under gravity; is the mesh in metres "
                       "(unit_m), is young_pa in Pa, are enough places fixed?");
    }
  }
  std::optional<elastic::WarpedFactor> at_rest;
  if (made.body->description().branches.empty()) {  // which the modes do not know
    const double young_pa = made.body->description().materials.front().young_modulus_pa;
    at_rest.emplace(*made.body, elastic::Precision::kDouble);
    made.slow_modes =
        elastic::slow_modes_of(*made.body, *at_rest, kShortestPeriods / made.solve_rate_hz,
                               kLeastGive / (young_pa * made.tip_radius_m), kMostSlowModes,
                               before == nullptr ? nullptr : &before->slow_modes, old_nodes);
  }
  lay_surface(name, made);
  return at_rest;
}

}  // namespace

double hertz_slope_newton_per_m(const elastic::Material& material, double tip_radius_m) {
  return 2.0 * material.young_modulus_pa / (1.0 - material.poisson_ratio * material.poisson_ratio) *
         std::sqrt(tip_radius_m * kHertzDepth_m);
}

std::shared_ptr<const ElasticBody> make_elastic_body(const TissueConfig& tissue,
                                                     std::uint32_t index, double tip_radius_m,
                                                     Neighbors neighbors) {
  const auto& geometry = std::get<FileGeometry>(tissue.geometry);
  const auto& material = std::get<ElasticMaterial>(tissue.material);
  const std::string name = geometry.file + ": as the elastic body \"" + tissue.name + "\": ";

  const TetrahedralMesh read = load_tetrahedral_mesh(geometry);
  for (const ElasticMaterial::Part& part : material.parts) check_tag(part.where, read, name);
  for (const RegionGeometry& region : material.fixed) check_tag(region, read, name);
  for (const ElasticMaterial::Attached& one : material.attached) check_tag(one.where, read, name);
  elastic::BodyDescription description{
      .mesh = mesh_of(read, geometry, material),
      .materials = {material_of(material, material.young_pa, material.poisson_ratio,
                                material.density_kg_per_m3)},
      .law = law_of(material.law),
      .fixed_nodes = {},
      .gravity_m_per_s2 = material.gravity_m_per_s2};
  for (const ElasticMaterial::Branch& branch : material.branches) {
    description.branches.push_back({.share = branch.share, .tau_s = branch.tau_s});
  }
  for (const ElasticMaterial::Part& part : material.parts) {
    description.materials.push_back(
        material_of(material, part.young_pa, part.poisson_ratio, part.density_kg_per_m3));
  }
  std::vector<TiedPlace> places;
  std::vector<std::string> idle;
  try {
    idle = hold(read, material, neighbors.tied, description, places);
  } catch (const SetupError& error) {
    throw SetupError(name + error.what());
  }
  if (description.fixed_nodes.empty() && description.attachments.empty()) {
    throw SetupError(name +
                     "no node lies in a fixed place, no face of the surface in an attached one; "
                     "give elastic.fixed where the body is held, in metres in W");
  }
  if (description.fixed_nodes.size() == description.mesh.nodes_m.size()) {
    throw SetupError(name + "all nodes are fixed; make elastic.fixed smaller");
  }
  std::vector<std::uint32_t> held = description.fixed_nodes;
  for (const elastic::Attachment& one : description.attachments) held.push_back(one.node);
  if (const std::string complaint = elastic::complaint_about_support(description.mesh, held);
      !complaint.empty()) {
    throw SetupError(name + complaint);
  }
  if (description.mesh.element_count() > kMostElasticElements) {
    throw SetupError(name + std::to_string(description.mesh.element_count()) +
                     " tetrahedra; must be at most " + std::to_string(kMostElasticElements) +
                     "; coarsen the mesh");
  }

  std::optional<elastic::UnloadedShape> unloaded;
  if (!material.scan_gravity_m_per_s2.isZero(0.0)) {
    unloaded = unloaded_shape(description, material.scan_gravity_m_per_s2, name);
    description.mesh = unloaded->mesh;
    description.more_load_newton = unloaded->more_load_newton;
  }

  auto made = std::make_shared<ElasticBody>(ElasticBody{
      .tissue = index, .shape = Shape(SphereGeometry{}), .bounds = {}, .body = nullptr});
  for (std::size_t i = 0; i < material.parts.size(); ++i) {
    const auto& regions = description.mesh.regions;
    if (std::find(regions.begin(), regions.end(), i + 1) != regions.end()) continue;
    idle.push_back(idle_place("part", i, "has no element of the mesh, or a later part has them"));
  }
  made->idle_places = std::move(idle);
  made->part_count = material.parts.size();
  made->tip_radius_m = tip_radius_m;
  made->contact_stiffness_pa_per_m = kContactStiffness * material.young_pa / tip_radius_m;
  made->hertz_newton = 4.0 / 3.0 * material.young_pa /
                       (1.0 - material.poisson_ratio * material.poisson_ratio) *
                       std::sqrt(tip_radius_m) * std::pow(kHertzDepth_m, 1.5);
  made->friction_coefficient = material.friction_coefficient;
  made->pierced = material.pierced;
  made->shear_newton_per_m = 4.0 * material.young_pa * std::sqrt(tip_radius_m * kHertzDepth_m) /
                             ((1.0 + material.poisson_ratio) * (2.0 - material.poisson_ratio));
  made->solve_rate_hz = material.solve_rate_hz;
  made->viscosity_s = material.viscosity_s;
  made->prompt_ratio =
      1.0 / (1.0 + elastic::stiffening_of(description.branches, 1.0 / material.solve_rate_hz));
  if (unloaded) made->scan_error_m = unloaded->away_m;
  made->rigid = std::move(neighbors.rigid);
  made->touches = std::move(neighbors.elastic);
  made->ties = std::move(places);
  check_outside(description.mesh, made->rigid, name);
  complete(std::move(description), unloaded ? unloaded->loaded_m : elastic::VectorXd(), name,
           *made);
  if (elastic::Tearing tearing(*made->body); tearing.note(made->start_m.data())) {
    throw SetupError(name +
                     "elastic.attached tears under the weight of the body; give more "
                     "toughness_joule_per_m2 or hold more of it in elastic.fixed");
  }
  return made;
}

RemadeBody remade_elastic_body(const ElasticBody& like, elastic::BodyDescription description,
                               const elastic::VectorXd& start_m, const ElasticBody* before,
                               std::span<const std::uint32_t> old_nodes) {
  auto made = std::make_shared<ElasticBody>(ElasticBody{
      .tissue = like.tissue, .shape = Shape(SphereGeometry{}), .bounds = {}, .body = nullptr});
  made->part_count = like.part_count;
  made->tip_radius_m = like.tip_radius_m;
  made->contact_stiffness_pa_per_m = like.contact_stiffness_pa_per_m;
  made->hertz_newton = like.hertz_newton;
  made->friction_coefficient = like.friction_coefficient;
  made->pierced = like.pierced;
  made->shear_newton_per_m = like.shear_newton_per_m;
  made->solve_rate_hz = like.solve_rate_hz;
  made->viscosity_s = like.viscosity_s;
  made->prompt_ratio = like.prompt_ratio;
  made->rigid = like.rigid;
  made->touches = like.touches;
  made->ties = like.ties;
  auto at_rest = complete(std::move(description), start_m, "", *made, before, old_nodes);
  return {.body = std::move(made), .at_rest = std::move(at_rest)};
}

std::vector<std::shared_ptr<const ElasticBody>> elastic_bodies_of(const SceneConfig& scene) {
  std::vector<std::shared_ptr<const ElasticBody>> bodies;
  for (std::size_t i = 0; i < scene.tissues.size(); ++i) {
    if (!std::holds_alternative<ElasticMaterial>(scene.tissues[i].material)) continue;
    bodies.push_back(make_elastic_body(scene.tissues[i], static_cast<std::uint32_t>(i),
                                       scene.tip_radius_m, neighbors_of(scene, scene.tissues[i])));
  }
  for (const auto& body : bodies) {
    for (const auto& other : bodies) {
      if (body->touched(other->tissue) == nullptr) continue;
      const std::string name = "the elastic body \"" + scene.tissues[body->tissue].name + "\": ";
      check_outside(body->body->mesh(),
                    {{.name = scene.tissues[other->tissue].name,
                      .surface = std::make_shared<const Shape>(other->shape)}},
                    name);
    }
  }
  // and where those that lean on each other rest together
  std::vector<std::optional<RestAmongOthers>> rests = rests_among_others(bodies);
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (!rests[i]) continue;
    const auto made = std::const_pointer_cast<ElasticBody>(bodies[i]);  // nobody else has it yet
    made->start_m = std::move(rests[i]->x_m);
    made->resting.emplace(std::move(rests[i]->resting));
    if (rests[i]->has_torn) {
      throw SetupError("the elastic body \"" + scene.tissues[made->tissue].name +
                       "\": elastic.attached tears under the weight of what it ties together; give "
                       "more toughness_joule_per_m2 or hold more of it in elastic.fixed");
    }
    lay_surface("the elastic body \"" + scene.tissues[made->tissue].name + "\": ", *made);
  }
  return bodies;
}

std::vector<std::array<std::uint32_t, 3>> triangles_of(const elastic::Mesh& mesh,
                                                       const std::vector<elastic::Face>& faces) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (const elastic::Face& face : faces) {
    const auto& [a, b, c, ab, bc, ca] = face.nodes;
    if (mesh.nodes_per_element == 4) {
      triangles.push_back({a, b, c});
    } else {
      triangles.insert(triangles.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
  }
  return triangles;
}

TriangleMesh surface_mesh(const ElasticBody& body, const elastic::VectorXd& x_m) {
  TriangleMesh surface;
  std::vector<std::uint32_t> vertex_of(body.body->node_count(), 0);
  for (const std::uint32_t node : body.surface_nodes) {
    vertex_of[node] = static_cast<std::uint32_t>(surface.vertices_m.size());
    surface.vertices_m.emplace_back(x_m.segment<3>(3 * Eigen::Index{node}));
  }
  for (const auto& [a, b, c] : triangles_of(body)) {
    surface.triangles.push_back({vertex_of[a], vertex_of[b], vertex_of[c]});
  }
  return surface;
}

}  // namespace palpate::physics
