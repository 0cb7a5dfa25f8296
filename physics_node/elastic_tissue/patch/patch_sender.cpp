// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/patch/patch_sender.h"

#include <algorithm>
#include <limits>

namespace palpate::physics {
namespace {

constexpr Duration kShortestRepeat = std::chrono::milliseconds(5);
constexpr Duration kRepeatBeforeAge =
    std::chrono::milliseconds(40);        // while the loop's age is unknown
constexpr double kRepeatBehind_m = 1.0;   // first all that was never sent
constexpr double kMostBytesAtOnce = 8e3;  // at once
// On the wire.
constexpr double kNewsBytes = 150.0;
constexpr double kOtherBytes = 19.0;
constexpr double kPlaceBytes = 17.0;
constexpr double kRestBytes = 6.0;

}  // namespace

void PatchSender::empty(std::uint64_t store_id) noexcept {
  store_id_ = store_id;
  next_number_ = 1;
  sent_ = {};
  carries_ = {};
}

void PatchSender::acknowledge(const ElasticReceipts& receipts) noexcept {
  for (std::uint64_t i = 0; i < kReceiptBits && i < receipts.newest; ++i) {
    if ((receipts.received >> i & 1U) == 0) continue;
    const std::uint64_t number = receipts.newest - i;
    Carry& carry = carries_[number % kCarries];
    if (carry.number != number) continue;
    carry.number = 0;  // once
    Sent& sent = sent_[carry.patch];
    Item& item = carry.slot < kElasticSlots ? sent.points[carry.slot] : sent.state;
    if (item.version == carry.version) item.is_acknowledged = true;
  }
}

/// It has not been acknowledged, nor sent too shortly ago.
bool PatchSender::is_due(Item& item, std::uint32_t version, TimePoint now,
                         Duration repeat_after) noexcept {
  if (item.version != version) item = {.version = version};
  if (item.is_acknowledged) return false;
  return !item.is_sent || now - item.sent_at >= std::max(kShortestRepeat, repeat_after);
}

void PatchSender::carry(std::size_t patch, std::size_t slot, Item& item, TimePoint now,
                        ElasticNews& news) noexcept {
  item.is_sent = true;
  item.sent_at = now;
  news.store_id = store_id_;
  news.number = next_number_++;
  carries_[news.number % kCarries] = {
      .number = news.number, .patch = patch, .slot = slot, .version = item.version};
}

void PatchSender::fill(ElasticTissues& tissues, std::size_t tool, const ToolMotion& motion,
                       TimePoint now, Interaction& answer) noexcept {
  if (!motion.elastic_receipts || motion.receipts.store_id == 0) return;
  if (motion.receipts.store_id != store_id_) empty(motion.receipts.store_id);
  acknowledge(*motion.elastic_receipts);
  const Duration age = motion.receipts.loop_age;
  // a state soon, a point when its receipt is late
  const Duration repeat_state = age > Duration::zero() ? age / 3 : kRepeatBeforeAge;
  const Duration repeat_point = age > Duration::zero() ? age + age / 8 : kRepeatBeforeAge;
  rate_.observe(age, now);
  bytes_ = std::min(kMostBytesAtOnce, bytes_ + rate_.bytes_per_s() * to_seconds(now - bytes_at_));
  bytes_at_ = now;
  const bool has_room = !answer.surface.has_description && answer.surface.tile_count == 0 &&
                        answer.listed_count <= kMaxContactsWithElastic;
  if (!has_room || bytes_ < 0.0) return;

  // a state that is new, then points, then what else is due
  const std::size_t count = std::min(kMaxElasticPatches, tissues.tissues().size());
  std::array<const ElasticPatch*, kMaxElasticPatches> patches{};
  for (std::size_t i = 0; i < count; ++i) {
    const ElasticPatch* const patch = tissues.tissues()[i]->patch(tool);
    if (patch == nullptr || patch->state.number == 0) continue;
    patches[i] = patch;
    Item& item = sent_[i].state;
    if (!is_due(item, patch->state.number, now, repeat_state)) continue;
    carry(i, kElasticSlots, item, now, answer.elastic);
    answer.elastic.has_point = false;
    answer.elastic.state = patch->state;
    answer.elastic.state.patch = static_cast<std::uint32_t>(i);
    bytes_ -= kNewsBytes +
              (kPlaceBytes + (patch->state.relaxation_s > 0.0 ? kRestBytes : 0.0)) * kElasticSlots;
    return;
  }
  std::size_t patch = 0;
  std::size_t slot = kElasticSlots;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    if (patches[i] == nullptr) continue;
    for (std::size_t k = 0; k < kElasticSlots; ++k) {
      const ElasticPatch::Slot& one = patches[i]->slots[k];
      Item& item = sent_[i].points[k];
      if (one.point.version == 0 || !is_due(item, one.point.version, now, repeat_point)) continue;
      const double away_m = one.distance_m + (item.is_sent ? kRepeatBehind_m : 0.0);
      if (!(away_m < nearest_m)) continue;
      patch = i;
      slot = k;
      nearest_m = away_m;
    }
  }
  if (slot == kElasticSlots) return;
  const ElasticPoint& point = patches[patch]->slots[slot].point;
  carry(patch, slot, sent_[patch].points[slot], now, answer.elastic);
  answer.elastic.has_point = true;
  answer.elastic.point = point;
  answer.elastic.point.patch = static_cast<std::uint32_t>(patch);
  bytes_ -= kNewsBytes + kOtherBytes * static_cast<double>(point.has_other.count());
}

}  // namespace palpate::physics
