// SPDX-License-Identifier: Apache-2.0
// geometry_fuzz.cpp — any bytes as a geometry file: a surface that can be viewed from anywhere,
// or a SetupError; never a crash, a hang or another exception. The first byte selects the format.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "common/core/check.h"
#include "physics_node/files/surface_files.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using palpate::FileGeometry;
  using palpate::Vector3;
  if (size == 0) return 0;
  FileGeometry geometry;
  std::string name;
  switch (data[0]) {
    case 'p':
      name = "fuzz.ply";
      break;
    case 'k':
      name = "fuzz.ply";
      geometry.stiffness_property = "k";
      break;
    case 'o':
      geometry.kind = FileGeometry::Kind::kTriangleSurface;
      name = "fuzz.obj";
      break;
    case 's':
      geometry.kind = FileGeometry::Kind::kTriangleSurface;
      name = "fuzz.stl";
      break;
    case 'm':
      geometry.kind = FileGeometry::Kind::kTetrahedralMesh;
      name = "fuzz.msh";
      break;
    case 'u':
      geometry.kind = FileGeometry::Kind::kTetrahedralMesh;
      name = "fuzz.vtu";
      break;
    default:
      geometry.kind = FileGeometry::Kind::kTetrahedralMesh;
      name = "fuzz.vtk";
  }
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    const auto surface = palpate::physics::parse_surface(bytes, name, geometry);
    const palpate::Bounds bounds = surface->bounds();
    PALPATE_REQUIRE(bounds.lowest_m.allFinite() && bounds.highest_m.allFinite());
    for (const Vector3& place : {Vector3(0, 0, 0), Vector3(bounds.highest_m),
                                 Vector3(0.5 * (bounds.lowest_m + bounds.highest_m)),
                                 Vector3(1e200, -1e200, palpate::kNaN)}) {
      const palpate::SurfaceView seen = surface->view(place);
      PALPATE_REQUIRE(!std::isnan(seen.distance_m) && seen.normal.allFinite() &&
                      seen.curvature_per_m.allFinite() && seen.stiffness_ratio >= 0.0);
    }
  } catch (const palpate::SetupError&) {
    // the expected result of most inputs
  }
  return 0;
}
