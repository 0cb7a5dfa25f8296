// SPDX-License-Identifier: Apache-2.0
// rendered_share.h — how much of the requested force acted, weighted by time.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "common/telemetry/tick_row.h"

namespace palpate::bench {

/// ∫ of the force that acted, projected on what the tissue requested and capped there, over ∫ of
/// what it requested, from the first to the last row. A request stands until the next one; so a
/// tick that was skipped counts. NaN without a request.
///
/// Telemetry does not tell how long a force acts when no later tick replaces it.
/// @param lease  that time: with the shortest and the longest possible lease a lower and an upper
///               bound of the share
inline double rendered_share(std::span<const TickRow> rows, Duration lease) {
  Vector3 requested = Vector3::Zero();
  Vector3 acting = Vector3::Zero();
  TimePoint ends_at{};
  double rendered = 0.0;
  double wanted = 0.0;
  const auto add = [&](TimePoint from, TimePoint until) {
    const double newton = requested.norm();
    if (newton < 1e-9 || until <= from) return;
    const double acted_s = std::max(0.0, to_seconds(std::min(until, ends_at) - from));
    const double share = std::clamp(acting.dot(requested) / (newton * newton), 0.0, 1.0);
    rendered += share * newton * acted_s;
    wanted += newton * to_seconds(until - from);
  };
  for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
    const DeviceTick& tick = rows[i].device;
    const TimePoint next = rows[i + 1].device.sampled_at;
    if (rows[i].mofc) requested = rows[i].mofc->requested_force_on_hand_newton;
    const TimePoint switched_at = std::clamp(tick.switched_at, tick.sampled_at, next);
    add(tick.sampled_at, switched_at);
    acting = tick.force_on_hand_newton;
    // a force on its lease began to act before
    if (tick.guard != GuardState::kLeased) ends_at = switched_at + lease;
    add(switched_at, next);
  }
  return wanted > 0.0 ? rendered / wanted : kNaN;
}

}  // namespace palpate::bench
