// SPDX-License-Identifier: Apache-2.0
// Tiles in blocks of neighbours: what a search finds, and how much it looks at.
#include "common/contact/tiles/tile_blocks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <set>
#include <vector>

#include "common/core/random.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"

namespace palpate {
namespace {

constexpr std::uint32_t kSide = 64;
constexpr double kCell_m = 3e-3;

/// A plane of 64 x 64 cells: where the slot's tile is.
Bounds cell(std::uint32_t slot) {
  const Vector3 from_m(kCell_m * (slot % kSide), kCell_m * (slot / kSide), 0.0);
  return {.lowest_m = from_m, .highest_m = from_m + Vector3(kCell_m, kCell_m, 1e-4)};
}

std::vector<std::uint32_t> slots() {
  std::vector<std::uint32_t> all(kSide * kSide);
  std::iota(all.begin(), all.end(), 0U);
  return all;
}

struct Found {
  std::set<std::uint32_t> slots;
  std::uint32_t work = 0;
};
Found within(const TileBlocks& blocks, const Vector3& point_m, double distance_m) {
  Found found;
  SurfaceHint hint;
  EXPECT_TRUE(blocks.look_near(
      point_m, hint, [&] { return distance_m * distance_m; },
      [&](std::uint32_t slot, const Bounds& tile) {
        EXPECT_EQ(tile.lowest_m, cell(slot).lowest_m);
        EXPECT_TRUE(found.slots.insert(slot).second);
        return true;
      }));
  found.work = hint.work;
  return found;
}

// Physics sends the nearest tiles first: rings around a tool that moves. At least 8 tiles are in a
// block that was divided, so there are at most 512 blocks; some 4 x 4 of the tiles are near.
TEST(TileBlocks, ASearchLooksAtFewWhateverTheOrder) {
  const auto most_work = [](const std::vector<std::uint32_t>& order) {
    TileBlocks blocks(order.size());
    for (const std::uint32_t slot : order) blocks.add(slot, cell(slot));
    std::uint32_t most = 0;
    for (double x_m = 0.0; x_m < kSide * kCell_m; x_m += 7e-3) {
      const Found found = within(blocks, {x_m, 0.5 * x_m, 1e-3}, 5e-3);
      EXPECT_GE(found.slots.size(), 4u);
      most = std::max(most, found.work);
    }
    return most;
  };
  std::vector<std::uint32_t> order = slots();
  EXPECT_LE(most_work(order), 512u + 20u * TileBlocks::kMost);
  const Vector3 middle_m(0.5 * kSide * kCell_m, 0.5 * kSide * kCell_m, 0.0);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return cell(a).squared_distance(middle_m) < cell(b).squared_distance(middle_m);
  });
  EXPECT_LE(most_work(order), 512u + 20u * TileBlocks::kMost);
  Random random(1);
  for (std::size_t i = order.size() - 1; i > 0; --i) {
    std::swap(order[i], order[random.below(i + 1)]);
  }
  EXPECT_LE(most_work(order), 512u + 20u * TileBlocks::kMost);
}

TEST(TileBlocks, HoldWhatWasAddedAndNotRemoved) {
  for (const std::uint64_t seed : test::seeds(20)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    TileBlocks blocks(kSide * kSide);
    std::set<std::uint32_t> held;
    const double share = random.uniform(0.3, 0.7);
    for (int i = 0; i < 3000; ++i) {
      const auto slot = static_cast<std::uint32_t>(random.below(300 + seed));
      if (random.chance(share) && held.insert(slot).second) {
        blocks.add(slot, cell(slot));
      } else {
        ASSERT_EQ(blocks.remove(slot), held.erase(slot) > 0);
      }
      ASSERT_LE(blocks.count(), held.size() / 4 + 1);
      ASSERT_EQ(blocks.is_empty(), held.empty());
    }
    EXPECT_EQ(within(blocks, Vector3::Zero(), 10.0).slots, held);
    const Vector3 point_m(random.uniform(0.0, 0.2), random.uniform(0.0, 0.02), 0.0);
    std::set<std::uint32_t> near;
    for (const std::uint32_t slot : held) {
      if (cell(slot).squared_distance(point_m) <= 1e-4) near.insert(slot);
    }
    EXPECT_EQ(within(blocks, point_m, 1e-2).slots, near);
    blocks.clear();
    EXPECT_TRUE(blocks.is_empty());
    EXPECT_FALSE(blocks.remove(7));
  }
}

TEST(TileBlocks, NeitherTilesInOnePlaceNorTilesThatGoAllocate) {
  TileBlocks blocks(kSide * kSide);
  const test::AllocGuard guard;
  for (int round = 0; round < 3; ++round) {
    for (std::uint32_t slot = 0; slot < kSide * kSide; ++slot) blocks.add(slot, cell(0));
    for (std::uint32_t slot = 0; slot < kSide * kSide; slot += 1 + slot % 3) blocks.remove(slot);
    for (std::uint32_t slot = 0; slot < kSide * kSide; ++slot) blocks.remove(slot);
  }
  EXPECT_TRUE(blocks.is_empty());
  EXPECT_EQ(guard.count(), 0u);
}

}  // namespace
}  // namespace palpate
