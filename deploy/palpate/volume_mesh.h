// SPDX-License-Identifier: Apache-2.0
// volume_mesh.h — tetrahedra within a closed surface, by isosurface stuffing or by the program
// gmsh, and what a user should know of the result.
#pragma once

#include <string>

#include "physics_node/surfaces/tetrahedral_mesh.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate {

struct VolumeMeshing {
  double edge_m = 0.0;  ///< length of edges to aim at, > 0
  /// The triangles stay as they are, and edge_m holds inside only.
  bool has_given_surface = false;
  double limit_s = 600.0;  ///< that gmsh may take, > 0
};

/// Where no length is given: a 25th of the diagonal of the bounding box.
[[nodiscard]] double usual_edge_m(const physics::TriangleMesh& surface);

/// By isosurface stuffing of the signed distance to the surface: any closed surface, staircases of
/// voxels too. Edges and corners are rounded to about edge_m; of parts that are not connected the
/// largest is kept.
/// @param edge_m  of the lattice's cubes at the surface, > 0; they are up to twice as long inside
/// @throws SetupError  if the surface is open or folded, or edge_m so short that more than a
/// million
///     tetrahedra would come, or so long that nothing is left
[[nodiscard]] physics::TetrahedralMesh stuffed_mesh_of(const physics::TriangleMesh& surface,
                                                       double edge_m, const std::string& file_name);

/// Runs gmsh, which must be in $PATH, on one processor. Interrupted by Ctrl-C.
/// @param surface    in metres; complaint_about(surface) is empty
/// @param file_name  of the surface, for messages
/// @throws SetupError  if the surface is open, edge_m is so short that more than a million
///     tetrahedra would come, gmsh is not installed, does not mesh the surface or takes longer
[[nodiscard]] physics::TetrahedralMesh volume_mesh_of(const physics::TriangleMesh& surface,
                                                      const VolumeMeshing& meshing,
                                                      const std::string& file_name);

/// Number, scale, shape and volume in lines of text, each ending with a line end; what a session
/// would refuse, or would run badly with, as lines that begin with "WARNING: ".
[[nodiscard]] std::string quality_report(const physics::TetrahedralMesh& mesh,
                                         double surface_volume_m3);

}  // namespace palpate
