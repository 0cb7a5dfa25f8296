// SPDX-License-Identifier: Apache-2.0
#include "physics_node/answer/surface_sender.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/contact/analytic_surfaces.h"
#include "common/contact/proxy.h"
#include "common/contact/shaft.h"
#include "common/contact/tissue_motion.h"

namespace palpate::physics {
namespace {

constexpr double kReachMargin_m = 3e-3;
constexpr double kLeastReach_m = 10e-3;
constexpr double kMostReach_m = 40e-3;
constexpr double kFloatMargin_m = 1e-4;  // more than a float of a kilometre rounds
constexpr double kBackPerSending_m = 3e-3;
constexpr double kTileBytesPerS = 600e3;
constexpr double kRestBytesPerS = 200e3;
// Bounds of what the parts of a message take; descriptions and tiles together: kMostBytes.
constexpr double kMostBytes = 5000.0;
constexpr double kFrameBytes = 7900.0;
constexpr double kHeadBytes = 250.0 + 35.0 * kMaxPendingTiles;
constexpr double kContactBytes = 500.0;
constexpr double kCoverageBytes = 85.0;
constexpr double kDescriptionBytes = 420.0;
constexpr double kInclusionBytes = 75.0;
constexpr double kTileBytes = 75.0;
constexpr double kVertexBytes = 6.0;
constexpr double kFacetBytes = 3.0;
constexpr double kPointBytes = 32.0;
// Of the last 64 messages lost at which repeating early is worth it.
constexpr double kLossy = 0.05;
constexpr Duration kReceiptMargin = std::chrono::milliseconds(5);
constexpr double kWhole_m = 1000.0;  // radius of the coverage of a surface that is known as a whole
constexpr Duration kSpeedBin = std::chrono::milliseconds(50);
constexpr Duration kLeastRepeat = std::chrono::milliseconds(5);
constexpr Duration kFirstRepeat = std::chrono::milliseconds(20);  // while the loop's age is unknown

/// The tile is no nearer than this to the line in the middle of the region.
double at_least_m(const DescribedTissue& tissue, std::uint32_t tile,
                  const CapsuleGeometry& region) noexcept {
  const Bounds& bounds = tissue.bounds[tile];
  if (region.from_m == region.to_m) return std::sqrt(bounds.squared_distance(region.from_m));
  return std::max(0.0, distance_to_axis_m(region, bounds.center_m()) - tissue.radii_m[tile]);
}

double bytes_of(const SurfaceTile& tile) noexcept {
  return kTileBytes + kVertexBytes * tile.vertex_count + kFacetBytes * tile.facet_count +
         kPointBytes * tile.point_count;
}

}  // namespace

template <std::size_t kMost>
void SurfaceSender::First<kMost>::offer(const Missing& one, std::size_t most) noexcept {
  if (most == 0 || (count == most && one.key_m >= entries[count - 1].key_m)) return;
  std::size_t place = count == most ? count - 1 : count++;
  for (; place > 0 && one.key_m < entries[place - 1].key_m; --place) {
    entries[place] = entries[place - 1];
  }
  entries[place] = one;
}

SurfaceSender::SurfaceSender(std::span<const DescribedTissue> tissues, double rate_hz)
    : tissues_(tissues), period_s_(1.0 / rate_hz) {
  if (tissues_.empty()) return;
  slots_.resize(kTileSlots);
  free_.reserve(kTileSlots);
  ranked_.reserve(kTileSlots);
  std::size_t described = 0;
  for (const DescribedTissue& tissue : tissues_) {
    slot_of_tile_.emplace_back(tissue.tiles.size(), kNoSlot);
    if (!tissue.description) continue;
    shaft_length_m_ = tissue.description->tool.shaft_length_m;
    ++described;
  }
  all_fit_ = described <= kMaxDescribed && tissues_.size() <= 4 * kMaxDescribed;
}

void SurfaceSender::fill(const ToolMotion& motion, TimePoint now,
                         Interaction& interaction) noexcept {
  SurfaceNews& news = interaction.surface;
  news.store_id = tissues_.empty() ? 0 : motion.receipts.store_id;
  if (news.store_id == 0) return;
  if (news.store_id != store_id_) empty(motion.receipts);
  tiles_per_message_ = motion.receipts.tiles_per_message;
  ranked_.clear();
  acknowledge(motion.receipts);
  note_speed(motion, now);
  loop_age_ = motion.receipts.loop_age;

  // where the tool is when this arrives, and how far it can be from there before the next
  const double age_s = to_seconds(loop_age_);
  const double reach_m = motion.receipts.newest > 0 ? this->reach_m() : kMostReach_m;
  const Vector3 ahead_m =
      limited_to_norm(age_s * motion.tool_velocity_world_m_per_s, 0.5 * reach_m);
  if (!(motion.tool_position_world_m + ahead_m).allFinite()) return;
  const double time_s = to_seconds((now + interaction.scene_ahead).time_since_epoch());

  // the listed tissues, deepest first
  struct Wanted {
    std::uint32_t slot = 0;
    CapsuleGeometry region{};
  };
  std::array<Wanted, kMaxDescribed> wanted{};
  std::size_t wanted_count = 0;
  for (std::uint32_t i = 0; i < interaction.listed_count; ++i) {
    const Contact& contact = interaction.contacts[i];
    if (!tissues_[contact.tissue].description) continue;
    const std::uint32_t slot = slot_for(contact.tissue, now);
    if (slot == kMaxDescribed) continue;
    const CapsuleGeometry region = region_of(contact, motion, ahead_m, reach_m, time_s);
    const auto end = wanted.begin() + static_cast<std::ptrdiff_t>(wanted_count);
    const auto known =
        std::find_if(wanted.begin(), end, [&](const Wanted& one) { return one.slot == slot; });
    if (known == end) {
      wanted[wanted_count++] = {.slot = slot, .region = region};
    } else if (contact.penetration_m > 0.0) {  // tip and shaft
      known->region.radius_m = std::max(known->region.radius_m, region.radius_m);
    }
  }
  // then the others, before the tool is near
  for (std::uint32_t tissue = 0; all_fit_ && tissue < tissues_.size(); ++tissue) {
    if (!tissues_[tissue].description) continue;
    const std::uint32_t slot = slot_for(tissue, now);
    const auto end = wanted.begin() + static_cast<std::ptrdiff_t>(wanted_count);
    const auto is_it = [&](const Wanted& one) { return one.slot == slot; };
    if (slot == kMaxDescribed || std::any_of(wanted.begin(), end, is_it)) continue;
    CapsuleGeometry region;
    region.from_m = motion.tool_position_world_m + ahead_m -
                    displacement(tissues_[tissue].description->motion, time_s).position_m;
    region.to_m = region.from_m;
    region.radius_m = kMostReach_m;
    wanted[wanted_count++] = {.slot = slot, .region = region};
  }
  const auto all = std::span(wanted).first(wanted_count);
  const double dt_s = std::max(0.0, to_seconds(now - filled_at_));
  filled_at_ = now;
  tile_bytes_ = std::min(kMostBytes, tile_bytes_ + kTileBytesPerS * dt_s);
  rest_bytes_ = std::min(kMostBytes, rest_bytes_ + kRestBytesPerS * dt_s);
  room_bytes_ =
      std::min(kMostBytes, kFrameBytes - kHeadBytes - kContactBytes * interaction.listed_count -
                               kCoverageBytes * static_cast<double>(wanted_count));
  // the description that has waited longest
  std::uint32_t next = kMaxDescribed;
  for (const Wanted& one : all) {
    const Described& described = described_[one.slot];
    if (described.is_acknowledged) continue;
    const auto sent_at = [&](std::uint32_t slot) {
      return described_[slot].is_sent ? described_[slot].sent_at : TimePoint::min();
    };
    if (next == kMaxDescribed || sent_at(one.slot) < sent_at(next)) next = one.slot;
  }
  if (next != kMaxDescribed) describe(next, now, news);
  for (const Wanted& one : all) {
    if (tissues_[*described_[one.slot].tissue].tiles.empty()) continue;
    cover(one.slot, one.region, ahead_m, now, news);
  }
  for (const Wanted& one : all) send_rest(one.slot, one.region, now, news);

  if (!news.has_description && news.tile_count == 0) return;
  news.number = next_number_++;
  Carry& carry = carries_[news.number % kCarries];
  carry = {.number = news.number, .tile_count = news.tile_count};
  if (news.has_description) {
    carry.description = {.slot = news.description.slot, .version = news.description.version};
  }
  for (std::uint32_t i = 0; i < news.tile_count; ++i) {
    carry.tiles[i] = {.slot = news.tiles[i].slot, .version = news.tiles[i].version};
  }
}

/// Where the tissue must be known, in its rest frame.
CapsuleGeometry SurfaceSender::region_of(const Contact& contact, const ToolMotion& motion,
                                         const Vector3& ahead_m, double reach_m,
                                         double time_s) const noexcept {
  const TissueDescription& description = *tissues_[contact.tissue].description;
  const ToolShape& tool = description.tool;
  const double gap_m = std::max(0.0, -contact.penetration_m + contact.normal_world.dot(ahead_m));
  const double radius_m = contact.is_shaft ? tool.shaft_radius_m : tool.tip_radius_m;
  const double away_m = std::abs(radius_m - std::max(0.0, contact.penetration_m));
  CapsuleGeometry region;
  region.from_m =
      motion.tool_position_world_m + ahead_m - displacement(description.motion, time_s).position_m;
  if (!(tool.shaft_length_m > 0.0)) {
    // a tool above the surface will touch it below
    region.from_m -= gap_m * contact.normal_world;
    region.to_m = region.from_m;
    region.radius_m = std::clamp(reach_m + away_m, kLeastReach_m, kMostReach_m);
    return region;
  }
  const Vector3 along = motion.tool_orientation_world * Vector3::UnitZ();
  const ShaftSegment shaft = shaft_segment(tool, region.from_m, along);
  const double step_m = (shaft.last_m - shaft.first_m) / static_cast<double>(kShaftSteps);
  const double least_m = clearance_m(tool.shaft_radius_m) + step_m + kReachMargin_m;
  region.to_m = region.from_m + tool.shaft_length_m * along;
  region.radius_m = std::clamp(reach_m + away_m + gap_m,
                               std::clamp(least_m, kLeastReach_m, kMostReach_m), kMostReach_m);
  return region;
}

// --- what mofc_node has -------------------------------------------------------------------------

void SurfaceSender::empty(const SurfaceReceipts& receipts) noexcept {
  store_id_ = receipts.store_id;
  next_number_ = 1;
  described_ = {};
  carries_ = {};
  std::fill(slots_.begin(), slots_.end(), Slot{});
  free_.clear();
  const std::size_t slots = std::min<std::size_t>(receipts.tile_slots, kTileSlots);
  for (std::size_t i = slots; i > 0; --i) free_.push_back(static_cast<std::uint16_t>(i - 1));
  for (auto& tiles : slot_of_tile_) std::fill(tiles.begin(), tiles.end(), kNoSlot);
}

void SurfaceSender::acknowledge(const SurfaceReceipts& receipts) noexcept {
  const auto window = static_cast<double>(std::min(kReceiptBits, receipts.newest));
  is_lossy_ = std::popcount(receipts.received) < (1.0 - kLossy) * window;
  for (std::uint64_t i = 0; i < kReceiptBits && i < receipts.newest; ++i) {
    if ((receipts.received >> i & 1U) == 0) continue;
    const std::uint64_t number = receipts.newest - i;
    Carry& carry = carries_[number % kCarries];
    if (carry.number != number) continue;
    carry.number = 0;  // once
    if (carry.description) {
      Described& described = described_[carry.description->slot];
      if (described.version == carry.description->version) described.is_acknowledged = true;
    }
    for (std::uint32_t k = 0; k < carry.tile_count; ++k) {
      Slot& slot = slots_[carry.tiles[k].slot];
      if (slot.described == kMaxDescribed || slot.version != carry.tiles[k].version) continue;
      if (!slot.is_acknowledged) ++described_[slot.described].tiles_known;
      slot.is_acknowledged = true;
    }
  }
}

void SurfaceSender::note_speed(const ToolMotion& motion, TimePoint now) noexcept {
  const std::int64_t bin = now.time_since_epoch() / kSpeedBin;
  const auto count = static_cast<std::int64_t>(kSpeedBins);
  if (bin - speed_bin_ >= count || bin < speed_bin_) {
    speeds_ = {};
  } else {
    for (std::int64_t i = speed_bin_ + 1; i <= bin; ++i) {
      speeds_[static_cast<std::size_t>(i % count)] = 0.0;
    }
  }
  speed_bin_ = bin;
  double& highest = speeds_[static_cast<std::size_t>(bin % count)];
  highest = std::max(highest, motion.tool_velocity_world_m_per_s.norm());
  if (!(shaft_length_m_ > 0.0) || motion.device_sampled_at == shaft_at_) return;
  const Vector3 shaft_m = shaft_length_m_ * (motion.tool_orientation_world * Vector3::UnitZ());
  const double dt_s = to_seconds(motion.device_sampled_at - shaft_at_);
  if (dt_s > 0.0 && shaft_at_ > TimePoint{}) {
    const Vector3 turn_m_per_s = (shaft_m - shaft_m_) / dt_s;
    highest = std::max(highest, (motion.tool_velocity_world_m_per_s + turn_m_per_s).norm());
  }
  shaft_m_ = shaft_m;
  shaft_at_ = motion.device_sampled_at;
}

double SurfaceSender::reach_m() const noexcept {
  const double speed = *std::max_element(speeds_.begin(), speeds_.end());
  return std::min(kMostReach_m, speed * (to_seconds(loop_age_) + 2.0 * period_s_) + kReachMargin_m);
}

/// Where the tissue is described, or kMaxDescribed. A new one replaces the one that has not been
/// wanted for longest.
std::uint32_t SurfaceSender::slot_for(std::uint32_t tissue, TimePoint now) noexcept {
  std::uint32_t oldest = 0;
  for (std::uint32_t i = 0; i < kMaxDescribed; ++i) {
    if (described_[i].tissue == tissue) {
      described_[i].wanted_at = now;
      return i;
    }
    const auto age_of = [&](std::uint32_t slot) {
      return described_[slot].tissue ? now - described_[slot].wanted_at : Duration::max();
    };
    if (age_of(i) > age_of(oldest)) oldest = i;
  }
  if (described_[oldest].tissue && described_[oldest].wanted_at == now) return kMaxDescribed;
  begin(oldest, tissue, now);
  return oldest;
}

/// A new version of the slot, without tiles.
void SurfaceSender::begin(std::uint32_t slot, std::uint32_t tissue, TimePoint now) noexcept {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (slots_[i].described == slot) release(static_cast<std::uint16_t>(i));
  }
  described_[slot] = {.tissue = tissue, .version = next_version_++, .wanted_at = now};
}

void SurfaceSender::forget(std::uint32_t tissue) noexcept {
  for (std::uint32_t slot = 0; slot < kMaxDescribed; ++slot) {
    const Described& described = described_[slot];
    if (described.tissue == tissue) begin(slot, tissue, described.wanted_at);
  }
}

std::uint16_t& SurfaceSender::slot_of(const Described& described, std::uint32_t tile) noexcept {
  return slot_of_tile_[*described.tissue][tile];
}

void SurfaceSender::release(std::uint16_t index) noexcept {
  Slot& slot = slots_[index];
  Described& described = described_[slot.described];
  if (slot.is_acknowledged) --described.tiles_known;
  slot_of(described, slot.tile) = kNoSlot;
  slot = {};
  free_.push_back(index);
}

// --- what this message carries ------------------------------------------------------------------

Duration SurfaceSender::repeat_after(std::uint32_t sendings) const noexcept {
  if (loop_age_ <= Duration::zero()) return kFirstRepeat * (1U << std::min(sendings, 5U));
  if (is_lossy_) return std::max(kLeastRepeat, loop_age_ / 3);
  return loop_age_ + kReceiptMargin + from_seconds(period_s_);
}

/// Not sent yet, or long enough ago.
bool SurfaceSender::is_due(std::uint16_t index, TimePoint now) const noexcept {
  return index == kNoSlot || (!slots_[index].is_acknowledged && slots_[index].sent_at != now &&
                              now - slots_[index].sent_at >= repeat_after(slots_[index].sendings));
}

bool SurfaceSender::has_room(std::uint32_t slot, std::uint32_t tile,
                             const SurfaceNews& news) const noexcept {
  const std::uint32_t most = tiles_per_message_ - (news.has_description ? 1 : 0);
  return news.tile_count < most &&
         bytes_of(tissues_[*described_[slot].tissue].tiles[tile]) <= room_bytes_;
}

/// Tiles travel with their description until it is acknowledged.
bool SurfaceSender::may_carry_tiles(std::uint32_t slot, const SurfaceNews& news) const noexcept {
  return described_[slot].is_acknowledged ||
         (news.has_description && news.description.slot == slot);
}

void SurfaceSender::describe(std::uint32_t slot, TimePoint now, SurfaceNews& news) noexcept {
  Described& described = described_[slot];
  if (described.is_sent && now - described.sent_at < kLeastRepeat) return;
  news.has_description = true;
  news.description = *tissues_[*described.tissue].description;
  news.description.slot = slot;
  news.description.version = described.version;
  described.is_sent = true;
  described.sent_at = now;
  room_bytes_ -= kDescriptionBytes + kInclusionBytes * news.description.inclusion_count;
}

/// A slot that is free, or whose tile is farther away than this one.
std::uint16_t SurfaceSender::take_slot(const CapsuleGeometry& region, double wanted_m,
                                       SurfaceNews& news) noexcept {
  if (free_.empty()) {
    if (ranked_.empty()) rank(region);
    if (ranked_.empty() || ranked_.back().away_m <= wanted_m) return kNoSlot;
    const std::uint16_t farthest = ranked_.back().slot;
    ranked_.pop_back();
    // what has been said in this message must stay true
    const auto is_said = [&](const auto& one) { return one.slot == farthest; };
    if (std::any_of(news.tiles.begin(), news.tiles.begin() + news.tile_count, is_said) ||
        std::any_of(news.pending.begin(), news.pending.begin() + news.pending_count, is_said)) {
      return kNoSlot;
    }
    release(farthest);
  }
  const std::uint16_t slot = free_.back();
  free_.pop_back();
  return slot;
}

/// The slots in use whose tiles are farthest away: as many as a message can need.
void SurfaceSender::rank(const CapsuleGeometry& region) noexcept {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (slots_[i].described == kMaxDescribed) continue;
    const DescribedTissue& tissue = tissues_[*described_[slots_[i].described].tissue];
    ranked_.push_back({at_least_m(tissue, slots_[i].tile, region), static_cast<std::uint16_t>(i)});
  }
  const auto is_farther = [](const Ranked& a, const Ranked& b) { return a.away_m > b.away_m; };
  const std::size_t count = std::min(ranked_.size(), kMaxTilesPerMessage + kMaxPendingTiles);
  std::partial_sort(ranked_.begin(), ranked_.begin() + static_cast<std::ptrdiff_t>(count),
                    ranked_.end(), is_farther);
  ranked_.resize(count);
  std::reverse(ranked_.begin(), ranked_.end());
}

/// False if there is no slot for it.
bool SurfaceSender::carry(std::uint32_t described, std::uint32_t tile,
                          const CapsuleGeometry& region, double away_m, TimePoint now,
                          SurfaceNews& news) noexcept {
  std::uint16_t& index = slot_of(described_[described], tile);
  if (index == kNoSlot) {
    const std::uint16_t taken = take_slot(region, away_m, news);
    if (taken == kNoSlot) return false;
    slots_[taken] = {.described = described, .tile = tile, .version = next_version_++};
    index = taken;
  }
  Slot& slot = slots_[index];
  slot.sent_at = now;
  ++slot.sendings;
  SurfaceTile& to = news.tiles[news.tile_count++];
  to = tissues_[*described_[described].tissue].tiles[tile];
  to.slot = index;
  to.described_slot = described;
  to.version = slot.version;
  room_bytes_ -= bytes_of(to);
  tile_bytes_ -= bytes_of(to);
  return true;
}

void SurfaceSender::cover(std::uint32_t slot, const CapsuleGeometry& region, const Vector3& ahead_m,
                          TimePoint now, SurfaceNews& news) noexcept {
  Described& described = described_[slot];
  const DescribedTissue& tissue = tissues_[*described.tissue];
  SurfaceCoverage coverage{
      .described_slot = slot,
      .description_version = described.version,
      .region = {.from_m = region.from_m, .to_m = region.to_m, .radius_m = kWhole_m}};
  double& covered_m = coverage.region.radius_m;
  if (described.tiles_known < tissue.tiles.size()) {
    // of the tiles that are not known: the nearest, and those to be sent first
    CapsuleGeometry way = region;
    if (region.from_m == region.to_m) way.from_m -= ahead_m;
    constexpr std::size_t kNone = 1;  // the first that is not listed as pending
    First<kMaxPendingTiles + kNone> nearest;
    First<kMaxTilesPerMessage> first;
    covered_m = region.radius_m;
    const std::size_t most =
        may_carry_tiles(slot, news) && tile_bytes_ > 0.0
            ? tiles_per_message_ - std::min(tiles_per_message_, news.tile_count)
            : 0;
    tissue.tree.visit_near(bounds_of(region), [&](std::uint32_t tile) {
      const std::uint16_t index = slot_of(described, tile);
      if (index != kNoSlot && slots_[index].is_acknowledged) return;
      const double distance_m = at_least_m(tissue, tile, region);
      if (distance_m > region.radius_m) return;
      nearest.offer({.key_m = distance_m, .distance_m = distance_m, .tile = tile});
      if (!is_due(index, now)) return;
      // nearest middle first; each time that a tile has been sent puts it back
      const double sendings = index == kNoSlot ? 0.0 : slots_[index].sendings;
      first.offer({.key_m = distance_to_axis_m(way, tissue.bounds[tile].center_m()) +
                            kBackPerSending_m * sendings,
                   .distance_m = distance_m,
                   .tile = tile},
                  most);
    });
    for (std::size_t i = 0; i < first.count && tile_bytes_ > 0.0; ++i) {
      const Missing& one = first.entries[i];
      if (!has_room(slot, one.tile, news)) break;
      if (!carry(slot, one.tile, region, one.distance_m, now, news)) break;
    }
    for (std::size_t i = 0; i < nearest.count; ++i) {
      const Missing& one = nearest.entries[i];
      const std::uint16_t index = slot_of(described, one.tile);
      const bool is_sent = index != kNoSlot;
      const bool is_carried = is_sent && slots_[index].sent_at == now;  // by this very message
      if (i == kMaxPendingTiles || (!is_carried && news.pending_count == kMaxPendingTiles)) {
        covered_m = std::min(covered_m, one.distance_m);
        break;
      }
      if (is_carried) continue;
      const Vector3 middle_m = tissue.bounds[one.tile].center_m();
      news.pending[news.pending_count++] = {
          .slot = is_sent ? std::uint32_t{index} : 0,
          .described_slot = slot,
          .version = is_sent ? slots_[index].version : 0,
          .center_m = {static_cast<float>(middle_m.x()), static_cast<float>(middle_m.y()),
                       static_cast<float>(middle_m.z())},
          .radius_m = static_cast<float>(tissue.radii_m[one.tile] + kFloatMargin_m)};
    }
  }
  news.coverages[news.coverage_count++] = coverage;
}

/// Tiles that the tool will not reach soon, in spare room.
void SurfaceSender::send_rest(std::uint32_t slot, const CapsuleGeometry& region, TimePoint now,
                              SurfaceNews& news) noexcept {
  Described& described = described_[slot];
  const DescribedTissue& tissue = tissues_[*described.tissue];
  if (described.tiles_known == tissue.tiles.size() || !may_carry_tiles(slot, news)) return;
  constexpr std::size_t kMostLooks = 256;
  const std::size_t looks = std::min(kMostLooks, tissue.tiles.size());
  for (std::size_t i = 0; i < looks && rest_bytes_ > 0.0 && tile_bytes_ > 0.0; ++i) {
    const auto tile = static_cast<std::uint32_t>(described.next_tile);
    const std::uint16_t index = slot_of(described, tile);
    if (is_due(index, now) && (index != kNoSlot || !free_.empty())) {
      if (!has_room(slot, tile, news)) return;
      if (carry(slot, tile, region, kWhole_m, now, news))
        rest_bytes_ -= bytes_of(tissue.tiles[tile]);
    }
    described.next_tile = (described.next_tile + 1) % tissue.tiles.size();
  }
}

}  // namespace palpate::physics
