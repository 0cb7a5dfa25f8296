// SPDX-License-Identifier: Apache-2.0
// fault_line.h — simulated network faults: delay, jitter, loss, bursts, duplication, reordering,
// outages, stalls and frozen content. It is part of the receiver's Inbox, so that one
// implementation serves memory and ZeroMQ links, experiments and tests.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "common/core/messages.h"
#include "common/core/random.h"
#include "common/core/time.h"

namespace palpate {

/// A time window on the receiver's clock, relative to the start of the link.
struct FaultWindow {
  enum class Kind : std::uint8_t {
    kOutage,  ///< messages that arrive in the window are lost
    kStall,   ///< messages that arrive are held and delivered together at the end, as TCP does
    kFreeze,  ///< messages keep arriving, with the content of the first one of the window
  };
  Kind kind = Kind::kOutage;
  Duration from{};
  Duration until{};
  Duration every{};  ///< > 0: the window repeats with this period

  /// Time left in the window, `since_start` after the start; nothing outside it.
  [[nodiscard]] std::optional<Duration> left(Duration since_start) const {
    const Duration t = every.count() > 0 ? since_start % every : since_start;
    if (t < from || t >= until) return std::nullopt;
    return until - t;
  }
};

struct LinkFaults {
  Duration delay{};
  Duration jitter{};               ///< each message's extra delay is uniform in [0, jitter]
  double loss_ratio = 0.0;         ///< independent loss
  double burst_ratio = 0.0;        ///< fraction of messages that start a burst of losses
  std::uint32_t burst_length = 1;  ///< messages lost in one burst
  double duplicate_ratio = 0.0;
  double reorder_ratio = 0.0;  ///< fraction of messages delayed by `reorder_delay`
  Duration reorder_delay{};
  /// Jitter alone keeps messages in order unless this is set.
  bool jitter_reorders = false;
  std::vector<FaultWindow> windows{};

  [[nodiscard]] bool any() const {
    return delay.count() != 0 || jitter.count() != 0 || loss_ratio > 0 || burst_ratio > 0 ||
           duplicate_ratio > 0 || reorder_ratio > 0 || !windows.empty();
  }
};

/// Delays, drops, duplicates and reorders messages. Deterministic for a given seed. Not
/// thread-safe: it belongs to one receiver.
template <class T>
class FaultLine {
 public:
  FaultLine(const LinkFaults& faults, std::uint64_t seed, TimePoint start)
      : faults_(faults), random_(seed), start_(start) {
    pending_.reserve(kReady);
    messages_.reserve(kReady);
    free_.reserve(kReady);
  }

  void push(const T& message, TimePoint now) {
    // loss: independent, in a burst, in an outage
    const bool is_lost = faults_.loss_ratio > 0 && random_.chance(faults_.loss_ratio);
    if (burst_left_ == 0 && faults_.burst_ratio > 0 && random_.chance(faults_.burst_ratio)) {
      burst_left_ = faults_.burst_length;
    }
    const bool is_in_burst = burst_left_ > 0;
    if (is_in_burst) --burst_left_;
    if (is_lost || is_in_burst || window(FaultWindow::Kind::kOutage, now)) return;

    // frozen content with a new header
    const bool is_frozen = window(FaultWindow::Kind::kFreeze, now).has_value();
    if (is_frozen && !is_frozen_) copy_message(message, frozen_);
    if (is_frozen) frozen_.header = message.header;
    is_frozen_ = is_frozen;
    const T& delivered = is_frozen ? frozen_ : message;

    // delay: constant, random, until the end of a stall
    TimePoint due = now + faults_.delay;
    if (faults_.jitter.count() > 0) {
      due += Duration(static_cast<std::int64_t>(random_.uniform() *
                                                static_cast<double>(faults_.jitter.count() + 1)));
    }
    if (const auto stalled = window(FaultWindow::Kind::kStall, now)) {
      due = std::max(due, now + *stalled);
    }
    const bool is_held_back = faults_.reorder_ratio > 0 && random_.chance(faults_.reorder_ratio);
    if (is_held_back) due += faults_.reorder_delay;
    if (!is_held_back && !faults_.jitter_reorders) {
      due = std::max(due, newest_due_);
      newest_due_ = due;
    }
    insert(delivered, due);
    if (faults_.duplicate_ratio > 0 && random_.chance(faults_.duplicate_ratio)) {
      insert(delivered, due);
    }
  }

  /// The next message due by `now`, and the time at which it was due; false if there is none.
  [[nodiscard]] bool pop(TimePoint now, T& message, TimePoint& due) {
    if (pending_.empty() || pending_.front().due > now) return false;
    std::pop_heap(pending_.begin(), pending_.end(), Later{});
    copy_message(messages_[pending_.back().slot], message);
    free_.push_back(pending_.back().slot);
    due = pending_.back().due;
    pending_.pop_back();
    return true;
  }

  /// When the next message is due; TimePoint::max() if none is pending.
  [[nodiscard]] TimePoint next_due() const {
    return pending_.empty() ? TimePoint::max() : pending_.front().due;
  }

 private:
  static constexpr std::size_t kReady = 64;  // messages that need no further allocation

  struct Pending {
    TimePoint due;
    std::uint64_t order;
    std::size_t slot;  // of messages_
  };
  struct Later {
    bool operator()(const Pending& a, const Pending& b) const {
      return a.due != b.due ? a.due > b.due : a.order > b.order;
    }
  };

  void insert(const T& message, TimePoint due) {
    if (free_.empty()) {
      free_.push_back(messages_.size());
      messages_.emplace_back();
    }
    const std::size_t slot = free_.back();
    free_.pop_back();
    copy_message(message, messages_[slot]);
    pending_.push_back({due, order_++, slot});
    std::push_heap(pending_.begin(), pending_.end(), Later{});
  }

  /// Time left in a window of that kind; nothing outside.
  [[nodiscard]] std::optional<Duration> window(FaultWindow::Kind kind, TimePoint now) const {
    for (const FaultWindow& w : faults_.windows) {
      if (w.kind != kind) continue;
      if (const auto left = w.left(now - start_)) return left;
    }
    return std::nullopt;
  }

  LinkFaults faults_;
  Random random_;
  TimePoint start_;
  std::vector<Pending> pending_;   // heap, earliest due first
  std::vector<T> messages_;        // kilobytes each: they stay where they are
  std::vector<std::size_t> free_;  // slots of messages_
  std::uint64_t order_ = 0;
  TimePoint newest_due_{};
  std::uint32_t burst_left_ = 0;
  bool is_frozen_ = false;
  T frozen_{};
};

}  // namespace palpate
