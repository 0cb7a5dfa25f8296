// SPDX-License-Identifier: Apache-2.0
// Tissue that mofc_node steps itself, of which only a part is known.
#include "mofc_node/tissue/local_tissues.h"

#include <gtest/gtest.h>

#include "tests/support/alloc_guard.h"

namespace palpate::mofc {
namespace {

constexpr double kTip_m = 0.003;
constexpr double kStiffness = 400.0;

/// A floor at z = 0: a square of 20 mm around the origin is known, a tile beside it is not.
class PartOfAFloor : public testing::Test {
 protected:
  PartOfAFloor() {
    SurfaceNews& news = interaction_.surface;
    news.store_id = 1;
    news.number = 1;
    news.has_description = true;
    news.description.geometry = TiledGeometry{};
    news.description.material.stiffness_newton_per_m = kStiffness;
    news.description.tool.tip_radius_m = kTip_m;
    SurfaceTile& tile = news.tiles[0];
    tile.origin_m = {-0.01, -0.01, 0.0};
    tile.step_m = 0.02;
    tile.vertices = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}};
    tile.vertex_count = 4;
    tile.facets = {{{0, 1, 2}, {0, 2, 3}}};
    tile.facet_count = 2;
    news.tile_count = 1;
    news.coverages[0].region.radius_m = 1.0;
    news.coverage_count = 1;
    news.pending[0] = {.version = 7, .center_m = {0.045F, 0.0F, 0.0F}, .radius_m = 0.04F};
    news.pending_count = 1;
    interaction_.header.session_id = 9;
    interaction_.listed_count = 1;
  }

  /// Physics looked at the tool here.
  void physics_saw(double z_m) {
    interaction_.tool_position_world_m = {0.0, 0.0, z_m};
    interaction_.contacts[0].penetration_m = kTip_m - z_m;
    store_.take(interaction_, {});
  }

  const LocalTissues::Result& step_to(const Vector3& tip_m) {
    time_s_ += 1e-3;
    local_.step(store_.tissues(), interaction_, {.tip_m = tip_m, .time_s = time_s_},
                Vector3::Zero(), shares_);
    shares_[0] = local_.results()[0].is_valid ? 1.0 : 0.0;
    return local_.results()[0];
  }

  Interaction interaction_;
  TissueStore store_{1};
  LocalTissues local_;
  std::array<double, kMaxDescribed> shares_{};
  double time_s_ = 0.0;
};

// seen from above, the tile that is missing may be nearer than the one that is known
TEST_F(PartOfAFloor, IsFeltFromTheFirstPressOn) {
  physics_saw(0.05);
  for (double z_m = 0.03; z_m > 0.001; z_m -= 1e-3) {
    const LocalTissues::Result& result = step_to({0.0, 0.0, z_m});
    ASSERT_TRUE(result.is_valid) << z_m;
    EXPECT_NEAR(result.force.force_on_tool_newton.z(), kStiffness * std::max(0.0, kTip_m - z_m),
                1e-6);
  }
}

TEST_F(PartOfAFloor, IsNotFeltWhereATileIsMissing) {
  physics_saw(0.05);
  ASSERT_TRUE(step_to({0.0, 0.0, 0.01}).is_valid);
  for (double x_m = 0.0; x_m < 0.03; x_m += 1e-3) step_to({x_m, 0.0, 0.01});
  EXPECT_FALSE(step_to({0.03, 0.0, 0.002}).is_valid);
}

// between two looks the tool may have passed through what is missing
TEST_F(PartOfAFloor, ABallOfPhysicsEndsWhereItDoes) {
  physics_saw(0.05);
  EXPECT_TRUE(step_to({0.03, 0.0, 0.04}).is_valid);
  LocalTissues anew;
  anew.step(store_.tissues(), interaction_, {.tip_m = {0.03, 0.0, 0.005}, .time_s = 1.0},
            Vector3::Zero(), {});
  EXPECT_FALSE(anew.results()[0].is_valid);
}

// the handle's end lies on the floor, over what is missing or away from it
TEST_F(PartOfAFloor, IsFeltByAShaftWhereItIsKnown) {
  const auto is_felt = [&](double away_x) {
    interaction_.surface.description.tool = {
        .tip_radius_m = kTip_m, .shaft_length_m = 0.03, .shaft_radius_m = 0.002};
    interaction_.surface.description.version += 1;
    interaction_.surface.coverages[0].description_version += 1;
    interaction_.surface.number += 1;
    interaction_.contacts[0].is_shaft = true;
    interaction_.contacts[0].penetration_m = -0.03;
    const Vector3 shaft = Vector3(away_x, 0.0, -1.0).normalized();
    interaction_.tool_position_world_m = {0.0, 0.0, 0.062};
    interaction_.tool_orientation_world = Quaternion::FromTwoVectors(Vector3::UnitZ(), shaft);
    store_.take(interaction_, {});
    LocalTissues local;
    for (double z_m = 0.06; z_m > 0.0285; z_m -= 1e-4) {
      time_s_ += 1e-3;
      local.step(store_.tissues(), interaction_,
                 {.tip_m = {0.0, 0.0, z_m}, .shaft = shaft, .time_s = time_s_}, Vector3::Zero(),
                 {});
    }
    const LocalTissues::Result& result = local.results()[0];
    // an invalid step that has no share in the force ends early
    if (result.is_valid) {
      EXPECT_GT(result.force.force_on_tool_newton.z(), 0.1 * kStiffness * 1e-3);
    }
    return result.is_valid;
  };
  EXPECT_TRUE(is_felt(-0.2));
  EXPECT_FALSE(is_felt(0.2));
}

TEST_F(PartOfAFloor, StepsDoNotAllocate) {
  physics_saw(0.05);
  const test::AllocGuard guard;
  for (double z_m = 0.03; z_m > 0.001; z_m -= 1e-3) step_to({0.0, 0.0, z_m});
  EXPECT_EQ(guard.count(), 0u);
}

}  // namespace
}  // namespace palpate::mofc
