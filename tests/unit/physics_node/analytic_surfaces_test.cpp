// SPDX-License-Identifier: Apache-2.0
#include "common/contact/analytic_surfaces.h"

#include <gtest/gtest.h>

#include "common/core/random.h"

namespace palpate::physics {
namespace {

// Central differences of the distance (gradient) and of the normal (Hessian) over 2·1 µm. The
// distance of the shapes below is curved by at most 1/5 mm, so the truncation is below 1e-6.
template <class Shape>
void expect_derivatives_match_differences(const Shape& shape, const Vector3& point) {
  constexpr double kStep = 1e-6;
  const SurfaceView surface = view(shape, point);
  for (int axis = 0; axis < 3; ++axis) {
    const SurfaceView ahead = view(shape, point + kStep * Vector3::Unit(axis));
    const SurfaceView behind = view(shape, point - kStep * Vector3::Unit(axis));
    EXPECT_NEAR(surface.normal[axis], (ahead.distance_m - behind.distance_m) / (2 * kStep), 1e-6);
    const Vector3 difference = (ahead.normal - behind.normal) / (2 * kStep);
    EXPECT_LT((surface.curvature_per_m.col(axis) - difference).norm(), 1e-4)
        << "axis " << axis << " of point " << point.transpose();
  }
  EXPECT_NEAR(surface.normal.norm(), 1.0, 1e-12);
  EXPECT_LT((surface.curvature_per_m * surface.normal).norm(), 1e-9);
}

TEST(HalfSpaceView, IsTheSignedDistanceAlongTheNormal) {
  const HalfSpaceGeometry half_space{.point_m = {1, 2, 3}, .normal = {0.6, 0.0, 0.8}};

  // from (1,2,3) to (2,5,4): (1,3,1)·(0.6,0,0.8) = 1.4
  EXPECT_NEAR(view(half_space, {2, 5, 4}).distance_m, 1.4, 1e-15);
  EXPECT_NEAR(view(half_space, {0, 5, 2}).distance_m, -1.4, 1e-15);
  EXPECT_EQ(view(half_space, {0, 5, 2}).normal, Vector3(0.6, 0.0, 0.8));
  EXPECT_EQ(view(half_space, {0, 5, 2}).curvature_per_m, Matrix3(Matrix3::Zero()));
}

TEST(SphereView, IsRadialInsideAndOutside) {
  const SphereGeometry sphere{.center_m = {1, 0, 0}, .radius_m = 2.0};

  // (1,3,4) is 5 from the centre, direction (0, 0.6, 0.8); (1,0,−1.5) is 0.5 inside
  EXPECT_NEAR(view(sphere, {1, 3, 4}).distance_m, 3.0, 1e-15);
  EXPECT_LT((view(sphere, {1, 3, 4}).normal - Vector3(0, 0.6, 0.8)).norm(), 1e-15);
  EXPECT_NEAR(view(sphere, {1, 0, -1.5}).distance_m, -0.5, 1e-15);
  EXPECT_EQ(view(sphere, {1, 0, -1.5}).normal, Vector3(0, 0, -1));
}

TEST(SphereView, IsCurvedByOneOverTheDistanceFromTheCentre) {
  // 5 from the centre along z: 1/5 in x and y, flat in z
  const SurfaceView surface = view(SphereGeometry{.radius_m = 2.0}, {0, 0, 5});

  EXPECT_LT((surface.curvature_per_m - Matrix3(Vector3(0.2, 0.2, 0).asDiagonal())).norm(), 1e-15);
}

TEST(SphereView, PointsUpwardsAtTheCentre) {
  const SphereGeometry sphere{.radius_m = 2.0};

  for (const Vector3& point : {Vector3(0, 0, 0), Vector3(1e-200, 0, 0), Vector3(0, 1e-16, 0)}) {
    const SurfaceView surface = view(sphere, point);
    EXPECT_EQ(surface.distance_m, -2.0);
    EXPECT_EQ(surface.normal, Vector3(0, 0, 1));
    EXPECT_EQ(surface.curvature_per_m, Matrix3(Matrix3::Zero()));
  }
}

TEST(BoxView, IsTheDistanceToAFaceInFrontOfIt) {
  const BoxGeometry box{.center_m = {1, 1, 1}, .size_m = {2, 4, 6}};

  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const Vector3 outwards = side * Vector3::Unit(axis);
      const Vector3 point = box.center_m + outwards * (0.5 * box.size_m[axis] + 0.25);
      EXPECT_NEAR(view(box, point).distance_m, 0.25, 1e-15);
      EXPECT_EQ(view(box, point).normal, outwards);
      EXPECT_EQ(view(box, point).curvature_per_m, Matrix3(Matrix3::Zero()));
    }
  }
}

TEST(BoxView, IsCurvedLikeACylinderAtAnEdge) {
  // half edges 1: (4, −5, 0.5) is beyond x by 3 and beyond −y by 4, so 5 from the edge
  const SurfaceView surface = view(BoxGeometry{.size_m = {2, 2, 2}}, {4, -5, 0.5});

  Matrix3 curvature;  // (diag(1,1,0) − n nᵀ)/5 with n = (0.6, −0.8, 0)
  curvature << 0.128, 0.096, 0, 0.096, 0.072, 0, 0, 0, 0;
  EXPECT_NEAR(surface.distance_m, 5.0, 1e-15);
  EXPECT_LT((surface.normal - Vector3(0.6, -0.8, 0)).norm(), 1e-15);
  EXPECT_LT((surface.curvature_per_m - curvature).norm(), 1e-15);
}

TEST(BoxView, IsCurvedLikeASphereAtACorner) {
  // half edges 1: (2, 3, −3) is beyond by (1, 2, 2), so 3 from the corner
  const SurfaceView surface = view(BoxGeometry{.size_m = {2, 2, 2}}, {2, 3, -3});

  const Vector3 n = Vector3(1, 2, -2) / 3;
  EXPECT_NEAR(surface.distance_m, 3.0, 1e-15);
  EXPECT_LT((surface.normal - n).norm(), 1e-15);
  EXPECT_LT((surface.curvature_per_m - (Matrix3::Identity() - n * n.transpose()) / 3).norm(),
            1e-15);
}

TEST(BoxView, IsTheNearestFaceInside) {
  const BoxGeometry box{.size_m = {2, 4, 6}};

  // (0.2, −1.7, 1) has 0.8 to +x, 0.3 to −y, 2 to +z
  EXPECT_NEAR(view(box, {0.2, -1.7, 1}).distance_m, -0.3, 1e-15);
  EXPECT_EQ(view(box, {0.2, -1.7, 1}).normal, Vector3(0, -1, 0));
}

TEST(BoxView, TakesTheFirstOfEquallyNearFaces) {
  const BoxGeometry cube{.size_m = {2, 2, 2}};

  EXPECT_EQ(view(cube, {0, 0, 0}).normal, Vector3(1, 0, 0));
  EXPECT_EQ(view(cube, {-0.5, 0.5, 0}).normal, Vector3(-1, 0, 0));
  EXPECT_EQ(view(cube, {0, 0.5, -0.5}).normal, Vector3(0, 1, 0));
}

TEST(BoxView, HasANormalOnItsSurfaceEdgesAndCorners) {
  const BoxGeometry cube{.size_m = {2, 2, 2}};

  for (const Vector3& point : {Vector3(1, 0, 0), Vector3(1, 1, 0), Vector3(1, 1, 1),
                               Vector3(std::nextafter(1.0, 2.0), std::nextafter(1.0, 2.0), 1)}) {
    const SurfaceView surface = view(cube, point);
    EXPECT_NEAR(surface.distance_m, 0.0, 1e-15);
    EXPECT_NEAR(surface.normal.norm(), 1.0, 1e-15);
    EXPECT_EQ(surface.curvature_per_m, Matrix3(Matrix3::Zero()));
  }
}

TEST(CapsuleView, IsACylinderBesideItsAxisAndASphereBeyondItsEnds) {
  const CapsuleGeometry capsule{.from_m = {0, 0, 1}, .to_m = {0, 0, 3}, .radius_m = 1};

  // (3,4,2) is 5 from the axis: curved by 1/5 round z, not along it
  const SurfaceView beside = view(capsule, {3, 4, 2});
  EXPECT_NEAR(beside.distance_m, 4.0, 1e-15);
  EXPECT_LT((beside.normal - Vector3(0.6, 0.8, 0)).norm(), 1e-15);
  EXPECT_NEAR(beside.curvature_per_m.trace(), 0.2, 1e-15);
  EXPECT_LT((beside.curvature_per_m * Vector3::UnitZ()).norm(), 1e-15);
  // (0,3,7) is (0,3,4) from the upper end
  const SurfaceView beyond = view(capsule, {0, 3, 7});
  EXPECT_NEAR(beyond.distance_m, 4.0, 1e-15);
  EXPECT_LT((beyond.normal - Vector3(0, 0.6, 0.8)).norm(), 1e-15);
  EXPECT_NEAR(beyond.curvature_per_m.trace(), 0.4, 1e-15);
}

TEST(CapsuleView, HasANormalOnItsAxisAndIsASphereWithoutLength) {
  const SurfaceView on_axis =
      view(CapsuleGeometry{.to_m = {0, 0, 1}, .radius_m = 0.5}, {0, 0, 0.5});
  EXPECT_EQ(on_axis.distance_m, -0.5);
  EXPECT_NEAR(on_axis.normal.norm(), 1.0, 1e-15);
  EXPECT_EQ(on_axis.normal.z(), 0.0);
  EXPECT_NEAR(view(CapsuleGeometry{.radius_m = 2}, {3, 0, 4}).distance_m, 3.0, 1e-15);
}

TEST(GeometryProperty, NormalAndCurvatureAreTheDerivativesOfTheDistance) {
  const BoxGeometry box{.center_m = {0.01, 0.02, 0.03}, .size_m = {0.02, 0.03, 0.05}};
  const SphereGeometry sphere{.center_m = {0.01, 0.02, 0.03}, .radius_m = 0.02};
  const HalfSpaceGeometry half_space{.point_m = {0, 0, 0.01}, .normal = {0.48, 0.6, 0.64}};
  const CapsuleGeometry capsule{
      .from_m = {0.01, 0, 0.01}, .to_m = {-0.02, 0.03, 0.02}, .radius_m = 0.012};
  Random random(1);

  int outside_box = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3 point =
        box.center_m +
        0.06 * Vector3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    expect_derivatives_match_differences(half_space, point);
    if ((point - sphere.center_m).norm() > 0.005) {
      expect_derivatives_match_differences(sphere, point);
    }
    // its curvature jumps where the cylinder meets the half-spheres
    const Vector3 axis = capsule.to_m - capsule.from_m;
    const double along = (point - capsule.from_m).dot(axis) / axis.squaredNorm();
    if (view(capsule, point).distance_m > -0.005 && std::abs(along) > 1e-4 &&
        std::abs(along - 1.0) > 1e-4) {
      expect_derivatives_match_differences(capsule, point);
    }
    // the box's second derivative jumps between the regions of faces, edges and corners, and grows
    // without bound close to edges and corners
    const Vector3 beyond = (point - box.center_m).cwiseAbs() - 0.5 * box.size_m;
    if (beyond.maxCoeff() > 0.005 && beyond.cwiseAbs().minCoeff() > 1e-5) {
      ++outside_box;
      expect_derivatives_match_differences(box, point);
    }
  }
  EXPECT_GT(outside_box, 1000);
}

// Not 1 km, as of a plane: any motion changes the direction to the surface.
TEST(SphereView, IsTrustedLeastAtItsCentre) {
  const SurfaceView centre = view(SphereGeometry{.radius_m = 0.01}, Vector3::Zero());

  EXPECT_EQ(centre.trust_radius_m, kMinTrustRadiusM);
  EXPECT_FALSE(centre.is_plane());
  EXPECT_TRUE(view(HalfSpaceGeometry{}, Vector3::Zero()).is_plane());
}

TEST(Bounds, HoldTheWholeShape) {
  const Bounds sphere = bounds_of(SphereGeometry{.center_m = {1, 2, 3}, .radius_m = 0.5});
  const Bounds box = bounds_of(BoxGeometry{.center_m = {1, 2, 3}, .size_m = {2, 4, 6}});

  const Bounds capsule =
      bounds_of(CapsuleGeometry{.from_m = {1, 2, 3}, .to_m = {0, 4, 3}, .radius_m = 0.5});

  EXPECT_EQ(capsule.lowest_m, Vector3(-0.5, 1.5, 2.5));
  EXPECT_EQ(capsule.highest_m, Vector3(1.5, 4.5, 3.5));
  EXPECT_EQ(sphere.lowest_m, Vector3(0.5, 1.5, 2.5));
  EXPECT_EQ(sphere.highest_m, Vector3(1.5, 2.5, 3.5));
  EXPECT_EQ(box.lowest_m, Vector3(0, 0, 0));
  EXPECT_EQ(box.highest_m, Vector3(2, 4, 6));
}

}  // namespace
}  // namespace palpate::physics
