// SPDX-License-Identifier: Apache-2.0
// physics_clock.h — the time of moving tissue in physics, estimated on the device's side.
#pragma once

#include <algorithm>
#include <optional>

#include "common/core/messages.h"
#include "common/core/time.h"

namespace palpate::mofc {

/// An Interaction left physics_node half-way between the DeviceState that it answers and its first
/// use, as far as anybody knows; the answer with the shortest way round says it best. The estimate
/// follows a better one at 1 % of the passing time, so it never runs backwards. No allocation, no
/// throw.
class PhysicsClock {
 public:
  void reset() noexcept {
    ahead_.reset();
    best_.reset();
  }

  /// @param now  device's clock
  void note(const Interaction& interaction, TimePoint now) noexcept {
    const Duration age = now - interaction.device_sampled_at;
    if (age < Duration::zero()) return;
    if (best_ && age > best_->age + (now - best_->at) / kForget) return;
    best_ = {.age = age,
             .at = now,
             .ahead = interaction.header.sampled_at + interaction.scene_ahead -
                      interaction.device_sampled_at - age / 2};
  }

  /// The estimate without that bound; none before the first Interaction.
  [[nodiscard]] std::optional<TimePoint> best(TimePoint now) const noexcept {
    if (!best_) return std::nullopt;
    return now + best_->ahead;
  }

  /// Once per DeviceState, in order. None before the first Interaction.
  [[nodiscard]] std::optional<double> now_s(TimePoint now) noexcept {
    if (!best_) return std::nullopt;
    if (!ahead_) ahead_ = best_->ahead;
    const Duration most = (now - last_) / kSlew;
    const Duration error = best_->ahead - *ahead_;
    if (error > kJump || error < -kJump) {
      ahead_ = best_->ahead;
    } else {
      *ahead_ += std::clamp(error, -most, most);
    }
    last_ = std::max(last_, now);
    return to_seconds((now + *ahead_).time_since_epoch());
  }

 private:
  static constexpr int kSlew = 100;
  static constexpr int kForget = 1000;  // a way longer by 1 ms counts after a second
  static constexpr Duration kJump = std::chrono::milliseconds(100);

  struct Best {
    Duration age{};
    TimePoint at{};
    Duration ahead{};
  };
  std::optional<Best> best_;
  std::optional<Duration> ahead_;  // of physics' clock before the device's, in use
  TimePoint last_{};
};

}  // namespace palpate::mofc
