// SPDX-License-Identifier: Apache-2.0
// patch_sender.h — hop 3: what mofc_node gets to know of elastic bodies, and when.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/core/messages.h"
#include "common/core/time.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/elastic_tissue/patch/link_rate.h"

namespace palpate::physics {

/// Sends the patches of the first kMaxElasticPatches elastic bodies of the scene to a mofc_node
/// that takes them: a new state first, then points, pressed ones and the nearest to the tip's way
/// first. What is not acknowledged is repeated, behind what is new: a state, while it is the
/// newest, after a third of the loop's age, a point after 9/8 of it. One point or state per
/// message, 3.3 kB at most, none in messages that carry tiles; in the mean as many bytes as the
/// link bears. No allocation, lock or throw.
class PatchSender {
 public:
  /// Fills answer.elastic; the rest of the answer is there.
  /// @param now  physics' clock, time of this step
  void fill(ElasticTissues& tissues, std::size_t tool, const ToolMotion& motion, TimePoint now,
            Interaction& answer) noexcept;

 private:
  static constexpr std::size_t kCarries = 256;
  /// What mofc_node has, and when it was sent.
  struct Item {
    std::uint32_t version = 0;
    bool is_acknowledged = false;
    bool is_sent = false;
    TimePoint sent_at{};
  };
  struct Sent {
    std::array<Item, kElasticSlots> points{};
    Item state{};
  };
  struct Carry {
    std::uint64_t number = 0;
    std::size_t patch = 0;
    std::size_t slot = 0;  // kElasticSlots: the state
    std::uint32_t version = 0;
  };

  void empty(std::uint64_t store_id) noexcept;
  void acknowledge(const ElasticReceipts& receipts) noexcept;
  [[nodiscard]] static bool is_due(Item& item, std::uint32_t version, TimePoint now,
                                   Duration repeat_after) noexcept;
  void carry(std::size_t patch, std::size_t slot, Item& item, TimePoint now,
             ElasticNews& news) noexcept;

  std::uint64_t store_id_ = 0;
  std::uint64_t next_number_ = 1;
  std::array<Sent, kMaxElasticPatches> sent_{};
  std::array<Carry, kCarries> carries_{};
  LinkRate rate_;
  double bytes_ = 0.0;  // that may be sent
  TimePoint bytes_at_{};
};

}  // namespace palpate::physics
