// SPDX-License-Identifier: Apache-2.0
// The octree against brute force.
#include "physics_node/surfaces/octree.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/core/random.h"
#include "tests/support/alloc_guard.h"

namespace palpate::physics {
namespace {

using Points = std::vector<Octree::Point>;

Octree::Point at(const Vector3& place) {
  const Eigen::Vector3f p = place.cast<float>();
  return {.x = p.x(), .y = p.y(), .z = p.z()};
}

Vector3 in_cube(Random& random) {
  return {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
}

/// Clouds of the shapes that are difficult for trees: a volume, a surface, a line, clusters of very
/// different size, one point.
std::vector<Points> clouds() {
  Random random(1);
  std::vector<Points> all(5);
  for (int i = 0; i < 3000; ++i) {
    all[0].push_back(at(in_cube(random)));
    all[1].push_back(at(random.direction()));
    all[2].push_back(at({-1.0 + i / 1500.0, 0.5, 0.5}));
    all[3].push_back(at(std::pow(10.0, -random.uniform(0, 3)) * in_cube(random)));
  }
  all[4].push_back(at({0.1, 0.2, 0.3}));
  return all;
}

float squared_distance(const Eigen::Vector3f& a, const Octree::Point& b) {
  const float x = a.x() - b.x;
  const float y = a.y() - b.y;
  const float z = a.z() - b.z;
  return x * x + y * y + z * z;
}

/// All points in the order of `nearest`, the oracle.
std::vector<Octree::Neighbor> sorted(const Octree& tree, const Eigen::Vector3f& center) {
  std::vector<Octree::Neighbor> all;
  for (std::uint32_t i = 0; i < tree.points().size(); ++i) {
    all.push_back({squared_distance(center, tree.points()[i]), i});
  }
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) {
    return a.squared_distance != b.squared_distance ? a.squared_distance < b.squared_distance
                                                    : a.point < b.point;
  });
  return all;
}

TEST(Octree, KeepsEveryPointAndItsOriginalIndex) {
  for (const Points& points : clouds()) {
    const Octree tree(points);

    ASSERT_EQ(tree.points().size(), points.size());
    std::vector<bool> is_seen(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::uint32_t was = tree.order()[i];
      EXPECT_EQ(squared_distance({points[was].x, points[was].y, points[was].z}, tree.points()[i]),
                0.0F);
      is_seen[was] = true;
    }
    EXPECT_EQ(std::count(is_seen.begin(), is_seen.end(), true),
              static_cast<std::ptrdiff_t>(points.size()));
  }
}

TEST(Octree, FindsTheNearestLikeBruteForce) {
  Random random(2);
  for (const Points& points : clouds()) {
    const Octree tree(points);
    Octree::Hint hint;
    for (int query = 0; query < 300; ++query) {
      const Eigen::Vector3f center = (2.0 * in_cube(random)).cast<float>();
      const auto all = sorted(tree, center);
      for (const std::size_t k : {1U, 20U}) {
        std::vector<Octree::Neighbor> found(k);
        const std::size_t count = tree.nearest(center, found, hint);
        ASSERT_EQ(count, std::min(k, points.size()));
        for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(found[i].point, all[i].point);
      }
    }
  }
}

TEST(Octree, FindsNothingBeyondTheLimit) {
  Random random(3);
  for (const Points& points : clouds()) {
    const Octree tree(points);
    for (int query = 0; query < 100; ++query) {
      const Eigen::Vector3f center = in_cube(random).cast<float>();
      const auto within = static_cast<float>(random.uniform(0, 0.5));
      const auto all = sorted(tree, center);
      const auto inside =
          static_cast<std::size_t>(std::count_if(all.begin(), all.end(), [&](const auto& point) {
            return point.squared_distance <= within * within;
          }));
      std::vector<Octree::Neighbor> found(50);
      Octree::Hint hint;
      EXPECT_EQ(tree.nearest(center, found, hint, within), std::min<std::size_t>(inside, 50));
    }
  }
}

TEST(Octree, TheHintDoesNotChangeTheResult) {
  Random random(4);
  for (const Points& points : clouds()) {
    const Octree tree(points);
    for (int query = 0; query < 300; ++query) {
      const Eigen::Vector3f center = in_cube(random).cast<float>();
      std::vector<Octree::Neighbor> cold(7);
      std::vector<Octree::Neighbor> warm(7);
      Octree::Hint none;
      Octree::Hint any{static_cast<std::uint32_t>(random.below(2 * points.size()))};
      const std::size_t count = tree.nearest(center, cold, none);
      ASSERT_EQ(tree.nearest(center, warm, any), count);
      for (std::size_t i = 0; i < count; ++i) EXPECT_EQ(cold[i].point, warm[i].point);
    }
  }
}

TEST(Octree, OfEquallyNearPointsTheLowerIndexComesFirst) {
  // 8 corners of a cube, each √3 from its middle, and enough others to split the leaf
  Points points;
  for (int i = 0; i < 8; ++i) {
    points.push_back(
        at({i % 2 == 0 ? -1.0 : 1.0, i / 2 % 2 == 0 ? -1.0 : 1.0, i < 4 ? -1.0 : 1.0}));
  }
  for (int i = 0; i < 30; ++i) points.push_back(at({3.0 + i, 0, 0}));
  const Octree tree(points);

  std::vector<Octree::Neighbor> found(8);
  Octree::Hint hint;
  ASSERT_EQ(tree.nearest({0, 0, 0}, found, hint), 8U);

  for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(found[i].squared_distance, 3.0F);
  for (std::size_t i = 1; i < 8; ++i) EXPECT_LT(found[i - 1].point, found[i].point);
}

TEST(Octree, OvershootIsBounded) {
  Random random(5);
  const Octree tree(clouds()[1]);
  for (int query = 0; query < 300; ++query) {
    const Eigen::Vector3f center = (0.1 * in_cube(random)).cast<float>();  // near the centre
    std::array<Octree::Neighbor, 1> found{};
    Octree::Hint hint;
    ASSERT_EQ(tree.nearest(center, found, hint, 10.0F, 0.05F), 1U);
    // 1e-6: rounding of float
    EXPECT_LE(std::sqrt(found[0].squared_distance),
              1.05F * std::sqrt(sorted(tree, center)[0].squared_distance) + 1e-6F);
  }
}

TEST(Octree, VisitsThePointsInABall) {
  Random random(6);
  for (const Points& points : clouds()) {
    const Octree tree(points);
    for (int query = 0; query < 100; ++query) {
      const Eigen::Vector3f center = in_cube(random).cast<float>();
      const auto radius = static_cast<float>(random.uniform(0, 0.5));
      std::vector<bool> is_seen(points.size());
      tree.visit_within(center, radius, [&](std::uint32_t i, float squared) {
        EXPECT_FALSE(is_seen[i]);
        EXPECT_EQ(squared, squared_distance(center, tree.points()[i]));
        is_seen[i] = true;
      });
      for (std::uint32_t i = 0; i < points.size(); ++i) {
        EXPECT_EQ(is_seen[i], squared_distance(center, tree.points()[i]) <= radius * radius);
      }
    }
  }
}

TEST(Octree, VisitsThePointsThatReach) {
  Random random(7);
  for (const Points& points : clouds()) {
    Octree tree(points);
    std::vector<float> reaches(points.size());
    for (float& reach : reaches) reach = static_cast<float>(std::pow(random.uniform(), 4));
    tree.set_reaches(reaches);
    for (int query = 0; query < 100; ++query) {
      const Eigen::Vector3f center = in_cube(random).cast<float>();
      std::vector<bool> is_seen(points.size());
      tree.visit_reaching(center, [&](std::uint32_t i, float) { is_seen[i] = true; });
      for (std::uint32_t i = 0; i < points.size(); ++i) {
        EXPECT_EQ(is_seen[i],
                  squared_distance(center, tree.points()[i]) <= reaches[i] * reaches[i]);
      }
    }
  }
}

TEST(Octree, KeepsOneOfCoincidentPoints) {
  Points points(1000, at({0.5, 0.5, 0.5}));
  points.push_back(at({0, 0, 0}));
  const Octree tree(points);

  ASSERT_EQ(tree.points().size(), 2U);
  EXPECT_EQ(tree.order()[0], 1000U);
  EXPECT_EQ(tree.order()[1], 0U);
}

TEST(Octree, OfNoPointsFindsNone) {
  const Octree tree;
  std::array<Octree::Neighbor, 3> found{};
  Octree::Hint hint;

  EXPECT_EQ(tree.nearest({0, 0, 0}, found, hint), 0U);
  tree.visit_within({0, 0, 0}, 1.0F, [](std::uint32_t, float) { FAIL(); });
}

TEST(Octree, QueriesDoNotAllocate) {
  const Octree tree(clouds()[0]);
  std::array<Octree::Neighbor, 20> found{};
  Octree::Hint hint;
  float sum = 0.0F;

  const test::AllocGuard guard;
  tree.nearest({0, 0, 0}, found, hint);
  tree.visit_within({0, 0, 0}, 0.5F, [&](std::uint32_t, float squared) { sum += squared; });

  EXPECT_EQ(guard.count(), 0U);
  EXPECT_GT(sum, 0.0F);
}

TEST(Octree, TakesAtMost26BytesAPoint) {
  Random random(8);
  Points points;
  for (int i = 0; i < 100000; ++i) points.push_back(at(random.direction()));
  Octree tree(points);
  tree.forget_order();

  // 16 bytes a point; nodes of 40 bytes, one per 4 … 8 points
  EXPECT_LT(static_cast<double>(tree.bytes()) / 1e5, 16.0 + 10.0);
}

}  // namespace
}  // namespace palpate::physics
