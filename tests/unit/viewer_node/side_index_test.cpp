// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/side_index.h"

#include <gtest/gtest.h>

namespace palpate::viewer {
namespace {

TEST(SideIndex, FindsEachOf64SidesAndNoOther) {
  Session session;
  session.sides.assign(64, Side{});
  for (std::size_t i = 0; i < 64; ++i) session.sides[i].name = "side" + std::to_string(63 - i);

  const SideIndex index(session);

  for (std::size_t i = 0; i < 64; ++i) EXPECT_EQ(index.of(session.sides[i].name), i);
  EXPECT_EQ(index.of("side64"), std::nullopt);
  EXPECT_EQ(index.of(""), std::nullopt);
}

TEST(SideIndex, TheSideOfASessionWithOneDeviceHasNoName) {
  EXPECT_EQ(SideIndex(Session{}).of(""), 0U);
}

}  // namespace
}  // namespace palpate::viewer
