// SPDX-License-Identifier: Apache-2.0
// A surface or a cloud that is sent in tiles and evaluated from them, beside the surface itself.
#include "common/contact/tiles/tile_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "physics_node/scene/scene_description.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/random_messages.h"
#include "tests/support/sampled_clouds.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

/// Bounds the error of a vertex: half a step of the lattice per axis.
double lattice_error_m(const DescribedTissue& tissue) {
  return 0.5 * std::sqrt(3.0) * tissue.tiles.front().step_m;
}

class Tiled {
 public:
  explicit Tiled(std::shared_ptr<const FileSurface> surface)
      : shape_(PlacedSurface{std::move(surface), Vector3(0.01, -0.02, 0.03),
                             Quaternion(0.5, 0.5, -0.1, 0.7).normalized()}),
        tissue_(described(shape_, {}, {}, {}, 0)),
        held_(tissue_.tiles.size()),
        surface_(held_) {
    surface_.reset(std::get<TiledGeometry>(tissue_.description->geometry));
    for (std::uint32_t i = 0; i < held_.size(); ++i) {
      held_[i].take(tissue_.tiles[i]);
      surface_.add(i);
    }
    surface_.cover({.radius_m = 1000.0});
  }
  [[nodiscard]] const Shape& shape() const { return shape_; }
  [[nodiscard]] const DescribedTissue& tissue() const { return tissue_; }
  [[nodiscard]] TileSurface& surface() { return surface_; }
  std::vector<HeldTile>& held() { return held_; }

 private:
  Shape shape_;
  DescribedTissue tissue_;
  std::vector<HeldTile> held_;
  TileSurface surface_;
};

class TiledMesh : public Tiled {
 public:
  explicit TiledMesh(TriangleMesh mesh)
      : Tiled(std::make_shared<TriangleSurface>(std::move(mesh))) {}
};

Vector3 random_point(Random& random, const Bounds& bounds, double margin_m) {
  Vector3 point;
  for (int i = 0; i < 3; ++i) {
    point[i] = random.uniform(bounds.lowest_m[i] - margin_m, bounds.highest_m[i] + margin_m);
  }
  return point;
}

void expect_same_views(TiledMesh& mesh, std::uint64_t seed, bool has_gather) {
  Random random(seed);
  const double error_m = lattice_error_m(mesh.tissue()) * 2.0;
  SurfaceHint hint;
  SurfaceHint other;
  for (int i = 0; i < test::place_count(2000); ++i) {
    const Vector3 point_m = random_point(random, *mesh.shape().bounds(), 0.01);
    if (has_gather) mesh.surface().gather(point_m);
    const SurfaceView part = mesh.surface().view(point_m, hint);
    const SurfaceView whole = mesh.shape().view(point_m, other);
    ASSERT_NEAR(part.distance_m, whole.distance_m, error_m) << "point " << i;
    // the foot may be on another facet that is as far away, and edges are sharp
    const Vector3 foot_m = point_m - part.distance_m * part.normal;
    ASSERT_LE(std::abs(mesh.shape().view(foot_m).distance_m), error_m) << "point " << i;
  }
  EXPECT_EQ(hint.uncovered_views, 0u);
}

TEST(TileSurface, SeesWhatTheWholeSurfaceSees) {
  TiledMesh ball(ball_mesh(0.03, 12));
  expect_same_views(ball, 1, true);
  TiledMesh cube(cube_mesh(0.05));
  expect_same_views(cube, 2, true);
}

// needles: sharp edges, where the sign depends on the sum of the normals
TEST(TileSurface, HasTheSignOfTheWholeSurfaceAtSharpEdges) {
  TiledMesh blade(bar_mesh({{0.0, 0.0}, {0.03, 0.002}, {0.03, -0.002}}, 0.05));
  expect_same_views(blade, 3, true);
}

TEST(TileSurface, NeedsNoGathering) {
  TiledMesh ball(ball_mesh(0.03, 12));
  expect_same_views(ball, 4, false);
}

TEST(TileSurface, KeepsTheSheetASheet) {
  TiledMesh sheet(sheet_mesh(0.03, 8));
  EXPECT_TRUE(sheet.surface().is_sheet());
  expect_same_views(sheet, 5, true);
}

TEST(TileSurface, EveryFacetIsInOneTile) {
  TiledMesh ball(ball_mesh(0.03, 20));
  std::size_t facets = 0;
  for (const SurfaceTile& tile : ball.tissue().tiles) {
    EXPECT_LE(tile.vertex_count, kMaxTileVertices);
    EXPECT_GE(tile.facet_count, 1u);
    facets += tile.facet_count;
  }
  EXPECT_EQ(facets, ball_mesh(0.03, 20).triangles.size());
}

// within the coverage no unknown facet can be nearer than the foot; beyond, one may be
TEST(TileSurface, CountsViewsThatAnUnknownTileMayChange) {
  TiledMesh ball(ball_mesh(0.03, 12));
  const Vector3 center_m = ball.shape().bounds()->center_m();
  const Vector3 point_m = center_m + Vector3(0.0, 0.0, 0.035);  // 5 mm off
  const auto uncovered = [&](double radius_m) {
    const Vector3 beside_m = point_m + Vector3(0.002, 0.0, 0.0);
    ball.surface().cover({.from_m = beside_m, .to_m = beside_m, .radius_m = radius_m});
    SurfaceHint hint;
    static_cast<void>(ball.surface().view(point_m, hint));
    return hint.uncovered_views;
  };
  EXPECT_EQ(uncovered(0.0065), 1u);  // 2 mm + 5 mm
  EXPECT_EQ(uncovered(0.0075), 0u);
}

// along a shaft: as far from the line as from a point
TEST(TileSurface, IsCoveredAlongALine) {
  TiledMesh ball(ball_mesh(0.03, 12));
  const Vector3 center_m = ball.shape().bounds()->center_m();
  const Vector3 point_m = center_m + Vector3(0.0, 0.0, 0.035);
  const Vector3 along_m(0.05, 0.0, 0.0);
  ball.surface().cover({.from_m = point_m - along_m, .to_m = point_m + along_m, .radius_m = 0.01});
  EXPECT_NEAR(ball.surface().unknown_m(point_m + Vector3(0.04, 0.003, 0.0)), 0.007, 1e-12);
  EXPECT_NEAR(ball.surface().unknown_m(point_m + Vector3(0.07, 0.0, 0.0)), -0.01, 1e-12);
  SurfaceHint hint;
  static_cast<void>(ball.surface().view(point_m, hint));
  EXPECT_EQ(hint.uncovered_views, 0u);
}

// tiles come and go without a new look at all of them
TEST(TileSurface, SeesTilesThatArriveAfterGathering) {
  TiledMesh ball(ball_mesh(0.03, 20));
  TileSurface& surface = ball.surface();
  const Vector3 center_m = ball.shape().bounds()->center_m();
  const auto place = [&](std::size_t i) {
    return Vector3(center_m + Vector3(0.0, 0.0, i == 0 ? 0.034 : -0.034));
  };
  const auto count = static_cast<std::uint32_t>(ball.held().size());
  for (std::uint32_t i = 0; i < count; ++i) surface.remove(i);
  Random random(9);
  for (std::uint32_t i = 0; i < count; ++i) {
    surface.add(i);
    surface.gather(place(0), 0);
    surface.gather(place(1), 1);
  }
  for (std::uint32_t i = 0; i < count; i += 2) {  // and again
    surface.remove(i);
    surface.add(i);
  }
  const double error_m = 2.0 * lattice_error_m(ball.tissue());
  SurfaceHint hint;
  for (int i = 0; i < 500; ++i) {
    const Vector3 point_m = place(random.below(2)) + random.uniform(0.0, 0.01) * random.direction();
    ASSERT_NEAR(surface.view(point_m).distance_m, ball.shape().view(point_m).distance_m, error_m);
    ASSERT_LE(surface.known_at_least_m(point_m, hint), std::abs(surface.view(point_m).distance_m));
  }
}

// of 32 facets each; a tile that spans distant parts of the surface would be nearly everywhere
TEST(TileSurface, TilesAreCompact) {
  const TiledMesh ball(ball_mesh(0.05, 40));
  const double all_m = ball.shape().bounds()->longest_side_m();
  ASSERT_LE(ball.tissue().tiles.size(), ball_mesh(0.05, 40).triangles.size() / 32 + 30);
  for (const Bounds& bounds : ball.tissue().bounds) {
    EXPECT_LT(bounds.longest_side_m(), 0.3 * all_m);
  }
}

// 128 tiles may be examined for a view; more are only found where somebody wants to cost time
TEST(TileSurface, ManyTilesInOnePlaceAreNotAllExamined) {
  const TiledMesh one(cube_mesh(0.02));
  ASSERT_EQ(one.tissue().tiles.size(), 1u);
  std::vector<HeldTile> heap(200);
  TileSurface surface(heap);
  surface.reset({});
  surface.cover({.radius_m = 1000.0});
  for (std::uint32_t i = 0; i < heap.size(); ++i) {
    heap[i].take(one.tissue().tiles[0]);
    surface.add(i);
  }
  const Vector3 center_m = one.shape().bounds()->center_m();
  surface.gather(center_m);
  SurfaceHint hint;
  EXPECT_TRUE(std::isinf(surface.view(center_m, hint).distance_m));
  EXPECT_EQ(hint.uncovered_views, 1u);
}

// what a view looks at is counted; a limit ends it, and it is then uncovered
TEST(TileSurface, AViewEndsWhenItsWorkIsUsedUp) {
  TiledMesh ball(ball_mesh(0.03, 20));
  const Vector3 center_m = ball.shape().bounds()->center_m();
  for (const bool has_gather : {false, true}) {
    if (has_gather) ball.surface().gather(center_m + Vector3(0.0, 0.0, 0.03));
    SurfaceHint free;
    const SurfaceView whole = ball.surface().view(center_m + Vector3(0.0, 0.0, 0.031), free);
    ASSERT_GT(free.work, 0u);
    SurfaceHint enough{.most_work = free.work};
    const SurfaceView same = ball.surface().view(center_m + Vector3(0.0, 0.0, 0.031), enough);
    EXPECT_EQ(same.distance_m, whole.distance_m);
    EXPECT_FALSE(enough.is_exhausted());
    EXPECT_EQ(enough.uncovered_views, 0u);
    SurfaceHint less{.most_work = free.work / 2};
    (void)ball.surface().view(center_m + Vector3(0.0, 0.0, 0.031), less);
    EXPECT_TRUE(less.is_exhausted());
    EXPECT_EQ(less.uncovered_views, 1u);
    // not more than one tile later
    EXPECT_LE(less.work, less.most_work + 32 * kMaxTileFacets);
  }
}

// what is farther away than what may be missing is not looked for where nobody would use it
TEST(TileSurface, AViewOfOnlyWhatIsCoveredEndsWhereNothingIs) {
  TiledMesh ball(ball_mesh(0.03, 90));
  const Vector3 center_m = ball.shape().bounds()->center_m();
  const Vector3 point_m = center_m + Vector3(0.0, 0.0, 0.036);  // 6 mm off
  const auto look = [&](double covered_m, bool only_covered) {
    ball.surface().cover({.from_m = point_m, .to_m = point_m, .radius_m = covered_m});
    SurfaceHint hint{.only_covered = only_covered};
    return std::pair(ball.surface().view(point_m, hint), hint);
  };
  const auto [whole, free] = look(0.007, false);
  const auto [same, covered] = look(0.007, true);
  EXPECT_EQ(same.distance_m, whole.distance_m);
  EXPECT_EQ(same.normal, whole.normal);
  EXPECT_EQ(covered.uncovered_views, 0u);

  for (const double covered_m : {0.005, 0.0, -0.01}) {
    EXPECT_EQ(look(covered_m, false).first.distance_m, whole.distance_m);
    const auto [nothing, uncovered] = look(covered_m, true);
    EXPECT_TRUE(std::isinf(nothing.distance_m));
    EXPECT_EQ(uncovered.uncovered_views, 1u);
    EXPECT_LT(uncovered.work, free.work);
  }
}

// --- clouds -------------------------------------------------------------------------------------

class TiledCloud : public Tiled {
 public:
  explicit TiledCloud(const PointCloud& cloud) : Tiled(std::make_shared<CloudSurface>(cloud)) {}
};

PointCloud sampled_sphere(double radius_m) {
  Random random(1);
  PointCloud cloud = test::sampled(test::sphere_shape(radius_m), 1.5e-3, 1e-4, true,
                                   test::Sampling::kRandom, random);
  for (const Vector3& point_m : cloud.points_m) {
    cloud.stiffness_ratios.push_back(1.0 + 20.0 * std::abs(point_m.x()));
  }
  return cloud;
}

// what differs is the rounding of the points: 1.5 µm of place and 2e-5 of the normal
TEST(TiledCloud, IsSeenAsTheWholeCloudIs) {
  for (const bool has_gather : {true, false}) {
    constexpr double kRadius = 0.03;
    TiledCloud cloud(sampled_sphere(kRadius));
    const Vector3 center_m = cloud.shape().bounds()->center_m();
    Random random(2);
    SurfaceHint hint;
    SurfaceHint other;
    for (std::uint64_t i = 0; i < test::seed_count(2000); ++i) {
      const Vector3 outwards = test::random_vector(random, 1.0).normalized();
      const Vector3 point_m = center_m + random.uniform(0.8, 1.2) * kRadius * outwards;
      if (has_gather) cloud.surface().gather(point_m);
      const SurfaceView part = cloud.surface().view(point_m, hint);
      const SurfaceView whole = cloud.shape().view(point_m, other);
      ASSERT_NEAR(part.distance_m, whole.distance_m, 5e-6) << "point " << i;
      ASSERT_LT((part.normal - whole.normal).norm(), 1e-3) << "point " << i;
      ASSERT_NEAR(part.stiffness_ratio, whole.stiffness_ratio, 1e-3) << "point " << i;
    }
    EXPECT_EQ(hint.uncovered_views, 0u);
  }
}

TEST(TiledCloud, CountsViewsThatAnUnknownTileMayChange) {
  TiledCloud cloud(sampled_sphere(0.03));
  const Vector3 point_m = cloud.shape().bounds()->center_m() + Vector3(0.0, 0.0, 0.031);
  const auto uncovered_around = [&](const Vector3& gap_m) {
    cloud.surface().cover({.radius_m = 1000.0});
    cloud.surface().except(gap_m, 0.008);
    cloud.surface().gather(point_m);
    SurfaceHint hint;
    static_cast<void>(cloud.surface().view(point_m, hint));
    return hint.uncovered_views;
  };
  EXPECT_EQ(uncovered_around(point_m + Vector3(0.007, 0.0, 0.0)), 1u);
  EXPECT_EQ(uncovered_around(point_m + Vector3(0.02, 0.0, 0.0)), 0u);
}

TEST(TiledCloud, ViewsDoNotAllocate) {
  TiledCloud cloud(sampled_sphere(0.03));
  Random random(3);
  const Bounds bounds = *cloud.shape().bounds();
  const test::AllocGuard guard;
  SurfaceHint hint;
  for (int i = 0; i < 200; ++i) {
    const Vector3 point_m = random_point(random, bounds, 0.01);
    cloud.surface().gather(point_m);
    static_cast<void>(cloud.surface().view(point_m, hint));
  }
  EXPECT_EQ(guard.count(), 0u);
}

TEST(TileSurface, WithoutTilesIsInfinitelyFarAndUncovered) {
  std::vector<HeldTile> none;
  TileSurface surface(none);
  surface.reset({});
  surface.cover({.radius_m = 1000.0});
  surface.gather(Vector3::Zero());
  SurfaceHint hint;
  EXPECT_TRUE(std::isinf(surface.view(Vector3::Zero(), hint).distance_m));
  EXPECT_EQ(hint.uncovered_views, 1u);
}

TEST(TileSurface, NeverAllocatesAfterItsConstruction) {
  TiledMesh ball(ball_mesh(0.03, 12));
  Random random(6);
  const Bounds bounds = *ball.shape().bounds();
  const test::AllocGuard guard;
  SurfaceHint hint;
  for (int i = 0; i < 200; ++i) {
    const Vector3 point_m = random_point(random, bounds, 0.01);
    ball.surface().gather(point_m);
    static_cast<void>(ball.surface().view(point_m, hint));
    const auto slot = static_cast<std::uint32_t>(random.below(ball.held().size()));
    ball.surface().remove(slot);
    ball.held()[slot].take(ball.tissue().tiles[slot]);
    ball.surface().add(slot);
  }
  ball.surface().reset({});
  EXPECT_EQ(guard.count(), 0u);
}

}  // namespace
}  // namespace palpate::physics
