// SPDX-License-Identifier: Apache-2.0
// silence_fade.h — fades the force out when the physics is silent, and back in when it returns.
#pragma once

#include <cstdint>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate::mofc {

/// After `stale_after` of silence, or at once if the connection is lost, |F| never exceeds what it
/// was then and fades to zero over `fade`. When the physics answers again, |F| grows from where it
/// is to its full value over `fade`. Only ever reduces |F|; the direction is kept. No allocation,
/// no throw.
class SilenceFade {
 public:
  enum class Phase : std::uint8_t {
    kPresent,  ///< the physics answers, or never has
    kFading,
    kFadedOut,  ///< no force
  };
  struct Output {
    Vector3 force_newton = Vector3::Zero();
    Phase phase = Phase::kPresent;
  };

  SilenceFade(Duration stale_after, Duration fade) : stale_after_(stale_after), fade_(fade) {}

  /// Once per answer.
  /// @param silence   0: the physics has just answered, or never has
  /// @param needs_no_news  the force stays however long the silence
  /// @param lost_for  since the connection was lost; 0: it is not
  [[nodiscard]] Output step(const Vector3& force_newton, Duration silence, bool needs_no_news,
                            Duration lost_for, TimePoint now) noexcept;

 private:
  [[nodiscard]] Vector3 recovering(const Vector3& force_newton, TimePoint now) noexcept;

  Duration stale_after_;
  Duration fade_;
  TimePoint present_at_{};  // last time that no fade was due
  bool is_stale_ = false;
  double newton_when_stale_ = 0.0;
  bool is_recovering_ = false;
  TimePoint recovering_since_{};
  double newton_when_recovering_ = 0.0;
  double last_newton_ = 0.0;  // |F| of the last step
};

}  // namespace palpate::mofc
