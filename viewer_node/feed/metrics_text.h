// SPDX-License-Identifier: Apache-2.0
// metrics_text.h — the counters and times of all nodes in Prometheus' text format 0.0.4. Thread:
// the viewer's.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "common/telemetry/telemetry.h"
#include "viewer_node/feed/telemetry_mirror.h"

namespace palpate::viewer {

/// Classic histogram: 10 µs … 1 s in steps of 1, 2, 5, and longer.
struct TimeHistogram {
  static constexpr std::array<double, 16> kBounds_s{1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3,
                                                    5e-3, 1e-2, 2e-2, 5e-2, 0.1,  0.2,  0.5,  1.0};
  void add(Duration time) noexcept;

  std::array<std::uint64_t, kBounds_s.size() + 1> counts{};
  double sum_s = 0.0;
};

/// Counts of the viewer itself.
struct ViewerCounts {
  std::uint32_t clients = 0;
  std::uint64_t messages_dropped = 0;
  std::uint64_t messages_thinned = 0;  ///< of an audience
  std::uint64_t requests_refused = 0;
  std::uint64_t frames_rejected = 0;
};

/// Counters are those of the nodes since their start; histograms cover the received ticks.
/// With several devices each line of a node carries its side: `{side="left",…}`.
class MetricsText {
 public:
  explicit MetricsText(const Session& session);

  /// @param side  index in session.sides
  void note(std::size_t side, const DeviceBatch& batch) noexcept;
  void note(std::size_t side, const MofcBatch& batch) noexcept;
  void note(std::size_t side, const PhysicsBatch& batch) noexcept;

  /// The text. Counters of nodes that were never heard are omitted.
  /// @param mirrors  of each side
  [[nodiscard]] std::string text(std::span<const TelemetryMirror> mirrors,
                                 const ViewerCounts& viewer, TimePoint now) const;

 private:
  struct Times {
    TimeHistogram reply_time;
    TimeHistogram lateness;
    TimeHistogram force_age;
    TimeHistogram compute_time;
  };
  std::vector<std::string> sides_;  // their names
  std::vector<Times> times_;        // of each
};

}  // namespace palpate::viewer
