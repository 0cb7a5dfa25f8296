// SPDX-License-Identifier: Apache-2.0
// elastic_body.h — the elastic body of a tissue: its mesh, material and support from the session.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/contact/bounds.h"
#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic/body.h"
#include "physics_node/elastic/condensed/slow_modes.h"
#include "physics_node/elastic/contact/rigid_contact.h"
#include "physics_node/elastic/sphere_contact.h"
#include "physics_node/elastic_tissue/attached/held_mesh.h"
#include "physics_node/elastic_tissue/touching/neighbors.h"
#include "physics_node/surfaces/shape.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {

/// More tetrahedra than these are refused.
inline constexpr std::size_t kMostElasticElements = 200'000;

/// In the SetupError of a body whose shape without load is not found.
inline constexpr const char* kNoUnloadedShape =
    "no shape without load is found from which it sags into that of the scan: it is too soft for "
    "its weight, or held in too few places";

/// The surface of a part of a body: drawn inside it.
struct BodyPart {
  std::uint8_t region = 0;  ///< of the mesh
  std::vector<elastic::Face> faces = {};
  std::size_t first_node = 0;  ///< its nodes in ElasticBody::shown_nodes
  std::size_t node_count = 0;
};

/// What does not change while the tool deforms the body; shared by all its simulations. Positions
/// are in W.
struct ElasticBody {
  std::uint32_t tissue = 0;  ///< index in the scene
  Shape shape;               ///< the surface where it rests under gravity, untouched
  Bounds bounds;             ///< of that surface
  std::unique_ptr<const elastic::Body> body = {};
  std::vector<elastic::Face> faces = {};
  std::vector<elastic::SurfacePoint> points = {};  ///< of the contact
  std::vector<std::uint32_t> surface_nodes = {};
  std::vector<BodyPart> parts = {};  ///< those that have elements
  /// That the session has. Region r of the mesh is part r mod (part_count + 1), 0 is none; those
  /// from part_count + 1 on are softened.
  std::size_t part_count = 0;
  std::vector<std::uint32_t> shown_nodes = {};  ///< of the surface, then of each part's
  elastic::VectorXd start_m = {};               ///< at rest under gravity, untouched
  std::vector<std::string> idle_places = {};    ///< fields of the session that catch nothing
  double sag_m = 0.0;                           ///< largest displacement under gravity
  /// Of the shape under the scan's gravity from that of the mesh; < 0: the mesh is without load
  double scan_error_m = -1.0;
  double contact_stiffness_pa_per_m = 0.0;
  double tip_radius_m = 0.0;
  double hertz_newton = 0.0;  ///< of the tip 1 mm deep in much of the material [Hertz]
  double friction_coefficient = 0.0;
  /// Of a tip stuck to a half-space of much of the material, 1 mm deep: 8 a G/(2 − ν) [Mindlin49].
  double shear_newton_per_m = 0.0;
  double solve_rate_hz = 50.0;
  double viscosity_s = 0.0;  ///< Rayleigh's β
  /// Of the compliance at rest, what gives way within a period of full solutions: the rest creeps.
  double prompt_ratio = 1.0;
  std::optional<ElasticMaterial::Pierced> pierced = {};
  std::vector<elastic::RigidNeighbor> rigid = {};     ///< that it cannot go through
  std::optional<elastic::RigidContact> resting = {};  ///< how it lies on them at start_m
  std::vector<ElasticNeighbor> touches = {};
  std::vector<TiedPlace> ties = {};    ///< of the attachments that are ties
  elastic::SlowModes slow_modes = {};  ///< that move by themselves between two full solutions

  /// The elastic tissue with this index in the scene, if the session says that this one touches it;
  /// null: it does not.
  [[nodiscard]] const ElasticNeighbor* touched(std::uint32_t other) const noexcept {
    const auto found = std::find_if(touches.begin(), touches.end(),
                                    [&](const auto& one) { return one.tissue == other; });
    return found == touches.end() ? nullptr : &*found;
  }
  /// It is tied to the elastic tissue with this index in the scene.
  [[nodiscard]] bool is_tied_to(std::uint32_t other) const noexcept {
    return std::any_of(ties.begin(), ties.end(),
                       [&](const auto& one) { return one.tissue == other; });
  }
  /// It may lie on what moves.
  [[nodiscard]] bool can_be_carried() const noexcept { return resting && resting->can_move(); }
  [[nodiscard]] bool can_tear() const noexcept {
    const std::vector<elastic::Attachment>& all = body->description().attachments;
    return std::any_of(all.begin(), all.end(), [](const auto& one) { return one.tears(); });
  }
};

/// The faces as triangles between nodes of the mesh; quadratic ones as four.
[[nodiscard]] std::vector<std::array<std::uint32_t, 3>> triangles_of(
    const elastic::Mesh& mesh, const std::vector<elastic::Face>& faces);
[[nodiscard]] inline std::vector<std::array<std::uint32_t, 3>> triangles_of(
    const ElasticBody& body) {
  return triangles_of(body.body->mesh(), body.faces);
}
/// The surface as a mesh of its own, its vertices in the order of surface_nodes.
/// @param x_m  of all nodes, 3 each
[[nodiscard]] TriangleMesh surface_mesh(const ElasticBody& body, const elastic::VectorXd& x_m);

/// Slope of the force on a tip that presses 1 mm into a half-space of this material [Hertz], N/m.
[[nodiscard]] double hertz_slope_newton_per_m(const elastic::Material& material,
                                              double tip_radius_m);

/// Reads the mesh and finds the rest position under gravity. Takes up to seconds.
/// @param tip_radius_m  > 0
/// @param neighbors  what it touches
/// @throws SetupError  if the file or the body cannot be used: inverted elements, nothing
///     that holds it, no rest position, inside of what is rigid
[[nodiscard]] std::shared_ptr<const ElasticBody> make_elastic_body(const TissueConfig& tissue,
                                                                   std::uint32_t index,
                                                                   double tip_radius_m,
                                                                   Neighbors neighbors = {});

/// A body like this one, of another description: fewer elements, other materials. Takes up to
/// seconds.
struct RemadeBody {
  std::shared_ptr<const ElasticBody> body;
  std::optional<elastic::WarpedFactor> at_rest;  ///< of the undeformed one, if it was needed
};

/// A body like this one, of another description: fewer elements, other materials. Takes up to
/// seconds.
/// @param start_m  where the search for its rest position begins
/// @param before, old_nodes  of which it is made, for speed @see elastic::Body
/// @throws SetupError  it cannot be used @see make_elastic_body
[[nodiscard]] RemadeBody remade_elastic_body(const ElasticBody& like,
                                             elastic::BodyDescription description,
                                             const elastic::VectorXd& start_m,
                                             const ElasticBody* before = nullptr,
                                             std::span<const std::uint32_t> old_nodes = {});

/// The elastic bodies of a scene; empty: it has none. @throws SetupError  @see make_elastic_body
[[nodiscard]] std::vector<std::shared_ptr<const ElasticBody>> elastic_bodies_of(
    const SceneConfig& scene);

/// One line on the mesh of an elastic tissue for a person: size, quality, fixed nodes, parts.
[[nodiscard]] std::string mesh_report(const ElasticBody& body);

}  // namespace palpate::physics
