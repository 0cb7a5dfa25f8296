// SPDX-License-Identifier: Apache-2.0
// status_line.h — the state of the whole system in one line of text.
#pragma once

#include <string>

#include "viewer_node/feed/telemetry_mirror.h"

namespace palpate::viewer {

inline constexpr std::size_t kStatusColumns = 160;

/// For example, with every node alive:
///
///   1000.0 Hz  jitter p99 85 µs  reply p99 140 µs  answered 99.98 %  contact  |F| 1.92/2.40 N
///   clamp 12 %  E 3.1 mJ (true 4.0)  transp 0.93  age 1.1 ms  lost 0
///
/// |F| is rendered/requested, now; E the controller's ledger; `answered` counts from the device's
/// start, `lost` counts messages missing on hops 1 and 4 and, in brackets, batches and records of
/// telemetry; the other figures cover the last second. The word in the middle is the state of the
/// physics, or of the device while it applies no answer. Unknown figures are "-". A node that is
/// gone or was never heard is reported in words, without its figures.
///
/// UTF-8, no line end, at most `columns` characters; figures that do not fit are omitted.
/// @param now  viewer's clock
[[nodiscard]] std::string status_line(const TelemetryMirror& mirror, TimePoint now,
                                      std::size_t columns = kStatusColumns);

}  // namespace palpate::viewer
