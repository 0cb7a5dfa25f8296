// SPDX-License-Identifier: Apache-2.0
// surface_files.h — surfaces from files: each is read and checked once and shared by all tissues
// that name it.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "common/session/scene_config.h"
#include "physics_node/surfaces/file_surface.h"
#include "physics_node/surfaces/shape.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::physics {

/// The shape of a tissue; loads its file, if it has one.
/// @throws SetupError  if the file cannot be used; "file:line: what: rule; remedy"
[[nodiscard]] Shape to_shape(const Geometry& geometry);

/// The surface in the frame of the file, in metres. As long as the surface is in use, the same file
/// (name, size, modification time, unit and property) gives the same object again. Thread-safe.
/// @throws SetupError
[[nodiscard]] std::shared_ptr<const FileSurface> load_surface(const FileGeometry& geometry);

/// As load_surface, from memory. The extension of `file_name` selects the format: .ply, .obj, .stl,
/// .msh, .vtk.
/// @throws SetupError
[[nodiscard]] std::shared_ptr<const FileSurface> parse_surface(std::string_view bytes,
                                                               const std::string& file_name,
                                                               const FileGeometry& geometry);

/// The complete mesh of a kTetrahedralMesh, in metres; not shared.
/// @throws SetupError
[[nodiscard]] TetrahedralMesh load_tetrahedral_mesh(const FileGeometry& geometry);

/// The complete mesh of a kTriangleSurface, in metres; not shared.
/// @throws SetupError
[[nodiscard]] TriangleMesh load_triangle_mesh(const FileGeometry& geometry);

}  // namespace palpate::physics
