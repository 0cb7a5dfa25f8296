// SPDX-License-Identifier: Apache-2.0
// The rules of elastic.attached to another tissue in a session: each violated, and kept.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

const std::string kTiedMesh = "tetrahedral_mesh { file: 'b.msh' } elastic { young_pa: 1e4 ";
const std::string kTiedFixed = "fixed { half_space {} } ";
const std::string kTie = "attached { tissue: 'liver' stiffness_pa_per_m: 2e5 ";

struct Given {
  std::string own = kTiedFixed + kTie + "}";
  std::string liver = kTiedFixed;
  std::string tool = "tip_radius_m: 0.001";
};

std::vector<std::string> tied_complaints(const Given& given) {
  return complaints("name: \"x\" hand { press { until_s: 1 } } scene { tool { " + given.tool +
                        " } tissue { name: 'gall' " + kTiedMesh + given.own +
                        "} } tissue { name: 'liver' " + kTiedMesh + given.liver +
                        "} } tissue { name: 'bone' half_space {} "
                        "kelvin_voigt { stiffness_newton_per_m: 1e3 } } }",
                    {}, "/tmp");
}

/// A problem at this field, with the file and the line.
auto is_tied_at(const std::string& field, const std::string& words) {
  return Contains(AllOf(StartsWith("x.txtpb:"),
                        HasSubstr("scene.tissue[0].elastic.attached[0]." + field),
                        HasSubstr(words)));
}

TEST(TiedRules, ATissueMayBeAttachedToAnotherElasticOne) {
  EXPECT_THAT(tied_complaints({}), IsEmpty());
  EXPECT_THAT(tied_complaints({.own = kTie + "}"}), IsEmpty());  // the liver holds it
  EXPECT_THAT(tied_complaints({.own = kTiedFixed + kTie +
                                      "toughness_joule_per_m2: 5 gap_m: 0.005 where { half_space "
                                      "{} } } touches { tissue: 'liver' }"}),
              IsEmpty());
}

TEST(TiedRules, NamesAnotherElasticTissueThatIsHeld) {
  const auto to = [](const std::string& name) {
    return Given{.own = kTiedFixed + "attached { tissue: '" + name + "' stiffness_pa_per_m: 2e5 }"};
  };
  EXPECT_THAT(tied_complaints(to("livr")),
              is_tied_at("tissue", "did you mean \"liver\"? no tissue of the scene has this name"));
  EXPECT_THAT(tied_complaints(to("gall")), is_tied_at("tissue", "is this tissue itself"));
  EXPECT_THAT(tied_complaints(to("bone")),
              is_tied_at("tissue", "does not give way, as it is not elastic"));
  EXPECT_THAT(tied_complaints({.liver = kTiedFixed + "solve_rate_hz: 25 "}),
              is_tied_at("tissue", "is solved at 25 Hz, this one at 50 Hz"));
  EXPECT_THAT(tied_complaints({.liver = "attached { tissue: 'gall' stiffness_pa_per_m: 2e5 } "}),
              is_tied_at("tissue", "is not held by itself, so that both would fall"));
  EXPECT_THAT(tied_complaints(
                  {.liver = kTiedFixed + "attached { tissue: 'gall' stiffness_pa_per_m: 2e5 } "}),
              is_tied_at("tissue", "is tied to this one already"));
}

TEST(TiedRules, WhatItIsTiedToDoesNotChange) {
  EXPECT_THAT(tied_complaints({.liver = kTiedFixed +
                                        "attached { where { half_space {} } stiffness_pa_per_m: "
                                        "2e5 toughness_joule_per_m2: 5 } "}),
              is_tied_at("tissue", "may tear off itself"));
  EXPECT_THAT(tied_complaints({.liver = kTiedFixed +
                                        "gravity_m_per_s2 { z: -9.8 } scan_gravity_m_per_s2 { z: "
                                        "-9.8 } "}),
              is_tied_at("tissue", "leave out scan_gravity_m_per_s2 of both"));
  EXPECT_THAT(tied_complaints({.tool = "tip_radius_m: 0.001 electrode {}"}),
              is_tied_at("tissue", "does not go with scene.tool.electrode"));
  EXPECT_THAT(tied_complaints({.liver = kTiedFixed + "pierced { toughness_joule_per_m2: 130 } ",
                               .tool = "tip_radius_m: 0.001 blade { length_m: 0.01 }"}),
              is_tied_at("tissue", "does not go with scene.tool.blade"));
}

TEST(TiedRules, RangesAndWhatDoesNotGoTogether) {
  const auto with = [](const std::string& more) { return Given{.own = kTiedFixed + kTie + more}; };
  EXPECT_THAT(tied_complaints(with("gap_m: 0 }")), is_tied_at("gap_m", "must be > 0"));
  EXPECT_THAT(tied_complaints(with("gap_m: 0.0051 }")), is_tied_at("gap_m", "0.005"));
  EXPECT_THAT(tied_complaints(with("} viscoelastic { branch { share: 0.3 tau_s: 0.3 } }")),
              is_tied_at("tissue", "do not relax"));
  EXPECT_THAT(tied_complaints({.own = kTie + "toughness_joule_per_m2: 5 }"}),
              is_tied_at("toughness_joule_per_m2", "would fall"));
  EXPECT_THAT(tied_complaints({.own = kTiedFixed +
                                      "attached { where { half_space {} } stiffness_pa_per_m: 2e5 "
                                      "gap_m: 0.001 }"}),
              is_tied_at("gap_m", "is that to another elastic tissue"));
  EXPECT_THAT(tied_complaints({.own = kTiedFixed + "attached { stiffness_pa_per_m: 2e5 }"}),
              is_tied_at("where", "a place is required"));
}

}  // namespace
}  // namespace palpate
