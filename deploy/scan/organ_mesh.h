// SPDX-License-Identifier: Apache-2.0
// organ_mesh.h — from a label map to one solid of tetrahedra with a region for each label.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "deploy/scan/label_map.h"
#include "deploy/scan/smooth_field.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::scan {

/// Angles between two faces of a tetrahedron, six of each.
struct FaceAngles {
  double least_rad = 0.0;
  double largest_rad = 0.0;
  std::array<std::uint64_t, 18> histogram{};  ///< in steps of 10°
  std::size_t slivers = 0;                    ///< elements with an angle below kSliverAngle_degrees
};
inline constexpr double kSliverAngle_degrees = 5.0;
/// Quadratic elements of more have so many nodes that a body takes minutes and gigabytes: sessions
/// take them as linear ones.
inline constexpr std::size_t kMostQuadratic = 20'000;
/// Of one element [rad].
[[nodiscard]] std::array<double, 6> face_angles_rad(const physics::TetrahedralMesh& mesh,
                                                    std::size_t element);
[[nodiscard]] FaceAngles face_angles_of(const physics::TetrahedralMesh& mesh);

struct OrganMeshing {
  /// Edge of the lattice's cubes where it is finest [m]; none: so that there are at most
  /// `tetrahedra`.
  std::optional<double> cell_m{};
  std::size_t tetrahedra = 6000;
  Smoothing smoothing{};
  /// Labels, by index of the segment, at whose boundary the lattice is finest.
  std::vector<std::uint32_t> fine{};
  /// If given, the surface is finest within `site_radius_m` of this place only, and elsewhere of
  /// cubes of up to four cells.
  std::optional<Vector3> site_m{};
  double site_radius_m = 0.03;
};

struct Region {
  std::uint32_t segment = 0;
  std::uint64_t voxels = 0;          ///< of the file
  std::uint64_t dropped_voxels = 0;  ///< not connected to the rest by faces of voxels
  double voxels_m3 = 0.0;            ///< of those that were meshed
  double mesh_m3 = 0.0;
  std::size_t elements = 0;
};

struct OrganMesh {
  physics::TetrahedralMesh mesh{};  ///< with regions: index into `regions`, whose names it has
  std::vector<Region> regions{};
  double cell_m = 0.0;
  double smoothing_m = 0.0;  ///< width of the smoothing
  double level = 0.0;        ///< by which the surface is moved where it is coarsest, for the volume
  double lost_m3 = 0.0;      ///< of parts that touch the rest in an edge, a node or not at all
  FaceAngles angles{};
};

/// Sets voxels to 0 that are of other segments, or not of the largest part connected by faces.
/// @param segments  of the body, by index, at least one
/// @return  a region for each of them
[[nodiscard]] std::vector<Region> keep_largest_part(LabelMap& map,
                                                    const std::vector<std::uint32_t>& segments);

/// Voxels for which `is_inside` holds that form the largest part connected by faces.
[[nodiscard]] std::vector<std::size_t> largest_part_of(
    const LabelMap& map, const std::function<bool(std::uint16_t)>& is_inside);

/// @param map      in the frame of the mesh, of one part
/// @param regions  keep_largest_part(map, …)
/// @throws SetupError  nothing is left; the cells are too large for the body, or too many
[[nodiscard]] OrganMesh organ_mesh_of(const LabelMap& map, std::vector<Region> regions,
                                      const OrganMeshing& meshing);

/// The faces between elements of these regions and anything else, facing outwards.
[[nodiscard]] physics::TriangleMesh surface_of_region(const physics::TetrahedralMesh& mesh,
                                                      std::uint16_t region);

}  // namespace palpate::scan
