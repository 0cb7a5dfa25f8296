// SPDX-License-Identifier: Apache-2.0
// Elastic bodies that are tied together under a tool: peeled off each other, and between solutions.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/property/seeds.h"
#include "tests/unit/elastic/touching/together.h"

namespace palpate::physics {
namespace {

constexpr double kLong_m = 0.1;
constexpr double kWide_m = 0.01;
constexpr double kHigh_m = 0.006;
constexpr double kYoung_pa = 1e6;
constexpr double kBed_pa_per_m = 3e7;
constexpr double kFree_m = 0.035;  // of the beam, at the start
constexpr double kToughness_joule_per_m2 = 0.6;

class TiedUnderATool : public testing::Test {
 protected:
  /// A beam that lies on a block, and is tied to it but for its free end.
  SceneConfig beam_on_block(int cells) {
    ElasticMaterial beam{.young_pa = kYoung_pa, .poisson_ratio = 0.0};
    beam.mass_damping_per_s = 20.0;
    ElasticMaterial block = beam;
    beam.fixed = {HalfSpaceGeometry{.point_m = {kLong_m - 1e-4, 0, 0}, .normal = {-1, 0, 0}}};
    beam.attached = {{.where = HalfSpaceGeometry{.point_m = {kFree_m, 0, 0}, .normal = {-1, 0, 0}},
                      .stiffness_pa_per_m = kBed_pa_per_m,
                      .toughness_joule_per_m2 = kToughness_joule_per_m2,
                      .tissue = 1}};
    block.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0099}}};
    block.is_linear = true;
    return {.tip_radius_m = kPairTip_m,
            .tissues = {soft_box("beam",
                                 box_file(folder_, "beam", {0, 0, 0}, {kLong_m, kWide_m, kHigh_m},
                                          {cells, 2, 2}),
                                 beam),
                        soft_box("block",
                                 box_file(folder_, "block", {0.02, -0.005, -0.01},
                                          {kLong_m, kWide_m + 0.005, 0}, {17, 4, 2}),
                                 block)}};
  }

  /// A slab on a block, both soft; springs hold them together.
  SceneConfig slab_on_block(double toughness_joule_per_m2) {
    ElasticMaterial slab{.young_pa = 10e3, .poisson_ratio = 0.4, .viscosity_s = 0.005};
    slab.fixed = {HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = {1, 0, 0}}};
    slab.attached = {{.stiffness_pa_per_m = 3e5,
                      .toughness_joule_per_m2 = toughness_joule_per_m2,
                      .tissue = 1,
                      .is_anywhere = true}};
    ElasticMaterial block{.young_pa = 6e3, .poisson_ratio = 0.4, .viscosity_s = 0.005};
    block.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0299}}};
    return {
        .tip_radius_m = kPairTip_m,
        .tissues = {
            soft_box("slab",
                     box_file(folder_, "slab", {-0.03, -0.02, 0}, {0.03, 0.02, 0.012}, {6, 4, 2}),
                     slab),
            soft_box(
                "block",
                box_file(folder_, "block", {-0.025, -0.025, -0.03}, {0.02, 0.025, 0}, {5, 5, 3}),
                block)}};
  }
  test::TempFolder folder_;
};

// By beam theory force P and way u of the end alone give its free length, P = 3 E I u/a³, and with
// it the rate at which it releases energy, G = P² a²/(2 b E I). What the block gives way counts as
// a longer beam.
TEST_F(TiedUnderATool, ABeamIsPeeledOffABlockWithTheToughness) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  constexpr double kSpeed_m_per_s = 0.001;
  constexpr double kSoftJaws_newton_per_m = 200.0;
  const double bending = kYoung_pa * kWide_m * std::pow(kHigh_m, 3) / 12.0;  // N m²
  const double stretching_newton_per_m = kYoung_pa * kWide_m * kHigh_m / kLong_m;
  Together both(beam_on_block(40));
  ElasticSimulation& beam = *both.simulations[0];
  const Vector3 end_m(0.0, 0.5 * kWide_m, 0.5 * kHigh_m);
  ASSERT_GE(beam.hold(0, end_m, 0.0015, 4, kSoftJaws_newton_per_m), 2U);
  Vector3 at_m = end_m;
  Vector3 before_newton = Vector3::Zero();
  double work_joule = 0.0;
  double release_joule_per_m2 = 0.0;
  int advances = 0;
  double area_m2 = 0.0;
  for (int step = 1; step * kStep_s * kSpeed_m_per_s <= 0.012; ++step) {
    const double up_m = step * kStep_s * kSpeed_m_per_s;
    const Vector3 way_m(-0.2 * before_newton.x() / stretching_newton_per_m, 0.0,
                        kStep_s * kSpeed_m_per_s);
    at_m += way_m;
    both.step(TipState{.tip_m = at_m, .place_m = end_m});
    const Vector3 newton = -beam.touch(0).force_on_tool_newton;
    work_joule += 0.5 * (newton + before_newton).dot(way_m);
    before_newton = newton;
    double torn_newton_per_m = 0.0;
    for (const auto& one : beam.tearing().attachments()) {
      if (!(one.ratio() > 0.0)) torn_newton_per_m += one.attachment.intact_newton_per_m;
    }
    area_m2 = torn_newton_per_m / kBed_pa_per_m;
    if (area_m2 > 0.005 * kWide_m && area_m2 < 0.035 * kWide_m) {
      const double free_m =
          std::cbrt(3.0 * bending * (up_m / newton.z() - 1.0 / kSoftJaws_newton_per_m));
      release_joule_per_m2 += std::pow(newton.z() * free_m, 2) / (2.0 * kWide_m * bending);
      ++advances;
    }
  }
  ASSERT_GT(advances, 20) << "this says nothing";
  release_joule_per_m2 /= advances;
  const double taken_joule = beam.tearing().taken_joule();
  std::printf("release rate %.3f, taken %.3f of the toughness; work less stored %.3f of taken\n",
              release_joule_per_m2 / kToughness_joule_per_m2,
              taken_joule / (kToughness_joule_per_m2 * area_m2),
              (work_joule - beam.stored_joule()) / taken_joule);
  EXPECT_NEAR(release_joule_per_m2 / kToughness_joule_per_m2, 1.0, 0.12);
  EXPECT_NEAR(taken_joule / (kToughness_joule_per_m2 * area_m2), 1.0, 0.12);
  EXPECT_NEAR((work_joule - beam.stored_joule()) / taken_joule, 1.0, 0.05);
}

struct Errors {
  double error = 0.0;  // root mean square over that of the reference
  double largest_newton = 0.0;
};

/// @param tip_m  at a time   @param closes_s  the jaws
template <class Way>
Errors errors_of(const SceneConfig& scene, double until_s, double closes_s, const Way& tip_m,
                 ElasticTissues& elastic) {
  ElasticReference reference(elastic_bodies_of(scene), kPairTip_m, 1e-3, scene.gripper);
  double error2 = 0.0;
  double force2 = 0.0;
  Errors errors;
  for (int tick = 0; tick < static_cast<int>(until_s / 1e-3); ++tick) {
    const double time_s = 1e-3 * tick;
    const bool is_closed = time_s > closes_s;
    SceneForce force;
    elastic.step(0, tip_m(time_s), time_s, 0.05, force, {.is_closed = is_closed});
    SceneForce ideal;
    reference.advance(time_s, tip_m(time_s), ideal, is_closed);
    error2 += (force.force_on_tool_newton - ideal.force_on_tool_newton).squaredNorm();
    force2 += ideal.force_on_tool_newton.squaredNorm();
    errors.largest_newton = std::max(errors.largest_newton, ideal.force_on_tool_newton.norm());
  }
  errors.error = std::sqrt(error2 / force2);
  return errors;
}

TEST_F(TiedUnderATool, TheForceBetweenFullSolutionsKnowsThatTheOtherBodyGivesWay) {
  for (const bool is_on_slab : {true, false}) {
    const SceneConfig scene = slab_on_block(0.0);
    const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
    const Errors found = errors_of(
        scene, 0.6, 1e9,
        [&](double time_s) {
          const double way_m = 0.006 * 0.5 * (1.0 - std::cos(2.0 * 3.14159265 * time_s / 0.5));
          const double deeper_m = way_m - 0.001 - kPairTip_m;
          return is_on_slab ? Vector3(0.0, 0.001, 0.012 - deeper_m)
                            : Vector3(-0.025 + deeper_m, 0.001, -0.006);
        },
        *elastic);
    std::printf("%s: error %.1f %%, %.2f N\n", is_on_slab ? "on the slab" : "beside, on the block",
                1e2 * found.error, found.largest_newton);
    EXPECT_LT(found.error, 0.06);
  }
}

/// By its free end, which is lifted and brought back.
Vector3 lifted_m(double time_s) {
  const double up_m = 0.010 * 0.5 * (1.0 - std::cos(2.0 * 3.14159265 * (time_s - 0.2) / 1.6));
  return {0.027, 0.0, 0.012 + kPairTip_m - 0.001 + (time_s > 0.2 ? up_m : 0.0)};
}

TEST_F(TiedUnderATool, JawsLiftBothAndTearThemApart) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const auto lifted = [&](SceneConfig scene, const char* name) {
    scene.gripper =
        GripperConfig{.reach_m = 0.009, .stiffness_newton_per_m = 1e4, .jaw_newton = 100};
    const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
    const Errors found = errors_of(scene, 1.8, 0.1, lifted_m, *elastic);
    PhysicsCounters counters;
    elastic->count_into(counters);
    std::printf("%s: error %.1f %%, %.2f N, %d torn, %d bodies\n", name, 1e2 * found.error,
                found.largest_newton, static_cast<int>(counters.elastic_attachments_torn),
                static_cast<int>(counters.elastic_bodies_remade));
    EXPECT_EQ(counters.elastic_solves_failed, 0U);
    EXPECT_EQ(counters.elastic_bodies_refused, 0U);
    EXPECT_EQ(counters.elastic_attachments_torn > 5, counters.elastic_bodies_remade > 0);
    return found.error;
  };
  SceneConfig on_bed = slab_on_block(2.0);
  on_bed.tissues.pop_back();
  auto& attached = std::get<ElasticMaterial>(on_bed.tissues[0].material).attached[0];
  attached.tissue.reset();
  attached.is_anywhere = false;
  attached.where = BoxGeometry{.center_m = {-0.0025, 0, 0}, .size_m = {0.045, 0.05, 1e-4}};
  const double off_a_bed = lifted(on_bed, "off a bed that stands still");
  EXPECT_LT(lifted(slab_on_block(0.0), "tied to the block"), 0.06);
  EXPECT_LT(lifted(slab_on_block(2.0), "off the block"), std::max(0.1, 1.5 * off_a_bed));
}

}  // namespace
}  // namespace palpate::physics
