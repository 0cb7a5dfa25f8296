// SPDX-License-Identifier: Apache-2.0
// watcher.h — a viewer that waits for the events that a test expects.
#pragma once

#include <algorithm>
#include <chrono>
#include <functional>
#include <vector>

#include "common/core/clock.h"
#include "common/process/process_links.h"
#include "common/session/session.h"
#include "tests/support/machine/machine.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/process.h"

namespace palpate::test {

class Watcher {
 public:
  static constexpr auto kAmple = std::chrono::seconds(30);  ///< on an idle machine, for any event

  Watcher(const Session& session, ProcessLinks& links)
      : feed_(session, clock_, links), mirrors_(session.sides.size()), rows_(mirrors_.size()) {
    for (std::size_t i = 0; i < mirrors_.size(); ++i) {
      mirrors_[i].on_row = [this, i](const TickRow& row) { rows_[i].push_back(row); };
    }
  }

  /// Receives until `is_seen()`; false if that has not happened after test::patience(ample).
  bool until(const std::function<bool()>& is_seen, Duration ample = kAmple) {
    const TimePoint end =
        clock_.now() + patience(std::chrono::ceil<std::chrono::milliseconds>(ample));
    while (!is_seen()) {
      const TimePoint now = clock_.now();
      if (now >= end) return false;
      feed_.pump(mirrors_, std::min(now + std::chrono::milliseconds(20), end));
    }
    return true;
  }
  /// Receives until `count` more rows have arrived.
  bool until_rows(std::size_t count) {
    const std::size_t wanted = rows_[0].size() + count;
    return until([&] { return rows_[0].size() >= wanted; });
  }

  [[nodiscard]] bool sees_all_nodes() const {
    const TimePoint now = clock_.now();
    return std::all_of(mirrors_.begin(), mirrors_.end(), [&](const auto& mirror) {
      return mirror.device_link().is_alive(now) && mirror.mofc_link().is_alive(now) &&
             mirror.physics_link().is_alive(now);
    });
  }
  /// @param side  index in session.sides
  [[nodiscard]] const viewer::TelemetryMirror& mirror(std::size_t side = 0) const {
    return mirrors_[side];
  }
  /// For SceneState, which needs a subscription.
  [[nodiscard]] TelemetrySubscriber& subscriber() { return feed_.subscriber(); }
  /// Rows of all device ticks so far, in order.
  [[nodiscard]] const std::vector<TickRow>& rows(std::size_t side = 0) const { return rows_[side]; }

 private:
  SteadyClock clock_;
  viewer::TelemetryFeed feed_;
  std::vector<viewer::TelemetryMirror> mirrors_;
  std::vector<std::vector<TickRow>> rows_;
};

}  // namespace palpate::test
