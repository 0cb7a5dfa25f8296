// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/triangle_surface.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "common/contact/analytic_surfaces.h"
#include "common/core/random.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

using ::testing::HasSubstr;

constexpr double kEdge_m = 0.02;

TEST(TriangleSurface, OfACubeIsTheBox) {
  const TriangleSurface surface(cube_mesh(kEdge_m));
  const BoxGeometry box{.size_m = Vector3::Constant(kEdge_m)};
  Random random(1);

  SurfaceHint hint;
  for (int i = 0; i < test::place_count(5000); ++i) {
    const Vector3 place =
        0.02 * Vector3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const SurfaceView seen = surface.view(place, hint);
    const SurfaceView truth = view(box, place);
    EXPECT_NEAR(seen.distance_m, truth.distance_m, 1e-15);
    EXPECT_LT((seen.normal - truth.normal).norm(), 1e-9);
    EXPECT_LT((seen.curvature_per_m - truth.curvature_per_m).norm(),
              1e-6 * (1.0 + truth.curvature_per_m.norm()));
  }
}

TEST(TriangleSurface, FindsTheNearestLikeBruteForce) {
  const TriangleMesh mesh = ball_mesh(0.03, 12);
  const TriangleSurface surface(mesh);
  Random random(2);
  for (int i = 0; i < test::place_count(30); ++i) {
    const Vector3 place = random.uniform(0, 0.06) * random.direction();

    // the oracle: each triangle as a surface of its own
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& triangle : mesh.triangles) {
      const TriangleSurface alone({mesh.vertices_m, {triangle}});
      nearest = std::min(nearest, std::abs(alone.view(place).distance_m));
    }
    EXPECT_NEAR(std::abs(surface.view(place).distance_m), nearest, 1e-15);
  }
}

TEST(TriangleSurface, SignsItsDistanceEverywhere) {
  // inscribed in a ball of 30 mm, within 1.1 mm of it
  const TriangleSurface surface(ball_mesh(0.03, 12));
  Random random(3);
  for (int i = 0; i < test::place_count(2000); ++i) {
    const double radius_m = random.uniform(0, 0.06);
    const double distance_m = surface.view(radius_m * random.direction()).distance_m;
    EXPECT_NEAR(distance_m, radius_m - 0.03, 1.2e-3);
  }
  EXPECT_TRUE(surface.is_closed());
}

TEST(TriangleSurface, IsTheSameWithAndWithoutAHint) {
  const TriangleSurface surface(ball_mesh(0.03, 12));
  Random random(4);
  SurfaceHint hint;
  for (int i = 0; i < test::place_count(2000); ++i) {
    const Vector3 place = random.uniform(0, 0.05) * random.direction();
    const SurfaceView warm = surface.view(place, hint);
    const SurfaceView cold = surface.view(place);
    EXPECT_EQ(warm.distance_m, cold.distance_m);
    EXPECT_EQ(warm.normal, cold.normal);
  }
}

TEST(TriangleSurface, HasANormalOnItself) {
  const TriangleSurface surface(cube_mesh(kEdge_m));

  // a corner of three faces: their mean; the middle of a face; what is not a place
  const SurfaceView corner = surface.view(Vector3::Constant(0.5 * kEdge_m));
  EXPECT_EQ(corner.distance_m, 0.0);
  EXPECT_LT((corner.normal - Vector3::Constant(1 / std::sqrt(3.0))).norm(), 1e-9);
  EXPECT_EQ(surface.view({0.5 * kEdge_m, 1e-3, 2e-3}).normal, Vector3(1, 0, 0));
  EXPECT_EQ(surface.view({kNaN, 0, 0}).distance_m, std::numeric_limits<double>::infinity());
}

TEST(TriangleSurface, ViewDoesNotAllocate) {
  const TriangleSurface surface(ball_mesh(0.03, 12));

  const test::AllocGuard guard;
  const double distance_m = surface.view({0.02, 0, 0}).distance_m;

  EXPECT_EQ(guard.count(), 0U);
  EXPECT_LT(distance_m, 0.0);
}

TEST(TriangleMesh, EnclosesItsVolume) {
  EXPECT_NEAR(enclosed_volume_m3(cube_mesh(kEdge_m)), kEdge_m * kEdge_m * kEdge_m, 1e-18);
  EXPECT_EQ(complaint_about(cube_mesh(kEdge_m)), "");
}

TEST(TriangleMesh, ComplaintsNameTheTriangle) {
  TriangleMesh flat = cube_mesh(kEdge_m);
  flat.triangles[4] = {0, 1, 1};
  EXPECT_THAT(complaint_about(flat), HasSubstr("triangle 5: its corners lie on a line"));

  TriangleMesh twice = cube_mesh(kEdge_m);
  twice.triangles.push_back(twice.triangles[0]);
  EXPECT_THAT(complaint_about(twice), HasSubstr("share one edge"));

  TriangleMesh turned = cube_mesh(kEdge_m);
  std::swap(turned.triangles[3][0], turned.triangles[3][1]);
  EXPECT_THAT(complaint_about(turned), HasSubstr("face opposite sides"));

  TriangleMesh inwards = cube_mesh(kEdge_m);
  for (auto& triangle : inwards.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_THAT(complaint_about(inwards), HasSubstr("face inwards"));

  EXPECT_EQ(complaint_about({}), "has no triangles");
}

TEST(TriangleMesh, MayBeOpen) {
  TriangleMesh open = cube_mesh(kEdge_m);
  open.triangles.pop_back();

  EXPECT_EQ(complaint_about(open), "");
  EXPECT_FALSE(TriangleSurface(open).is_closed());
}

}  // namespace
}  // namespace palpate::physics
