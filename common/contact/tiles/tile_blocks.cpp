// SPDX-License-Identifier: Apache-2.0
#include "common/contact/tiles/tile_blocks.h"

#include <algorithm>

namespace palpate {
namespace {

/// How much longer the sides of the block become with the tile.
double growth_m(const Bounds& block, const Bounds& tile) noexcept {
  Bounds both = block;
  both.include(tile);
  return (both.highest_m - both.lowest_m).sum() - (block.highest_m - block.lowest_m).sum();
}

}  // namespace

TileBlocks::TileBlocks(std::size_t most_slots) : block_of_(most_slots, kNowhere) {
  blocks_.reserve(most_slots / kLeast + 1);
}

void TileBlocks::clear() noexcept {
  blocks_.clear();
  std::fill(block_of_.begin(), block_of_.end(), kNowhere);
}

void TileBlocks::add(std::uint32_t slot, const Bounds& bounds) noexcept {
  if (blocks_.empty()) {
    blocks_.emplace_back();
    return put(0, slot, bounds);
  }
  std::size_t block = 0;
  double least_m = growth_m(blocks_[0].bounds, bounds);
  for (std::size_t i = 1; i < blocks_.size(); ++i) {
    const double longer_m = growth_m(blocks_[i].bounds, bounds);
    if (!(longer_m < least_m)) continue;
    least_m = longer_m;
    block = i;
  }
  if (blocks_[block].count == kMost) {
    divide(block);
    const std::size_t other = blocks_.size() - 1;
    if (growth_m(blocks_[other].bounds, bounds) < growth_m(blocks_[block].bounds, bounds)) {
      block = other;
    }
  }
  put(block, slot, bounds);
}

bool TileBlocks::remove(std::uint32_t slot) noexcept {
  const std::uint32_t at = block_of_[slot];
  if (at == kNowhere) return false;
  block_of_[slot] = kNowhere;
  Block& block = blocks_[at];
  const auto found = std::find(block.slots.begin(), block.slots.end(), slot);
  block.erase(static_cast<std::size_t>(found - block.slots.begin()));
  if (block.count == 0 || (block.count < kLeast && blocks_.size() > 1)) {
    give_up(at);
  } else {
    block.bound_anew();
  }
  return true;
}

void TileBlocks::put(std::size_t block, std::uint32_t slot, const Bounds& tile) noexcept {
  blocks_[block].append(slot, tile);
  block_of_[slot] = static_cast<std::uint32_t>(block);
}

/// The upper half becomes the last block.
void TileBlocks::divide(std::size_t block) noexcept {
  const Block whole = blocks_[block];
  const int axis = whole.bounds.longest_axis();
  std::array<std::size_t, kMost> order{};
  for (std::size_t i = 0; i < kMost; ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    const double a_m = whole.tiles[a].center_m()[axis];
    const double b_m = whole.tiles[b].center_m()[axis];
    return a_m < b_m || (a_m == b_m && a < b);
  });
  blocks_[block].count = 0;
  const std::size_t other = blocks_.size();
  blocks_.emplace_back();
  for (std::size_t i = 0; i < kMost; ++i) {
    put(i < kMost / 2 ? block : other, whole.slots[order[i]], whole.tiles[order[i]]);
  }
}

/// Its tiles join other blocks.
void TileBlocks::give_up(std::size_t block) noexcept {
  const Block left = blocks_[block];
  const std::size_t last = blocks_.size() - 1;
  if (block != last) {
    blocks_[block] = blocks_[last];
    for (std::size_t i = 0; i < blocks_[block].count; ++i) {
      block_of_[blocks_[block].slots[i]] = static_cast<std::uint32_t>(block);
    }
  }
  blocks_.pop_back();
  for (std::size_t i = 0; i < left.count; ++i) add(left.slots[i], left.tiles[i]);
}

void TileBlocks::Block::append(std::uint32_t slot, const Bounds& tile) noexcept {
  if (count == 0) {
    bounds = tile;
  } else {
    bounds.include(tile);
  }
  slots[count] = slot;
  tiles[count++] = tile;
}

void TileBlocks::Block::erase(std::size_t i) noexcept {
  --count;
  slots[i] = slots[count];
  tiles[i] = tiles[count];
}

void TileBlocks::Block::bound_anew() noexcept {
  bounds = tiles[0];
  for (std::size_t i = 1; i < count; ++i) bounds.include(tiles[i]);
}

}  // namespace palpate
