// SPDX-License-Identifier: Apache-2.0
// Surfaces as they are drawn: on the true surface, closed, seen from outside, not too many
// vertices.
#include "physics_node/display/display_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <numbers>
#include <utility>

#include "common/contact/analytic_surfaces.h"
#include "physics_node/display/file_surface_mesh.h"
#include "physics_node/surfaces/cloud_surface.h"
#include "tests/support/sampled_clouds.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

const DisplayArea kArea{.center_m = Vector3(0.01, 0.02, 0.03), .half_extent_m = 0.1};

Vector3 vertex(const SurfaceMesh& mesh, std::uint32_t index) {
  return {mesh.vertices_m[3 * index], mesh.vertices_m[3 * index + 1],
          mesh.vertices_m[3 * index + 2]};
}

/// By the divergence theorem: positive only if the triangles are seen from outside.
double enclosed_volume_m3(const SurfaceMesh& mesh) {
  double volume = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3) {
    volume +=
        vertex(mesh, mesh.triangles[t])
            .dot(vertex(mesh, mesh.triangles[t + 1]).cross(vertex(mesh, mesh.triangles[t + 2]))) /
        6.0;
  }
  return volume;
}

/// Each edge belongs to two triangles, which run through it in opposite directions.
bool is_closed(const SurfaceMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> uses;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t from = mesh.triangles[t + i];
      const std::uint32_t to = mesh.triangles[t + (i + 1) % 3];
      ++uses[{from, to}];
    }
  }
  return std::all_of(uses.begin(), uses.end(), [&](const auto& use) {
    const auto back = uses.find({use.first.second, use.first.first});
    return back != uses.end() && back->second == use.second;
  });
}

template <class G>
void expect_on_surface(const SurfaceMesh& mesh, const G& geometry) {
  ASSERT_FALSE(mesh.triangles.empty());
  for (std::uint32_t i = 0; i < mesh.vertex_count(); ++i) {
    // float32 of 0.1 m resolves 7e-9 m
    ASSERT_NEAR(view(geometry, vertex(mesh, i)).distance_m, 0.0, 2e-8) << "vertex " << i;
  }
  for (const std::uint32_t index : mesh.triangles) ASSERT_LT(index, mesh.vertex_count());
}

TEST(DisplayMesh, OfABoxIsTheBox) {
  const BoxGeometry box{.center_m = Vector3(0, 0, -0.02), .size_m = Vector3(0.12, 0.1, 0.04)};
  const SurfaceMesh mesh = display_mesh(box, kArea);

  expect_on_surface(mesh, box);
  EXPECT_NEAR(enclosed_volume_m3(mesh), 0.12 * 0.1 * 0.04, 1e-9);
  EXPECT_LT(mesh.vertex_count(), 13'000u);  // 10 000 cells and the edges
}

TEST(DisplayMesh, OfASphereIsAlmostTheSphere) {
  const SphereGeometry sphere{.center_m = Vector3(0.01, 0, 0), .radius_m = 0.05};
  const SurfaceMesh mesh = display_mesh(sphere, kArea);

  expect_on_surface(mesh, sphere);
  // chords of an edge e lie inside: 5 divisions, e = 0.033 r, volume short by about e²/4
  const double volume_m3 = 4.0 / 3.0 * std::numbers::pi * 0.05 * 0.05 * 0.05;
  EXPECT_NEAR(enclosed_volume_m3(mesh), volume_m3, 1e-3 * volume_m3);
  EXPECT_EQ(mesh.vertex_count(), 10'242u);  // 10·4^5 + 2
  EXPECT_EQ(mesh.triangles.size(), 3u * 20'480u);
}

TEST(DisplayMesh, OfASmallSphereIsNotFinerThanADentNeeds) {
  // edges 0.53, 0.26, 0.13, 0.07 of 8 mm: the fourth is below 1 mm; 10·4^4 + 2 vertices
  EXPECT_EQ(display_mesh(SphereGeometry{.radius_m = 0.008}, kArea).vertex_count(), 2562u);
  EXPECT_EQ(display_mesh(SphereGeometry{.radius_m = 1e-4}, kArea).vertex_count(), 12u);
}

TEST(DisplayMesh, OfAHalfSpaceIsASquareWhereTheToolWorks) {
  const HalfSpaceGeometry half_space{.point_m = Vector3(0, 0, -0.01),
                                     .normal = Vector3(1, 2, 3).normalized()};
  const SurfaceMesh mesh = display_mesh(half_space, kArea);

  expect_on_surface(mesh, half_space);
  double area_m2 = 0.0;
  Vector3 middle_m = Vector3::Zero();
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3) {
    const Vector3 a = vertex(mesh, mesh.triangles[t]);
    const Vector3 twice =
        (vertex(mesh, mesh.triangles[t + 1]) - a).cross(vertex(mesh, mesh.triangles[t + 2]) - a);
    ASSERT_GT(twice.dot(half_space.normal), 0.0);
    area_m2 += 0.5 * twice.norm();
  }
  for (std::uint32_t i = 0; i < mesh.vertex_count(); ++i) middle_m += vertex(mesh, i);
  middle_m /= static_cast<double>(mesh.vertex_count());
  EXPECT_NEAR(area_m2, 0.2 * 0.2, 1e-6);
  // the middle is the foot of the area's centre on the plane
  EXPECT_NEAR((kArea.center_m - middle_m).cross(half_space.normal).norm(), 0.0, 1e-6);
}

TEST(DisplayMesh, OfACapsuleIsAlmostTheCapsule) {
  const CapsuleGeometry capsule{
      .from_m = Vector3(0.01, 0, 0), .to_m = Vector3(0.04, 0.04, 0), .radius_m = 0.02};
  const SurfaceMesh mesh = display_mesh(capsule, kArea);

  expect_on_surface(mesh, capsule);
  // a ball and a cylinder of 50 mm, short by half of a square of the angle of a row, ≈ (1/15)²
  const double volume_m3 = std::numbers::pi * 0.02 * 0.02 * (4.0 / 3.0 * 0.02 + 0.05);
  EXPECT_NEAR(enclosed_volume_m3(mesh), volume_m3, 3e-3 * volume_m3);
  EXPECT_TRUE(is_closed(mesh));
  EXPECT_LT(mesh.vertex_count(), 13'000u);

  // both ends at one place: a sphere
  const SurfaceMesh ball = display_mesh(CapsuleGeometry{.radius_m = 0.02}, kArea);
  EXPECT_NEAR(enclosed_volume_m3(ball), 4.0 / 3.0 * std::numbers::pi * 8e-6, 1e-7);
  EXPECT_TRUE(is_closed(ball));
}

// Moved and turned; the points lie on a sphere of 50 mm, 1 mm from each other.
TEST(DisplayMesh, OfAClosedCloudIsAClosedSurface) {
  Random random(1);
  const PlacedSurface ball{
      .surface = std::make_shared<CloudSurface>(
          test::sampled(test::sphere_shape(0.05), 1e-3, 0.0, true, test::Sampling::kEven, random)),
      .position_m = Vector3(0.1, 0, 0),
      .rotation = Quaternion(Eigen::AngleAxisd(1.0, Vector3::UnitX()))};
  const SurfaceMesh mesh = display_mesh(ball, kArea);

  const SphereGeometry truth{.center_m = Vector3(0.1, 0, 0), .radius_m = 0.05};
  for (std::uint32_t i = 0; i < mesh.vertex_count(); ++i) {
    ASSERT_NEAR(view(truth, vertex(mesh, i)).distance_m, 0.0, 1e-5) << "vertex " << i;
  }
  EXPECT_TRUE(is_closed(mesh));
  const double volume_m3 = 4.0 / 3.0 * std::numbers::pi * 0.05 * 0.05 * 0.05;
  EXPECT_NEAR(enclosed_volume_m3(mesh), volume_m3, 2e-3 * volume_m3);
  EXPECT_GT(mesh.vertex_count(), 3'000u);
  EXPECT_LT(mesh.vertex_count(), 15'000u);
}

// No walls are drawn down from the border, where the distance jumps from inside to outside.
TEST(DisplayMesh, OfAnOpenCloudIsThePatch) {
  Random random(1);
  const CloudSurface patch(
      test::sampled(test::plane_shape(0.02), 1e-3, 0.0, true, test::Sampling::kEven, random));
  const SurfaceMesh mesh = display_mesh(patch);

  double area_m2 = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 3) {
    const Vector3 a = vertex(mesh, mesh.triangles[t]);
    area_m2 += 0.5 * (vertex(mesh, mesh.triangles[t + 1]) - a)
                         .cross(vertex(mesh, mesh.triangles[t + 2]) - a)
                         .z();
  }
  for (std::uint32_t i = 0; i < mesh.vertex_count(); ++i) {
    ASSERT_NEAR(vertex(mesh, i).z(), 0.0, 1e-6);
  }
  // 40 mm wide, and up to a reach of 3 mm more on each side
  EXPECT_GT(area_m2, 0.038 * 0.038);
  EXPECT_LT(area_m2, 0.046 * 0.046);
}

TEST(DisplayMesh, OfAMeshIsItself) {
  const TriangleMesh ball = ball_mesh(0.03, 20);
  const SurfaceMesh mesh = display_mesh(TriangleSurface(ball));

  EXPECT_EQ(mesh.vertex_count(), ball.vertices_m.size());
  EXPECT_EQ(mesh.triangles.size(), 3 * ball.triangles.size());
  EXPECT_NEAR(enclosed_volume_m3(mesh), enclosed_volume_m3(ball), 1e-10);
}

// 2·200² + 2 = 80 002 vertices.
TEST(DisplayMesh, OfALargeMeshHasAtMostFiftyThousandVertices) {
  const TriangleMesh ball = ball_mesh(0.03, 200);
  const SurfaceMesh mesh = display_mesh(TriangleSurface(ball));

  EXPECT_LE(mesh.vertex_count(), 50'000u);
  EXPECT_GT(mesh.vertex_count(), 20'000u);
  EXPECT_NEAR(enclosed_volume_m3(mesh), enclosed_volume_m3(ball), 1e-3 * enclosed_volume_m3(ball));
}

TEST(DisplayMesh, StaysSmallAndOnTheWireWhateverTheSize) {
  for (const Vector3& size :
       {Vector3(1e9, 1e9, 1e9), Vector3(1e9, 1e-3, 1e-3), Vector3(1e-6, 1e-6, 1e-6)}) {
    const SurfaceMesh mesh = display_mesh(BoxGeometry{.size_m = size}, kArea);
    EXPECT_LT(mesh.vertex_count(), 15'000u) << size.transpose();
    for (const float x : mesh.vertices_m) ASSERT_LE(std::abs(x), 1000.0F);
  }
}

}  // namespace
}  // namespace palpate::physics
