// SPDX-License-Identifier: Apache-2.0
// The rules of elastic { … } in a session: each violated, and kept.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <complex>
#include <fstream>
#include <iterator>
#include <numbers>

#include "common/session/materials.h"
#include "common/session/power_law.h"
#include "tests/support/machine/places.h"
#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr const char* kMesh = "tetrahedral_mesh { file: 'b.msh' }";
const std::string kHeld = "young_pa: 1e4 fixed { half_space {} }";

std::vector<std::string> elastic_complaints(const std::string& elastic,
                                            const std::string& geometry = kMesh,
                                            const std::string& tip_radius_m = "0.001") {
  return complaints(
      "name: \"x\" hand { press { until_s: 1 } } scene { tool { tip_radius_m: " + tip_radius_m +
          " } tissue { name: 'a' " + geometry + " elastic { " + elastic + " } } }",
      {}, "/tmp");
}

/// One problem, at this field.
auto is_at(const std::string& field, const std::string& words) {
  return AllOf(SizeIs(2),
               ::testing::Contains(AllOf(StartsWith("x.txtpb:"),
                                         HasSubstr("scene.tissue[0]." + field), HasSubstr(words))));
}

TEST(ElasticRules, AHeldBodyIsAccepted) {
  EXPECT_THAT(elastic_complaints(kHeld), IsEmpty());
  EXPECT_THAT(elastic_complaints("young_pa: 10 poisson_ratio: 0.49 friction_coefficient: 10 "
                                 "fixed { sphere { radius_m: 1 } } "
                                 "fixed { box { size_m { x: 1 y: 1 z: 1 } } } "
                                 "part { where { half_space {} } young_pa: 1e9 poisson_ratio: 0 }"),
              IsEmpty());
}

TEST(ElasticRules, NeedsTetrahedraThatNothingMovesUnderATipOfASize) {
  EXPECT_THAT(elastic_complaints(kHeld, "sphere { radius_m: 1 }"),
              is_at("elastic", "needs the inside of the body; give tetrahedral_mesh"));
  EXPECT_THAT(elastic_complaints(kHeld, std::string(kMesh) + " motion { frequency_hz: 1 }"),
              is_at("motion", "held by its fixed places"));
  EXPECT_THAT(elastic_complaints(kHeld, kMesh, "0.0009"),
              is_at("elastic", "a sphere of at least 1 mm; set scene.tool.tip_radius_m"));
}

TEST(ElasticRules, PlacesMayBeRegionsOfTheMesh) {
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 fixed { tag: 'vena cava' } "
                                 "part { where { tag: 'lesion' } young_pa: 6e4 }"),
              IsEmpty());
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 fixed { tag: '' }"),
              is_at("elastic.fixed[0].tag", "must name a region of the mesh"));
  EXPECT_THAT(
      elastic_complaints("young_pa: 1e4 fixed { near { tag: 'vena cava' within_m: 0.003 } }"),
      IsEmpty());
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 fixed { near { tag: 'vena cava' } }"),
              is_at("elastic.fixed[0].near.within_m", "required"));
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 fixed { near { tag: 'a' within_m: 0 } }"),
              is_at("elastic.fixed[0].near.within_m", "must be > 0"));
}

TEST(ElasticRules, SpringsMayHoldItInsteadOfFixedPlaces) {
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 attached { where { tag: 'ligament' } "
                                 "stiffness_pa_per_m: 2e5 } attached { where { near { tag: 'a' "
                                 "within_m: 0.003 } } stiffness_pa_per_m: 1e9 }"),
              IsEmpty());
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 attached { where { tag: 'ligament' } }"),
              is_at("elastic.attached[0].stiffness_pa_per_m", "required"));
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 attached { stiffness_pa_per_m: 2e5 }"),
              is_at("elastic.attached[0].where", "a place is required"));
  EXPECT_THAT(elastic_complaints(kHeld + " attached { where { half_space {} } "
                                         "stiffness_pa_per_m: 99 }"),
              is_at("elastic.attached[0].stiffness_pa_per_m = 99", "must be 100"));
  const std::string tears =
      " attached { where { half_space {} } stiffness_pa_per_m: 2e5 toughness_joule_per_m2: 5 }";
  EXPECT_THAT(elastic_complaints(kHeld + tears), ::testing::IsEmpty());
  EXPECT_THAT(elastic_complaints("young_pa: 1e4" + tears),
              is_at("elastic.attached[0].toughness_joule_per_m2", "would fall"));
  EXPECT_THAT(
      elastic_complaints(kHeld + tears + " viscoelastic { branch { share: 0.3 tau_s: 0.3 } }"),
      is_at("elastic.attached[0].toughness_joule_per_m2", "do not relax"));
  EXPECT_THAT(elastic_complaints(kHeld + " attached { where { half_space {} } "
                                         "stiffness_pa_per_m: 2e5 toughness_joule_per_m2: 0 }"),
              is_at("elastic.attached[0].toughness_joule_per_m2 = 0", "must be 0.01"));
}

TEST(ElasticRules, NamesWhatIsMissing) {
  EXPECT_THAT(elastic_complaints("fixed { half_space {} }"), is_at("elastic.young_pa", "required"));
  EXPECT_THAT(elastic_complaints("young_pa: 1e4"), is_at("elastic.fixed", "the body would fall"));
  EXPECT_THAT(elastic_complaints("young_pa: 1e4 fixed {}"),
              is_at("elastic.fixed[0]", "a place is required"));
  EXPECT_THAT(elastic_complaints(kHeld + " part { where { half_space {} } }"),
              is_at("elastic.part[0].young_pa", "required"));
}

TEST(ElasticRules, NamesWhatIsBeyondItsLimits) {
  const std::string fixed = " fixed { half_space {} }";
  EXPECT_THAT(elastic_complaints("young_pa: 9" + fixed),
              is_at("elastic.young_pa = 9", "must be 10"));
  EXPECT_THAT(elastic_complaints(kHeld + " poisson_ratio: 0.5"),
              is_at("elastic.poisson_ratio = 0.5", "must be 0 … 0.49"));
  EXPECT_THAT(elastic_complaints(kHeld + " friction_coefficient: 10.1"),
              is_at("elastic.friction_coefficient", "must be 0 … 10"));
  EXPECT_THAT(elastic_complaints(kHeld + " solve_rate_hz: 0.5"),
              is_at("elastic.solve_rate_hz", "must be 1 … 1000"));
  EXPECT_THAT(elastic_complaints(kHeld + " part { where { half_space {} } young_pa: 1e4 "
                                         "poisson_ratio: -0.1 }"),
              is_at("elastic.part[0].poisson_ratio", "must be 0 … 0.49"));
}

TEST(ElasticRules, AMaterialByNameGivesTheModulusAndAFigureGivenBesideItCounts) {
  EXPECT_THAT(elastic_complaints("material: 'liver' fixed { half_space {} } "
                                 "part { where { half_space {} } material: 'focal lesion' }"),
              IsEmpty());
  EXPECT_THAT(elastic_complaints("material: 'livr' fixed { half_space {} }"),
              is_at("elastic.material", "did you mean \"liver\"? known are \"hepatocellular"));
  EXPECT_THAT(elastic_complaints(kHeld + " part { where { half_space {} } material: 'xyzzyxx' }"),
              is_at("elastic.part[0].material", "known are"));
}

TEST(ElasticRules, RefusesRelaxationThatCannotBe) {
  const std::string branches = kHeld + " viscoelastic { ";
  EXPECT_THAT(elastic_complaints(branches + "branch { share: 0.3 tau_s: 0.1 } "
                                            "branch { share: 0.3 tau_s: 1 } }"),
              IsEmpty());
  EXPECT_THAT(elastic_complaints(branches + "power_law { exponent: 0.1 } }"), IsEmpty());
  EXPECT_THAT(elastic_complaints(branches + "}"), is_at("elastic.viscoelastic", "nothing relaxes"));
  EXPECT_THAT(elastic_complaints(branches + "branch { share: -0.1 tau_s: 1 } }"),
              is_at("elastic.viscoelastic.branch[0].share = -0.1", "must be"));
  EXPECT_THAT(elastic_complaints(branches + "branch { share: 0.1 tau_s: 0 } }"),
              is_at("elastic.viscoelastic.branch[0].tau_s = 0", "must be"));
  EXPECT_THAT(elastic_complaints(branches + "branch { share: nan tau_s: 1 } }"),
              is_at("elastic.viscoelastic.branch[0].share", "finite"));
  EXPECT_THAT(elastic_complaints(branches + "branch { share: 0.6 tau_s: 1 } "
                                            "branch { share: 0.5 tau_s: 2 } }"),
              is_at("elastic.viscoelastic", "sum to 1.1"));
  EXPECT_THAT(elastic_complaints(branches + "power_law { exponent: 0.7 } }"),
              is_at("elastic.viscoelastic.power_law.exponent = 0.7", "must be"));
  EXPECT_THAT(elastic_complaints(branches + "power_law { exponent: 0.1 } "
                                            "branch { share: 0.6 tau_s: 1 } }"),
              is_at("elastic.viscoelastic.power_law", "leave out"));
  std::string many = branches;
  for (int i = 0; i < 9; ++i) many += "branch { share: 0.01 tau_s: 1 } ";
  EXPECT_THAT(elastic_complaints(many + "}"), is_at("elastic.viscoelastic.branch[8]", "at most 8"));
}

// |E*(i ω)| of the branches, summed here by themselves, on frequencies between those of the fit.
TEST(PowerLaw, ItsBranchesFollowItWithinTheStatedError) {
  for (const double exponent : {0.02, 0.1, 0.2, 0.3}) {
    for (const double at_hz : {0.1, 1.0, 7.0}) {
      const PowerLawFit fit = fit_power_law(exponent, at_hz);
      double shares = 0.0;
      for (const auto& branch : fit.branches) {
        EXPECT_GT(branch.share, 0.0);
        shares += branch.share;
      }
      EXPECT_LT(shares, 0.99);
      double largest = 0.0;
      for (double f = 0.1; f <= 10.0; f *= 1.0077) {
        const std::complex<double> law =
            std::polar(std::pow(f / at_hz, exponent), 0.5 * std::numbers::pi * exponent);
        std::complex<double> sum = fit.rest_ratio;
        for (const auto& branch : fit.branches) {
          const double wt = 2.0 * std::numbers::pi * f * branch.tau_s;
          const double at_once = fit.rest_ratio * branch.share / (1.0 - shares);
          sum += at_once * std::complex<double>(wt * wt, wt) / (1.0 + wt * wt);
        }
        largest = std::max(largest, std::abs(sum - law) / std::abs(law));
      }
      EXPECT_LT(largest, 0.005) << exponent;
      EXPECT_NEAR(largest, fit.error_ratio, 0.05 * fit.error_ratio + 1e-6) << exponent;
    }
  }
}

// The table of the docs is that of the program.
TEST(Materials, TheirTableIsInTheDocs) {
  std::ifstream file(test::source_dir() + "/docs/materials.md");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_NE(text.find(materials_table()), std::string::npos)
      << "refresh it with the output of `palpate explain materials`";
}

// --- scene.tool.gripper
// ---------------------------------------------------------------------------

std::string with_gripper(const std::string& gripper, const std::string& material) {
  return "name: \"x\" hand { press { until_s: 1 } } scene { tool { tip_radius_m: 0.006 gripper { " +
         gripper + " } } tissue { name: 'a' " + material + " } }";
}
const std::string kBlock = std::string(kMesh) + " elastic { " + kHeld + " }";

TEST(GripperRules, HasDefaultsThatFollowTheTip) {
  const Session session = parse_session(with_gripper("button: 3", kBlock), "x.txtpb", {}, "/tmp");
  ASSERT_TRUE(session.scene.gripper);
  const GripperConfig& gripper = *session.scene.gripper;
  EXPECT_EQ(gripper.button, 3U);
  EXPECT_DOUBLE_EQ(gripper.reach_m, 0.009);
  EXPECT_EQ(gripper.most_points, 64U);
  EXPECT_EQ(gripper.stiffness_newton_per_m, 2000.0);
  EXPECT_EQ(gripper.slip_newton(), 5.0);
  EXPECT_EQ(gripper.tear_newton, 8.0);
  EXPECT_FALSE(
      parse_session("name: \"x\" scene { tool { tip_radius_m: 0.006 } tissue { " + kBlock + " } }",
                    "x.txtpb", {}, "/tmp")
          .scene.gripper);
}

TEST(GripperRules, NeedsElasticTissueAndFiguresInRange) {
  const auto complaint = [](const std::string& gripper, const std::string& material = kBlock) {
    return complaints(with_gripper(gripper, material), {}, "/tmp");
  };
  const auto at = [](const std::string& field, const std::string& words) {
    return AllOf(SizeIs(2), ::testing::Contains(AllOf(StartsWith("x.txtpb:"),
                                                      HasSubstr("scene.tool.gripper" + field),
                                                      HasSubstr(words))));
  };
  EXPECT_THAT(complaint("reach_m: 0.1 most_points: 1 jaw_newton: 1000 tear_newton: 1000"),
              IsEmpty());
  EXPECT_THAT(complaint("", "half_space {} kelvin_voigt { stiffness_newton_per_m: 400 }"),
              at("", "elastic"));
  EXPECT_THAT(complaint("button: 32"), at(".button", "31"));
  EXPECT_THAT(complaint("reach_m: 0"), at(".reach_m", "0"));
  EXPECT_THAT(complaint("reach_m: 0.11"), at(".reach_m", "0.1"));
  EXPECT_THAT(complaint("most_points: 0"), at(".most_points", "1"));
  EXPECT_THAT(complaint("most_points: 65"), at(".most_points", "64"));
  EXPECT_THAT(complaint("stiffness_newton_per_m: 9"), at(".stiffness_newton_per_m", "10"));
  EXPECT_THAT(complaint("jaw_newton: 0"), at(".jaw_newton", "0"));
  EXPECT_THAT(complaint("friction_coefficient: 10.1"), at(".friction_coefficient", "10"));
  EXPECT_THAT(complaint("tear_newton: 0"), at(".tear_newton", "0"));
}

TEST(GripperRules, TheJawsHaveAButtonOfTheirOwn) {
  const auto complaint = [](const std::string& rest) {
    return complaints(with_gripper("button: 3", kBlock) + rest, {}, "/tmp");
  };
  const auto at = [](const std::string& field) {
    return ElementsAre(HasSubstr("1 problem"),
                       AllOf(HasSubstr(field), HasSubstr("scene.tool.gripper.button")));
  };
  EXPECT_THAT(complaint("device { workspace { clutch_button: 3 } }"),
              at("device.workspace.clutch_button"));
  EXPECT_THAT(complaint("device { dead_man_button: 3 }"), at("device.dead_man_button"));
  EXPECT_THAT(complaint("task { mark_button: 3 free {} }"), at("task.mark_button"));
  EXPECT_THAT(complaint("device { dead_man_button: 2 workspace { clutch_button: 1 } } "
                        "task { mark_button: 0 free {} }"),
              IsEmpty());
}

// --- scene.tool.needle
// ---------------------------------------------------------------------------

std::string with_needle(const std::string& needle, const std::string& elastic,
                        const std::string& tool = "") {
  return "name: \"x\" scene { tool { tip_radius_m: 0.002 needle { " + needle + " } " + tool +
         " } tissue { name: 'a' " + std::string(kMesh) + " elastic { " + kHeld + " " + elastic +
         " } } }";
}
const std::string kPierced = "pierced { toughness_joule_per_m2: 130 }";

TEST(NeedleRules, HasDefaultsThatFollowTheTip) {
  const Session session =
      parse_session(with_needle("", kPierced + " part { where { sphere { radius_m: 0.01 } } "
                                               "young_pa: 9e3 toughness_joule_per_m2: 300 }"),
                    "x.txtpb", {}, "/tmp");
  ASSERT_TRUE(session.scene.needle);
  EXPECT_DOUBLE_EQ(session.scene.needle->width_m, 0.004);
  EXPECT_DOUBLE_EQ(session.scene.needle->reach_m, 0.003);
  EXPECT_FALSE(session.scene.gripper);
  ASSERT_TRUE(session.scene.holder());
  EXPECT_TRUE(session.scene.holder()->is_needle());
  EXPECT_EQ(session.scene.holder()->stiffness_newton_per_m, 2000.0);
  const auto& pierced = std::get<ElasticMaterial>(session.scene.tissues[0].material).pierced;
  ASSERT_TRUE(pierced);
  EXPECT_EQ(pierced->spreading_ratio, 0.3);
  EXPECT_EQ(pierced->friction_newton_per_m, 10.0);
  EXPECT_EQ(pierced->membrane_newton, 0.0);
  EXPECT_EQ(pierced->toughness_at({0, 0, 0.009}), 300.0);
  EXPECT_EQ(pierced->toughness_at({0, 0, 0.011}), 130.0);
}

TEST(NeedleRules, NeedsTissueThatLetsItInAndFiguresInRange) {
  const auto complaint = [](const std::string& needle, const std::string& elastic = kPierced,
                            const std::string& tool = "") {
    return complaints(with_needle(needle, elastic, tool), {}, "/tmp");
  };
  const auto at = [](const std::string& field, const std::string& words) {
    return AllOf(SizeIs(2), ::testing::Contains(
                                AllOf(StartsWith("x.txtpb:"), HasSubstr(field), HasSubstr(words))));
  };
  EXPECT_THAT(complaint("width_m: 0.02 most_points: 1"), IsEmpty());
  EXPECT_THAT(complaint("", ""), at("scene.tool.needle", "pierced"));
  EXPECT_THAT(complaint("", kPierced, "gripper {}"), at("scene.tool.needle", "gripper"));
  EXPECT_THAT(complaint("width_m: 0"), at("needle.width_m", "0"));
  EXPECT_THAT(complaint("width_m: 0.021"), at("needle.width_m", "0.02"));
  EXPECT_THAT(complaint("reach_m: 0.11"), at("needle.reach_m", "0.1"));
  EXPECT_THAT(complaint("most_points: 65"), at("needle.most_points", "64"));
  EXPECT_THAT(complaint("stiffness_newton_per_m: 9"), at("needle.stiffness_newton_per_m", "10"));
  const auto pierced = [&](const std::string& fields) {
    return complaint("", "pierced { " + fields + " }");
  };
  EXPECT_THAT(pierced(""), at("pierced.toughness_joule_per_m2", "liver"));
  EXPECT_THAT(pierced("toughness_joule_per_m2: 0"), at("toughness_joule_per_m2", "0"));
  const std::string tough = "toughness_joule_per_m2: 100 ";
  EXPECT_THAT(pierced(tough + "spreading_ratio: 3.1"), at("pierced.spreading_ratio", "3"));
  EXPECT_THAT(pierced(tough + "friction_newton_per_m: -1"),
              at("pierced.friction_newton_per_m", "0"));
  EXPECT_THAT(pierced(tough + "membrane_newton: 101"), at("pierced.membrane_newton", "100"));
  const std::string part = "part { young_pa: 9e3 toughness_joule_per_m2: 300 where { ";
  EXPECT_THAT(complaint("", kPierced + part + "tag: 'b' } }"),
              at("part[0].toughness_joule_per_m2", "sphere"));
}

// --- scene.tool.blade
// -------------------------------------------------------------------------------

std::string with_blade(const std::string& blade, const std::string& elastic = kPierced,
                       const std::string& tool = "", const std::string& more = "") {
  return "name: \"x\" " + more + " scene { tool { tip_radius_m: 0.002 blade { " + blade + " } " +
         tool + " } tissue { name: 'a' " + std::string(kMesh) + " elastic { " + kHeld + " " +
         elastic + " } } }";
}

TEST(BladeRules, HasDefaultsThatFollowTheTip) {
  const Session session = parse_session(with_blade("length_m: 0.02"), "x.txtpb", {}, "/tmp");
  ASSERT_TRUE(session.scene.blade);
  EXPECT_DOUBLE_EQ(session.scene.blade->reach_m, 0.003);
  EXPECT_EQ(session.scene.blade->facing, Vector3(Vector3::UnitX()));
  ASSERT_TRUE(session.scene.holder());
  EXPECT_TRUE(session.scene.holder()->is_needle());  // as which it goes in
  EXPECT_TRUE(session.scene.holder()->is_blade());
  EXPECT_DOUBLE_EQ(session.scene.holder()->needle_width_m, 0.004);
  EXPECT_TRUE(is_restorable(session.scene, session.scene.tissues[0]));
  const Session turned =
      parse_session(with_blade("length_m: 0.001 facing { x: 3 y: -4 }"), "x.txtpb", {}, "/tmp");
  EXPECT_NEAR((turned.scene.blade->facing - Vector3(0.6, -0.8, 0)).norm(), 0.0, 1e-12);
  EXPECT_DOUBLE_EQ(turned.scene.holder()->needle_width_m, 0.001);
}

TEST(BladeRules, NeedsTissueThatItCutsAndFiguresInRange) {
  const std::string ok = "length_m: 0.02 ";
  const auto complaint = [](const std::string& blade, const std::string& elastic = kPierced,
                            const std::string& tool = "", const std::string& more = "") {
    return complaints(with_blade(blade, elastic, tool, more), {}, "/tmp");
  };
  const auto at = [](const std::string& field, const std::string& words) {
    return AllOf(SizeIs(2), ::testing::Contains(
                                AllOf(StartsWith("x.txtpb:"), HasSubstr(field), HasSubstr(words))));
  };
  EXPECT_THAT(complaint("length_m: 0.1 most_points: 1"), IsEmpty());
  EXPECT_THAT(complaint(""), at("blade.length_m", "edge"));
  EXPECT_THAT(complaint("length_m: 0"), at("blade.length_m", "0"));
  EXPECT_THAT(complaint("length_m: 0.11"), at("blade.length_m", "0.1"));
  EXPECT_THAT(complaint(ok + "facing { z: 1 }"), at("blade.facing", "right angle"));
  EXPECT_THAT(complaint(ok + "reach_m: 0.11"), at("blade.reach_m", "0.1"));
  EXPECT_THAT(complaint(ok + "most_points: 65"), at("blade.most_points", "64"));
  EXPECT_THAT(complaint(ok + "stiffness_newton_per_m: 9"),
              at("blade.stiffness_newton_per_m", "10"));
  EXPECT_THAT(complaint(ok, ""), at("scene.tool.blade", "pierced"));
  EXPECT_THAT(complaint(ok, kPierced, "needle {}"), at("scene.tool.blade", "needle"));
  EXPECT_THAT(complaint(ok, kPierced, "gripper {}"), at("scene.tool.blade", "gripper"));
  EXPECT_THAT(complaint(ok, kPierced, "", "physics { standby {} }"), at("standby", "cut"));
  EXPECT_THAT(complaint(ok, kPierced + " attached { where { half_space {} } stiffness_pa_per_m: "
                                       "2e5 toughness_joule_per_m2: 5 }"),
              at("scene.tool.blade", "tears"));
}

// --- scene.tool.electrode
// ---------------------------------------------------------------------------

std::string with_electrode(const std::string& electrode, const std::string& material = kBlock,
                           const std::string& tool = "") {
  return "name: \"x\" hand { press { until_s: 1 } } scene { tool { tip_radius_m: 0.006 " + tool +
         " electrode { " + electrode + " } } tissue { name: 'a' " + material + " } }";
}

TEST(ElectrodeRules, HasDefaultsThatFollowTheTip) {
  const Session session = parse_session(with_electrode(""), "x.txtpb", {}, "/tmp");
  ASSERT_TRUE(session.scene.electrode);
  const ElectrodeConfig& electrode = *session.scene.electrode;
  EXPECT_EQ(electrode.button, 0U);
  EXPECT_EQ(electrode.power_watt, 50.0);
  EXPECT_DOUBLE_EQ(electrode.reach_m, 0.009);
  EXPECT_EQ(electrode.energy_joule_per_kg, 2e6);
  EXPECT_EQ(electrode.softest_ratio, 0.2);
  EXPECT_FALSE(parse_session(with_gripper("", kBlock), "x.txtpb", {}, "/tmp").scene.electrode);
}

TEST(ElectrodeRules, NeedsElasticTissueAndFiguresInRange) {
  const auto complaint = [](const std::string& electrode, const std::string& material = kBlock) {
    return complaints(with_electrode(electrode, material), {}, "/tmp");
  };
  const auto at = [](const std::string& field, const std::string& words) {
    return AllOf(SizeIs(2), ::testing::Contains(AllOf(StartsWith("x.txtpb:"),
                                                      HasSubstr("scene.tool.electrode" + field),
                                                      HasSubstr(words))));
  };
  EXPECT_THAT(complaint("button: 31 power_watt: 1000 reach_m: 0.1 energy_joule_per_kg: 1e9 "
                        "softest_ratio: 1"),
              IsEmpty());
  EXPECT_THAT(complaint("", "half_space {} kelvin_voigt { stiffness_newton_per_m: 400 }"),
              at("", "elastic"));
  EXPECT_THAT(complaint("button: 32"), at(".button", "31"));
  EXPECT_THAT(complaint("power_watt: 0"), at(".power_watt", "0"));
  EXPECT_THAT(complaint("power_watt: 1001"), at(".power_watt", "1000"));
  EXPECT_THAT(complaint("reach_m: 0.006"), at(".reach_m", "scene.tool.tip_radius_m"));
  EXPECT_THAT(complaint("reach_m: 0.11"), at(".reach_m", "0.1"));
  EXPECT_THAT(complaint("energy_joule_per_kg: 999"), at(".energy_joule_per_kg", "1000"));
  EXPECT_THAT(complaint("energy_joule_per_kg: 1.1e9"), at(".energy_joule_per_kg", "1e"));
  EXPECT_THAT(complaint("softest_ratio: 0.009"), at(".softest_ratio", "0.01"));
  EXPECT_THAT(complaint("softest_ratio: 1.1"), at(".softest_ratio", "1"));
}

TEST(ElectrodeRules, HasAButtonOfItsOwn) {
  const auto complaint = [](const std::string& rest, const std::string& tool = "") {
    return complaints(with_electrode("button: 3", kBlock, tool) + rest, {}, "/tmp");
  };
  const auto at = [](const std::string& field, const std::string& owner = "electrode") {
    return ElementsAre(HasSubstr("1 problem"),
                       AllOf(HasSubstr(field), HasSubstr("scene.tool." + owner + ".button, or")));
  };
  EXPECT_THAT(complaint("", "gripper { button: 2 }"), IsEmpty());
  EXPECT_THAT(complaint("", "gripper { button: 3 }"), at("electrode.button", "gripper"));
  EXPECT_THAT(complaint("device { workspace { clutch_button: 3 } }"),
              at("device.workspace.clutch_button"));
  EXPECT_THAT(complaint("device { dead_man_button: 3 }"), at("device.dead_man_button"));
  EXPECT_THAT(complaint("task { mark_button: 3 free {} }"), at("task.mark_button"));
}

// A standby would go on with the whole body.
TEST(ElectrodeRules, NeedsAPhysicsWithoutStandby) {
  EXPECT_THAT(complaints(with_electrode("") + " physics { standby {} }", {}, "/tmp"),
              ::testing::Contains(AllOf(HasSubstr("physics.standby"), HasSubstr("ablated"))));
}

}  // namespace
}  // namespace palpate
