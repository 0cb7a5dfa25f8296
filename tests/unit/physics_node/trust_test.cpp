// SPDX-License-Identifier: Apache-2.0
// How far the described contact is still the surface, where that is not exact: clouds and meshes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"
#include "common/contact/material.h"
#include "tests/property/seeds.h"
#include "tests/support/sampled_clouds.h"
#include "tests/unit/physics_node/random_scene.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

constexpr double kSoft_newton_per_m = 1000.0;

struct Trust {
  double worst_error_m = 0.0;  // |force − force of the surface itself| / k
  double rms_error_m = 0.0;
  double mean_radius_m = 0.0;
};

/// Described from up to `depth_m` below and above places of `points_m`, compared anywhere within
/// the trust radius; a point as tip.
template <class PlaceOf>
Trust trust_in(const Surface& surface, const PlaceOf& place_m, double depth_m) {
  Random random(9);
  const KelvinVoigtMaterial material{.stiffness_newton_per_m = kSoft_newton_per_m};
  Trust trust;
  int compared = 0;
  while (compared < test::place_count(3000)) {
    const Vector3 on_surface = place_m(random);
    const SurfaceView there = surface.view(on_surface);
    const Vector3 x = on_surface + depth_m * random.uniform(-1, 0.5) * there.normal;
    const SurfaceView seen = surface.view(x);
    const Contact contact = describe(material, seen, -seen.distance_m, 0.0, x);
    const Vector3 d = random.uniform(0.0, 1.0) * seen.trust_radius_m * random.direction();
    const SurfaceView after = surface.view(x + d);
    if (!(after.distance_m < 0.0) || after.distance_m < -depth_m) continue;
    ++compared;
    const Vector3 truth = -kSoft_newton_per_m * after.distance_m * after.normal;
    const double error_m =
        (palpate::evaluate(contact, d, Vector3::Zero(), 0.0).force_on_tool_newton - truth).norm() /
        kSoft_newton_per_m;
    trust.worst_error_m = std::max(trust.worst_error_m, error_m);
    trust.rms_error_m += error_m * error_m;
    trust.mean_radius_m += seen.trust_radius_m;
  }
  trust.rms_error_m = std::sqrt(trust.rms_error_m / compared);
  trust.mean_radius_m /= compared;
  return trust;
}

// One point per mm²: quadrics reach some 3 mm.
TEST(TrustRadius, OfACloudHoldsWhatItPromises) {
  for (const test::Shape& shape : {test::plane_shape(0.03), test::sphere_shape(0.05),
                                   test::torus_shape(0.03, 0.015), test::saddle_shape(0.1, 0.03)}) {
    SCOPED_TRACE(shape.name);
    Random random(3);
    const CloudSurface cloud(test::sampled(shape, 1e-3, 0.0, true, test::Sampling::kEven, random));
    const auto place_m = [&](Random& r) {
      for (;;) {
        const Vector3 p = shape.point(r.uniform(), r.uniform());
        if (shape.is_inside_border(p)) return p;
      }
    };
    const Trust trust = trust_in(cloud, place_m, 3e-3);

    // of depths up to 3 mm
    EXPECT_LT(trust.rms_error_m, 1e-5);
    EXPECT_LT(trust.worst_error_m, 6e-5);
    EXPECT_GT(trust.mean_radius_m, 2.5e-3);
  }
}

// Facets of 30 mm·π/41 ≈ 2.3 mm at angles of some 4°.
TEST(TrustRadius, OfAFineMeshGoesBeyondTheFacet) {
  const double radius_m = 0.03;
  const TriangleSurface ball(ball_mesh(radius_m, 40));
  const Trust trust = trust_in(
      ball, [=](Random& r) -> Vector3 { return 0.999 * radius_m * r.direction(); }, 3e-3);

  // 0.1 mm of distance, and 3 mm of depth turned by two of the angles: 0.46 mm
  EXPECT_LT(trust.worst_error_m, 5e-4);
  EXPECT_LT(trust.rms_error_m, 1e-4);
  EXPECT_GT(trust.mean_radius_m, 1e-3);
}

// 1 mm beside the edge of a cube's face, outside: the face is known up to 0.1 mm past the edge.
TEST(TrustRadius, OfAMeshEndsAtASharpEdge) {
  const TriangleSurface cube(cube_mesh(0.02));
  EXPECT_NEAR(cube.view(Vector3(0.009, 0.003, 0.0101)).trust_radius_m, 1.1e-3, 1e-9);
  // inside, 1 mm deep and 2 mm from the edge: where the other face gets nearer, 1 mm·√½ away
  EXPECT_NEAR(cube.view(Vector3(0.008, 0.003, 0.009)).trust_radius_m, 1e-3 * std::sqrt(0.5) + 1e-4,
              1e-9);
}

}  // namespace
}  // namespace palpate::physics
