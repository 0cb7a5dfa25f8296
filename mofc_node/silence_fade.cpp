// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/silence_fade.h"

#include <algorithm>

namespace palpate::mofc {

SilenceFade::Output SilenceFade::step(const Vector3& force_newton, Duration silence,
                                      bool needs_no_news, Duration lost_for,
                                      TimePoint now) noexcept {
  Output output;
  const bool is_present = silence <= stale_after_ || needs_no_news;
  if (is_present) present_at_ = now;
  const Duration silent_for =
      is_present ? Duration::zero() : std::min(silence - stale_after_, now - present_at_);
  const Duration fading_for = std::max(silent_for, lost_for);
  if (fading_for <= Duration::zero()) {
    if (is_stale_) {
      is_stale_ = false;
      is_recovering_ = true;
      recovering_since_ = now;
      newton_when_recovering_ = last_newton_;
    }
    output.force_newton = recovering(force_newton, now);
  } else {
    if (!is_stale_) {
      is_stale_ = true;
      newton_when_stale_ = last_newton_;
    }
    const double left = 1.0 - to_seconds(fading_for) / to_seconds(fade_);
    output.phase = left > 0.0 ? Phase::kFading : Phase::kFadedOut;
    if (left > 0.0) output.force_newton = left * limited_to_norm(force_newton, newton_when_stale_);
  }
  last_newton_ = output.force_newton.norm();
  return output;
}

Vector3 SilenceFade::recovering(const Vector3& force_newton, TimePoint now) noexcept {
  if (!is_recovering_) return force_newton;
  const double share = to_seconds(now - recovering_since_) / to_seconds(fade_);
  const double rise = force_newton.norm() - newton_when_recovering_;
  is_recovering_ = share < 1.0;
  if (!is_recovering_ || rise <= 0.0) return force_newton;
  return limited_to_norm(force_newton, newton_when_recovering_ + share * rise);
}

}  // namespace palpate::mofc
