// SPDX-License-Identifier: Apache-2.0
// display_mesh.h — the meshes that viewers draw. They do not affect the force.
#pragma once

#include "common/core/scene_messages.h"
#include "common/core/vector.h"
#include "common/session/session.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/surfaces/shape.h"

namespace palpate::physics {

/// The region of W in which unbounded surfaces are drawn, and the resolution.
struct DisplayArea {
  Vector3 center_m = Vector3::Zero();
  double half_extent_m = 0.1;
  /// Approximate largest number of vertices of a surface that is not from a file, whatever its
  /// size: 30 frames per second of 10 000 vertices are 4 MB/s.
  double vertices = 10'000.0;
};

/// A region that contains the workspaces of the tools; with many tissues each is drawn coarser.
[[nodiscard]] DisplayArea display_area_of(const Session& session);

/// The surface of a tissue, in W.
[[nodiscard]] SurfaceMesh display_mesh(const Shape& shape, const DisplayArea& area);

/// A square of the plane, 2 half extents wide, around the point nearest to the area's centre.
[[nodiscard]] SurfaceMesh display_mesh(const HalfSpaceGeometry& half_space,
                                       const DisplayArea& area);
/// An icosahedron, subdivided until its edges are short relative to the radius.
[[nodiscard]] SurfaceMesh display_mesh(const SphereGeometry& sphere, const DisplayArea& area);
/// Six grids, each with its own vertices on edges and corners, so that these are drawn sharp.
[[nodiscard]] SurfaceMesh display_mesh(const BoxGeometry& box, const DisplayArea& area);

/// Rings around the axis, and two ends.
[[nodiscard]] SurfaceMesh display_mesh(const CapsuleGeometry& capsule, const DisplayArea& area);
/// The mesh of its FileSurface (file_surface_mesh.h), at its place.
[[nodiscard]] SurfaceMesh display_mesh(const PlacedSurface& placed, const DisplayArea& area);

/// The surface of an elastic body where it rests; vertices are its surface nodes.
[[nodiscard]] SurfaceMesh display_mesh(const ElasticBody& body);
/// The surface of its part where it rests; vertices are the part's nodes.
[[nodiscard]] SurfaceMesh display_mesh(const ElasticBody& body, const BodyPart& part);
/// Stiffness of each vertex of the surface: hertz_slope_newton_per_m() of the material beneath it.
[[nodiscard]] std::vector<float> display_stiffness_newton_per_m(const ElasticBody& body);

[[nodiscard]] TissueShape shape_of(const Geometry& geometry);

}  // namespace palpate::physics
