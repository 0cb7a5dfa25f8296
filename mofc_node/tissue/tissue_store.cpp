// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/tissue_store.h"

#include <algorithm>
#include <utility>

#include "mofc_node/tissue/receipts.h"

namespace palpate::mofc {
namespace {

// The reported age of the loop falls by this share per message, and rises at once.
constexpr int kAgeDecay = 256;
constexpr Duration kLongestLoopAge = std::chrono::seconds(10);

template <std::size_t... kIndices>
std::array<DescribedTissue, sizeof...(kIndices)> tissues_of(
    std::span<const HeldTile> tiles, std::index_sequence<kIndices...> /*unused*/) {
  return {((void)kIndices, DescribedTissue(tiles))...};
}

}  // namespace

void DescribedTissue::take(const TissueDescription& description) noexcept {
  is_known_ = true;
  version_ = description.version;
  tissue_ = description.tissue;
  motion_ = description.motion;
  tool_ = description.tool;
  material_.inclusions.clear();
  auto inclusions = std::move(material_.inclusions);  // keeps the room
  material_ = description.material;
  material_.inclusions = std::move(inclusions);
  for (std::uint32_t i = 0; i < description.inclusion_count; ++i) {
    material_.inclusions.push_back(description.inclusions[i]);
  }
  std::visit(
      [&](const auto& shape) {
        if constexpr (std::is_same_v<std::decay_t<decltype(shape)>, TiledGeometry>) {
          is_tiled_ = true;
          tiled_.reset(shape);
        } else {
          is_tiled_ = false;
          analytic_ = AnalyticSurface(shape);
        }
      },
      description.geometry);
}

TissueStore::TissueStore(std::uint64_t session_id)
    : held_(kTileSlots),
      tags_(kTileSlots),
      tissues_(tissues_of(held_, std::make_index_sequence<kMaxDescribed>{})),
      receipts_{.store_id = session_id,
                .tile_slots = kTileSlots,
                .tiles_per_message = kMaxTilesPerMessage} {}

void TissueStore::drop() noexcept {
  if (receipts_.newest > 0) empty();
}

void TissueStore::empty() noexcept {
  for (Tag& tag : tags_) tag.is_held = false;
  for (DescribedTissue& tissue : tissues_) {
    tissue.is_known_ = false;
    tissue.tiled_.reset({});
  }
  ++receipts_.store_id;
  if (receipts_.store_id == 0) ++receipts_.store_id;
  receipts_.newest = 0;
  receipts_.received = 0;
}

void TissueStore::take(const Interaction& interaction, Duration loop_age) noexcept {
  const Duration age = std::clamp(loop_age, Duration::zero(), kLongestLoopAge);
  receipts_.loop_age = std::max(age, receipts_.loop_age - receipts_.loop_age / kAgeDecay);
  if (interaction.header.session_id != physics_session_id_) {
    if (physics_session_id_ != 0) empty();
    physics_session_id_ = interaction.header.session_id;
  }
  const SurfaceNews& news = interaction.surface;
  if (news.store_id != receipts_.store_id) return;
  if (news.number > 0) note_receipt(news.number, receipts_.newest, receipts_.received);
  if (news.has_description) take(news.description);
  for (std::uint32_t i = 0; i < news.tile_count; ++i) take(news.tiles[i]);
  cover(news);
}

void TissueStore::take(const TissueDescription& description) noexcept {
  DescribedTissue& tissue = tissues_[description.slot];
  if (tissue.is_known_ && tissue.version_ == description.version) return;  // a repetition
  for (Tag& tag : tags_) tag.is_held = tag.is_held && tag.described_slot != description.slot;
  tissue.take(description);
}

void TissueStore::take(const SurfaceTile& tile) noexcept {
  Tag& tag = tags_[tile.slot];
  if (tag.is_held && tag.version == tile.version && tag.described_slot == tile.described_slot) {
    return;  // a repetition
  }
  if (tag.is_held) {
    TileSurface& before = tissues_[tag.described_slot].tiled_;
    before.remove(tile.slot);
    before.cover({.radius_m = 0.0});
  }
  tag = {.version = tile.version, .described_slot = tile.described_slot, .is_held = true};
  held_[tile.slot].take(tile);
  tissues_[tile.described_slot].tiled_.add(tile.slot);
}

void TissueStore::cover(const SurfaceNews& news) noexcept {
  for (std::uint32_t i = 0; i < news.coverage_count; ++i) {
    const SurfaceCoverage& coverage = news.coverages[i];
    DescribedTissue& tissue = tissues_[coverage.described_slot];
    if (!tissue.is_known_ || tissue.version_ != coverage.description_version) continue;
    tissue.tiled_.cover(coverage.region);
    for (std::uint32_t k = 0; k < news.pending_count; ++k) {
      const PendingTile& pending = news.pending[k];
      if (pending.described_slot != coverage.described_slot) continue;
      const Tag& tag = tags_[pending.slot];
      const bool has_arrived = tag.is_held && tag.version == pending.version &&
                               tag.described_slot == pending.described_slot;
      if (has_arrived) continue;
      const auto& [x, y, z] = pending.center_m;
      tissue.tiled_.except(Vector3(x, y, z), pending.radius_m);
    }
  }
}

}  // namespace palpate::mofc
