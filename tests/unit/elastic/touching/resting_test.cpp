// SPDX-License-Identifier: Apache-2.0
// Bodies that lie on each other under gravity begin at rest.
#include <gtest/gtest.h>

#include "tests/unit/elastic/touching/together.h"

namespace palpate::physics {
namespace {

class RestingTogether : public testing::Test {
 protected:
  /// A soft slab that would sag through the block below it.
  SceneConfig slab_on_block(bool is_linear, double gap_m) {
    ElasticMaterial slab{.young_pa = 4e3, .poisson_ratio = 0.4, .viscosity_s = 0.005};
    slab.is_linear = is_linear;
    slab.gravity_m_per_s2 = {0, 0, -9.81};
    slab.fixed = {HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = {1, 0, 0}},
                  HalfSpaceGeometry{.point_m = {0.0299, 0, 0}, .normal = {-1, 0, 0}}};
    ElasticMaterial block = slab;
    block.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0299 - gap_m}}};
    slab.touches = {{.tissue = 1, .friction_coefficient = 0.2}};
    return {.tip_radius_m = kPairTip_m,
            .tissues = {soft_box("slab",
                                 box_file(folder_, "slab", {-0.03, -0.025, 0}, {0.03, 0.025, 0.012},
                                          {6, 5, 2}),
                                 slab),
                        soft_box("block",
                                 box_file(folder_, "block", {-0.025, -0.025, -0.03 - gap_m},
                                          {0.025, 0.025, -gap_m}, {5, 5, 3}),
                                 block)}};
  }
  test::TempFolder folder_;
};

TEST_F(RestingTogether, NothingSettlesInTheFirstSeconds) {
  for (const bool is_linear : {true, false}) {
    SceneConfig scene = slab_on_block(is_linear, 0.0005);
    Together both(scene);
    // as each would rest alone
    std::get<ElasticMaterial>(scene.tissues[0].material).touches.clear();
    const auto alone = elastic_bodies_of(scene);
    double would_move_m = 0.0;
    double moved_m = 0.0;
    for (int i = 0; i < 200; ++i) {
      both.step();
      for (std::size_t k = 0; k < 2; ++k) {
        const elastic::VectorXd& x_m = both.simulations[k]->x_m();
        moved_m = std::max(moved_m, (x_m - both.bodies[k]->start_m).cwiseAbs().maxCoeff());
        would_move_m = std::max(would_move_m, (x_m - alone[k]->start_m).cwiseAbs().maxCoeff());
      }
    }
    const Vector3 on_slab = both.island->pairs()[0].force_on_first_newton();
    std::printf("moved %.4f mm, without %.2f mm; borne %.3f N; deepest %.4f mm\n", 1e3 * moved_m,
                1e3 * would_move_m, on_slab.z(), 1e3 * both.deepest_m());
    EXPECT_GT(would_move_m, 3e-4);
    EXPECT_LT(moved_m, 2e-5);
    EXPECT_GT(on_slab.z(), 0.05);
    EXPECT_LT(both.deepest_m(), 2e-5);
  }
}

TEST_F(RestingTogether, BodiesThatAreApartRestAsEachAlone) {
  SceneConfig scene = slab_on_block(true, 0.02);
  const auto both = elastic_bodies_of(scene);
  std::get<ElasticMaterial>(scene.tissues[0].material).touches.clear();
  const auto alone = elastic_bodies_of(scene);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_EQ(both[k]->start_m, alone[k]->start_m);
}

}  // namespace
}  // namespace palpate::physics
