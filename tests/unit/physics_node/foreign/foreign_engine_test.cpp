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
