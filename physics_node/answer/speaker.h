// SPDX-License-Identifier: Apache-2.0
// speaker.h — whether this physics speaks, and the time of its moving tissue: shared by all tools
// of one physics_node.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>

#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/core/physics_term.h"
#include "common/core/time.h"

namespace palpate::physics {

/// Keeps the highest term that any tool's motions have named, which every Interaction repeats
/// (theory.md §5.1), so that all sides hear of it. A physics that does not speak sets its scene to
/// the time of the one that does: at once if it is off by more than 0.1 s, else by 1/64 of the
/// difference per motion. The one that speaks never changes its own.
///
/// hear() on the thread of the steps; the rest on any thread. No allocation, no lock, no throw.
class Speaker {
 public:
  explicit Speaker(PhysicsRole role) : role_(role) {}

  /// Once per motion.
  void hear(const Received<ToolMotion>& motion) noexcept {
    const std::uint64_t term = std::max(term_.load(kRelaxed), motion.value.physics_term);
    term_.store(term, kRelaxed);
    if (!motion.value.scene_time || speaker_of(term) == role_) return;
    const Duration ahead = scene_ahead();
    const Duration error = *motion.value.scene_time - motion.received_at - ahead;
    const bool is_far = error > kJump || error < -kJump;
    const Duration next = is_far ? ahead + error : ahead + error / kSlowness;
    ahead_.store(std::clamp(next, -kMostAhead, kMostAhead).count(), kRelaxed);
  }

  [[nodiscard]] std::uint64_t term() const noexcept { return term_.load(kRelaxed); }
  [[nodiscard]] bool is_speaking() const noexcept { return speaker_of(term()) == role_; }
  /// Time of moving tissue less this host's clock.
  [[nodiscard]] Duration scene_ahead() const noexcept { return Duration(ahead_.load(kRelaxed)); }

 private:
  static constexpr std::memory_order kRelaxed = std::memory_order_relaxed;
  static constexpr Duration kJump = std::chrono::milliseconds(100);
  static constexpr int kSlowness = 64;
  static constexpr Duration kMostAhead{std::int64_t{1} << 61};  // of hop 3

  PhysicsRole role_;
  std::atomic<std::uint64_t> term_{0};
  std::atomic<Duration::rep> ahead_{0};
};

}  // namespace palpate::physics
