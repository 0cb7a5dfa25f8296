// SPDX-License-Identifier: Apache-2.0
// request_comparison.h — what acted over time, from the records of a device's ticks, and what it
// was against the requested force: the same for a run, a recording and the window of a viewer.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "common/telemetry/device_telemetry.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/mofc_telemetry.h"

namespace palpate {

/// The force to which a tick switched, and when.
struct LastSwitch {
  TimePoint at{};
  Vector3 force_newton = Vector3::Zero();
};

/// Calls use(from, until, force_newton) for what acted since the previous tick until the reading of
/// this one. A record of a version that did not keep it says only to what force the device switched
/// before: that one is taken to have acted from its switch on.
/// @param before  of the previous tick of the same device session; empty: there is none
template <class Use>
void for_each_acted(const std::optional<LastSwitch>& before, const DeviceTick& tick, Use&& use) {
  for (std::uint32_t i = 0; i < tick.acted_count; ++i) {
    const AppliedForce& acted = tick.acted[i];
    use(acted.from, acted.until, acted.force_on_hand_newton);
  }
  if (tick.acted_count == 0 && before && before->at < tick.sampled_at) {
    use(before->at, tick.sampled_at, before->force_newton);
  }
}

/// The answer to a tick is the request from the switch of that tick on until that of the next one
/// with a request: so a hole is charged for as long as it lasts. The time after a tick whose answer
/// acted, but is not known, does not count. No allocation, no throw.
class RequestComparison {
 public:
  /// The ticks of one device session, in order; any may be missing.
  void add(const DeviceTick& tick, const std::optional<MofcTick>& mofc) noexcept {
    if (before_ && tick.sequence != sequence_ + 1) interrupt();
    const TimePoint switched_at = before_ ? before_->at : tick.sampled_at;
    for_each_acted(before_, tick, [&](TimePoint from, TimePoint until, const Vector3& acted) {
      compare(request_before_, from, std::min(until, switched_at), acted);
      compare(request_, std::max(from, switched_at), until, acted);
    });
    request_before_ = request_;
    if (mofc) {
      request_ = mofc->requested_force_on_hand_newton;
    } else if (tick.is_answered) {
      request_.reset();
    }
    sequence_ = tick.sequence;
    before_ = LastSwitch{.at = tick.switched_at, .force_newton = tick.force_on_hand_newton};
  }
  /// The next tick is of another device session.
  void interrupt() noexcept {
    before_.reset();
    request_before_.reset();
    request_.reset();
  }

  /// Projected and capped, and its companions.
  [[nodiscard]] const ForceComparison& rendered() const noexcept { return rendered_; }
  /// Per axis, [MOFC] eqs. (15)–(18).
  [[nodiscard]] const PaperTransparency& per_axis() const noexcept { return per_axis_; }

 private:
  void compare(const std::optional<Vector3>& request, TimePoint from, TimePoint until,
               const Vector3& acted) noexcept {
    if (!request || until <= from) return;
    rendered_.add(to_seconds(until - from), *request, acted);
    per_axis_.add(to_seconds(until - from), *request, acted);
  }

  std::uint64_t sequence_ = 0;             // of the previous tick
  std::optional<LastSwitch> before_;       // likewise; empty: it is not known
  std::optional<Vector3> request_;         // from the last switch on
  std::optional<Vector3> request_before_;  // until then
  ForceComparison rendered_;
  PaperTransparency per_axis_;
};

}  // namespace palpate
