// display_mesh.h — surfaces as viewers draw them. Nothing here takes part in the force.
#pragma once

#include "common/core/scene_messages.h"
#include "common/session/scene_config.h"
#include "common/core/vector.h"
#include "physics_node/files/surface_files.h"

namespace palpate::physics {

/// Where unbounded surfaces are drawn: round the place where the tool works; W. And how finely.
struct DisplayArea {
  Vector3 center_m = Vector3::Zero();
  double half_extent_m = 0.1;
  /// About so many of each surface that has no file, however large it is, or fewer: 30 frames a
  /// second of all of 10 000 are 4 MB/s.
  double vertices = 10'000.0;
};

/// A square of the plane, 2 half extents wide, about the point nearest to the area's centre.
[[nodiscard]] SurfaceMesh display_mesh(const HalfSpaceGeometry& half_space,
                                       const DisplayArea& area);
/// An icosahedron, divided until its edges are short against the radius.
[[nodiscard]] SurfaceMesh display_mesh(const SphereGeometry& sphere, const DisplayArea& area);
/// Six grids; edges and corners belong to each of theirs, so that they are drawn sharp.
[[nodiscard]] SurfaceMesh display_mesh(const BoxGeometry& box, const DisplayArea& area);

/// Rings about the axis, and two ends.
[[nodiscard]] SurfaceMesh display_mesh(const CapsuleGeometry& capsule, const DisplayArea& area);
/// What Surface::display_mesh() gives, at its place.
[[nodiscard]] SurfaceMesh display_mesh(const PlacedSurface& placed, const DisplayArea& area);

[[nodiscard]] TissueShape shape_of(const Geometry& geometry);

}  // namespace palpate::physics
