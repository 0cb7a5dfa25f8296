// SPDX-License-Identifier: Apache-2.0
// random_scene.h — scenes for tests: of one tissue, and seeded ones for property tests with tissues
// of every kind, a few cm in size, within 10 cm of the origin.
#pragma once

#include <string>

#include "common/core/random.h"
#include "common/session/session.h"

namespace palpate::physics {

inline const Vector3 kAtRest = Vector3::Zero();

inline SceneConfig one_tissue(const Geometry& geometry, const Material& material,
                              double tip_radius_m = 0.0) {
  return {.tip_radius_m = tip_radius_m,
          .tissues = {{.name = "tissue", .geometry = geometry, .material = material}}};
}

inline Vector3 random_in_cube(Random& random, double half_edge) {
  return half_edge * Vector3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
}

inline SceneConfig random_scene(Random& random, int tissues) {
  SceneConfig scene;
  scene.tip_radius_m = random.chance(0.5) ? 0.0 : random.uniform(0.001, 0.01);
  for (int i = 0; i < tissues; ++i) {
    TissueConfig tissue;
    tissue.name = std::to_string(i);
    const Vector3 center_m = random_in_cube(random, 0.05);
    switch (random.below(4)) {
      case 0:
        tissue.geometry = HalfSpaceGeometry{.point_m = center_m, .normal = random.direction()};
        break;
      case 1:
        tissue.geometry =
            SphereGeometry{.center_m = center_m, .radius_m = random.uniform(0.005, 0.05)};
        break;
      case 2:
        tissue.geometry = CapsuleGeometry{.from_m = center_m,
                                          .to_m = random_in_cube(random, 0.05),
                                          .radius_m = random.uniform(0.005, 0.03)};
        break;
      default:
        tissue.geometry = BoxGeometry{
            .center_m = center_m, .size_m = Vector3::Constant(0.06) + random_in_cube(random, 0.05)};
    }
    tissue.material = KelvinVoigtMaterial{
        .stiffness_newton_per_m = random.uniform(5, 2000),
        .damping_newton_s_per_m = random.chance(0.3) ? 0.0 : random.uniform(0.1, 20),
        .is_damping_isotropic = random.chance(0.5),
        .is_adhesive = random.chance(0.5),
        .stiffening_newton_per_m3 = random.chance(0.5) ? 0.0 : random.uniform(1e4, 1e7)};
    if (random.chance(0.3)) {
      tissue.material = KelvinVoigtMaterial{.stiffness_newton_per_m = random.uniform(5, 500),
                                            .damping_newton_s_per_m = random.uniform(0.0, 10),
                                            .exponent = random.uniform(1.0, 3.0),
                                            .exponent_depth_m = random.uniform(0.005, 0.02),
                                            .is_adhesive = random.chance(0.5)};
    }
    scene.tissues.push_back(tissue);
  }
  return scene;
}

}  // namespace palpate::physics
