// SPDX-License-Identifier: Apache-2.0
// triangle_files.h — triangle meshes from OBJ and STL files, lengths in the unit of the file.
#pragma once

#include <string>
#include <string_view>

#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {

/// Lines `v` and `f` of Wavefront OBJ; polygons become fans of triangles around their first corner.
/// Other lines (texture, normals, groups, materials) are ignored.
/// @throws SetupError  as "file:line: what: rule", also for everything complaint_about() reports
[[nodiscard]] TriangleMesh parse_obj(std::string_view bytes, const std::string& file_name);

/// ASCII or binary STL; corners with equal coordinates become one vertex. The normals of the file
/// are ignored: the order of the corners determines the outside.
/// @throws SetupError  as parse_obj
[[nodiscard]] TriangleMesh parse_stl(std::string_view bytes, const std::string& file_name);

}  // namespace palpate::physics
