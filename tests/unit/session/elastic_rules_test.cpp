// SPDX-License-Identifier: Apache-2.0
// The rules of elastic { … } in a session: each violated, and kept.
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

}  // namespace
}  // namespace palpate
