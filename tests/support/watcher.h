// watcher.h — a viewer that waits for what a test expects to see.
#pragma once

#include <chrono>
#include <functional>
#include <vector>

#include "common/core/clock.h"
#include "common/core/session.h"
#include "common/runtime/process_links.h"
#include "viewer_node/process.h"
#include "viewer_node/telemetry_mirror.h"

namespace palpate::test {

class Watcher {
 public:
  static constexpr auto kDeadline = std::chrono::seconds(30);

  Watcher(const Session& session, ProcessLinks& links) : feed_(session.links, clock_, links) {
    mirror_.on_row = [this](const viewer::TickRow& row) { rows_.push_back(row); };
  }

  /// Looks on until `is_seen()` or the deadline; whether it was seen.
  bool until(const std::function<bool()>& is_seen, Duration deadline = kDeadline) {
    const TimePoint end = clock_.now() + deadline;
    while (!is_seen()) {
      const TimePoint now = clock_.now();
      if (now >= end) return false;
      feed_.pump(mirror_, std::min(now + std::chrono::milliseconds(20), end));
    }
    return true;
  }
  /// Looks on until `count` more rows are there.
  bool until_rows(std::size_t count) {
    const std::size_t wanted = rows_.size() + count;
    return until([&] { return rows_.size() >= wanted; });
  }

  [[nodiscard]] bool sees_all_nodes() const {
    const TimePoint now = clock_.now();
    return mirror_.device_link().is_alive(now) && mirror_.mofc_link().is_alive(now) &&
           mirror_.physics_link().is_alive(now);
  }
  /// SceneState comes on request only.
  [[nodiscard]] TelemetrySubscriber& subscriber() { return feed_.subscriber(); }
  [[nodiscard]] const viewer::TelemetryMirror& mirror() const { return mirror_; }
  /// Of every device tick seen, in order.
  [[nodiscard]] const std::vector<viewer::TickRow>& rows() const { return rows_; }

 private:
  SteadyClock clock_;
  viewer::TelemetryFeed feed_;
  viewer::TelemetryMirror mirror_;
  std::vector<viewer::TickRow> rows_;
};

}  // namespace palpate::test
