// SPDX-License-Identifier: Apache-2.0
// The contact with an elastic body that mofc_node solves itself. The body is a half-space, whose
// compliance [Boussinesq, Cerruti] and whose force [Hertz] are known in closed form.
#include "mofc_node/tissue/elastic_patches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "deploy/lockstep/random_elastic.h"
#include "mofc_node/tissue/tissue_model.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/hostile/costly_descriptions.h"

namespace palpate::mofc {
namespace {

constexpr double kRadius_m = 0.006;
constexpr double kSpacing_m = 1.2e-3;
constexpr int kSide = 11;  // points along each side of the patch
constexpr double kYoung_pa = 15e3;
constexpr double kTick_s = 1e-3;
constexpr double kNewtonPerS = 100.0;

/// Of an incompressible half-space z < 0: displacement at `to` under a force at `from`.
Matrix3 half_space(const Vector3& from, const Vector3& to) {
  const double shear_pa = kYoung_pa / 3.0;
  const double unit = 1.0 / (4.0 * std::numbers::pi * shear_pa);  // (1 − ν)/(2πG), ν = ½
  const Vector3 way = to - from;
  const double r = way.norm();
  Matrix3 give = Matrix3::Zero();
  if (r == 0.0) {
    // mean of 1/r over the square that the point stands for
    const double mean = 4.0 * std::log(1.0 + std::numbers::sqrt2) / kSpacing_m;
    give.diagonal() = unit * mean * Vector3(1.5, 1.5, 1.0);
    return give;
  }
  give.diagonal().setConstant(unit / r);
  give += unit / (r * r * r) * way * way.transpose();
  give(2, 2) = unit / r;
  return give;
}

double hertz_newton(double depth_m) {
  return 4.0 / 3.0 * (kYoung_pa / 0.75) * std::sqrt(kRadius_m) * std::pow(depth_m, 1.5);
}

class HalfSpacePatch : public testing::Test {
 protected:
  HalfSpacePatch() {
    interaction_.elastic.store_id = kStore;
    constexpr int kMiddle = kSide / 2;
    for (int i = 0; i < kSide; ++i) {
      for (int k = 0; k < kSide; ++k) {
        places_m_.emplace_back(kSpacing_m * (i - kMiddle), kSpacing_m * (k - kMiddle), 0.0);
      }
    }
    for (std::size_t slot = 0; slot < places_m_.size(); ++slot) points_.push_back(point(slot));
    state_.number = 1;
    state_.tip_radius_m = kRadius_m;
    state_.center_m = {0.0, 0.0, 0.02};
    state_.radius_m = 0.02;
    state_.away_step_m = 0.02F;
    for (std::size_t slot = 0; slot < places_m_.size(); ++slot) {
      state_.places[slot].version = points_[slot].version;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        state_.places[slot].away[axis] = static_cast<std::int16_t>(
            std::lround(places_m_[slot][static_cast<Eigen::Index>(axis)] / 0.02 * kElasticScale));
      }
    }
  }

  ElasticPoint point(std::size_t slot) const {
    ElasticPoint point{.slot = static_cast<std::uint32_t>(slot),
                       .version = static_cast<std::uint32_t>(slot) + 1,
                       .rest_m = places_m_[slot],
                       .rigid_give_m_per_newton = 1e-6F};
    const Vector3& from = places_m_[slot];
    const double step = 2.0 * half_space(from, from)(0, 0);
    point.step_m_per_newton = static_cast<float>(step);
    const auto rounded = [&](double x) {
      return static_cast<std::int16_t>(std::lround(x / step * kElasticScale));
    };
    const Matrix3 own = half_space(from, from);
    point.own = {rounded(own(0, 0)), 0, 0, rounded(own(1, 1)), 0, rounded(own(2, 2))};
    for (std::size_t other = 0; other < slot; ++other) {
      point.has_other.set(other);
      const Matrix3 block = half_space(from, places_m_[other]);
      for (std::size_t i = 0; i < 9; ++i) {
        point.others[other][i] =
            rounded(block(static_cast<Eigen::Index>(i / 3), static_cast<Eigen::Index>(i % 3)));
      }
    }
    return point;
  }
  void send(const ElasticPoint& point) {
    interaction_.elastic.number = ++number_;
    interaction_.elastic.has_point = true;
    interaction_.elastic.point = point;
    patches_.take(interaction_, kStore, 0.0);
  }
  void send(const ElasticState& state) {
    interaction_.elastic.number = ++number_;
    interaction_.elastic.has_point = false;
    interaction_.elastic.state = state;
    patches_.take(interaction_, kStore, 0.0);
  }
  void send_all() {
    send(state_);
    for (const ElasticPoint& point : points_) send(point);
  }
  const ElasticPatches::Result& step_to(const Vector3& tip_m) {
    patches_.step(interaction_, tip_m, kTick_s, scene_s_, LocalTissues::kMostWork);
    return patches_.results()[0];
  }
  /// Straight down, at 100 mm/s.
  const ElasticPatches::Result& press(double depth_m, double x_m = 0.0) {
    for (double z_m = kRadius_m + 1e-3; z_m > kRadius_m - depth_m; z_m -= 1e-4) {
      step_to({x_m, 0.0, z_m});
    }
    return step_to({x_m, 0.0, kRadius_m - depth_m});
  }

  static constexpr std::uint64_t kStore = 5;
  std::vector<Vector3> places_m_;
  std::vector<ElasticPoint> points_;
  ElasticState state_;
  Interaction interaction_;
  double scene_s_ = 0.0;
  ElasticPatches patches_{kNewtonPerS};
  std::uint64_t number_ = 0;
};

TEST_F(HalfSpacePatch, PressesAsHertzSays) {
  send_all();
  for (const double depth_m : {0.5e-3, 1e-3, 1.5e-3}) {
    const auto& result = press(depth_m);
    ASSERT_TRUE(result.is_valid);
    const Vector3& force = result.force.force_on_tool_newton;
    EXPECT_NEAR(force.z(), hertz_newton(depth_m), 0.08 * hertz_newton(depth_m)) << depth_m;
    EXPECT_LT(force.head<2>().norm(), 1e-2 * force.z());
    // V = ⅖ F d
    EXPECT_NEAR(result.force.stored_energy_joule, 0.4 * force.z() * depth_m,
                0.1 * 0.4 * force.z() * depth_m);
  }
}

// Between two solutions the surface comes up to a tip that stands still.
TEST_F(HalfSpacePatch, PressesATipToWhichItIsCarried) {
  state_.carried_m = {0.0, 0.0, 0.3e-3};
  state_.carried_m_per_s = {0.0, 0.0, 0.01};
  state_.carried_at_s = scene_s_ = 5.0;
  send_all();
  // 0.1 mm above where the surface was in the session, 0.2 mm deep in the solution
  const Vector3 tip_m(0.0, 0.0, kRadius_m + 1e-4);
  for (double z_m = 2e-3; z_m > 0.0; z_m -= 1e-4) step_to(tip_m + Vector3(0, 0, z_m));
  double newton = 0.0;
  for (int i = 0; i < 80; ++i) {
    scene_s_ = 5.0 + kTick_s * i;
    const auto& result = step_to(tip_m);
    EXPECT_TRUE(result.is_valid);
    newton = result.force.force_on_tool_newton.z();
  }
  const double depth_m = 0.2e-3 + 0.01 * (scene_s_ - 5.0);
  EXPECT_NEAR(newton, hertz_newton(depth_m), 0.08 * hertz_newton(depth_m));
  // from then on it is not known where it went
  scene_s_ = 100.0;
  const double longest_m = 0.2e-3 + 0.01 * kLongestCarriedS;
  for (int i = 0; i < 20; ++i) newton = step_to(tip_m).force.force_on_tool_newton.z();
  EXPECT_NEAR(newton, hertz_newton(longest_m), 0.15 * hertz_newton(longest_m));
}

// [LeeRadok60]: while the contact grows, the force on a Kelvin–Voigt half-space is that of a spring
// and a damper on Hertz's force. The points could take it as penalty, as if they were held fast.
TEST_F(HalfSpacePatch, AViscousBodyAlsoPressesBackByItsRate) {
  constexpr double kDepth_m = 1.5e-3;
  constexpr double kSpeed_m_per_s = 0.1;
  const auto pressed_newton = [&](double relaxation_s, int held_ticks) {
    ++state_.number;
    state_.relaxation_s = relaxation_s;
    for (ElasticPlace& place : state_.places) place.rest = place.away;
    patches_.take(interaction_, kStore + 1, 0.0);  // empties it
    interaction_.elastic.store_id = kStore;
    for (ElasticPoint& point : points_) point.rigid_give_m_per_newton = 1e-2F;
    send_all();
    double newton = 0.0;
    const int ticks = 10 + static_cast<int>(std::lround(kDepth_m / (kSpeed_m_per_s * kTick_s)));
    for (int i = 0; i <= ticks + held_ticks; ++i) {
      const double depth_m = kSpeed_m_per_s * kTick_s * (std::min(i, ticks) - ticks) + kDepth_m;
      const auto& result = step_to({0.0, 0.0, kRadius_m - depth_m});
      newton = result.force.force_on_tool_newton.z();
      EXPECT_TRUE(result.is_valid || i < 5);
    }
    return newton;
  };
  const double elastic = hertz_newton(kDepth_m);
  for (const double relaxation_s : {0.005, 0.01, 0.02}) {
    const double wanted = elastic * (1.0 + 1.5 * relaxation_s * kSpeed_m_per_s / kDepth_m);
    EXPECT_NEAR(pressed_newton(relaxation_s, 0), wanted, 0.12 * wanted) << relaxation_s;
    EXPECT_NEAR(pressed_newton(relaxation_s, 200), elastic, 0.1 * elastic) << relaxation_s;
  }
}

// The places of rest in the state are where the points go, not where they are.
TEST_F(HalfSpacePatch, AViscousPointGoesOnToItsPlaceOfRest) {
  state_.relaxation_s = 0.01;
  // the surface was pressed 1 mm deep, and comes back
  for (std::size_t slot = 0; slot < points_.size(); ++slot) {
    state_.places[slot].rest = state_.places[slot].away;
    state_.places[slot].away[2] = static_cast<std::int16_t>(-1e-3 / 0.02 * kElasticScale);
  }
  state_.center_m = {0.0, 0.0, kRadius_m};
  send_all();
  const auto force = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) step_to({0.0, 0.0, kRadius_m - 0.5e-3});
    return patches_.results()[0].force.force_on_tool_newton.z();
  };
  // e⁻⁰·⁷ of the way is left after 7 ms
  EXPECT_EQ(force(2), 0.0);
  EXPECT_GT(force(100), 0.8 * hertz_newton(0.5e-3));
}

TEST_F(HalfSpacePatch, IsFreeAboveTheSurface) {
  send_all();
  for (int i = 0; i < 40; ++i) step_to({0.0, 0.0, kRadius_m + 1e-4});
  EXPECT_TRUE(patches_.results()[0].is_valid);
  EXPECT_FALSE(patches_.results()[0].force.is_touching);
  EXPECT_EQ(patches_.results()[0].force.force_on_tool_newton.norm(), 0.0);
}

TEST_F(HalfSpacePatch, IsTheSameInAnyOrderOfArrival) {
  send_all();
  const double newton = press(1e-3).force.force_on_tool_newton.z();
  Random random(4);
  for (int i = 0; i < 3; ++i) {
    for (std::size_t k = points_.size() - 1; k > 0; --k) {
      std::swap(points_[k], points_[random.below(k + 1)]);
    }
    interaction_.elastic.store_id = kStore;
    patches_.take(interaction_, kStore + 1, 0.0);  // empties it
    send_all();
    EXPECT_EQ(press(1e-3).force.force_on_tool_newton.z(), newton);
  }
}

TEST_F(HalfSpacePatch, DoesNotCountWhereAPointIsMissing) {
  send(state_);
  for (std::size_t slot = 0; slot + kSide < points_.size(); ++slot) send(points_[slot]);
  // the last row, at x = 6 mm, is missing
  EXPECT_FALSE(press(1e-3, 1e-3).is_valid);
  EXPECT_TRUE(press(1e-3, -1e-3).is_valid);
  for (std::size_t slot = points_.size() - kSide; slot < points_.size(); ++slot) {
    send(points_[slot]);
  }
  EXPECT_TRUE(press(1e-3, 1e-3).is_valid);
}

TEST_F(HalfSpacePatch, DoesNotCountBeyondWhatIsListed) {
  send_all();
  ASSERT_TRUE(press(0.5e-3).is_valid);
  const double reach_m = state_.radius_m - kRadius_m;
  EXPECT_TRUE(press(0.5e-3, reach_m - 1e-4).is_valid);
  EXPECT_FALSE(press(0.5e-3, reach_m + 1e-4).is_valid);
  // on the other side of the body
  step_to({0.0, 0.0, -0.05});
  for (int i = 0; i < 40; ++i) step_to({0.0, 0.0, -0.05});
  EXPECT_FALSE(patches_.results()[0].is_valid);
}

TEST_F(HalfSpacePatch, KeepsTheNewerPointOfASlot) {
  send_all();
  const double newton = press(1e-3).force.force_on_tool_newton.z();
  ElasticPoint older = points_[60];
  older.version = 1;
  older.own = {30000, 0, 0, 30000, 0, 30000};
  send(older);
  EXPECT_EQ(press(1e-3).force.force_on_tool_newton.z(), newton);
}

// a new place never uses the stiffness of an old one
TEST_F(HalfSpacePatch, DoesNotCountWithAPointThatIsNotTheOneListed) {
  send_all();
  ASSERT_TRUE(press(1e-3).is_valid);
  ElasticPoint newer = points_[60];
  newer.version = 1000;
  send(newer);
  EXPECT_FALSE(press(1e-3).is_valid);
}

TEST_F(HalfSpacePatch, DoesNotCountUntilEveryPressedPointHasArrived) {
  state_.force_step_newton = 0.1F;
  state_.places[60].force = {0, 0, -32767};
  send(state_);
  for (std::size_t slot = 0; slot < points_.size(); ++slot) {
    if (slot != 60) send(points_[slot]);
  }
  EXPECT_FALSE(step_to({0.0, 0.0, kRadius_m}).is_stepped);
  send(points_[60]);
  EXPECT_TRUE(step_to({0.0, 0.0, kRadius_m}).is_stepped);
}

// walking there from where the tip was in the state takes ticks, jumping would turn the normals
TEST_F(HalfSpacePatch, GoesToTheTipInSteps) {
  send_all();
  int ticks = 0;
  while (!step_to({0.0, 0.0, kRadius_m - 1e-3}).is_valid) ASSERT_LT(++ticks, 10);
  EXPECT_GT(ticks, 0);
  EXPECT_NEAR(patches_.results()[0].force.force_on_tool_newton.z(), hertz_newton(1e-3),
              0.08 * hertz_newton(1e-3));
}

TEST_F(HalfSpacePatch, ChangesTheForceOfANewStateNoFasterThanTheBound) {
  send_all();
  double before = press(1e-3).force.force_on_tool_newton.z();
  ElasticState other = state_;
  other.number = 2;
  other.compliance_ratio = 0.5;
  other.force_outside_patch_newton = {0.0, 0.0, 1.0};
  send(other);
  const Vector3 tip_m(0.0, 0.0, kRadius_m - 1e-3);
  const double aim = 2.0 * before + 1.0;
  int ticks = 0;
  for (; before < 0.99 * aim && ticks < 100; ++ticks) {
    const auto& result = step_to(tip_m);
    ASSERT_TRUE(result.is_valid);
    const double newton = result.force.force_on_tool_newton.z();
    EXPECT_LE(std::abs(newton - before), kNewtonPerS * kTick_s + 0.02);
    before = newton;
  }
  EXPECT_GE(ticks, 9);
  EXPECT_NEAR(before, aim, 0.02 * aim);
}

// Until there is a patch again the contact model of the Interaction counts, here none.
class PatchThatEnds : public HalfSpacePatch {
 protected:
  static constexpr double kSlowNewtonPerS = 5.0;  // so that it takes 70 ms
  /// Both by the fixture's patches, which are of another store, and by the model.
  void receive(const auto& news) {
    send(news);
    model_.receive(interaction_, {});
    interaction_.elastic.number = 0;
  }
  double newton_at(double depth_m) {
    const test::AllocGuard guard;
    const ModelForce force =
        model_.step(interaction_, {}, {0.0, 0.0, kRadius_m - depth_m}, Vector3::Zero(), kTick_s);
    EXPECT_EQ(guard.count(), 0U);
    return force.force_on_tool_newton.z();
  }
  double press_with_a_patch() {
    interaction_.elastic.store_id = model_.receipts().store_id;
    state_.force_step_newton = 1e-5F;
    state_.places[60].force = {0, 0, -32767};
    for (const ElasticPoint& point : points_) receive(point);
    receive(state_);
    double newton = 0.0;
    for (int tick = 0; tick < 120; ++tick) newton = newton_at(std::min(3e-3, 1e-4 * tick));
    return newton;
  }
  void expect_to_fade_within_the_bound(double before) {
    ASSERT_GT(before, 0.25);
    int ticks = 0;
    for (; before > 0.0 && ticks < 100; ++ticks) {
      const double newton = newton_at(3e-3);
      ASSERT_LE(std::abs(newton - before), kSlowNewtonPerS * kTick_s + 1e-9);
      before = newton;
    }
    EXPECT_EQ(before, 0.0);
    EXPECT_GT(ticks, 50);
  }

 private:
  TissueModel model_{true, kSlowNewtonPerS, 1, from_seconds(kTick_s)};
};

// A body of which something has vanished is described anew, point by point.
TEST_F(PatchThatEnds, WithAPointThatIsReplacedFadesNoFasterThanTheBound) {
  const double newton = press_with_a_patch();

  ElasticPoint newer = points_[60];
  newer.version = 1000;
  receive(newer);
  expect_to_fade_within_the_bound(newton);
}

// A body that leans on something gives way otherwise than its points say.
TEST_F(PatchThatEnds, WithAStateWithoutRadiusFadesNoFasterThanTheBoundAndBeginsAgain) {
  const double newton = press_with_a_patch();
  ElasticState next = state_;
  next.number = 2;
  next.radius_m = 0.0;
  next.places.fill({});

  receive(next);
  expect_to_fade_within_the_bound(newton);

  state_.number = 3;
  receive(state_);
  double again = 0.0;
  for (int tick = 0; tick < 120; ++tick) again = newton_at(3e-3);
  EXPECT_NEAR(again, newton, 0.01 * newton);
}

TEST_F(HalfSpacePatch, HasFrictionUpToItsCoefficient) {
  state_.friction_coefficient = 0.3;
  state_.friction_stiffness_newton_per_m = 500.0;
  send_all();
  press(1e-3);
  for (double x_m = 0.0; x_m < 4e-3; x_m += 5e-5) step_to({x_m, 0.0, kRadius_m - 1e-3});
  const Vector3 force = patches_.results()[0].force.force_on_tool_newton;
  EXPECT_NEAR(force.x(), -0.3 * force.z(), 0.06 * force.z());
}

TEST_F(HalfSpacePatch, AcknowledgesWhatArrived) {
  send(state_);
  send(points_[0]);
  ++number_;  // one is lost
  send(points_[1]);
  EXPECT_EQ(patches_.receipts().newest, 4u);
  EXPECT_EQ(patches_.receipts().received, 0b1101u);
  patches_.take(interaction_, kStore + 1, 0.0);
  EXPECT_EQ(patches_.receipts().newest, 0u);
}

// points that push each other on for ever; one sweep begins, whatever is left
TEST(ElasticPatches, DoNoMoreThanTheirBudget) {
  constexpr std::uint64_t kStore = 1;
  for (const std::uint32_t most_work : {LocalTissues::kMostWork, LocalTissues::kMostWork / 4, 0U}) {
    Random random(4);
    test::CostlyPhysics physics = test::costly_physics(
        {.tissues = 1, .tiles = 1, .tip_radius_m = 3e-4, .elastic_patches = 2}, kStore, random);
    ElasticPatches patches(kNewtonPerS);
    for (const Interaction& message : physics.messages) patches.take(message, kStore, 0.0);
    std::uint32_t most = 0;
    for (int i = 1; i <= 200; ++i) {
      physics.next_answer();
      patches.take(physics.last, kStore, 0.0);
      const double angle = 0.15 * i;
      patches.step(physics.last, 2e-3 * Vector3(std::cos(angle), std::sin(angle), 0.0), kTick_s,
                   0.0, most_work);
      most = std::max(most, patches.work());
    }
    EXPECT_LE(most, most_work + 14000);
    EXPECT_GE(most, std::min(most_work, LocalTissues::kMostWork / 2));
  }
}

TEST(ElasticPatches, AreFiniteAndBoundedWhateverArrives) {
  Random random(1);
  for (int run = 0; run < 40; ++run) {
    ElasticPatches patches(kNewtonPerS);
    Interaction interaction;
    std::array<std::uint32_t, kElasticSlots> versions{};
    Vector3 tip_m = Vector3::Zero();
    for (std::uint32_t i = 1; i < 400; ++i) {
      randomise(interaction.elastic, random);
      interaction.elastic.store_id = 1;
      interaction.elastic.number = i;
      ElasticPoint& point = interaction.elastic.point;
      ElasticState& state = interaction.elastic.state;
      if (interaction.elastic.has_point) {
        point.patch = 0;
        point.slot = static_cast<std::uint32_t>(random.below(16));
        point.has_other.reset(point.slot);
        point.version = versions[point.slot] = i;
        point.rest_m = random_vector(random, 0.02);
      } else {
        state.patch = 0;
        state.number = i;
        state.from_m = state.to_m = Vector3::Zero();
        state.radius_m = 100.0;
        for (std::size_t slot = 0; slot < kElasticSlots; ++slot) {
          state.places[slot].version = versions[slot];
        }
      }
      const test::AllocGuard guard;
      patches.take(interaction, 1, 0.0);
      tip_m += random_vector(random, 1e-3);
      patches.step(interaction, tip_m, kTick_s, 0.0, LocalTissues::kMostWork);
      for (const ElasticPatches::Result& result : patches.results()) {
        EXPECT_TRUE(result.force.force_on_tool_newton.allFinite());
        // the points' and the rest of the state's; friction adds its share
        EXPECT_LE(result.force.force_on_tool_newton.cwiseAbs().maxCoeff(),
                  30.0 * kMaxTissueForceNewton);
        EXPECT_GE(result.force.stored_energy_joule, 0.0);
        EXPECT_TRUE(std::isfinite(result.force.stored_energy_joule));
      }
      ASSERT_EQ(guard.count(), 0u);
    }
  }
}

}  // namespace
}  // namespace palpate::mofc
