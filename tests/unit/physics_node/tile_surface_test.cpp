// A surface that is sent in tiles and evaluated from them, beside the surface itself.
#include "common/contact/tile_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "common/core/random.h"
#include "physics_node/scene/scene_description.h"
#include "tests/support/alloc_guard.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

/// Bounds the error of a vertex: half a step of the lattice per axis.
double lattice_error_m(const DescribedTissue& tissue) {
  return 0.5 * std::sqrt(3.0) * tissue.tiles.front().step_m;
}

class TiledMesh {
 public:
  explicit TiledMesh(TriangleMesh mesh)
      : shape_(PlacedSurface{std::make_shared<TriangleSurface>(std::move(mesh)),
                             Vector3(0.01, -0.02, 0.03),
                             Quaternion(0.5, 0.5, -0.1, 0.7).normalized()}),
        tissue_(described(shape_, {}, {}, {}, 0)),
        held_(tissue_.tiles.size()),
        surface_(held_) {
    surface_.reset(shape_.is_sheet());
    for (std::uint32_t i = 0; i < held_.size(); ++i) {
      held_[i].take(tissue_.tiles[i]);
      surface_.add(i);
    }
    surface_.cover(Vector3::Zero(), 1000.0);
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
  for (int i = 0; i < 2000; ++i) {
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
    ball.surface().cover(point_m + Vector3(0.002, 0.0, 0.0), radius_m);
    SurfaceHint hint;
    static_cast<void>(ball.surface().view(point_m, hint));
    return hint.uncovered_views;
  };
  EXPECT_EQ(uncovered(0.0065), 1u);  // 2 mm + 5 mm
  EXPECT_EQ(uncovered(0.0075), 0u);
}

TEST(TileSurface, WithoutTilesIsInfinitelyFarAndUncovered) {
  std::vector<HeldTile> none;
  TileSurface surface(none);
  surface.reset(false);
  surface.cover(Vector3::Zero(), 1000.0);
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
  ball.surface().reset(false);
  EXPECT_EQ(guard.count(), 0u);
}

}  // namespace
}  // namespace palpate::physics
