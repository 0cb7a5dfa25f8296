// SPDX-License-Identifier: Apache-2.0
// wait_for.h — waits for a file with a deadline.
#pragma once

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <chrono>

#include "common/core/time.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

using WireClock = std::chrono::steady_clock;

[[nodiscard]] inline WireClock::time_point wire_deadline(Duration within) noexcept {
  return WireClock::now() + std::chrono::duration_cast<WireClock::duration>(within);
}

/// Waits until one of `events`, POLLIN or POLLOUT, or the deadline.
[[nodiscard]] inline Transfer wait_for(int file, short events,
                                       WireClock::time_point deadline) noexcept {
  for (;;) {
    const auto left = std::max(deadline - WireClock::now(), WireClock::duration::zero());
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
    const timespec wait{.tv_sec = seconds.count(),
                        .tv_nsec = std::chrono::nanoseconds(left - seconds).count()};
    pollfd entry{.fd = file, .events = events, .revents = 0};
    const int ready = ::ppoll(&entry, 1, &wait, nullptr);
    if (ready > 0) return (entry.revents & events) != 0 ? Transfer::kDone : Transfer::kClosed;
    if (ready == 0) return Transfer::kTimeout;
    if (errno != EINTR) return Transfer::kClosed;
  }
}

}  // namespace palpate::device
