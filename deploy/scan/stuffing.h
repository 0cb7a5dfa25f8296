// SPDX-License-Identifier: Apache-2.0
// stuffing.h — tetrahedra within an implicit surface, by isosurface stuffing [Labelle07] on a
// body-centred cubic lattice that is fine at the surface and coarse inside.
//
// [Labelle07] Labelle, Shewchuk: Isosurface stuffing: fast tetrahedral meshes with good dihedral
// angles. ACM TOG 26(3), 2007.
#pragma once

#include <functional>

#include "common/contact/bounds.h"
#include "common/core/vector.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::scan {

struct Stuffing {
  Bounds bounds{};      ///< the body lies within [m]
  double cell_m = 0.0;  ///< edge of the lattice's cubes at the surface, > 0
  int coarsest = 0;     ///< cubes may be 2^coarsest cells long; 0: a uniform lattice, 0 … 4
  /// Positive inside, continuous.
  std::function<double(const Vector3&)> inside{};
  /// Largest cubes, as powers of two in cells, that may be at this place, 0 … coarsest; asked at
  /// the centre of each cube of the finest lattice within the body. Empty: coarsest.
  std::function<int(const Vector3&)> coarsest_at{};
  /// The same where the surface passes; empty: 0, so that the whole surface is fine.
  std::function<int(const Vector3&)> coarsest_at_surface{};
};

/// More cubes of the finest lattice than this are refused.
inline constexpr double kMostCubes = 30e6;

/// Deterministic. All elements have positive volume; angles between faces are 10°…165° if the whole
/// surface is fine, and may be sharper where the surface passes between cubes of different size. A
/// part of the body that is thinner than a cell may be missing.
/// @throws SetupError  if there would be more than kMostCubes cubes
[[nodiscard]] physics::TetrahedralMesh stuffed(const Stuffing& stuffing);

/// The mesh without what an elastic body cannot use: all but the largest part that is connected by
/// faces; where parts meet in an edge only, the smaller one is removed; where they meet in a node
/// only, each gets a node of its own. Afterwards the surface is a manifold.
/// @param kept  filled with the index of each element in the mesh before
[[nodiscard]] physics::TetrahedralMesh one_solid(const physics::TetrahedralMesh& mesh,
                                                 std::vector<std::uint32_t>& kept);

/// Moves nodes of elements with an angle below 8° towards the middle of their neighbours, those of
/// the surface along it, as long as the least angle there grows. Deterministic.
void open_slivers(physics::TetrahedralMesh& mesh);

}  // namespace palpate::scan
