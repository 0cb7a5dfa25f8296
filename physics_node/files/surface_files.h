// surface_files.h — surfaces from files: read and checked once, shared by all who name them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "common/session/scene_config.h"
#include "physics_node/surfaces/geometry.h"
#include "physics_node/contact/surface.h"
#include "physics_node/files/tetrahedral_mesh.h"

namespace palpate::physics {

/// A surface at its place in W.
struct PlacedSurface {
  std::shared_ptr<const Surface> surface;
  Vector3 position_m = Vector3::Zero();
  Quaternion rotation = Quaternion::Identity();
};

/// The surface as W sees it.
[[nodiscard]] SurfaceView view(const PlacedSurface& placed, const Vector3& point_m,
                               SurfaceHint& hint) noexcept;
[[nodiscard]] inline SurfaceView view(const PlacedSurface& placed,
                                      const Vector3& point_m) noexcept {
  SurfaceHint none;
  return view(placed, point_m, none);
}
[[nodiscard]] Bounds bounds_of(const PlacedSurface& placed) noexcept;

/// What the scene looks at: everything that a file gives is loaded.
using Shape =
    std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, CapsuleGeometry, PlacedSurface>;

/// @throws SetupError  if the file cannot be used; "file:line: what: rule; remedy"
[[nodiscard]] Shape to_shape(const Geometry& geometry);

[[nodiscard]] SurfaceView view(const Shape& shape, const Vector3& point_m,
                               SurfaceHint& hint) noexcept;

/// None for a half-space.
[[nodiscard]] std::optional<Bounds> bounds_of(const Shape& shape) noexcept;

/// The surface in the frame of the file, in metres. While somebody holds it, the same file (name,
/// size, time of change, unit and property) gives the same surface again. Thread-safe.
/// @throws SetupError
[[nodiscard]] std::shared_ptr<const Surface> load_surface(const FileGeometry& geometry);

/// The same from memory; the end of `file_name` tells the format: .ply, .obj, .stl, .msh, .vtk.
[[nodiscard]] std::shared_ptr<const Surface> parse_surface(std::string_view bytes,
                                                           const std::string& file_name,
                                                           const FileGeometry& geometry);

/// The whole mesh of a kTetrahedralMesh, in metres; not kept.
/// @throws SetupError
[[nodiscard]] TetrahedralMesh load_tetrahedral_mesh(const FileGeometry& geometry);

}  // namespace palpate::physics
