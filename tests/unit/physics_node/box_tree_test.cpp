// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/box_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>
#include <vector>

#include "common/core/random.h"
#include "tests/support/alloc_guard.h"
#include "tests/unit/physics_node/random_scene.h"

namespace palpate::physics {
namespace {

/// Boxes of up to 2 cm within 10 cm of the origin; every fourth is a copy of the one before.
std::vector<BoxTree::Item> random_items(Random& random, std::uint32_t count) {
  std::vector<BoxTree::Item> items;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Vector3 center_m = random_in_cube(random, 0.1);
    Bounds bounds{center_m, center_m};
    bounds.grow(random_in_cube(random, 0.01).cwiseAbs());
    items.push_back({bounds, center_m, i});
    if (i % 4 == 3) items.back() = {items[i - 1].bounds, items[i - 1].sort_key, i};
  }
  return items;
}

TEST(BoxTree, WithoutItemsFindsNothing) {
  const BoxTree none({}, 1);
  none.visit_near({}, [](std::uint32_t) { ADD_FAILURE(); });
  none.visit_nearest(Vector3::Zero(), 1.0, [](std::uint32_t) {
    ADD_FAILURE();
    return 0.0;
  });
}

TEST(BoxTreeProperty, FindsEachItemWhoseBoxMeetsTheQueryOnceAndNoOther) {
  Random random(1);
  for (const std::uint32_t count : {1U, 2U, 3U, 50U, 400U}) {
    const std::vector<BoxTree::Item> items = random_items(random, count);
    const BoxTree tree(items, 1);
    for (int i = 0; i < 50; ++i) {
      const Vector3 center_m = random_in_cube(random, 0.12);
      Bounds box{center_m, center_m};
      box.grow(random_in_cube(random, 0.02).cwiseAbs());
      std::multiset<std::uint32_t> expected;
      for (const BoxTree::Item& item : items) {
        if (item.bounds.meets(box)) expected.insert(item.index);
      }
      std::multiset<std::uint32_t> found;
      tree.visit_near(box, [&](std::uint32_t index) { found.insert(index); });
      EXPECT_EQ(found, expected);
    }
  }
}

TEST(BoxTreeProperty, OffersTheNearestItemAndNotAll) {
  Random random(2);
  constexpr std::uint32_t kItems = 400;
  const std::vector<BoxTree::Item> items = random_items(random, kItems);
  const BoxTree tree(items, 4);
  std::size_t offered = 0;
  for (int i = 0; i < 200; ++i) {
    const Vector3 point_m = random_in_cube(random, 0.2);
    double expected = std::numeric_limits<double>::max();
    for (const BoxTree::Item& item : items) {
      expected = std::min(expected, item.bounds.squared_distance(point_m));
    }
    double nearest = std::numeric_limits<double>::max();
    tree.visit_nearest(point_m, nearest, [&](std::uint32_t place) {
      ++offered;
      const BoxTree::Item& item = items[tree.order()[place]];
      nearest = std::min(nearest, item.bounds.squared_distance(point_m));
      return nearest;
    });
    EXPECT_EQ(nearest, expected);
  }
  EXPECT_LT(offered, 200U * kItems / 4);
}

TEST(BoxTree, LimitsTheSearchToTheGivenDistance) {
  const BoxTree tree({{.bounds = {{1, 0, 0}, {2, 1, 1}}}}, 1);
  int offered = 0;
  const auto offer = [&](std::uint32_t) {
    ++offered;
    return 0.0;
  };
  tree.visit_nearest(Vector3::Zero(), 0.99, offer);
  EXPECT_EQ(offered, 0);
  tree.visit_nearest(Vector3::Zero(), 1.0, offer);
  EXPECT_EQ(offered, 1);
}

TEST(BoxTree, QueriesDoNotAllocate) {
  Random random(3);
  const BoxTree tree(random_items(random, 1000), 1);
  std::uint32_t found = 0;

  const test::AllocGuard guard;
  for (int i = 0; i < 100; ++i) {
    const Vector3 point_m = random_in_cube(random, 0.1);
    tree.visit_near({point_m, point_m}, [&](std::uint32_t) { ++found; });
    tree.visit_nearest(point_m, 1.0, [&](std::uint32_t) {
      ++found;
      return 1.0;
    });
  }
  EXPECT_EQ(guard.count(), 0U);
  EXPECT_GT(found, 0U);
}

}  // namespace
}  // namespace palpate::physics
