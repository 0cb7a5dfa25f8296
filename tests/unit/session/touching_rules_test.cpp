// SPDX-License-Identifier: Apache-2.0
// The rules of elastic.touches in a session: each violated, and kept.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr const char* kTouchingMesh = "tetrahedral_mesh { file: 'b.msh' }";
const std::string kTouchingHeld = "young_pa: 1e4 fixed { half_space {} }";

/// One problem, at this field.
auto is_touching_at(const std::string& field, const std::string& words) {
  return AllOf(SizeIs(2),
               ::testing::Contains(AllOf(StartsWith("x.txtpb:"),
                                         HasSubstr("scene.tissue[0]." + field), HasSubstr(words))));
}

TEST(ElasticRules, TouchesOtherTissuesThatAreClosed) {
  const auto touching = [](const std::string& touches, const std::string& bone) {
    return complaints(
        "name: \"x\" scene { tool { tip_radius_m: 0.001 } tissue { name: 'a' " +
            std::string(kTouchingMesh) + " elastic { " + kTouchingHeld + " " + touches +
            " } } tissue { name: 'bone' kelvin_voigt { stiffness_newton_per_m: 1e3 } " + bone +
            " } }",
        {}, "/tmp");
  };
  for (const char* bone :
       {"half_space {}", "sphere { radius_m: 1 }", "box { size_m { x: 1 y: 1 z: 1 } }",
        "capsule { to_m { x: 1 } radius_m: 0.1 }", "triangle_surface { file: 'b.stl' }",
        "half_space {} motion { frequency_hz: 1 }"}) {
    EXPECT_THAT(touching("touches { tissue: 'bone' friction_coefficient: 10 }", bone), IsEmpty())
        << bone;
  }
  const std::string bone = "half_space {}";
  EXPECT_THAT(touching("touches {}", bone),
              is_touching_at("elastic.touches[0].tissue", "required"));
  EXPECT_THAT(touching("touches { tissue: 'bon' }", bone),
              is_touching_at("elastic.touches[0].tissue", "did you mean \"bone\"? no tissue"));
  EXPECT_THAT(touching("touches { tissue: 'a' }", bone),
              is_touching_at("elastic.touches[0].tissue", "is this tissue itself"));
  EXPECT_THAT(touching("touches { tissue: 'bone' } touches { tissue: 'bone' }", bone),
              is_touching_at("elastic.touches[1].tissue", "is named twice"));
  EXPECT_THAT(touching("touches { tissue: 'bone' friction_coefficient: 10.1 }", bone),
              is_touching_at("elastic.touches[0].friction_coefficient", "must be 0 … 10"));
  const auto other = [](const std::string& touches, const std::string& rate_hz) {
    const std::string mesh = std::string(kTouchingMesh) + " elastic { " + kTouchingHeld + " ";
    return complaints("name: \"x\" scene { tool { tip_radius_m: 0.001 } tissue { name: 'a' " +
                          mesh + touches + " } } tissue { name: 'b' " + mesh +
                          " solve_rate_hz: " + rate_hz + " } } }",
                      {}, "/tmp");
  };
  EXPECT_THAT(other("touches { tissue: 'b' }", "50"), IsEmpty());
  EXPECT_THAT(other("touches { tissue: 'b' }", "25"),
              is_touching_at("elastic.touches[0].tissue", "is solved at 25 Hz, this one at 50 Hz"));
  EXPECT_THAT(other("touches { tissue: 'b' friction_coefficient: 0.1 }", "50"), IsEmpty());
  const auto both = [](const std::string& first, const std::string& second) {
    const std::string mesh = std::string(kTouchingMesh) + " elastic { " + kTouchingHeld + " ";
    return complaints("name: \"x\" scene { tool { tip_radius_m: 0.001 } tissue { name: 'b' " +
                          mesh + "touches { tissue: 'a' " + first + " } } } tissue { name: 'a' " +
                          mesh + "touches { tissue: 'b' " + second + " } } } }",
                      {}, "/tmp");
  };
  EXPECT_THAT(both("friction_coefficient: 0.1", ""), IsEmpty());
  EXPECT_THAT(both("", "friction_coefficient: 0.1"), IsEmpty());
  EXPECT_THAT(both("friction_coefficient: 0.1", "friction_coefficient: 0.1"), IsEmpty());
  EXPECT_THAT(both("friction_coefficient: 0.1", "friction_coefficient: 0.2"),
              ::testing::Contains(HasSubstr("is another one than \"b\" gives for the two")));
  EXPECT_THAT(touching("touches { tissue: 'bone' }", "point_cloud { file: 'b.ply' }"),
              is_touching_at("elastic.touches[0].tissue", "is a point_cloud, which has no inside"));
  EXPECT_THAT(touching("touches { tissue: 'bone' }",
                       bone + " motion { frequency_hz: 1 amplitude_m { x: 0.016 z: 0.012 } }"),
              IsEmpty());
  EXPECT_THAT(touching("touches { tissue: 'bone' }",
                       bone + " motion { frequency_hz: 1 amplitude_m { x: 0.016 z: 0.013 } }"),
              is_touching_at("elastic.touches[0].tissue", "moves by up to 20.6"));
  EXPECT_THAT(
      touching("touches { tissue: 'bone' }",
               bone + " motion { frequency_hz: 5.1 amplitude_m { z: 0.001 } }"),
      is_touching_at("elastic.touches[0].tissue", "oscillates at 5.1 Hz: must be at most a tenth"));
}

}  // namespace
}  // namespace palpate
