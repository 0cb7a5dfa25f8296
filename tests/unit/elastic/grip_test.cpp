// SPDX-License-Identifier: Apache-2.0
// The jaws of a tool on an elastic body.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "physics_node/elastic/equilibrium.h"
#include "physics_node/elastic/grip/held_points.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/bench/elastic/elastic_problems.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"

namespace palpate::physics {
namespace {

constexpr double kGripTip_m = 0.006;
constexpr double kGripReach_m = 0.05;
constexpr double kGripTick_s = 1e-3;

std::vector<std::uint32_t> nodes_of(const std::vector<elastic::SurfacePoint>& points) {
  std::vector<std::uint32_t> nodes;
  for (const auto& point : points) point.add_nodes_to(nodes);
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

/// Holds what is far from the points, and pulls: the force of the full solution.
struct Pull {
  elastic::Body body{
      bench::standing_block(elastic::block_mesh(4, 4, 4e-3), elastic::Law::kStableNeoHookean)};
  std::vector<elastic::SurfacePoint> points{bench::top_points(body.mesh(), 0.012, 2)};
  elastic::HeldPoints held{};
  elastic::EquilibriumSearch search{body};
  elastic::WarpedFactor factor{body, elastic::Precision::kDouble};
  elastic::VectorXd x{body.rest_m()};
  elastic::WarpedFactor rest{body, elastic::Precision::kDouble};
  elastic::SurfaceCompliance compliance{body, rest, nodes_of(points)};
};

/// Of the first tool.
Matrix3 own_stiffness(elastic::SurfaceCompliance& compliance,
                      std::span<const elastic::HeldPoints> tools) {
  return elastic::grip_stiffness_newton_per_m(compliance, tools, 0)[0];
}

class HeldObstacle final : public elastic::Obstacle {
 public:
  explicit HeldObstacle(const elastic::HeldPoints& held) : held_(held) {}
  double add_gradient(const double* x_m, double* gradient) const override {
    return held_.add_gradient(x_m, gradient);
  }
  void add_stiffness(const double* /*x_m*/, const elastic::BlockPattern& pattern,
                     elastic::BlockValues& values) const override {
    held_.add_stiffness(pattern, values);
  }

 private:
  const elastic::HeldPoints& held_;
};

const Vector3 kGripTop_m(0.05, 0.05, 0.05);

// Small strain: the force of a full solution is that of K = Jᵀ (C + 1/k)⁻¹ J, in each direction.
TEST(Grip, ItsStiffnessIsThatOfTheFullSolution) {
  Pull pull;
  pull.held.take(pull.points, pull.x.data(), kGripTop_m, 0.008, 64, 2000.0);
  ASSERT_GT(pull.held.size(), 8U);
  const Matrix3 K = own_stiffness(pull.compliance, {&pull.held, 1});
  EXPECT_TRUE(K.isApprox(K.transpose(), 1e-12));

  const HeldObstacle obstacle(pull.held);
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3 way_m = 1e-5 * Vector3::Unit(axis);
    pull.held.set_place(kGripTop_m + way_m);
    pull.x = pull.body.rest_m();
    ASSERT_TRUE(find_rest(pull.search, pull.factor, const_cast<HeldObstacle*>(&obstacle),
                          {.tolerance_m = 1e-11}, pull.x)
                    .is_converged);
    std::vector<Vector3> on_body(pull.points.size(), Vector3::Zero());
    const Vector3 newton = pull.held.add_forces_on_body(pull.x.data(), on_body);
    EXPECT_LT((newton + K * way_m).norm(), 5e-3 * newton.norm()) << axis;
    Vector3 sum = newton;
    for (const Vector3& one : on_body) sum += one;
    EXPECT_LT(sum.norm(), 1e-12) << "action and reaction";
  }
}

// A soft spring to a body that hardly gives way is that spring alone.
TEST(Grip, SoftJawsAreTheirOwnStiffness) {
  Pull pull;
  pull.held.take(pull.points, pull.x.data(), kGripTop_m, 0.008, 5, 1.0);
  EXPECT_EQ(pull.held.size(), 5U);
  const Matrix3 K = own_stiffness(pull.compliance, {&pull.held, 1});
  EXPECT_LT((K - Matrix3::Identity()).norm(), 0.03);
}

TEST(Grip, ASecondGripMakesTheBodyStiffer) {
  Pull pull;
  pull.held.take(pull.points, pull.x.data(), kGripTop_m, 0.005, 64, 2000.0);
  std::vector<elastic::HeldPoints> all(2);
  all[0] = pull.held;
  all[1].take(pull.points, pull.x.data(), kGripTop_m + Vector3(0.01, 0, 0), 0.004, 64, 2000.0);
  ASSERT_FALSE(all[1].is_empty());
  const Matrix3 alone = own_stiffness(pull.compliance, {all.data(), 1});
  const Matrix3 both = own_stiffness(pull.compliance, all);
  EXPECT_GT((both - alone).eigenvalues().real().minCoeff(), 0.0);
}

// A force that stiffens along z alone: after the update the change along z is explained, across it
// the stiffness is what it was.
TEST(Grip, TheStiffnessFollowsWhatTheSolutionsShow) {
  const Matrix3 K = Vector3(50, 60, 70).asDiagonal();
  const Vector3 way_m(0, 0, 2e-3);
  const Matrix3 updated = elastic::updated_stiffness(K, way_m, {0.01, 0, 0.3});
  EXPECT_LT((updated * way_m - Vector3(0.01, 0, 0.3)).norm(), 1e-15);
  EXPECT_NEAR(updated(1, 1), 60.0, 1e-9);
  EXPECT_GT(updated.eigenvalues().real().minCoeff(), 0.0);
  // too short, against the way, or more than ten times as stiff
  EXPECT_EQ(elastic::updated_stiffness(K, {0, 0, 1e-6}, {0, 0, 1.0}), K);
  EXPECT_EQ(elastic::updated_stiffness(K, way_m, {0, 0, -0.1}), K);
  EXPECT_EQ(elastic::updated_stiffness(K, way_m, {0, 0, 2.0}), K);
}

// --- in a scene ----------------------------------------------------------------------------------

class GripScene : public testing::Test {
 protected:
  GripScene() {
    ElasticMaterial material{.young_pa = 4e3, .viscosity_s = 0.005};
    material.is_linear = true;
    material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0299}}};
    scene_.tip_radius_m = kGripTip_m;
    scene_.gripper = GripperConfig{.reach_m = 0.009, .jaw_newton = 200.0, .tear_newton = 100.0};
    scene_.tissues = {
        {.name = "block",
         .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                  .file = test::source_dir() + "/deploy/sessions/small_block.msh"},
         .material = material}};
  }
  [[nodiscard]] std::shared_ptr<ElasticTissues> tissues(std::size_t tools = 1) const {
    return ElasticTissues::of(scene_, tools, ElasticPace::kVirtual);
  }
  /// On the surface for 0.1 s, then up at 50 mm/s, at most 20 mm; closed from 40 ms on.
  static Vector3 pulled(double time_s) {
    return {0, 0, kGripTip_m - 2e-4 + std::clamp(0.05 * (time_s - 0.1), 0.0, 0.02)};
  }
  static JawInput closed_from(double time_s) { return {.is_closed = time_s > 0.04}; }

  SceneConfig scene_;
};

double force_z(ElasticTissues& elastic, double time_s, const Vector3& tip_m, const JawInput& jaw,
               std::size_t tool = 0) {
  SceneForce force;
  elastic.step(tool, tip_m, time_s, kGripReach_m, force, jaw);
  return force.force_on_tool_newton.z();
}

// The same model with a full solution every millisecond is the reference; 50 Hz in between.
TEST_F(GripScene, TheForceOfAPullIsThatOfTheFullSolution) {
  const auto elastic = tissues();
  ElasticReference reference(elastic_bodies_of(scene_), kGripTip_m, kGripTick_s, scene_.gripper);
  double error2 = 0.0;
  double peak = 0.0;
  const int ticks = test::kIsSanitized ? 200 : 600;
  for (int tick = 0; tick < ticks; ++tick) {
    const double time_s = kGripTick_s * tick;
    const JawInput jaw = closed_from(time_s);
    const double newton = force_z(*elastic, time_s, pulled(time_s), jaw);
    SceneForce ideal;
    reference.advance(time_s, pulled(time_s), ideal, jaw.is_closed);
    error2 += std::pow(newton - ideal.force_on_tool_newton.z(), 2);
    peak = std::max(peak, std::abs(ideal.force_on_tool_newton.z()));
  }
  EXPECT_GT(peak, test::kIsSanitized ? 0.1 : 0.5);
  // the path has corners; a sanitized run ends soon after the first
  EXPECT_LT(std::sqrt(error2 / ticks) / peak, test::kIsSanitized ? 0.06 : 0.03);

  PhysicsCounters counters;
  elastic->count_into(counters);
  EXPECT_GT(counters.elastic_points_held, 3U);
  EXPECT_LE(counters.elastic_points_held, 64U);
  EXPECT_EQ(counters.elastic_solves_failed, 0U);
  // each solution beside what was stated for it
  EXPECT_GT(counters.elastic_bounds_checked, 5U);
  EXPECT_LE(5 * counters.elastic_bound_violations, counters.elastic_bounds_checked);
  elastic->count_tool_into(0, counters);
  EXPECT_GE(counters.elastic_bound_newton, counters.elastic_error_newton);
  EXPECT_LT(counters.elastic_bound_newton, 0.2 * peak);
}

// What mofc_node may give back to the hand: the work that was done, but for what viscosity took.
TEST_F(GripScene, TheStoredEnergyIsTheWorkOfTheHandLessWhatViscosityTook) {
  for (const double viscosity_s : {0.0, 0.005}) {
    std::get<ElasticMaterial>(scene_.tissues[0].material).viscosity_s = viscosity_s;
    const auto elastic = tissues();
    double work_joule = 0.0;
    Contact contact;
    double z_before_m = pulled(0.0).z();
    double newton_before = 0.0;
    for (double time_s = 0.0; time_s < 0.6; time_s += kGripTick_s) {
      SceneForce force;
      elastic->step(0, pulled(time_s), time_s, kGripReach_m, force, closed_from(time_s));
      const double newton = force.force_on_tool_newton.z();
      work_joule -= 0.5 * (newton + newton_before) * (pulled(time_s).z() - z_before_m);
      newton_before = newton;
      z_before_m = pulled(time_s).z();
      if (force.listed_count > 0) contact = force.contacts[0];
    }
    ASSERT_NE(contact.grip.number, 0U);
    EXPECT_GT(work_joule, 2e-3);
    const double lost_joule = work_joule - contact.stored_energy_joule;
    if (viscosity_s == 0.0) {
      EXPECT_LT(std::abs(lost_joule), 0.03 * work_joule);
    } else {
      EXPECT_GT(lost_joule, 0.03 * work_joule);
    }
  }
}

TEST_F(GripScene, TheBodyGoesBackToRestWhenTheJawsOpenAndTheToolIsFree) {
  const auto elastic = tissues();
  double time_s = 0.0;
  for (; time_s < 0.6; time_s += kGripTick_s) {
    static_cast<void>(force_z(*elastic, time_s, pulled(time_s), closed_from(time_s)));
  }
  std::vector<float> at_rest;
  std::vector<float> strain;
  EXPECT_LT(force_z(*elastic, time_s, pulled(time_s), {.is_closed = true}), -0.1);
  time_s += kGripTick_s;
  EXPECT_EQ(force_z(*elastic, time_s, pulled(time_s), {}), 0.0) << "in the step of the opening";
  for (int tick = 0; tick < 1500; ++tick) {
    time_s += kGripTick_s;
    EXPECT_EQ(force_z(*elastic, time_s, pulled(time_s), {}), 0.0);
  }
  elastic->tissues()[0]->read_surface(at_rest, strain);
  const ElasticBody& body = elastic->tissues()[0]->body();
  double farthest_m = 0.0;
  for (std::size_t i = 0; i < body.shown_nodes.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = static_cast<Eigen::Index>(3 * std::size_t{body.shown_nodes[i]} + k);
      farthest_m = std::max(farthest_m,
                            std::abs(static_cast<double>(at_rest[3 * i + k]) - body.start_m[at]));
    }
  }
  EXPECT_LT(farthest_m, 1e-4);
}

// Of 0.2 N, the tool slips until it is out of reach, and holds nothing until the jaws close anew.
TEST_F(GripScene, SlipsOutAndTakesHoldAgain) {
  scene_.gripper->jaw_newton = 0.4;  // × 0.5
  const auto elastic = tissues();
  double most = 0.0;
  double time_s = 0.0;
  for (; time_s < 0.6; time_s += kGripTick_s) {
    const double newton = force_z(*elastic, time_s, pulled(time_s), closed_from(time_s));
    most = std::max(most, -newton);
  }
  EXPECT_NEAR(most, 0.2, 0.02);
  EXPECT_EQ(force_z(*elastic, time_s, pulled(time_s), {.is_closed = true}), 0.0);
  for (int tick = 0; tick < 300; ++tick) {
    time_s += kGripTick_s;
    EXPECT_EQ(force_z(*elastic, time_s, pulled(0.0) + Vector3(0, 0, 4e-4), {.is_closed = true}), 0)
        << "the jaws are closed around nothing";
  }
  time_s += kGripTick_s;
  static_cast<void>(force_z(*elastic, time_s, pulled(0.0), {}));
  double newton = 0.0;
  for (int tick = 0; tick < 200; ++tick) {
    time_s += kGripTick_s;
    newton = force_z(*elastic, time_s, pulled(0.0) + Vector3(0, 0, 1e-5 * std::max(0, tick - 60)),
                     {.is_closed = true});
  }
  EXPECT_LT(newton, -0.02);
}

TEST_F(GripScene, TearsAtItsLimit) {
  scene_.gripper->tear_newton = 0.3;
  const auto elastic = tissues();
  double most = 0.0;
  double last = 0.0;
  for (double time_s = 0.0; time_s < 0.6; time_s += kGripTick_s) {
    last = force_z(*elastic, time_s, pulled(time_s), closed_from(time_s));
    most = std::max(most, -last);
  }
  EXPECT_NEAR(most, 0.3, 0.01);
  EXPECT_EQ(last, 0.0);
}

// mofc_node says how far the tool has slipped, and that it has let go.
TEST_F(GripScene, FollowsTheReportOfMofcNode) {
  const auto elastic = tissues();
  double time_s = 0.0;
  GripReport report{.physics_session_id = 1, .number = 1};
  const auto run = [&](double z_m, int ticks) {
    double newton = 0.0;
    for (int tick = 0; tick < ticks; ++tick, time_s += kGripTick_s) {
      newton = force_z(*elastic, time_s, {0, 0, kGripTip_m + z_m},
                       {.is_closed = true, .report = report});
    }
    return newton;
  };
  static_cast<void>(force_z(*elastic, time_s, {0, 0, kGripTip_m}, {}));
  time_s += kGripTick_s;
  run(0.0, 100);
  const double pulled = run(0.004, 200);
  EXPECT_LT(pulled, -0.1);
  report.slip_m = {0, 0, 0.002};
  EXPECT_NEAR(run(0.004, 200), 0.5 * pulled, 0.1 * std::abs(pulled));
  EXPECT_NEAR(run(0.006, 200), pulled, 0.05 * std::abs(pulled));
  report.has_let_go = true;
  EXPECT_EQ(run(0.006, 1), 0.0);
  EXPECT_EQ(run(0.006, 200), 0.0);
}

// Two tools hold one block, one pulls: the other one has less to hold than with a block of its own.
TEST_F(GripScene, TwoToolsHoldOneBody) {
  const auto elastic = tissues(2);
  double lifted = 0.0;
  for (double time_s = 0.0; time_s < 0.6; time_s += kGripTick_s) {
    const JawInput jaw = closed_from(time_s);
    const Vector3 aside(0.008, 0, 0);
    static_cast<void>(force_z(*elastic, time_s, pulled(time_s) - aside, jaw, 0));
    lifted = force_z(*elastic, time_s, pulled(0.0) + aside, jaw, 1);
  }
  EXPECT_GT(lifted, 0.02) << "the first one pulls its tissue up";
  PhysicsCounters counters;
  elastic->count_into(counters);
  EXPECT_GT(counters.elastic_points_held, 6U);
}

// Between two solutions a tool at rest feels what the other one pulls at the body: 50 Hz beside a
// solution in every step.
TEST_F(GripScene, AToolFeelsTheOtherOneBetweenTwoSolutions) {
  const auto coarse = tissues(2);
  auto& material = std::get<ElasticMaterial>(scene_.tissues[0].material);
  material.solve_rate_hz = 1.0 / kGripTick_s;
  const auto fine = tissues(2);
  const Vector3 aside(0.008, 0, 0);
  double error2 = 0.0;
  double peak = 0.0;
  double held2 = 0.0;  // of a force that waits for the next solution
  double held = 0.0;
  constexpr int kTicks = 500;
  for (int tick = 0; tick < kTicks; ++tick) {
    const double time_s = kGripTick_s * tick;
    const JawInput still = closed_from(time_s);
    JawInput pulling = still;
    pulling.velocity_m_per_s = (pulled(time_s) - pulled(time_s - kGripTick_s)) / kGripTick_s;
    static_cast<void>(force_z(*coarse, time_s, pulled(time_s) - aside, pulling, 0));
    static_cast<void>(force_z(*fine, time_s, pulled(time_s) - aside, pulling, 0));
    const double newton = force_z(*coarse, time_s, pulled(0.0) + aside, still, 1);
    const double exact = force_z(*fine, time_s, pulled(0.0) + aside, still, 1);
    error2 += std::pow(newton - exact, 2);
    peak = std::max(peak, std::abs(exact));
    if (tick % 20 == 0) held = exact;
    held2 += std::pow(held - exact, 2);
  }
  EXPECT_GT(peak, 0.05);
  EXPECT_LT(std::sqrt(error2 / kTicks), 0.01 * peak);
  EXPECT_LT(error2, 0.25 * held2);
}

TEST_F(GripScene, AStepWithHeldTissueDoesNotAllocate) {
  const auto elastic = std::make_shared<ElasticTissues>(elastic_bodies_of(scene_), 1, kGripTip_m,
                                                        ElasticPace::kThread,
                                                        std::filesystem::path{}, scene_.gripper);
  const auto deadline = std::chrono::steady_clock::now() + test::patience(std::chrono::seconds(60));
  double time_s = 0.0;
  SceneForce force;
  while (force.listed_count == 0 || force.contacts[0].grip.number == 0) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    time_s += kGripTick_s;
    force = {};
    const test::AllocGuard guard;
    elastic->step(0, pulled(0.0), time_s, kGripReach_m, force, {.is_closed = time_s > 0.005});
    EXPECT_EQ(guard.count(), 0U);
    std::this_thread::yield();
  }
}

}  // namespace
}  // namespace palpate::physics
