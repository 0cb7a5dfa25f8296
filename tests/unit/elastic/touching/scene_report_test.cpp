// SPDX-License-Identifier: Apache-2.0
// What `palpate scene check` says of elastic tissues besides their meshes.
#include "physics_node/elastic_tissue/scene_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/elastic/touching/touching_scene.h"

namespace palpate::physics {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class SceneReport : public testing::Test {
 protected:
  test::TempFolder folder_;

  /// Held by all faces on one side.
  [[nodiscard]] TissueConfig box(const std::string& name, double lowest_z_m,
                                 ElasticMaterial material) const {
    material.fixed = {HalfSpaceGeometry{.point_m = {-0.0199, 0, 0}, .normal = {1, 0, 0}}};
    return soft_box(name,
                    box_file(folder_, name, {-0.02, -0.02, lowest_z_m},
                             {0.02, 0.02, lowest_z_m + 0.01}, {4, 4, 2}),
                    material);
  }
};

TEST_F(SceneReport, TellsWhatABodyTouchesWhetherThatGivesWayAndHowFarItIs) {
  ElasticMaterial upper;
  upper.touches = {{.tissue = 1, .friction_coefficient = 0.2}, {.tissue = 2}};
  SceneConfig scene{
      .tip_radius_m = 0.005,
      .tissues = {box("upper", 0.0, upper), bone(HalfSpaceGeometry{.point_m = {0, 0, 0.0005}}),
                  box("lower", -0.0115, {}), box("other", 0.05, {})}};
  const auto bodies = elastic_bodies_of(scene);
  EXPECT_THAT(
      touching_lines(bodies, *bodies.at(0), scene),
      ElementsAre("touches \"bone\", which does not give way, friction coefficient 0.2: overlap "
                  "0.5 mm at the start",
                  "touches \"lower\", which gives way too, friction coefficient 0: gap 1.5 mm at "
                  "the start"));
  EXPECT_THAT(touching_lines(bodies, *bodies.at(1), scene),
              ElementsAre(HasSubstr("touches \"upper\", which gives way too")));
  EXPECT_THAT(touching_lines(bodies, *bodies.at(2), scene), IsEmpty());

  scene.tissues[1] = bone(HalfSpaceGeometry{});
  const auto lying = elastic_bodies_of(scene);
  EXPECT_THAT(touching_lines(lying, *lying.at(0), scene).at(0), HasSubstr(": gap 0 mm"));
}

TEST_F(SceneReport, TellsWhatABodyIsTiedTo) {
  ElasticMaterial upper;
  upper.is_linear = true;
  upper.attached = {{.stiffness_pa_per_m = 1e5, .tissue = 1, .is_anywhere = true}};
  const SceneConfig scene{.tip_radius_m = 0.005,
                          .tissues = {box("upper", 0.0, upper), box("lower", -0.0105, {})}};
  const auto bodies = elastic_bodies_of(scene);
  // 25 nodes less 5 that are fixed; of 16 cm² those have a tenth to an eighth
  EXPECT_THAT(touching_lines(bodies, *bodies.at(0), scene),
              ElementsAre(AllOf(HasSubstr("tied to \"lower\", which gives way too, at 20 nodes "
                                          "with 1"),
                                HasSubstr(" N/m: gap at most 0.5 mm"))));
  EXPECT_THAT(touching_lines(bodies, *bodies.at(1), scene), IsEmpty());
}

// The faces of the bed have edges of 10, 10 and 14.1 mm.
TEST_F(SceneReport, WarnsOfABedThatElementsCannotPeelOffByEnergy) {
  const auto warnings = [&](double stiffness_pa_per_m, double toughness_joule_per_m2) {
    ElasticMaterial material{.young_pa = 15e3};
    material.is_linear = true;
    material.attached = {{.where = HalfSpaceGeometry{.point_m = {0, 0, 1e-4}},
                          .stiffness_pa_per_m = stiffness_pa_per_m,
                          .toughness_joule_per_m2 = toughness_joule_per_m2}};
    const SceneConfig scene{.tip_radius_m = 0.005, .tissues = {box("organ", 0.0, material)}};
    return tearing_warnings(*elastic_bodies_of(scene).at(0), material);
  };
  EXPECT_THAT(warnings(1e6, 5.0), IsEmpty());  // softens over 15 mm
  EXPECT_THAT(warnings(3e6, 0.0), IsEmpty());  // does not tear
  EXPECT_THAT(
      warnings(3e6, 5.0),
      ElementsAre(AllOf(HasSubstr("elastic.attached[0] "), HasSubstr("toughness_joule_per_m2, 5:"),
                        HasSubstr("stiffness_pa_per_m: 3e+06"), HasSubstr("about 5 mm"),
                        HasSubstr("there, 11 mm"), HasSubstr("1.3e+06 or less"),
                        HasSubstr("the edges 5 mm or shorter"))));
}

}  // namespace
}  // namespace palpate::physics
