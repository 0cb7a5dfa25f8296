// SPDX-License-Identifier: Apache-2.0
// The surface of a cloud against the shapes it was sampled from.
#include "physics_node/surfaces/cloud_surface.h"

#include <gtest/gtest.h>

#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/sampled_clouds.h"

namespace palpate::physics {
namespace {

using test::Sampling;

constexpr double kDepth_m = 3e-3;
constexpr double kDegree = std::numbers::pi / 180.0;

struct Errors {
  double distance_rms_m = 0.0;
  double normal_rms_rad = 0.0;
  double curvature_rms_ratio = 0.0;
};

/// Of the view from random places, from the surface to `depth_m` below it.
Errors errors_of(const CloudSurface& surface, const test::Shape& shape, double depth_m,
                 Random& random) {
  Errors sum;
  double curvature = 0.0;
  int count = 0;
  SurfaceHint hint;
  while (count < static_cast<int>(test::seed_count(2000))) {
    const Vector3 on_surface = shape.point(random.uniform(), random.uniform());
    if (!shape.is_inside_border(on_surface)) continue;
    ++count;
    const Vector3 place = on_surface - random.uniform(0, depth_m) * shape.view(on_surface).normal;
    const SurfaceView truth = shape.view(place);
    const SurfaceView seen = surface.view(place, hint);
    sum.distance_rms_m += std::pow(seen.distance_m - truth.distance_m, 2);
    sum.normal_rms_rad += std::pow(std::acos(std::min(1.0, seen.normal.dot(truth.normal))), 2);
    sum.curvature_rms_ratio += (seen.curvature_per_m - truth.curvature_per_m).squaredNorm();
    curvature += truth.curvature_per_m.squaredNorm();
  }
  return {std::sqrt(sum.distance_rms_m / count), std::sqrt(sum.normal_rms_rad / count),
          std::sqrt(sum.curvature_rms_ratio / curvature)};
}

// Force is stiffness times depth, so 1 % of the 3 mm force is 30 µm of distance.
TEST(CloudSurface, IsTheSphereItWasSampledFrom) {
  const test::Shape sphere = test::sphere_shape(0.03);
  for (const Sampling sampling : {Sampling::kEven, Sampling::kRandom}) {
    for (const bool has_normals : {true, false}) {
      Random random(1);
      const CloudSurface surface(test::sampled(sphere, 1e-3, 0.0, has_normals, sampling, random));
      const Errors errors = errors_of(surface, sphere, kDepth_m, random);

      EXPECT_LT(errors.distance_rms_m, 0.001 * kDepth_m);
      EXPECT_LT(errors.normal_rms_rad, 0.02 * kDegree);
      EXPECT_LT(errors.curvature_rms_ratio, 0.01);
    }
  }
}

TEST(CloudSurface, EvensOutNoiseOfATenthOfTheSpacing) {
  const test::Shape sphere = test::sphere_shape(0.03);
  for (const Sampling sampling : {Sampling::kEven, Sampling::kRandom}) {
    for (const bool has_normals : {true, false}) {
      Random random(2);
      const CloudSurface surface(test::sampled(sphere, 1e-3, 1e-4, has_normals, sampling, random));
      const Errors errors = errors_of(surface, sphere, kDepth_m, random);

      EXPECT_LT(errors.distance_rms_m, 0.015 * kDepth_m);
      EXPECT_LT(errors.normal_rms_rad, 1.8 * kDegree);
    }
  }
}

TEST(CloudSurface, FollowsSurfacesThatAreNotRound) {
  for (const test::Shape& shape :
       {test::plane_shape(0.03), test::torus_shape(0.03, 0.015), test::saddle_shape(0.1, 0.03)}) {
    SCOPED_TRACE(shape.name);
    Random random(3);
    const CloudSurface surface(test::sampled(shape, 1e-3, 0.0, true, Sampling::kEven, random));
    const Errors errors = errors_of(surface, shape, kDepth_m, random);

    EXPECT_LT(errors.distance_rms_m, 0.002 * kDepth_m);
    EXPECT_LT(errors.normal_rms_rad, 0.05 * kDegree);
    if (shape.name != "plane") {
      EXPECT_LT(errors.curvature_rms_ratio, 0.02);
    }
  }
}

// A plane through the points of a cap of radius h lies h²/4R below its top: 45 µm for the 3 mm of
// the reach on a sphere of 50 mm. The quadrics have no such bias.
TEST(CloudSurface, DoesNotSinkIntoACurvedSurface) {
  const test::Shape sphere = test::sphere_shape(0.05);
  Random random(4);
  const CloudSurface surface(test::sampled(sphere, 1e-3, 0.0, true, Sampling::kEven, random));

  double mean_m = 0.0;
  for (int i = 0; i < 500; ++i) {
    mean_m += surface.view(0.05 * random.direction()).distance_m / 500;
  }
  EXPECT_LT(std::abs(mean_m), 1e-6);
}

TEST(CloudSurface, SeesFarPlacesFromInsideAndOutside) {
  const test::Shape sphere = test::sphere_shape(0.05);
  Random random(5);
  const CloudSurface surface(test::sampled(sphere, 1e-3, 0.0, true, Sampling::kEven, random));

  for (int i = 0; i < 300; ++i) {
    // not the very centre: every direction leads out there
    const Vector3 place = random.uniform(0.005, 0.5) * random.direction();
    const SurfaceView seen = surface.view(place);
    const SurfaceView truth = sphere.view(place);
    EXPECT_NEAR(seen.distance_m, truth.distance_m, 1e-3 * std::abs(truth.distance_m) + 1e-6);
    EXPECT_GT(seen.normal.dot(truth.normal), std::cos(5 * kDegree)) << place.norm();
  }
}

TEST(CloudSurface, NormalIsTheGradientOfTheDistance) {
  const test::Shape torus = test::torus_shape(0.03, 0.015);
  for (const double noise_m : {0.0, 1e-4}) {
    Random random(6);
    const CloudSurface surface(test::sampled(torus, 1e-3, noise_m, true, Sampling::kEven, random));
    for (int i = 0; i < 500; ++i) {
      const Vector3 on_surface = torus.point(random.uniform(), random.uniform());
      const Vector3 place =
          on_surface + random.uniform(-3e-3, 3e-3) * torus.view(on_surface).normal;
      const SurfaceView seen = surface.view(place);
      constexpr double kStep = 1e-5;
      for (int axis = 0; axis < 3; ++axis) {
        const Vector3 step = kStep * Vector3::Unit(axis);
        const double slope =
            (surface.view(place + step).distance_m - surface.view(place - step).distance_m) /
            (2 * kStep);
        // the foot is found to a hundredth of the reach
        EXPECT_NEAR(seen.normal[axis], slope, 2e-3);
      }
      EXPECT_NEAR(seen.normal.norm(), 1.0, 1e-12);
      EXPECT_LT((seen.curvature_per_m * seen.normal).norm(), 1e-9);
    }
  }
}

TEST(CloudSurface, DistanceAndNormalDoNotJumpAlongAPath) {
  const test::Shape sphere = test::sphere_shape(0.05);
  Random random(7);
  const CloudSurface surface(test::sampled(sphere, 1e-3, 1e-4, true, Sampling::kRandom, random));

  // 2 µm a step, 2 mm deep: along the surface the normal may turn by 2e-6/48e-3 and as much again
  // as the noise bends it (curvature up to 1/reach = 330 /m: 7e-4)
  SurfaceView last = surface.view({0.048, 0, 0});
  for (int i = 1; i < test::place_count(5000); ++i) {
    const double angle = i * 2e-6 / 0.048;
    const SurfaceView now = surface.view(0.048 * Vector3(std::cos(angle), std::sin(angle), 0));
    EXPECT_LT(std::abs(now.distance_m - last.distance_m), 1e-6);
    EXPECT_LT((now.normal - last.normal).norm(), 2e-3);
    last = now;
  }
}

TEST(CloudSurface, TheHintDoesNotChangeTheView) {
  const test::Shape sphere = test::sphere_shape(0.02);
  Random random(8);
  const CloudSurface surface(test::sampled(sphere, 1e-3, 1e-4, true, Sampling::kRandom, random));

  SurfaceHint hint;
  for (int i = 0; i < test::place_count(1000); ++i) {
    const Vector3 place = random.uniform(0, 0.2) * random.direction();
    const SurfaceView warm = surface.view(place, hint);
    const SurfaceView cold = surface.view(place);
    EXPECT_EQ(warm.distance_m, cold.distance_m);
    EXPECT_EQ(warm.normal, cold.normal);
    EXPECT_EQ(warm.curvature_per_m, cold.curvature_per_m);
  }
}

TEST(CloudSurface, KeepsTheSidesOfAThinSheetApart) {
  // two planes 0.4 mm apart, sampled at 1 mm, facing away from each other
  Random random(9);
  PointCloud cloud =
      test::sampled(test::plane_shape(0.02), 1e-3, 0.0, true, Sampling::kEven, random);
  const std::size_t one_side = cloud.points_m.size();
  for (std::size_t i = 0; i < one_side; ++i) {
    cloud.points_m.push_back(cloud.points_m[i] - Vector3(3e-4, 2e-4, 4e-4));
    cloud.normals.push_back(-cloud.normals[i]);
  }
  const CloudSurface surface(cloud);

  for (int i = 0; i < 300; ++i) {
    const double x = random.uniform(-0.01, 0.01);
    const double y = random.uniform(-0.01, 0.01);
    // 1 mm above: 1 mm outside; 1 mm below the lower side likewise
    EXPECT_NEAR(surface.view({x, y, 1e-3}).distance_m, 1e-3, 1e-6);
    EXPECT_NEAR(surface.view({x, y, -1.4e-3}).distance_m, 1e-3, 1e-6);
    EXPECT_LT((surface.view({x, y, -1.4e-3}).normal + Vector3::UnitZ()).norm(), 1e-3);
  }
}

TEST(CloudSurface, BridgesASmallHoleAndEndsAtTheBorderOfALargeOne) {
  Random random(10);
  const PointCloud whole =
      test::sampled(test::plane_shape(0.03), 1e-3, 0.0, true, Sampling::kEven, random);
  const auto with_hole = [&](double radius_m) {
    PointCloud cloud;
    for (std::size_t i = 0; i < whole.points_m.size(); ++i) {
      if (whole.points_m[i].norm() < radius_m) continue;
      cloud.points_m.push_back(whole.points_m[i]);
      cloud.normals.push_back(whole.normals[i]);
    }
    return CloudSurface(cloud);
  };

  // the reach is some 3 mm: a hole of 2 mm radius is closed, one of 10 mm open in the middle
  EXPECT_NEAR(with_hole(2e-3).view({0, 0, -1e-3}).distance_m, -1e-3, 1e-6);
  const SurfaceView open = with_hole(10e-3).view({0, 0, -1e-3});
  EXPECT_GT(open.distance_m, 5e-3);
}

TEST(CloudSurface, BlendsTheStiffnessOfItsPoints) {
  Random random(11);
  PointCloud cloud =
      test::sampled(test::plane_shape(0.02), 1e-3, 0.0, true, Sampling::kEven, random);
  for (const Vector3& point : cloud.points_m) {
    cloud.stiffness_ratios.push_back(point.x() > 0.0 ? 3.0 : 1.0);
  }
  const CloudSurface surface(cloud);

  EXPECT_NEAR(surface.view({0.01, 0, 0}).stiffness_ratio, 3.0, 1e-6);
  EXPECT_NEAR(surface.view({-0.01, 0, 0}).stiffness_ratio, 1.0, 1e-6);
  EXPECT_NEAR(surface.view({0, 0, 0}).stiffness_ratio, 2.0, 0.3);
}

TEST(CloudSurface, AdmitsAnyPlace) {
  Random random(12);
  const CloudSurface surface(
      test::sampled(test::sphere_shape(0.01), 1e-3, 0.0, true, Sampling::kEven, random));

  const double huge = std::numeric_limits<double>::max();
  for (const Vector3& place :
       {Vector3(kNaN, 0, 0), Vector3(1e200, 0, 0), Vector3(0, huge, -huge)}) {
    EXPECT_EQ(surface.view(place).distance_m, std::numeric_limits<double>::infinity());
  }
  EXPECT_NEAR(surface.view({0, 0, 1e3}).distance_m, 1e3 - 0.01, 1.0);
  EXPECT_TRUE(std::isfinite(surface.view({0, 0, 0}).distance_m));  // as far from every point
}

TEST(CloudSurface, AdmitsDegenerateClouds) {
  PointCloud line;
  PointCloud heap;
  for (int i = 0; i < 50; ++i) {
    line.points_m.push_back({i * 1e-3, 0, 0});
    heap.points_m.push_back({1e-3, 1e-3, 1e-3});
  }
  for (const PointCloud& cloud : {line, heap}) {
    const SurfaceView seen = CloudSurface(cloud).view({2e-3, 1e-3, 1e-3});
    EXPECT_FALSE(std::isnan(seen.distance_m));
    EXPECT_TRUE(seen.normal.allFinite());
    EXPECT_TRUE(seen.curvature_per_m.allFinite());
  }
}

TEST(CloudSurface, ViewDoesNotAllocate) {
  Random random(14);
  const CloudSurface surface(
      test::sampled(test::sphere_shape(0.01), 1e-3, 0.0, true, Sampling::kEven, random));
  SurfaceHint hint;

  const test::AllocGuard guard;
  const double distance_m = surface.view({0.009, 0, 0}, hint).distance_m;

  EXPECT_EQ(guard.count(), 0U);
  EXPECT_NEAR(distance_m, -1e-3, 1e-5);
}

}  // namespace
}  // namespace palpate::physics
