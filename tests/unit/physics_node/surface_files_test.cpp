// SPDX-License-Identifier: Apache-2.0
// Surfaces from files: sharing, units, placing, and two real livers where available.
#include "physics_node/files/surface_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "common/core/check.h"
#include "physics_node/files/ply.h"
#include "physics_node/files/tetrahedral_files.h"
#include "physics_node/scene/scene.h"
#include "tests/support/machine/places.h"
#include "tests/support/sampled_clouds.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/physics_node/random_scene.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

using ::testing::HasSubstr;
using Kind = FileGeometry::Kind;

std::string complaint(const FileGeometry& geometry) {
  try {
    static_cast<void>(load_surface(geometry));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "none";
}

TEST(SurfaceFiles, AreSharedWhileInUse) {
  const test::TempFolder folder;
  const FileGeometry cube{.kind = Kind::kTetrahedralMesh,
                          .file = folder.write("cube.msh", msh_text(cube_of_tetrahedra(0.1)))};
  FileGeometry larger = cube;
  larger.unit_m = 2.0;

  const auto first = load_surface(cube);
  EXPECT_EQ(load_surface(cube), first);
  EXPECT_NE(load_surface(larger), first);

  // two tissues in two scenes, one surface
  FileGeometry moved = cube;
  moved.position_m = {1, 0, 0};
  EXPECT_EQ(to_shape(cube).file_surface(), first.get());
  EXPECT_EQ(to_shape(moved).file_surface(), first.get());
}

TEST(SurfaceFiles, ScaleTurnAndMove) {
  const test::TempFolder folder;
  // a cube of 100 in mm, turned 45° about z, its middle at (1, 2, 3)
  const Shape shape = to_shape(FileGeometry{
      .kind = Kind::kTetrahedralMesh,
      .file = folder.write("cube.msh", msh_text(cube_of_tetrahedra(100))),
      .unit_m = 0.001,
      .position_m = {1, 2, 3},
      .rotation = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 4, Vector3::UnitZ()))});
  const double s = std::sqrt(0.5);

  // 10 mm out of the face that looked along x and now looks along (1, 1, 0)/√2
  const SurfaceView face = shape.view(Vector3(1, 2, 3) + 0.06 * Vector3(s, s, 0));
  EXPECT_NEAR(face.distance_m, 0.01, 1e-12);
  EXPECT_LT((face.normal - Vector3(s, s, 0)).norm(), 1e-12);

  // 30 mm beyond the vertical edge that now looks along x: curved by 1/30 mm in y
  const SurfaceView edge = shape.view({1.03 + 0.1 * s, 2, 3});
  EXPECT_NEAR(edge.distance_m, 0.03, 1e-12);
  EXPECT_NEAR(edge.curvature_per_m(1, 1), 1 / 0.03, 1e-9);
  EXPECT_NEAR(edge.curvature_per_m.norm(), 1 / 0.03, 1e-9);

  const std::optional<Bounds> bounds = shape.bounds();
  ASSERT_TRUE(bounds);
  EXPECT_LT((bounds->highest_m - Vector3(1 + 0.1 * s, 2 + 0.1 * s, 3.05)).norm(), 1e-12);
}

TEST(SurfaceFiles, AreTissueLikeAnyOther) {
  const test::TempFolder folder;
  Random random(1);
  const PointCloud cloud =
      test::sampled(test::sphere_shape(0.05), 1e-3, 0.0, true, test::Sampling::kEven, random);
  SceneConfig config;
  config.tip_radius_m = 0.003;
  config.tissues.push_back(
      {.name = "ball",
       .geometry = FileGeometry{.file = folder.write("ball.ply", ply_text(cloud))},
       .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 500}});
  const Scene scene(config);

  // the tip of 3 mm reaches 2 mm deep: 500 · 0.002 = 1 N
  EXPECT_NEAR(scene.evaluate({0.051, 0, 0}, Vector3::Zero()).force_on_tool_newton.x(), 1.0, 1e-3);
  EXPECT_EQ(scene.evaluate({0.2, 0, 0}, Vector3::Zero()).contact_count, 0U);
  EXPECT_EQ(scene.evaluate({0.2, 0, 0}, Vector3::Zero()).tissues_skipped, 1U);
}

// A scene pays for a cloud where the tool is near it, and one without clouds never.
TEST(SurfaceFiles, TouchNoOctreeWhereThereIsNoCloud) {
  const test::TempFolder folder;
  Random random(1);
  const PointCloud cloud =
      test::sampled(test::sphere_shape(0.05), 2e-3, 0.0, true, test::Sampling::kEven, random);
  SceneConfig config = random_scene(random, 20);
  config.tissues.push_back(
      {.name = "cube",
       .geometry =
           FileGeometry{.kind = Kind::kTetrahedralMesh,
                        .file = folder.write("cube.msh", msh_text(cube_of_tetrahedra(0.1)))},
       .material = KelvinVoigtMaterial{}});
  const Scene without(config);
  config.tissues.push_back(
      {.name = "ball",
       .geometry = FileGeometry{.file = folder.write("ball.ply", ply_text(cloud))},
       .material = KelvinVoigtMaterial{}});
  const Scene with(config);

  for (int i = 0; i < 1000; ++i) {
    const Vector3 x = random_in_cube(random, 0.1);
    const SceneForce force = without.evaluate(x, Vector3::Zero());
    EXPECT_EQ(force.octree_cells_visited, 0U);
    EXPECT_EQ(force.tissues_visited + force.tissues_skipped, 21U);
  }
  EXPECT_GT(with.evaluate({0.05, 0, 0}, Vector3::Zero()).octree_cells_visited, 0U);
  EXPECT_EQ(with.evaluate({0.2, 0, 0}, Vector3::Zero()).octree_cells_visited, 0U);
}

// Two of three share a file. Along a path the nearest point is mostly in the cell of the last one.
TEST(SurfaceFiles, AreSearchedFromTheLastCellOn) {
  const test::TempFolder folder;
  Random random(1);
  const PointCloud cloud =
      test::sampled(test::sphere_shape(0.05), 1e-3, 0.0, true, test::Sampling::kEven, random);
  const FileGeometry ball{.file = folder.write("ball.ply", ply_text(cloud))};
  FileGeometry far = ball;
  far.position_m = {1, 0, 0};
  const Scene scene({.tip_radius_m = 0.003,
                     .tissues = {{.name = "a", .geometry = ball, .material = KelvinVoigtMaterial{}},
                                 {.name = "b", .geometry = far, .material = KelvinVoigtMaterial{}},
                                 {.name = "c",
                                  .geometry = SphereGeometry{.center_m = {0, 1, 0}},
                                  .material = KelvinVoigtMaterial{}}}});
  EXPECT_EQ(scene.shared_surface_count(), 1U);

  TissueMemory memory = scene.new_memory();
  std::uint32_t hits = 0;
  for (int i = 0; i < 100; ++i) {
    const Vector3 x(1e-5 * i, 0, 0.052);
    hits += scene.step(memory, x, Vector3::Zero(), 1e-3 * i).octree_last_cell_hits;
  }
  EXPECT_GT(hits, 150U);  // of two views a step
  EXPECT_LE(hits, 300U);
}

TEST(SurfaceFiles, ReportWhatTheyCannotUse) {
  const test::TempFolder folder;
  const auto file = [&](const char* name, double edge) {
    return folder.write(name, msh_text(cube_of_tetrahedra(edge)));
  };
  EXPECT_THAT(complaint({.kind = Kind::kPointCloud, .file = folder.path() / "none.ply"}),
              HasSubstr("none.ply: no such file"));
  EXPECT_THAT(complaint({.kind = Kind::kTetrahedralMesh, .file = file("far.msh", 10000)}),
              HasSubstr("is 10000.000000 m large: must be 0.0001 … 5 m; give its unit_m"));
  EXPECT_THAT(complaint({.kind = Kind::kTetrahedralMesh, .file = file("cube.ply", 0.1)}),
              HasSubstr("must end with .msh"));
  EXPECT_THAT(complaint({.kind = Kind::kPointCloud, .file = file("cube.msh", 0.1)}),
              HasSubstr("must end with .ply"));
  EXPECT_THAT(complaint({.kind = Kind::kTriangleSurface, .file = file("cube.msh", 0.1)}),
              HasSubstr("must end with .obj or .stl"));
}

TEST(SurfaceFiles, ReadRealLivers) {
  const char* const folder_name = std::getenv("PALPATE_LIVER_DATA");
  const std::filesystem::path folder =
      folder_name != nullptr ? folder_name : test::source_dir() + "/../shared/data/liver";
  if (!std::filesystem::exists(folder)) {
    GTEST_SKIP() << folder
                 << " is absent: no liver meshes to try; PALPATE_LIVER_DATA names another";
  }
  // their unit is unknown; the first is 6.5 wide, a liver some 0.2 m
  for (const auto& [name, unit_m, tetrahedra] :
       {std::tuple{"liver_181n_596t.msh", 0.03, 596U}, {"liver2_507n_1493t.msh", 0.1, 1493U}}) {
    SCOPED_TRACE(name);
    const FileGeometry geometry{
        .kind = Kind::kTetrahedralMesh, .file = folder / name, .unit_m = unit_m};
    const TetrahedralMesh mesh = load_tetrahedral_mesh(geometry);
    const auto surface = load_surface(geometry);

    EXPECT_EQ(mesh.tetrahedra.size(), tetrahedra);
    // the middle of a tetrahedron is inside
    for (const auto& corners : mesh.tetrahedra) {
      Vector3 middle = Vector3::Zero();
      for (const std::uint32_t corner : corners) middle += 0.25 * mesh.nodes_m[corner];
      EXPECT_LT(surface->view(middle).distance_m, 0.0);
    }
    EXPECT_GT(surface->view({1, 1, 1}).distance_m, 0.0);
  }
}

}  // namespace
}  // namespace palpate::physics
