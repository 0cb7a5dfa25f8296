// SPDX-License-Identifier: Apache-2.0
// Volume meshes of closed surfaces; where gmsh is not installed, the tests that run it are skipped.
#include "deploy/palpate/volume_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <numbers>
#include <string>

#include "common/core/check.h"
#include "deploy/palpate/organ.h"
#include "deploy/scan/organ_mesh.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class VolumeMeshByGmsh : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v gmsh >/dev/null") != 0) {  // NOLINT: a fixed text
      GTEST_SKIP() << "gmsh is not installed: apt-get install gmsh";
    }
  }
};

/// The surface of a cube with corners at ±half_m.
physics::TriangleMesh cube(double half_m) {
  physics::TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices_m.emplace_back((i & 1) != 0 ? half_m : -half_m, (i & 2) != 0 ? half_m : -half_m,
                                 (i & 4) != 0 ? half_m : -half_m);
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

double volume_m3(const physics::TetrahedralMesh& mesh) {
  double sum = 0.0;
  for (const auto& corners : mesh.tetrahedra) {
    sum += physics::six_volumes_m3(mesh.nodes_m, corners) / 6.0;
  }
  return sum;
}

std::string complaint(const physics::TriangleMesh& surface, double edge_m, double limit_s = 600.0) {
  try {
    static_cast<void>(volume_mesh_of(surface, {.edge_m = edge_m, .limit_s = limit_s}, "cube.stl"));
  } catch (const SetupError& error) {
    return error.what();
  }
  return {};
}

// Faces are flat and edges sharper than 40 degrees stay, so the volume is exact: 0.1³ m³.
TEST_F(VolumeMeshByGmsh, FillsACubeWithEdgesOfTheGivenLength) {
  const physics::TetrahedralMesh coarse = volume_mesh_of(cube(0.05), {.edge_m = 0.02}, "cube.stl");
  const physics::TetrahedralMesh fine = volume_mesh_of(cube(0.05), {.edge_m = 0.01}, "cube.stl");

  EXPECT_NEAR(volume_m3(coarse), 1e-3, 1e-9);
  EXPECT_NEAR(volume_m3(fine), 1e-3, 1e-9);
  // half the edge: eight times as many, more or less for the layers at the surface
  EXPECT_GT(fine.tetrahedra.size(), 5 * coarse.tetrahedra.size());
  EXPECT_LT(fine.tetrahedra.size(), 12 * coarse.tetrahedra.size());
  const physics::TriangleMesh surface = physics::surface_of(fine);
  EXPECT_EQ(physics::complaint_about(surface), "");
  EXPECT_TRUE(physics::TriangleSurface(surface).is_closed());
}

/// The faces of the voxels of 3 mm of a ball of 30 mm radius: a staircase.
physics::TriangleMesh stairs() {
  physics::TriangleMesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> vertex_of;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [entry, is_new] =
        vertex_of.try_emplace(at, static_cast<std::uint32_t>(mesh.vertices_m.size()));
    if (is_new) mesh.vertices_m.emplace_back(0.003 * Vector3(at[0], at[1], at[2]));
    return entry->second;
  };
  const auto is_in = [](const std::array<int, 3>& v) {
    return Vector3(v[0] + 0.5, v[1] + 0.5, v[2] + 0.5).norm() < 10.0;
  };
  for (int i = -11; i <= 11; ++i) {
    for (int j = -11; j <= 11; ++j) {
      for (int k = -11; k <= 11; ++k) {
        if (!is_in({i, j, k})) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          for (const int side : {0, 1}) {
            std::array<int, 3> beside{i, j, k};
            beside[axis] += side == 0 ? -1 : 1;
            if (is_in(beside)) continue;
            std::array<int, 3> a{i, j, k};
            a[axis] += side;
            std::array<int, 3> b = a;
            std::array<int, 3> c = a;
            std::array<int, 3> d = a;
            const std::size_t u = (axis + 1) % 3;
            const std::size_t v = (axis + 2) % 3;
            ++b[u], ++c[u], ++c[v], ++d[v];
            if (side == 0) std::swap(b, d);
            mesh.triangles.push_back({vertex(a), vertex(b), vertex(c)});
            mesh.triangles.push_back({vertex(a), vertex(c), vertex(d)});
          }
        }
      }
    }
  }
  return mesh;
}

TEST(StuffedMesh, FillsStaircasesAndOrgansWithWellShapedTetrahedra) {
  for (const physics::TriangleMesh& surface : {stairs(), physics::surface_of(organ_mesh(3))}) {
    ASSERT_EQ(physics::complaint_about(surface), "");
    const double wanted_m3 = physics::enclosed_volume_m3(surface);

    const physics::TetrahedralMesh mesh = stuffed_mesh_of(surface, 0.004, "organ.stl");

    EXPECT_NEAR(volume_m3(mesh) / wanted_m3, 1.0, 0.02);
    const scan::FaceAngles angles = scan::face_angles_of(mesh);
    // on stairs an edge may cross the surface more than once, and the proof does not hold
    EXPECT_GT(angles.least_rad, 5.0 * std::numbers::pi / 180.0);
    EXPECT_LT(angles.largest_rad, 165.0 * std::numbers::pi / 180.0);
    const physics::TriangleMesh made = physics::surface_of(mesh);
    EXPECT_EQ(physics::complaint_about(made), "");
    EXPECT_TRUE(physics::TriangleSurface(made).is_closed());
  }
}

TEST(StuffedMesh, RefusesOpenSurfacesAndEdgesThatDoNotFit) {
  const auto complaint_of = [](const physics::TriangleMesh& surface, double edge_m) -> std::string {
    try {
      static_cast<void>(stuffed_mesh_of(surface, edge_m, "cube.stl"));
    } catch (const SetupError& error) {
      return error.what();
    }
    return {};
  };
  physics::TriangleMesh open = cube(0.05);
  open.triangles.pop_back();
  EXPECT_THAT(complaint_of(open, 0.01), HasSubstr("the surface is open"));
  EXPECT_THAT(complaint_of(cube(0.05), 1e-4), HasSubstr("more than a million"));
  EXPECT_THAT(complaint_of(cube(0.001), 0.5), HasSubstr("longer than the body is thick"));
}

TEST_F(VolumeMeshByGmsh, KeepsTheGivenTriangles) {
  const physics::TriangleMesh given = physics::surface_of(organ_mesh(2));
  const physics::TetrahedralMesh mesh =
      volume_mesh_of(given, {.edge_m = 0.01, .has_given_surface = true}, "organ.stl");
  const physics::TriangleMesh surface = physics::surface_of(mesh);

  EXPECT_EQ(surface.triangles.size(), given.triangles.size());
  EXPECT_NEAR(volume_m3(mesh), physics::enclosed_volume_m3(given), 1e-10);
}

TEST(VolumeMesh, RefusesAnOpenSurface) {
  physics::TriangleMesh open = cube(0.05);
  open.triangles.pop_back();
  EXPECT_THAT(complaint(open, 0.02), HasSubstr("cube.stl: the surface is open"));
}

// A regular tetrahedron of edge l has l³/(6√2): 0.1³ m³ hold a million of edge (6√2·1e-9)^⅓ m.
TEST(VolumeMesh, RefusesEdgesThatMakeTooManyTetrahedra) {
  const double least_m = std::cbrt(6.0 * std::numbers::sqrt2 * 1e-9);
  EXPECT_THAT(complaint(cube(0.05), 0.99 * least_m),
              HasSubstr("makes more than a million tetrahedra; give at least 0.00204"));
}

/// What is said where $PATH has only timeout(1) and, if it is not empty, this script as gmsh.
std::string complaint_with(const std::string& script, double limit_s) {
  const test::TempFolder folder;
  std::filesystem::create_symlink("/usr/bin/timeout", folder.path() / "timeout");
  if (!script.empty()) {
    std::filesystem::permissions(folder.write("gmsh", script), std::filesystem::perms::owner_all);
  }
  const std::string path = std::getenv("PATH");  // NOLINT: no other thread
  setenv("PATH", folder.path().c_str(), 1);      // NOLINT: no other thread
  std::string said = complaint(cube(0.05), 0.02, limit_s);
  setenv("PATH", path.c_str(), 1);  // NOLINT: no other thread
  return said;
}

TEST(VolumeMesh, SaysHowToGetGmsh) {
  EXPECT_THAT(complaint_with("", 60.0),
              AllOf(HasSubstr("gmsh is not installed"), HasSubstr("apt-get install gmsh")));
}

TEST(VolumeMesh, EndsAGmshThatDoesNotEnd) {
  for (const char* deaf : {"", "trap '' TERM\n"}) {  // this one is killed 5 s later
    EXPECT_THAT(
        complaint_with(std::string("#!/bin/sh\n") + deaf + "while :; do /bin/sleep 1; done\n", 0.2),
        AllOf(HasSubstr("gmsh does not end within 0.2 s"), HasSubstr("try --given-surface")));
  }
}

// One corner of a cube of 0.1 m: three right angles, and between the slanted face and the others
// arccos(1/√3) = 54.7 degrees. Edges 0.1 and 0.1·√2 m, volume 0.1³/6 m³ = 166.7 ml.
TEST(VolumeMesh, ReportsNumberScaleShapeAndVolume) {
  physics::TetrahedralMesh mesh;
  mesh.nodes_m = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0, 0, 0.1}};
  mesh.tetrahedra = {{0, 1, 2, 3}};
  const std::string report = quality_report(mesh, 1e-3 / 6.0);

  EXPECT_THAT(report, HasSubstr("1 tetrahedra, 4 nodes"));
  EXPECT_THAT(report, HasSubstr("diagonal 173 mm, edges 100 to 141 mm"));
  EXPECT_THAT(report, HasSubstr("0 inverted, 0 slivers"));
  EXPECT_THAT(report, HasSubstr("angles between faces 54.7 to 90.0 degrees"));
  EXPECT_THAT(report, HasSubstr("166.7 ml, the surface encloses 166.7 ml"));
  EXPECT_THAT(report, Not(HasSubstr("WARNING")));
}

TEST(VolumeMesh, WarnsOfSliversAndOfAnotherVolume) {
  physics::TetrahedralMesh mesh;
  mesh.nodes_m = {{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0.05, 0.05, 0.001}};
  mesh.tetrahedra = {{0, 1, 2, 3}};
  const std::string report = quality_report(mesh, 2.0 * volume_m3(mesh));

  EXPECT_THAT(report, HasSubstr("1 slivers"));
  EXPECT_THAT(report, HasSubstr("WARNING: slivers"));
  EXPECT_THAT(report, HasSubstr("WARNING: the volume differs"));
}

}  // namespace
}  // namespace palpate
