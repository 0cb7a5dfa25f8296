// SPDX-License-Identifier: Apache-2.0
// tile_blocks.h — the tiles of a surface in blocks of neighbours, for searches.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/contact/bounds.h"
#include "common/contact/surface_view.h"
#include "common/core/vector.h"

namespace palpate {

/// Slots, each with the bounds of its tile, in blocks of at most kMost. A tile joins the block that
/// it makes least longer; a full block is divided into two halves along its longest side, and one
/// with too few tiles is given up. So whatever the order in which tiles come and go, a search looks
/// at few that are far away. Only the constructor allocates; no throw.
class TileBlocks {
 public:
  static constexpr std::size_t kMost = 16;

  /// @param most_slots  every slot is below it
  explicit TileBlocks(std::size_t most_slots);

  void clear() noexcept;
  /// A slot that is not there yet.
  void add(std::uint32_t slot, const Bounds& bounds) noexcept;
  /// Whether it was there.
  bool remove(std::uint32_t slot) noexcept;

  [[nodiscard]] bool is_empty() const noexcept { return blocks_.empty(); }
  [[nodiscard]] std::size_t count() const noexcept { return blocks_.size(); }

  /// Calls look(slot, bounds), which returns whether to go on, for each tile whose bounds are
  /// within limit() (squared) of the point. False if some look ended it, or the work: a unit for
  /// each block and tile that is tested.
  template <class Limit, class Look>
  bool look_near(const Vector3& point_m, SurfaceHint& hint, const Limit& limit,
                 const Look& look) const noexcept {
    for (const Block& block : blocks_) {
      ++hint.work;
      if (!(block.bounds.squared_distance(point_m) <= limit())) continue;
      for (std::size_t i = 0; i < block.count; ++i) {
        ++hint.work;
        const Bounds& tile = block.tiles[i];
        if (tile.squared_distance(point_m) <= limit() && !look(block.slots[i], tile)) return false;
        if (hint.is_exhausted()) return false;
      }
    }
    return true;
  }

 private:
  static constexpr std::size_t kLeast = kMost / 4;  // unless it is the only block
  static constexpr std::uint32_t kNowhere = ~std::uint32_t{0};
  struct Block {
    Bounds bounds;  // of all of it
    std::size_t count = 0;
    std::array<std::uint32_t, kMost> slots{};
    std::array<Bounds, kMost> tiles{};

    void append(std::uint32_t slot, const Bounds& tile) noexcept;
    void erase(std::size_t i) noexcept;
    void bound_anew() noexcept;
  };
  void put(std::size_t block, std::uint32_t slot, const Bounds& tile) noexcept;
  void divide(std::size_t block) noexcept;
  void give_up(std::size_t block) noexcept;

  std::vector<Block> blocks_;
  std::vector<std::uint32_t> block_of_;  // of a slot, or kNowhere
};

}  // namespace palpate
