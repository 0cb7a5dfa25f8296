// SPDX-License-Identifier: Apache-2.0
// rejection_log.h — logs why frames were refused, with the remedy.
#pragma once

#include <string>

#include "common/link/rejections.h"
#include "common/telemetry/event_log.h"

namespace palpate {

/// Writes a throttled line `event=frame_refused link=… reason=…` when a link refuses more frames.
/// Call note() repeatedly, on one thread that is not the tick's.
class RejectionLog {
 public:
  RejectionLog(spdlog::logger& log, const char* link, const Rejections& rejections)
      : log_(log), link_(link), rejections_(rejections) {}

  void note(TimePoint now) {
    const std::uint64_t total = rejections_.total();
    const std::uint64_t count = throttle_.note(now, total - seen_);
    seen_ = total;
    if (count == 0) return;
    const DecodeError latest = rejections_.latest();
    log_.warn("event=frame_refused link={} count={} reason=\"{}\"", link_, count,
              latest == DecodeError::kNone ? std::string("another peer is being served")
                                           : explain(latest, rejections_.peer_major()));
  }

 private:
  spdlog::logger& log_;
  const char* link_;
  const Rejections& rejections_;
  EventThrottle throttle_;
  std::uint64_t seen_ = 0;
};

}  // namespace palpate
