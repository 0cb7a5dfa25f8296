// SPDX-License-Identifier: Apache-2.0
// web_health.h — /health, /metrics and /verdict: the state of the nodes and of this viewer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/link/codec/viewer_codec.h"
#include "common/link/telemetry_subscriber.h"
#include "common/session/session.h"
#include "common/telemetry/verdict/verdict.h"
#include "viewer_node/feed/metrics_text.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/live/log.h"
#include "viewer_node/recording/run_figures.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

class WebHealth {
 public:
  /// References must outlive it. @param mirrors  of each of session.sides
  WebHealth(const Session& session, std::span<const TelemetryMirror> mirrors,
            const TelemetrySubscriber& subscriber, WebServer& server, WebLog& log);

  /// Counts a batch for /metrics and /verdict. @param side  index in session.sides
  template <class Batch>
  void note(std::size_t side, const Batch& batch) {
    metrics_.note(side, batch);
    figures_[side].add(batch);
  }
  /// Five times a second: publishes /health, updates /metrics, and logs nodes that start or stop
  /// sending. @param own  what this viewer knows (hand_holder, recorder, run, task; with several
  ///     sides, one of `sides` for each), asked when it is due
  void pump(TimePoint now, const std::function<ViewerHealth()>& own);
  /// Logs the verdict on each side: the last word of this viewer.
  void tell_verdicts();

 private:
  /// What a page shows of a side that is not on display.
  static void add_state(ViewerHealth::Side& state, const Side& side, const TelemetryMirror& mirror);
  void add_node(ViewerHealth& health, const std::string& name, const NodeLink& link, TimePoint now);
  /// {"session", "sides": {NAME: verdict}}; one device has the name "".
  [[nodiscard]] std::string verdicts() const;
  [[nodiscard]] std::vector<RunFinding> verdict_of(std::size_t side) const;
  void note_node(const std::string& name, bool is_heard, std::uint64_t sessions);

  const Session& session_;
  std::span<const TelemetryMirror> mirrors_;
  const TelemetrySubscriber& subscriber_;
  WebServer& server_;
  WebLog& log_;
  MetricsText metrics_;
  std::vector<RunFigures> figures_;         // by side
  std::optional<std::uint64_t> first_run_;  // of a replay, that this viewer has heard of
  std::uint64_t other_runs_ = 0;            // of a replay, since then
  struct Seen {
    bool is_heard = false;
    std::uint64_t sessions = 0;
  };
  std::map<std::string, Seen> seen_;  // by node
  TimePoint next_{};
};

}  // namespace palpate::viewer
