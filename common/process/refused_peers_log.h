// SPDX-License-Identifier: Apache-2.0
// refused_peers_log.h — logs peers that were refused because of their keys.
#pragma once

#include <map>
#include <string_view>
#include <utility>

#include "common/link/security/refused_peers.h"
#include "common/process/log.h"
#include "common/telemetry/event_throttle.h"

namespace palpate {

/// Writes a throttled line `event=peer_refused link=… reason=…` for each link and reason. Call
/// note() repeatedly, on one thread that is not the tick's.
class RefusedPeersLog {
 public:
  RefusedPeersLog(spdlog::logger& log, const RefusedPeers& refused)
      : log_(log), refused_(refused) {}

  void note(TimePoint now) {
    if (refused_.total() == 0) return;
    for (const auto& [what, refused] : refused_.counts()) {
      Line& line = lines_[what];
      const std::uint64_t due = line.throttle.note(now, refused.count - line.noted);
      line.noted = refused.count;
      if (due == 0) continue;
      log_.warn("event=peer_refused link={} count={} reason=\"{}\" address={}", what.first, due,
                explain(what.second), refused.address.empty() ? "unknown" : refused.address);
    }
  }

 private:
  struct Line {
    EventThrottle throttle{std::chrono::seconds(5)};
    std::uint64_t noted = 0;
  };

  spdlog::logger& log_;
  const RefusedPeers& refused_;
  std::map<std::pair<std::string_view, Refusal>, Line> lines_;
};

}  // namespace palpate
