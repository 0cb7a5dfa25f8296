// SPDX-License-Identifier: Apache-2.0
// Attachments that tear, against beam theory, which knows nothing of springs or tetrahedra.
#include "physics_node/elastic/attached/tearing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/elastic/random_shape.h"

namespace palpate::elastic {
namespace {

TEST(CohesiveLaw, TakesTheToughnessAndGoesBackOnALine) {
  const CohesiveLaw law{.softens_at_m = 2e-4};
  EXPECT_EQ(law.ratio(0.0), 1.0);
  EXPECT_EQ(law.ratio(2e-4), 1.0);
  EXPECT_NEAR(law.ratio(3e-4), 1.0 / 3.0, 1e-12);
  EXPECT_EQ(law.ratio(4e-4), 0.0);
  EXPECT_EQ(law.ratio(1.0), 0.0);
  // the area under f/k, by the trapezoidal rule
  constexpr int kParts = 10000;
  double area_m2 = 0.0;
  for (int i = 0; i < kParts; ++i) {
    const double at_m = 5e-4 * (i + 0.5) / kParts;
    area_m2 += 5e-4 / kParts * law.ratio(at_m) * at_m;
    if (i % 1000 == 999) {
      EXPECT_NEAR(law.area_m2(5e-4 * (i + 1) / kParts), area_m2, 1e-14) << i;
    }
  }
  EXPECT_NEAR(area_m2, 2e-4 * 2e-4, 1e-13);
}

/// A beam on springs of its lower side, some of which have torn further.
struct TornBeam {
  explicit TornBeam(unsigned seed) : body(description()), tearing(body) {
    tearing.note(random_shape(body, 3e-4, seed).data());
  }
  static BodyDescription description() {
    BodyDescription made{.mesh = beam_mesh(4, 1), .fixed_nodes = {}};
    made.fixed_nodes = nodes_where(made.mesh, [](const Vector3d& at) { return at.x() < 1e-9; });
    std::uint32_t index = 0;
    for (const std::uint32_t node : nodes_where(
             made.mesh, [](const Vector3d& at) { return at.x() > 0.01 && at.z() < 1e-9; })) {
      made.attachments.push_back({.node = node,
                                  .stiffness_newton_per_m = 80.0,
                                  .intact_newton_per_m = 100.0,
                                  .softens_at_m = 2e-4,
                                  .outward = Vector3d(0.6, 0.0, -0.8),
                                  .index = index++});
    }
    return made;
  }
  Body body;
  Tearing tearing;
};

// Central differences, away from the corners of the law.
TEST(Tearing, ForcesAreTheDerivativeOfTheEnergyAndWithTheBodyItIsStable) {
  int further = 0;
  for (const std::uint64_t number : test::seeds(20)) {
    const auto seed = static_cast<unsigned>(number);
    const TornBeam beam(seed);
    const VectorXd x = random_shape(beam.body, 4e-4, seed + 1000);
    VectorXd gradient = VectorXd::Zero(x.size());
    static_cast<void>(beam.tearing.add_gradient(x.data(), gradient.data()));
    BlockValues values(9 * beam.body.pattern().rows.size(), 0.0);
    beam.tearing.add_stiffness(x.data(), beam.body.pattern(), values);
    for (const Tearing::One& one : beam.tearing.attachments()) {
      const double apart_m = one.way(x.data()).apart_m.norm();
      further += apart_m > one.farthest_m ? 1 : 0;
      for (Eigen::Index k = 3 * Eigen::Index{one.attachment.node}, end = k + 3; k < end; ++k) {
        constexpr double kStep = 1e-8;
        VectorXd moved = x;
        VectorXd ignored = VectorXd::Zero(x.size());
        moved[k] = x[k] + kStep;
        const double above = beam.tearing.add_gradient(moved.data(), ignored.data());
        moved[k] = x[k] - kStep;
        const double below = beam.tearing.add_gradient(moved.data(), ignored.data());
        EXPECT_NEAR((above - below) / (2 * kStep), gradient[k], 3e-6) << seed;
      }
      const auto row = static_cast<std::size_t>(beam.body.pattern().row_of[one.attachment.node]);
      const Eigen::Map<const Eigen::Matrix3d> more(
          values.data() + std::size_t{9} * beam.body.pattern().starts[row]);
      const Eigen::Matrix3d both =
          more + one.attachment.stiffness_newton_per_m * Eigen::Matrix3d::Identity();
      EXPECT_GE(both.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), -1e-9);
    }
  }
  EXPECT_GT(further, 10) << "this says nothing";
}

// What was torn and is no longer there counts on.
TEST(Tearing, ContinuesInABodyWithFewerAttachments) {
  TornBeam beam(3);
  VectorXd x = beam.body.rest_m();
  x[3 * Eigen::Index{beam.tearing.attachments()[1].attachment.node}] -= 1e-3;
  EXPECT_TRUE(beam.tearing.note(x.data()));
  EXPECT_FALSE(beam.tearing.note(x.data()));
  const std::size_t torn = beam.tearing.torn();
  ASSERT_GE(torn, 1U);
  BodyDescription less = TornBeam::description();
  std::erase_if(less.attachments, [&](const Attachment& one) {
    return !(beam.tearing.attachments()[one.index].ratio() > 0.0);
  });
  const Body smaller(less);
  Tearing next(smaller);
  next.continue_as(beam.tearing);
  EXPECT_EQ(next.attachments().size() + torn, beam.tearing.attachments().size());
  EXPECT_EQ(next.torn(), torn);
  EXPECT_NEAR(next.taken_joule(), beam.tearing.taken_joule(), 1e-15);
}

}  // namespace
}  // namespace palpate::elastic

namespace palpate::physics {
namespace {

using testing::HasSubstr;

constexpr double kBeamLength_m = 0.1;
constexpr double kBeamWidth_m = 0.01;
constexpr double kBeamHeight_m = 0.006;
constexpr double kBeamYoung_pa = 1e6;
constexpr double kBed_pa_per_m = 3e7;
constexpr double kBeamFree_m = 0.035;  // of its length at the start
constexpr double kPeelTip_m = 0.003;

class Peeled : public testing::Test {
 protected:
  TissueConfig beam(int cells_along, double toughness_joule_per_m2) {
    const elastic::Mesh box = elastic::box_mesh(
        elastic::equal_planes(0.0, kBeamLength_m, cells_along),
        elastic::equal_planes(0.0, kBeamWidth_m, 2), elastic::equal_planes(0.0, kBeamHeight_m, 2));
    ElasticMaterial material{.young_pa = kBeamYoung_pa, .poisson_ratio = 0.0};
    material.viscosity_s = 0.0;
    material.mass_damping_per_s = 20.0;
    material.fixed = {
        HalfSpaceGeometry{.point_m = {kBeamLength_m - 1e-4, 0, 0}, .normal = {-1, 0, 0}}};
    material.attached = {
        {.where =
             BoxGeometry{.center_m = {0.5 * (kBeamFree_m + kBeamLength_m), 0.5 * kBeamWidth_m, 0.0},
                         .size_m = {kBeamLength_m - kBeamFree_m, kBeamWidth_m, 1e-4}},
         .stiffness_pa_per_m = kBed_pa_per_m,
         .toughness_joule_per_m2 = toughness_joule_per_m2}};
    return {.name = "beam",
            .geometry =
                FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                             .file = folder_.write("beam" + std::to_string(cells_along) + ".msh",
                                                   msh_text(test::tetrahedra_of(box)))},
            .material = material};
  }
  TempFolder folder_;
};

double torn_area_m2(const elastic::Tearing& tearing) {
  double newton_per_m = 0.0;
  for (const auto& one : tearing.attachments()) {
    if (!(one.ratio() > 0.0)) newton_per_m += one.attachment.intact_newton_per_m;
  }
  return newton_per_m / kBed_pa_per_m;
}

struct Peel {
  double release_joule_per_m2 = 0.0;  // by beam theory, mean while it advances
  double work_joule = 0.0;            // of the jaws
  double stored_joule = 0.0;
  double taken_joule = 0.0;
  double area_m2 = 0.0;
};

// The energy release rate of a cantilever follows from its force P and way u alone: P = 3 E I u/a³
// gives its free length a, then G = P² a²/(2 b E I).
Peel peel(const ElasticBody& body) {
  constexpr double kStep_s = 0.02;
  constexpr double kSpeed_m_per_s = 0.001;
  constexpr double kJaws_newton_per_m = 200.0;
  ElasticSimulation simulation(body, 1, kPeelTip_m, kStep_s);
  const Vector3 end_m(0.0, 0.5 * kBeamWidth_m, 0.5 * kBeamHeight_m);
  // so softly, and at so few points, that the end turns
  EXPECT_GE(simulation.hold(0, end_m, 0.0015, 4, kJaws_newton_per_m), 2U);
  const double bending = kBeamYoung_pa * kBeamWidth_m * std::pow(kBeamHeight_m, 3) / 12.0;  // N m²
  const double stretching_newton_per_m =
      kBeamYoung_pa * kBeamWidth_m * kBeamHeight_m / kBeamLength_m;
  Peel found;
  Vector3 at_m = end_m;
  Vector3 before_newton = Vector3::Zero();
  int advances = 0;
  std::vector<std::optional<TipState>> tips(1);
  for (int step = 1; step * kStep_s * kSpeed_m_per_s <= 0.012; ++step) {
    const double up_m = step * kStep_s * kSpeed_m_per_s;
    // straight up it would be stretched: its end is free to come along
    const Vector3 way_m(-0.2 * before_newton.x() / stretching_newton_per_m, 0.0,
                        kStep_s * kSpeed_m_per_s);
    at_m += way_m;
    tips[0] = TipState{.tip_m = at_m, .place_m = end_m};
    simulation.step(tips);
    const Vector3 newton = -simulation.touch(0).force_on_tool_newton;  // of the jaws
    found.work_joule += 0.5 * (newton + before_newton).dot(way_m);
    before_newton = newton;
    found.area_m2 = torn_area_m2(simulation.tearing());
    if (found.area_m2 > 0.005 * kBeamWidth_m && found.area_m2 < 0.035 * kBeamWidth_m) {
      const double free_m =
          std::cbrt(3.0 * bending * (up_m / newton.z() - 1.0 / kJaws_newton_per_m));
      found.release_joule_per_m2 +=
          std::pow(newton.z() * free_m, 2) / (2.0 * kBeamWidth_m * bending);
      ++advances;
    }
  }
  EXPECT_GT(advances, 20) << "this says nothing";
  found.release_joule_per_m2 /= advances;
  found.stored_joule = simulation.stored_joule();
  found.taken_joule = simulation.tearing().taken_joule();
  return found;
}

TEST_F(Peeled, TheReleaseRateOfABeamIsTheToughness) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  constexpr double kToughness = 0.6;
  std::vector<double> releases;
  for (const int cells : {40, 80}) {
    const auto body = make_elastic_body(beam(cells, kToughness), 0, kPeelTip_m);
    const Peel found = peel(*body);
    releases.push_back(found.release_joule_per_m2);
    EXPECT_NEAR(found.release_joule_per_m2 / kToughness, 1.0, 0.1) << cells;
    // of what is between two states of the law a part is taken
    EXPECT_NEAR(found.taken_joule / (kToughness * found.area_m2), 1.0, 0.1) << cells;
    EXPECT_NEAR((found.work_joule - found.stored_joule) / found.taken_joule, 1.0, 0.05) << cells;
  }
  EXPECT_NEAR(releases[1] / releases[0], 1.0, 0.05);
}

// Pressed towards what it is attached to it holds; with more toughness too.
TEST_F(Peeled, OnlyWhatIsPulledOffTears) {
  for (const double toughness : {0.6, 60.0}) {
    const auto body = make_elastic_body(beam(20, toughness), 0, kPeelTip_m);
    ElasticSimulation simulation(*body, 1, kPeelTip_m, 0.02);
    const Vector3 end_m(0.0, 0.5 * kBeamWidth_m, 0.5 * kBeamHeight_m);
    simulation.hold(0, end_m, 0.006, 64, 1e5);
    const double towards = toughness > 1.0 ? 1.0 : -1.0;
    std::vector<std::optional<TipState>> tips(1);
    for (int step = 1; step <= 100; ++step) {
      tips[0] =
          TipState{.tip_m = end_m + Vector3(0.0, 0.0, towards * 5e-5 * step), .place_m = end_m};
      simulation.step(tips);
    }
    if (toughness > 1.0) {
      EXPECT_EQ(simulation.tearing().taken_joule(), 0.0);
    } else {
      // on the other side of where it bends it is lifted, and only there
      EXPECT_LT(torn_area_m2(simulation.tearing()), 0.01 * kBeamWidth_m);
    }
    EXPECT_GT(simulation.touch(0).force_on_tool_newton.norm(), 0.02);
  }
}

/// On the free end, which is lifted at 10 mm/s.
Vector3 lifted_m(double time_s) {
  return {0.003, 0.5 * kBeamWidth_m,
          kBeamHeight_m + kPeelTip_m + std::clamp(0.01 * (time_s - 0.2), 0.0, 0.012)};
}

SceneForce lift(ElasticTissues& elastic, double time_s) {
  SceneForce force;
  elastic.step(0, lifted_m(time_s), time_s, 0.05, force, {.is_closed = time_s > 0.1});
  return force;
}

// The next bodies hold what is left; what is torn off does not come back when it is let go.
TEST_F(Peeled, ASessionFollowsItsFullSolutions) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const SceneConfig scene{
      .tip_radius_m = kPeelTip_m,
      .gripper = GripperConfig{.reach_m = 0.006, .stiffness_newton_per_m = 1e4, .jaw_newton = 100},
      .tissues = {beam(20, 0.6)}};
  const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
  ElasticReference reference(elastic_bodies_of(scene), kPeelTip_m, 1e-3, scene.gripper);
  double error2 = 0.0;
  double force2 = 0.0;
  for (double time_s = 0.0; time_s < 1.6; time_s += 1e-3) {
    const double newton = lift(*elastic, time_s).force_on_tool_newton.z();
    SceneForce ideal;
    reference.advance(time_s, lifted_m(time_s), ideal, time_s > 0.1, false);
    error2 += std::pow(newton - ideal.force_on_tool_newton.z(), 2);
    force2 += std::pow(ideal.force_on_tool_newton.z(), 2);
  }
  EXPECT_LT(std::sqrt(error2 / force2), 0.1);
  PhysicsCounters counters;
  elastic->count_into(counters);
  EXPECT_GT(counters.elastic_attachments_torn, 3U);
  EXPECT_GT(counters.elastic_torn_joule, 0.6 * 0.01 * kBeamWidth_m);
  EXPECT_GT(counters.elastic_bodies_remade, 0U);
  EXPECT_EQ(counters.elastic_bodies_refused, 0U);

  elastic->restore(0);
  static_cast<void>(lift(*elastic, 1.7));
  const auto& whole = elastic->tissues()[0]->ablation().present().body();
  EXPECT_EQ(whole, elastic->tissues()[0]->whole());
  PhysicsCounters after;
  elastic->count_into(after);
  EXPECT_EQ(after.elastic_attachments_torn, counters.elastic_attachments_torn);
  EXPECT_EQ(after.elastic_bodies_restored, 1U);
}

TEST_F(Peeled, IsRefusedWhereItsWeightTearsIt) {
  TissueConfig heavy = beam(20, 0.05);
  auto& material = std::get<ElasticMaterial>(heavy.material);
  material.gravity_m_per_s2 = {0.0, 0.0, 1.0};
  EXPECT_NO_THROW(static_cast<void>(make_elastic_body(heavy, 0, kPeelTip_m)));
  material.gravity_m_per_s2 = {0.0, 0.0, 99.0};
  material.density_kg_per_m3 = 3000.0;
  try {
    static_cast<void>(make_elastic_body(heavy, 0, kPeelTip_m));
    FAIL() << "accepted";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("tears under the weight"));
  }
}

}  // namespace
}  // namespace palpate::physics
