// SPDX-License-Identifier: Apache-2.0
#include "common/core/workspace_map.h"

#include <gtest/gtest.h>

namespace palpate {
namespace {

class WorkspaceMapTest : public testing::Test {
 protected:
  Vector3 tool(const Vector3& hand, bool is_held) {
    map_.update(hand, is_held);
    return map_.tool_position_world_m(hand);
  }
  WorkspaceMap map_{WorkspaceConfig{
      .scale_ratio = 2.0, .force_ratio = 1.0, .offset_m = {0.1, 0.0, 0.0}, .clutch_button = 0}};
};

TEST_F(WorkspaceMapTest, ScalesThenShifts) {
  // 0.1 + 2·0.01 = 0.12
  EXPECT_TRUE(tool({0.01, 0.02, 0.03}, false).isApprox(Vector3(0.12, 0.04, 0.06)));
  EXPECT_TRUE(map_.tool_velocity_world_m_per_s({0.1, 0, 0}).isApprox(Vector3(0.2, 0, 0)));
}

TEST_F(WorkspaceMapTest, TheToolStaysInPlaceWhileTheClutchIsHeld) {
  const Vector3 before = tool({0.01, 0, 0}, false);
  const Vector3 held = tool({0.02, 0, 0}, true);  // the tick of the press still moves the tool
  EXPECT_FALSE(before.isApprox(held));
  for (const double x : {0.03, 0.05, -0.04}) {
    EXPECT_TRUE(tool({x, 0.01, 0}, true).isApprox(held));
    EXPECT_TRUE(map_.is_clutched());
    EXPECT_EQ(map_.tool_velocity_world_m_per_s({1, 1, 1}), Vector3(0, 0, 0));
  }
}

TEST_F(WorkspaceMapTest, OnReleaseTheToolContinuesFromItsPlace) {
  const Vector3 held = tool({0.02, 0, 0}, true);
  static_cast<void>(tool({0.05, 0, 0}, true));
  const Vector3 released =
      tool({0.06, 0, 0}, false);  // motion up to the release does not move the tool
  EXPECT_TRUE(released.isApprox(held));
  EXPECT_FALSE(map_.is_clutched());
  EXPECT_TRUE(tool({0.07, 0, 0}, false).isApprox(held + Vector3(0.02, 0, 0)));
}

TEST_F(WorkspaceMapTest, ShiftsOfSeveralClutchesAddUp) {
  Vector3 at = tool({0, 0, 0}, false);
  for (int i = 0; i < 5; ++i) {  // ratchet: forward with the tool, back with the clutch held
    at = tool({0.01, 0, 0}, false);
    static_cast<void>(tool({0.01, 0, 0}, true));
    static_cast<void>(tool({0.0, 0, 0}, true));
    EXPECT_TRUE(tool({0.0, 0, 0}, false).isApprox(at));
  }
  EXPECT_TRUE(at.isApprox(Vector3(0.1 + 5 * 0.02, 0, 0)));
}

}  // namespace
}  // namespace palpate
