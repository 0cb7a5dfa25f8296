// SPDX-License-Identifier: Apache-2.0
// tetrahedral_files.h — volume meshes from Gmsh and VTK files, lengths in the unit of the file.
#pragma once

#include <string>
#include <string_view>

#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::physics {

/// Gmsh `.msh` of version 1, 2.2 or 4.1, text or binary. Points, lines and faces are ignored; of
/// tetrahedra of second order only the corners are used; other volume elements are refused. If all
/// elements are inverted, all are turned over. Regions are the physical volumes of versions 2.2 and
/// 4.1, by their names, or by their numbers where they have none; an element without one is in
/// region "0".
/// @throws SetupError  as "file:line: what: rule": malformed, numbers not finite, nodes that do not
///     exist or are given twice, elements without volume, some inverted
[[nodiscard]] TetrahedralMesh parse_msh(std::string_view bytes, const std::string& file_name);

/// Legacy VTK (`# vtk DataFile`), text or binary, UNSTRUCTURED_GRID. Regions are the whole numbers
/// of an array of CELL_DATA (CellRegions); otherwise as parse_msh.
[[nodiscard]] TetrahedralMesh parse_vtk(std::string_view bytes, const std::string& file_name);

/// VTK's XML (`.vtu`) with one piece: text, base64 or appended, uncompressed or by zlib; otherwise
/// as parse_vtk.
[[nodiscard]] TetrahedralMesh parse_vtu(std::string_view bytes, const std::string& file_name);

/// The mesh as Gmsh 2.2 ASCII, its regions as physical volumes.
[[nodiscard]] std::string msh_text(const TetrahedralMesh& mesh);

}  // namespace palpate::physics
