// SPDX-License-Identifier: Apache-2.0
// file_surface_mesh.h — the meshes that viewers draw of surfaces from files. They do not affect the
// force.
#pragma once

#include "common/core/scene_messages.h"
#include "physics_node/surfaces/file_surface.h"

namespace palpate::physics {

/// In the frame of the surface. Allocates, and takes up to seconds.
///
/// A TriangleSurface: its own mesh; of more than 50 000 vertices those in the same cell of a grid
/// are merged. A CloudSurface: the surface in the cells of a grid about as fine as the points, but
/// at most about 10 000 cells; each vertex lies on the surface. Parts thinner than a cell have
/// holes. Any other surface: an empty mesh.
[[nodiscard]] SurfaceMesh display_mesh(const FileSurface& surface);

}  // namespace palpate::physics
