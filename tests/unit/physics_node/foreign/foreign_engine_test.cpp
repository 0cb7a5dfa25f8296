// SPDX-License-Identifier: Apache-2.0
#include "physics_node/foreign/foreign_engine.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>

namespace palpate::physics {
namespace {

class Scripted final : public sdk::Engine {
 public:
  explicit Scripted(std::function<sdk::Answer(const sdk::Motion&)> law) : law_(std::move(law)) {}
  sdk::Answer step(const sdk::Motion& motion) override { return law_(motion); }
  bool deformed(std::size_t surface, std::vector<float>& vertices_m) override {
    vertices_m[2] = -0.5F;
    return surface == 0;
  }

 private:
  std::function<sdk::Answer(const sdk::Motion&)> law_;
};

/// A half-space of 2 kN/m and 3 N·s/m below z = 0 that tells only forces, but anywhere.
class Field final : public sdk::Engine {
 public:
  explicit Field(double slope_newton_per_m2 = 0.0) : slope_(slope_newton_per_m2) {}
  sdk::Answer step(const sdk::Motion& motion) override {
    sdk::Vector3 force = elastic(motion.position_m);
    if (force.z() > 0.0) force.z() = std::max(0.0, force.z() - 3.0 * motion.velocity_m_per_s.z());
    return {.force_on_tool_newton = force};
  }
  std::optional<sdk::Vector3> force_at(const sdk::Vector3& position_m) override {
    ++calls;
    return elastic(position_m);
  }
  int calls = 0;

 private:
  [[nodiscard]] sdk::Vector3 elastic(const sdk::Vector3& x) const {
    const double depth_m = std::max(0.0, -x.z());
    return depth_m * (2000.0 + slope_ * depth_m) * sdk::Vector3::UnitZ();
  }
  double slope_;  // [N/m²]
};

ToolMotion moving(double z_m, double z_m_per_s) {
  ToolMotion motion;
  motion.tool_position_world_m.z() = z_m;
  motion.tool_velocity_world_m_per_s.z() = z_m_per_s;
  return motion;
}

// 0.1 m/s straight down from 5 mm above the surface, which no step has touched.
TEST(ForeignEngine, KnowsTissueBeforeItIsTouchedIfTheEngineCanTellItsForceAnywhere) {
  auto field = std::make_unique<Field>();
  Field& asked = *field;
  ForeignEngine engine(std::move(field), true);
  Interaction answer;
  ASSERT_TRUE(engine.step(moving(0.005, -0.1), true, TimePoint{}, answer));

  ASSERT_EQ(answer.listed_count, 1U);
  EXPECT_EQ(answer.contact_count, 0U);
  EXPECT_EQ(answer.force_on_tool_newton, Vector3::Zero().eval());
  EXPECT_NEAR(answer.contacts[0].penetration_m, -0.005, 0.05e-3);
  EXPECT_NEAR(answer.contacts[0].d_force_d_position(2, 2), -2000.0, 40.0);
  EXPECT_GT(answer.contacts[0].trust_radius_m, 0.01);
  EXPECT_LE(asked.calls, 13);  // and one to see whether it can

  // where there is nothing ahead, one call
  asked.calls = 0;
  ASSERT_TRUE(engine.step(moving(0.1, 0.1), true, TimePoint{}, answer));
  EXPECT_EQ(asked.calls, 2);
}

TEST(ForeignEngine, TakesStiffnessAndDampingFromTheForceElsewhere) {
  ForeignEngine engine(std::make_unique<Field>(1e5), true);
  Interaction answer;
  ASSERT_TRUE(engine.step(moving(-0.004, -0.05), true, TimePoint{}, answer));
  ASSERT_EQ(answer.listed_count, 1U);
  // d/dp (2000 p + 1e5 p²) at 4.25 mm, the middle of the difference
  EXPECT_NEAR(answer.contacts[0].d_force_d_position(2, 2), -2850.0, 1.0);
  EXPECT_NEAR(answer.contacts[0].d_force_d_velocity(2, 2), -3.0, 1e-6);
}

// A table that ends at x = 0, touched and left; then down beside it, where its plane would be.
TEST(ForeignEngine, ExpectsNoSurfaceWhereTheEngineSaysThatThereIsNone) {
  class Table final : public sdk::Engine {
   public:
    explicit Table(bool is_field) : is_field_(is_field) {}
    sdk::Answer step(const sdk::Motion& motion) override {
      return {.force_on_tool_newton = force(motion.position_m)};
    }
    std::optional<sdk::Vector3> force_at(const sdk::Vector3& x) override {
      if (!is_field_) return std::nullopt;
      return force(x);
    }

   private:
    static sdk::Vector3 force(const sdk::Vector3& x) {
      const double newton = x.x() < 0.0 ? std::max(0.0, -500.0 * x.z()) : 0.0;
      return newton * sdk::Vector3::UnitZ();
    }
    bool is_field_;
  };
  for (const bool is_field : {false, true}) {
    ForeignEngine engine(std::make_unique<Table>(is_field), true);
    Interaction answer;
    for (const double z_m : {0.001, -0.001, -0.002, -0.001, 0.001}) {
      ToolMotion motion = moving(z_m, -0.1);
      motion.tool_position_world_m.x() = -0.003;
      ASSERT_TRUE(engine.step(motion, true, TimePoint{}, answer));
    }
    EXPECT_EQ(answer.listed_count, 1U) << "expected above the table";
    ToolMotion beside = moving(0.001, -0.1);
    beside.tool_position_world_m.x() = 0.003;
    ASSERT_TRUE(engine.step(beside, true, TimePoint{}, answer));
    EXPECT_EQ(answer.listed_count, is_field ? 0U : 1U) << is_field;
  }
}

TEST(ForeignEngine, RefusesAForceElsewhereThatIsNotFinite) {
  class Wild final : public sdk::Engine {
   public:
    sdk::Answer step(const sdk::Motion&) override {
      return {.force_on_tool_newton = sdk::Vector3(0, 0, 1)};
    }
    std::optional<sdk::Vector3> force_at(const sdk::Vector3&) override {
      return sdk::Vector3(0, 0, std::numeric_limits<double>::quiet_NaN());
    }
  };
  ForeignEngine engine(std::make_unique<Wild>(), true);
  Interaction answer;
  EXPECT_FALSE(engine.step(moving(0.0, -0.05), true, TimePoint{}, answer));
  try {
    engine.rethrow();
    FAIL();
  } catch (const std::exception& error) {
    EXPECT_NE(std::string(error.what()).find("force_at"), std::string::npos);
  }
}

struct Stepped {
  bool has_answer = false;
  Interaction answer;
  std::string error;
};

Stepped step(const sdk::Answer& answer, bool has_estimate = true) {
  ForeignEngine engine(std::make_unique<Scripted>([&](const sdk::Motion&) { return answer; }),
                       has_estimate);
  Stepped stepped;
  stepped.has_answer = engine.step({}, true, TimePoint{}, stepped.answer);
  try {
    engine.rethrow();
  } catch (const std::exception& error) {
    stepped.error = error.what();
  }
  return stepped;
}

TEST(ForeignEngine, ListsContactsTheDeepestFirstAndAddsTheirForces) {
  const Stepped stepped =
      step({.contacts = {{.penetration_m = -0.01, .stiffness_newton_per_m = 100.0},
                         {.penetration_m = 0.01, .stiffness_newton_per_m = 100.0, .tissue = 2},
                         {.normal = Vector3::UnitX(),
                          .penetration_m = 0.02,
                          .stiffness_newton_per_m = 100.0,
                          .tissue = 1}}});
  ASSERT_EQ(stepped.error, "");
  const Interaction& answer = stepped.answer;
  EXPECT_EQ(answer.listed_count, 3U);
  EXPECT_EQ(answer.contact_count, 2U);
  EXPECT_EQ(answer.contacts[0].tissue, 1U);
  EXPECT_EQ(answer.contacts[1].tissue, 2U);
  EXPECT_LT((answer.force_on_tool_newton - Vector3(2.0, 0.0, 1.0)).norm(), 1e-12);
  EXPECT_NEAR(answer.stored_energy_joule, 0.025, 1e-12);
}

TEST(ForeignEngine, KeepsTheDeepestOfMoreContactsThanAMessageHolds) {
  sdk::Answer many;
  for (int i = 1; i <= 12; ++i) {
    many.contacts.push_back({.penetration_m = 1e-3 * i, .stiffness_newton_per_m = 100.0});
  }
  const Interaction answer = step(many).answer;
  EXPECT_EQ(answer.listed_count, kMaxContacts);
  EXPECT_EQ(answer.contact_count, 12U);
  EXPECT_NEAR(answer.contacts[0].penetration_m, 0.012, 1e-12);
  EXPECT_NEAR(answer.force_on_tool_newton.z(), 7.8, 1e-9);
}

TEST(ForeignEngine, MakesAModelOfAForceAlone) {
  const Interaction answer = step({.force_on_tool_newton = Vector3(0.0, 0.0, 2.0)}).answer;
  EXPECT_EQ(answer.listed_count, 1U);
  EXPECT_EQ(answer.contact_count, 1U);
  EXPECT_EQ(answer.contacts[0].normal_world, Vector3::UnitZ());
  EXPECT_EQ(answer.force_on_tool_newton, Vector3(0.0, 0.0, 2.0));
}

// mofc_node holds the force and needs to know that something is touched.
TEST(ForeignEngine, GivesTheForceAloneWhereItIsHeld) {
  const Interaction answer =
      step({.contacts = {{.penetration_m = 1e-3, .force_on_tool_newton = Vector3(0.0, 0.0, 2.0)}}},
           false)
          .answer;
  EXPECT_EQ(answer.contact_count, 1U);
  EXPECT_EQ(answer.force_on_tool_newton, Vector3(0.0, 0.0, 2.0));
}

// Two contact points of one tissue, of which the engine knows forces only: one tissue.
TEST(ForeignEngine, JoinsThePointsOfATissue) {
  const Vector3 left = Vector3(-0.6, 0.0, 0.8);
  const Vector3 right = Vector3(0.6, 0.0, 0.8);
  const Interaction answer =
      step({.contacts =
                {{.normal = left, .penetration_m = 1e-3, .force_on_tool_newton = Vector3(left)},
                 {.normal = right, .penetration_m = 1e-3, .force_on_tool_newton = Vector3(right)}}})
          .answer;
  ASSERT_EQ(answer.listed_count, 1U);
  EXPECT_LT((answer.contacts[0].normal_world - Vector3::UnitZ()).norm(), 1e-9);
  EXPECT_NEAR(answer.force_on_tool_newton.z(), 1.6, 1e-9);
}

TEST(ForeignEngine, RefusesWhatTheWireRefusesAndSaysWhat) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto error_of = [](const sdk::Contact& contact) {
    return step({.contacts = {contact}}).error;
  };
  EXPECT_NE(
      error_of({.stiffness_newton_per_m = -3.0}).find("contacts[0].stiffness_newton_per_m = -3"),
      std::string::npos);
  EXPECT_NE(error_of({.normal = {0, 0, 2}, .stiffness_newton_per_m = 1.0}).find("normal"),
            std::string::npos);
  EXPECT_NE(error_of({.penetration_m = nan, .stiffness_newton_per_m = 1.0}).find("penetration_m"),
            std::string::npos);
  EXPECT_NE(error_of({.penetration_m = 1e-3}).find("neither stiffness nor force"),
            std::string::npos);
  const Stepped stepped = step({.force_on_tool_newton = Vector3(nan, 0.0, 0.0)});
  EXPECT_FALSE(stepped.has_answer);
  EXPECT_NE(stepped.error.find("force_on_tool_newton"), std::string::npos);
}

TEST(ForeignEngine, KeepsWhatTheEngineThrows) {
  ForeignEngine engine(std::make_unique<Scripted>([](const sdk::Motion&) -> sdk::Answer {
                         throw std::runtime_error("diverged");
                       }),
                       true);
  Interaction answer;
  EXPECT_FALSE(engine.step({}, true, TimePoint{}, answer));
  EXPECT_THROW(engine.rethrow(), std::runtime_error);
}

TEST(MovedSurfaces, AreAskedForOnlyWhileSomebodyWatches) {
  Scripted engine([](const sdk::Motion&) { return sdk::Answer{}; });
  MovedSurfaces surfaces;
  surfaces.reset({{.name = "a", .vertices_m = {0, 0, 0}, .triangles = {}},
                  {.name = "b", .vertices_m = {1, 1, 1}, .triangles = {}}});
  std::vector<float> vertices_m;
  surfaces.collect(engine);
  EXPECT_FALSE(surfaces.take(0, vertices_m));
  surfaces.request();
  surfaces.collect(engine);
  EXPECT_TRUE(surfaces.take(0, vertices_m));
  EXPECT_EQ(vertices_m, (std::vector<float>{0, 0, -0.5F}));
  EXPECT_FALSE(surfaces.take(0, vertices_m)) << "once";
  EXPECT_FALSE(surfaces.take(1, vertices_m)) << "this one has not moved";
}

}  // namespace
}  // namespace palpate::physics
