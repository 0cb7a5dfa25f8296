// SPDX-License-Identifier: Apache-2.0
// run_figures.h — the figures of a run as a viewer sees it: of `palpate launch` while it runs, and
// of its recording afterwards. Both come from here, so they agree.
//
// Two populations: counters of the nodes, over all of their ticks while they were observed; and the
// ticks whose telemetry was received, which are fewer if telemetry was lost.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/telemetry/metrics.h"
#include "common/telemetry/summary.h"
#include "common/telemetry/telemetry.h"
#include "common/telemetry/verdict/verdict.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// Figures of one device over the whole run: unlike the counters of a node, they do not start again
/// at 0 when the node is restarted.
struct RunFigures {
  /// Of a part of a run: what the nodes counted before its first batch is left out. Of the first
  /// batch of all this is so whenever a node has run for a while.
  bool is_part = false;
  DurationHistogram reply_time;
  DurationHistogram lateness;
  RunStatistics statistics;                 ///< of the ticks received
  double minimum_true_energy_joule = kNaN;  ///< NaN: not reported, as with real hardware
  double max_force_newton = 0.0;
  double largest_jump_newton = 0.0;
  /// The newest counters, with sums over all sessions in place of what counts since the last start.
  DeviceCounters device;
  MofcCounters mofc;
  // of the physics, over all its sessions, without the time between them
  std::uint64_t physics_steps = 0;
  Duration physics_time{};
  Duration physics_gap{};  ///< longest time between two steps of one session
  std::uint64_t clutched_ticks = 0;

  /// Call it for every row. @param ideal  the ideal run, where it is known
  void add(const TickRow& row, const IdealState& ideal = {});
  /// Call it for every batch.
  void add(const DeviceBatch& batch);
  void add(const MofcBatch& batch);
  void add(const PhysicsBatch& batch);

  /// Steps per second while it ran; NaN: unknown.
  [[nodiscard]] double physics_hz() const;
  /// Share of that time in which it computed, by the steps received; NaN: unknown.
  [[nodiscard]] double physics_busy_ratio() const;

 private:
  /// What is known of the session that a node is in.
  template <class Counters>
  struct Observed {
    std::uint64_t id = 0;
    std::uint64_t batch = 0;  // newest
    Counters newest;
  };
  Observed<DeviceCounters> device_session_;
  Observed<MofcCounters> mofc_session_;
  std::uint64_t physics_session_ = 0;
  std::uint64_t physics_sequence_ = 0;  // newest step
  TimePoint physics_stepped_at_{};
  std::uint64_t physics_received_ = 0;  // steps
  Duration physics_compute_{};          // of these
};

/// What is judged of an observed run. @param about  what is known of the session
[[nodiscard]] RunFacts facts_of(RunFacts about, const viewer::TelemetryMirror& mirror,
                                const RunFigures& figures);
/// Where another run began all nodes are other ones, and none was restarted.
/// @param others  runs that followed the first, in a recording or a replay
void leave_out_runs(RunFacts& facts, std::uint64_t others);
/// Controller of one side of a recording: "left: mofc guard, right: none" names those of all.
[[nodiscard]] std::string controller_of(const RecordingFile& recording, const std::string& side);

/// Keys: docs/glossary.md. @param controller  as controller_text() gives it
[[nodiscard]] nlohmann::ordered_json figures_json(const std::string& controller,
                                                  const viewer::TelemetryMirror& mirror,
                                                  const RunFigures& figures);
/// The same for people: label and value.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> figure_lines(
    const std::string& controller, const viewer::TelemetryMirror& mirror,
    const RunFigures& figures);

/// One device of a recording.
struct RecordedRun {
  viewer::TelemetryMirror mirror;
  RunFigures figures;
};
/// The same of a recording that read_run() has read; with less, if its session cannot be read here.
[[nodiscard]] RunFacts facts_of(const RecordingFile& recording, const RecordedRun& run);
/// Reads the chosen side of the recording into `run`.
/// @param on_row   called for every device tick, in order; may be empty
/// @param on_item  called for every message; may be empty
void read_run(RecordingFile& recording, RecordedRun& run,
              const std::function<void(const TickRow&)>& on_row = {},
              const std::function<void(const RecordingFile::Item&)>& on_item = {});

}  // namespace palpate
