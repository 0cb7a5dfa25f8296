// SPDX-License-Identifier: Apache-2.0
// Tissue that mofc_node steps itself, of which only a part is known.
#include "mofc_node/tissue/local_tissues.h"

#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "common/core/random.h"
#include "mofc_node/failover/tissue_pair.h"
#include "mofc_node/tissue/tissue_model.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/hostile/costly_descriptions.h"

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
                Vector3::Zero(), shares_, LocalTissues::kMostWork);
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
            Vector3::Zero(), {}, LocalTissues::kMostWork);
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
                 {.tip_m = {0.0, 0.0, z_m}, .shaft = shaft, .time_s = time_s_}, Vector3::Zero(), {},
                 LocalTissues::kMostWork);
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

// --- a tick with a budget -----------------------------------------------------------------------

using test::CostlyGenes;
using test::CostlyPhysics;

// of a view that ends: the tile that it was at; of a place that is looked at anew: all tiles
constexpr std::uint32_t kOvershoot = 2 * kTileSlots + 2 * (2 * kTileSlots + 8UL * 512UL);

TEST(WorkOfAStep, IsAPartOfAShortPeriod) {
  EXPECT_EQ(LocalTissues::work_in(std::chrono::milliseconds(20)), LocalTissues::kMostWork);
  EXPECT_EQ(LocalTissues::work_in(std::chrono::milliseconds(1)), LocalTissues::kMostWork);
  EXPECT_EQ(LocalTissues::work_in(std::chrono::microseconds(250)), LocalTissues::kMostWork / 4);
}

class LocalTissuesOfAny : public testing::TestWithParam<std::tuple<CostlyGenes, double>> {};

TEST_P(LocalTissuesOfAny, LookAtNoMoreThanTheirBudget) {
  const auto& [genes, period_ms] = GetParam();
  const std::uint32_t most_work = LocalTissues::work_in(from_seconds(1e-3 * period_ms));
  Random random(3);
  TissueStore store(1);
  const CostlyPhysics physics = test::costly_physics(genes, 1, random);
  for (const Interaction& message : physics.messages) store.take(message, {});
  store.take(physics.last, {});
  LocalTissues local;
  std::array<double, kMaxDescribed> shares{};
  std::uint32_t most = 0;
  bool is_exhausted = false;
  for (int i = 1; i <= 200; ++i) {
    const double angle = 0.1 * i;
    const Vector3 tip_m = 2e-3 * Vector3(std::cos(angle), std::sin(angle), std::sin(0.3 * angle));
    local.step(store.tissues(), physics.last, {.tip_m = tip_m, .time_s = 1e-3 * i}, Vector3::Zero(),
               shares, most_work);
    most = std::max(most, local.work());
    is_exhausted = is_exhausted || local.is_exhausted();
    for (std::size_t k = 0; k < kMaxDescribed; ++k) {
      shares[k] = local.results()[k].is_valid ? 1.0 : 0.5;
    }
  }
  EXPECT_LE(most, most_work + kOvershoot);
  EXPECT_TRUE(is_exhausted) << most;
}

std::string name_of_costly(const testing::TestParamInfo<std::tuple<CostlyGenes, double>>& info) {
  const auto& [genes, period_ms] = info.param;
  return std::to_string(genes.tissues) + (genes.is_cloud ? "_clouds" : "_meshes") +
         (genes.is_moving ? "_moving" : "") + (period_ms < 1.0 ? "_at_4_kHz" : "_at_1_kHz");
}
INSTANTIATE_TEST_SUITE_P(
    Kind, LocalTissuesOfAny,
    testing::Combine(
        testing::Values(CostlyGenes{.tissues = 8, .tiles = kTileSlots / 8},
                        CostlyGenes{.tissues = 1, .tiles = kTileSlots, .spread_m = 5e-3},
                        CostlyGenes{.tiles = kTileSlots / 8, .is_moving = true, .spread_m = 0.05},
                        CostlyGenes{.tiles = kTileSlots / 8, .is_cloud = true, .is_moving = true}),
        testing::Values(1.0, 0.25)),
    name_of_costly);

/// Tissue under a tool at rest in it, evaluated with what physics sends.
class BudgetOfAModel : public testing::Test {
 protected:
  /// @returns the force on the tool
  Vector3 step(const Interaction& newest) {
    state_.header.session_id = 1;
    state_.header.sequence += 1;
    state_.header.sampled_at += std::chrono::milliseconds(1);
    return model_.step(newest, state_, tip_m_, Vector3::Zero(), 1e-3).force_on_tool_newton;
  }
  /// A floor at z = 0 that is known as a whole, and the answer of its physics.
  Interaction floor() {
    Interaction message;
    message.header.session_id = 9;
    message.device_session_id = 1;
    SurfaceNews& news = message.surface;
    news.store_id = model_.receipts().store_id;
    news.number = 1;
    news.has_description = true;
    news.description.material.stiffness_newton_per_m = kStiffness;
    news.description.geometry = TiledGeometry{};
    news.description.tool.tip_radius_m = kTip_m;
    news.description.version = 1;
    SurfaceTile& tile = news.tiles[0];
    tile.origin_m = {-0.01, -0.01, 0.0};
    tile.step_m = 0.02;
    tile.vertices = {{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}};
    tile.vertex_count = 4;
    tile.facets = {{{0, 1, 2}, {0, 2, 3}}};
    tile.facet_count = 2;
    news.tile_count = 1;
    news.coverages[0] = {.description_version = 1, .region = {.radius_m = 1000.0}};
    news.coverage_count = 1;
    message.tool_position_world_m = tip_m_;
    return message;
  }

  static constexpr double kRate_newton_per_s = 50.0;
  TissueModel model_{true, kRate_newton_per_s, 1, std::chrono::milliseconds(1)};
  DeviceState state_;
  Vector3 tip_m_{0.0, 0.0, 0.5 * kTip_m};
};

// tissue that pushes has its turn first: what else is described does not cost it its force
TEST_F(BudgetOfAModel, IsSpentOnTheTissueThatPushesFirst) {
  Interaction newest = floor();
  newest.surface.description.slot = 7;
  newest.surface.tiles[0].described_slot = 7;
  newest.surface.tiles[0].slot = kTileSlots - 1;
  newest.surface.coverages[0].described_slot = 7;
  model_.receive(newest, state_.header);
  for (int i = 0; i < 100; ++i) step(newest);
  ASSERT_NEAR(step(newest).z(), 0.5 * kTip_m * kStiffness, 1e-9);

  Random random(3);
  const CostlyGenes genes{.tissues = 7, .tiles = (kTileSlots - 1) / 7, .tip_radius_m = 1e-4};
  for (const Interaction& message :
       test::costly_physics(genes, model_.receipts().store_id, random).messages) {
    model_.receive(message, state_.header);
  }
  // until the store is dropped
  for (int i = 0; i < 50; ++i) ASSERT_NEAR(step(newest).z(), 0.5 * kTip_m * kStiffness, 1e-9);
}

// facet upon facet where the tool presses: what cannot be stepped any more gives way to the contact
// model no faster than any hand-over
TEST_F(BudgetOfAModel, EndsTheForceOfATissueContinuously) {
  Interaction newest = floor();
  model_.receive(newest, state_.header);
  Vector3 last = Vector3::Zero();
  for (int i = 0; i < 100; ++i) last = step(newest);
  ASSERT_GT(last.z(), 0.4);

  Random random(3);
  const CostlyGenes genes{.tissues = 1, .tiles = kTileSlots - 1, .spread_m = 1e-5};
  std::uint64_t number = 2;
  for (Interaction message :
       test::costly_physics(genes, model_.receipts().store_id, random).messages) {
    if (message.surface.has_description) continue;
    message.surface.number = number++;
    for (std::uint32_t i = 0; i < message.surface.tile_count; ++i) {
      message.surface.tiles[i].slot += 1;
    }
    model_.receive(message, state_.header);
  }
  newest.surface.number = 0;  // repeats that all is known
  newest.surface.has_description = false;
  newest.surface.tile_count = 0;
  model_.receive(newest, state_.header);
  for (int i = 0; i < 200; ++i) {
    const Vector3 now = step(newest);
    ASSERT_LE((now - last).norm(), 1e-3 * kRate_newton_per_s * (1.0 + 1e-9)) << i;
    last = now;
  }
  EXPECT_EQ(last, Vector3::Zero());  // that of the contact model: there is none
  EXPECT_TRUE(model_.costs_too_much());
}

TEST_F(BudgetOfAModel, IsOfferedAnewToARestartedPhysics) {
  Random random(3);
  const std::uint64_t store_id = model_.receipts().store_id;
  const CostlyGenes genes{.tissues = 1, .tiles = kTileSlots - 1, .spread_m = 1e-5};
  const CostlyPhysics physics = test::costly_physics(genes, store_id, random);
  for (const Interaction& message : physics.messages) model_.receive(message, state_.header);
  model_.receive(physics.last, state_.header);
  for (int i = 0; i < 200; ++i) step(physics.last);
  EXPECT_TRUE(model_.costs_too_much());
  EXPECT_EQ(model_.receipts().store_id, 0u);  // nothing more is to be described

  Interaction restarted = floor();
  restarted.header.session_id = 10;
  model_.receive(restarted, state_.header);
  EXPECT_FALSE(model_.costs_too_much());
  EXPECT_NE(model_.receipts().store_id, 0u);
  EXPECT_NE(model_.receipts().store_id, store_id);
  restarted.surface.store_id = model_.receipts().store_id;
  model_.receive(restarted, state_.header);
  for (int i = 0; i < 100; ++i) step(restarted);
  EXPECT_NEAR(step(restarted).z(), 0.5 * kTip_m * kStiffness, 1e-9);
}

TEST_F(BudgetOfAModel, OfAPhysicsThatIsGoneIsFree) {
  const Interaction newest = floor();
  model_.receive(newest, state_.header);
  for (int i = 0; i < 100; ++i) step(newest);
  const std::uint64_t store_id = model_.receipts().store_id;
  model_.drop();
  EXPECT_EQ(step(newest), Vector3::Zero());
  EXPECT_EQ(model_.receipts().newest, 0u);
  EXPECT_NE(model_.receipts().store_id, store_id);  // physics begins anew
  const std::uint64_t dropped_id = model_.receipts().store_id;
  model_.drop();
  EXPECT_EQ(model_.receipts().store_id, dropped_id);
}

// Two physics share it, the one in use first: whatever the other describes, that keeps its force,
// and the other is not judged by what it was not offered.
TEST_F(BudgetOfAModel, IsSharedByTwoPhysicsTheOneInUseFirst) {
  for (const PhysicsRole in_use : {PhysicsRole::kFirst, PhysicsRole::kStandby}) {
    const PhysicsRole other =
        in_use == PhysicsRole::kFirst ? PhysicsRole::kStandby : PhysicsRole::kFirst;
    TissuePair pair(InteractionUse::kLocal, true, kRate_newton_per_s, 1,
                    std::chrono::milliseconds(1));
    Interaction honest = floor();
    honest.surface.store_id = pair.receipts(in_use).store_id;
    pair.receive(in_use, honest, state_.header);
    Random random(3);
    const CostlyGenes genes{.tissues = 1, .tiles = kTileSlots - 1, .spread_m = 1e-5};
    const CostlyPhysics costly = test::costly_physics(genes, pair.receipts(other).store_id, random);
    for (const Interaction& message : costly.messages) pair.receive(other, message, state_.header);
    pair.receive(other, costly.last, state_.header);
    std::array<const Interaction*, kPhysicsRoles> newest{};
    newest[index_of(in_use)] = &honest;
    newest[index_of(other)] = &costly.last;
    const auto step = [&](PhysicsRole used) {
      state_.header.session_id = 1;
      state_.header.sequence += 1;
      state_.header.sampled_at += std::chrono::milliseconds(1);
      return pair.step(newest, used, state_, tip_m_, Vector3::Zero(), 1e-3).force_on_tool_newton;
    };
    for (int i = 0; i < 300; ++i) {
      step(in_use);
      ASSERT_LE(pair.work(), LocalTissues::kMostWork + kOvershoot);
    }
    EXPECT_NEAR(step(in_use).z(), 0.5 * kTip_m * kStiffness, 1e-9);
    EXPECT_FALSE(pair.costs_too_much(in_use));
    EXPECT_FALSE(pair.costs_too_much(other));
    // in use it is offered everything
    for (int i = 0; i < 300; ++i) step(other);
    EXPECT_TRUE(pair.costs_too_much(other));
  }
}

}  // namespace
}  // namespace palpate::mofc
