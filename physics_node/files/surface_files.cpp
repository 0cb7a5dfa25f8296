// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/surface_files.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <mutex>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "common/contact/bounds.h"
#include "common/core/check.h"
#include "common/core/user/files.h"
#include "physics_node/files/ply.h"
#include "physics_node/files/tetrahedral_files.h"
#include "physics_node/files/triangle_files.h"
#include "physics_node/surfaces/cloud_surface.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {
namespace {

using Kind = FileGeometry::Kind;

constexpr std::uintmax_t kMaxFileBytes = 2'000'000'000;
// Tissue outside this range has most likely a wrong unit.
constexpr double kSmallest_m = 1e-4;
constexpr double kLargest_m = 5.0;

std::string extension_of(const std::string& file_name) {
  std::string extension = std::filesystem::path(file_name).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](char c) {
    return static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  });
  return extension;
}

/// Converts to metres and refuses implausible sizes.
void scale(std::vector<Vector3>& points, double unit_m, const std::string& file_name) {
  const Bounds bounds = bounds_of(points);
  const double size_m = unit_m * bounds.longest_side_m();
  const double farthest_m =
      unit_m * bounds.lowest_m.cwiseAbs().cwiseMax(bounds.highest_m.cwiseAbs()).maxCoeff();
  const auto complain = [&](const std::string& what) {
    throw SetupError(file_name + ": " + what + "; give its unit_m, e.g. 0.001 for mm");
  };
  if (!(size_m >= kSmallest_m && size_m <= kLargest_m)) {
    complain("is " + std::to_string(size_m) + " m large: must be 0.0001 … 5 m");
  }
  if (!(farthest_m <= 1e3)) {
    complain("reaches " + std::to_string(farthest_m) + " m from its origin: must be within 1 km");
  }
  for (Vector3& point : points) point *= unit_m;
}

[[noreturn]] void refuse_extension(const std::string& file_name, const char* rule) {
  throw SetupError(file_name + ": must end with " + rule);
}

TetrahedralMesh parse_tetrahedra(std::string_view bytes, const std::string& file_name,
                                 double unit_m) {
  const std::string extension = extension_of(file_name);
  TetrahedralMesh mesh;
  if (extension == ".msh") {
    mesh = parse_msh(bytes, file_name);
  } else if (extension == ".vtk") {
    mesh = parse_vtk(bytes, file_name);
  } else if (extension == ".vtu") {
    mesh = parse_vtu(bytes, file_name);
  } else {
    refuse_extension(file_name, ".msh (Gmsh), .vtk or .vtu (VTK) to be a tetrahedral_mesh");
  }
  scale(mesh.nodes_m, unit_m, file_name);
  return mesh;
}

TriangleMesh parse_triangles(std::string_view bytes, const std::string& file_name, double unit_m) {
  const std::string extension = extension_of(file_name);
  TriangleMesh mesh;
  if (extension == ".obj") {
    mesh = parse_obj(bytes, file_name);
  } else if (extension == ".stl") {
    mesh = parse_stl(bytes, file_name);
  } else {
    refuse_extension(file_name, ".obj or .stl to be a triangle_surface");
  }
  scale(mesh.vertices_m, unit_m, file_name);
  return mesh;
}

std::string read_file(const std::string& file) {
  FileContent content = read_regular_file(file, kMaxFileBytes);
  if (!content.complaint.empty()) throw SetupError(file + ": " + content.complaint);
  return std::move(content.bytes);
}

}  // namespace

std::shared_ptr<const FileSurface> parse_surface(std::string_view bytes,
                                                 const std::string& file_name,
                                                 const FileGeometry& geometry) {
  if (geometry.kind == Kind::kPointCloud) {
    if (extension_of(file_name) != ".ply") refuse_extension(file_name, ".ply to be a point_cloud");
    PointCloud cloud = parse_ply(bytes, file_name, geometry.stiffness_property);
    scale(cloud.points_m, geometry.unit_m, file_name);
    return std::make_shared<CloudSurface>(cloud);
  }
  if (geometry.kind == Kind::kTetrahedralMesh) {
    TriangleMesh surface = surface_of(parse_tetrahedra(bytes, file_name, geometry.unit_m));
    const std::string complaint = complaint_about(surface);
    if (!complaint.empty()) throw SetupError(file_name + ": its surface: " + complaint);
    return std::make_shared<TriangleSurface>(std::move(surface));
  }
  return std::make_shared<TriangleSurface>(parse_triangles(bytes, file_name, geometry.unit_m));
}

std::shared_ptr<const FileSurface> load_surface(const FileGeometry& geometry) {
  using Key = std::tuple<std::string, std::uintmax_t, std::filesystem::file_time_type, Kind, double,
                         std::string>;
  static std::mutex mutex;
  static std::map<Key, std::weak_ptr<const FileSurface>> loaded;

  std::error_code error;
  const Key key{geometry.file,
                std::filesystem::file_size(geometry.file, error),
                std::filesystem::last_write_time(geometry.file, error),
                geometry.kind,
                geometry.unit_m,
                geometry.stiffness_property};
  const std::scoped_lock lock(mutex);
  if (std::shared_ptr<const FileSurface> known = loaded[key].lock()) return known;
  std::shared_ptr<const FileSurface> surface =
      parse_surface(read_file(geometry.file), geometry.file, geometry);
  loaded[key] = surface;
  return surface;
}

TetrahedralMesh load_tetrahedral_mesh(const FileGeometry& geometry) {
  return parse_tetrahedra(read_file(geometry.file), geometry.file, geometry.unit_m);
}

TriangleMesh load_triangle_mesh(const FileGeometry& geometry) {
  return parse_triangles(read_file(geometry.file), geometry.file, geometry.unit_m);
}

Shape to_shape(const Geometry& geometry) {
  return std::visit(
      [](const auto& given) {
        if constexpr (std::is_same_v<std::decay_t<decltype(given)>, FileGeometry>) {
          return Shape(PlacedSurface{load_surface(given), given.position_m, given.rotation});
        } else {
          return Shape(given);
        }
      },
      geometry);
}

}  // namespace palpate::physics
