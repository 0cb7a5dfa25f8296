// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/import_reach.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "common/core/check.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// A plate of this size around `middle_m`, its upper side in squares of 5 mm, its lower side below.
physics::TriangleMesh plate(double x_m, double y_m, const Vector3& middle_m) {
  constexpr double kSquare_m = 0.005;
  physics::TriangleMesh mesh;
  const auto columns = static_cast<std::uint32_t>(x_m / kSquare_m + 0.5);
  const auto rows = static_cast<std::uint32_t>(y_m / kSquare_m + 0.5);
  for (const double z_m : {0.0, -0.02}) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices_m.size());
    for (std::uint32_t j = 0; j <= rows; ++j) {
      for (std::uint32_t i = 0; i <= columns; ++i) {
        mesh.vertices_m.push_back(
            middle_m + Vector3(kSquare_m * i - 0.5 * x_m, kSquare_m * j - 0.5 * y_m, z_m));
      }
    }
    for (std::uint32_t j = 0; j < rows; ++j) {
      for (std::uint32_t i = 0; i < columns; ++i) {
        const std::uint32_t a = first + j * (columns + 1) + i;
        const std::uint32_t b = a + columns + 1;
        if (z_m == 0.0) {
          mesh.triangles.insert(mesh.triangles.end(), {{a, a + 1, b}, {a + 1, b + 1, b}});
        } else {
          mesh.triangles.insert(mesh.triangles.end(), {{a, b, a + 1}, {a + 1, b, b + 1}});
        }
      }
    }
  }
  return mesh;
}

const ReachTarget kTarget{.tip_radius_m = 0.006, .below_m = 0.005};

TEST(ImportReach, WhatFitsIsTrueToScaleAndInTheMiddle) {
  const Reach reach = propose_reach(plate(0.1, 0.08, {0.01, -0.01, 0}), {}, kTarget);
  EXPECT_DOUBLE_EQ(reach.scale_ratio, 1.0);
  EXPECT_TRUE(reach.has_target);
  EXPECT_NEAR(reach.upper_ratio, 1.0, 1e-9);
  // the lower side is 31 mm below the highest place of the tip: below what is reached
  EXPECT_NEAR(reach.surface_ratio, 0.5, 1e-9);
  EXPECT_NEAR(reach.offset_m.x(), 0.01, 2e-3);
  EXPECT_NEAR(reach.offset_m.y(), -0.01, 2e-3);
  EXPECT_THAT(reach_report(reach, {}),
              AllOf(HasSubstr("160 x 120 x 70 mm"), HasSubstr("scale_ratio 1.00"),
                    HasSubstr("reaches 100 % of the side that is up"), Not(HasSubstr("WARNING")),
                    Not(HasSubstr("stiffer"))));
}

// 144 x 108 mm of the workspace are used: 180 mm need a scale of 1.25.
TEST(ImportReach, ALargerOrganEnlargesTheMotionOfTheHandUpToTwice) {
  const Reach reach = propose_reach(plate(0.18, 0.1, Vector3::Zero()), {}, kTarget);
  EXPECT_NEAR(reach.scale_ratio, 1.25, 0.051);
  EXPECT_NEAR(reach.upper_ratio, 1.0, 1e-9);
  EXPECT_THAT(reach_report(reach, {}), HasSubstr("so the organ feels that much stiffer"));

  // 320 x 240 mm of it are reached
  const Reach twice = propose_reach(plate(0.4, 0.4, Vector3::Zero()), {}, kTarget);
  EXPECT_DOUBLE_EQ(twice.scale_ratio, kMostScale);
  EXPECT_NEAR(twice.upper_ratio, 0.32 * 0.24 / 0.16, 0.03);
  EXPECT_THAT(reach_report(twice, {}), HasSubstr("WARNING: less than half of the side that is up"));
}

TEST(ImportReach, TheTargetIsReachedAlsoAtTheRimOfALargeOrgan) {
  const Reach reach = propose_reach(plate(0.6, 0.1, {0.28, 0, 0}), {}, kTarget);
  EXPECT_TRUE(reach.has_target);
  for (const Vector3& tool_m : {Vector3(0, 0, 0.001), Vector3(-0.02, 0.02, 0.026)}) {
    EXPECT_TRUE((reach.hand_m(tool_m).cwiseAbs().array() <= kSimulatedHalfExtent_m.array()).all());
  }
  EXPECT_GT(reach.offset_m.x(), 0.1);
}

TEST(ImportReach, AWorkspaceThatIsTooSmallIsSaid) {
  const ReachDevice small = reach_device_of_size(Vector3(20, 20, 10));
  const Reach reach = propose_reach(plate(0.1, 0.1, Vector3::Zero()), small, kTarget);
  EXPECT_FALSE(reach.has_target);
  EXPECT_THAT(reach_report(reach, small),
              HasSubstr("WARNING: the workspace is too small to press"));
}

TEST(ImportReach, TheDeviceIsThatOfASession) {
  const std::string sessions = test::source_dir() + "/deploy/sessions/";
  const ReachDevice falcon = reach_device_of(sessions + "falcon.txtpb");
  EXPECT_GT(falcon.half_extent_m.minCoeff(), 0.0);
  EXPECT_NE(falcon.half_extent_m, kSimulatedHalfExtent_m);
  EXPECT_EQ(reach_device_of(sessions + "default.txtpb").half_extent_m, kSimulatedHalfExtent_m);

  const test::TempFolder folder;
  const std::string plugin = folder.write(
      "plugin.txtpb",
      "name: 'a' device { plugin { library: './a.so' } } hand { press { until_s: 1 } } "
      "scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 100 } } }");
  try {
    static_cast<void>(reach_device_of(plugin));
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("give --workspace-mm X Y Z instead"));
  }
}

}  // namespace
}  // namespace palpate
