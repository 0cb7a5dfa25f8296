// SPDX-License-Identifier: Apache-2.0
// telemetry_publisher.h — hop 5, sending side: a thread of ordinary priority batches and publishes
// the records of the periodic thread and logs its events.
//
//   tick thread ──▶ RingSink (every tick) ─────┐
//   tick thread ──▶ Snapshot (counters) ───────┴──▶ TelemetryPublisher ──▶ Sender, log, recorder
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/core/snapshot.h"
#include "common/core/spsc_ring.h"
#include "common/core/version.h"
#include "common/telemetry/event_log.h"
#include "common/telemetry/flight_recorder.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

inline constexpr auto kPublishInterval = std::chrono::milliseconds(20);
/// A batch stays far below the link's largest frame; further records go into further batches.
inline constexpr std::size_t kMaxRecordsPerBatch = 256;
/// 4 s at 1 kHz: longer than any stall of the telemetry thread that is planned for.
inline constexpr std::size_t kTelemetryRingRecords = 4096;

/// Ring between the periodic thread and the publisher. keep() never blocks or allocates; when the
/// ring is full the record is lost and counted.
template <class Record>
class RingSink final : public TickSink<Record> {
 public:
  explicit RingSink(std::size_t capacity = kTelemetryRingRecords) : ring_(capacity) {}
  void keep(const Record& record) noexcept override { ring_.push(record); }

  bool take(Record& record) noexcept { return ring_.pop(record); }
  [[nodiscard]] std::uint64_t lost() const noexcept { return ring_.lost(); }

 private:
  SpscRing<Record> ring_;
};

/// Publishes the records and counters of one node every kPublishInterval, also without records:
/// silence means that the node is gone. After start() only the publisher's thread uses the
/// sender. Start it before enter_realtime(), so that its thread does not run on the tick's
/// processor.
template <class Record, class Counters>
class TelemetryPublisher {
 public:
  using Batch = TelemetryBatch<Record, Counters>;

  /// @param side  of the session, see Session::side
  TelemetryPublisher(std::uint64_t session_id, const Clock& clock, RingSink<Record>& ticks,
                     const Snapshot<Counters>& counters, Sender<Batch>& out, spdlog::logger& log,
                     const std::string& side = {})
      : clock_(clock), ticks_(ticks), counters_(counters), out_(out), events_(log) {
    batch_.header.session_id = session_id;
    batch_.node_version = version();
    batch_.side = side;
    batch_.records.reserve(kMaxRecordsPerBatch);
  }

  /// Passes the records to this recorder too, which must outlive the publisher: the destructor
  /// sends a last batch. Before start().
  void record_to(FlightRecorder<Record>& recorder) { recorder_ = &recorder; }

  /// Called after every publication, on its thread; set it before start(). Optional.
  std::function<void(TimePoint now)> on_pump;

  /// Adds counts of the publisher's thread to those of the tick thread; set it before
  /// start(). Optional.
  std::function<void(Counters& counters)> add_counts;

  /// Connections refused so far for lack of the right keys; set it before start(). Optional.
  std::function<std::uint64_t()> peers_refused;

  /// Starts to publish; the destructor ends with one last batch.
  void start() {
    thread_ = std::jthread([this](const std::stop_token& stop) {
      std::unique_lock lock(mutex_);
      while (!stop.stop_requested()) {
        pump();
        stopped_.wait_for(lock, stop, kPublishInterval, [] { return false; });
      }
      pump();
    });
  }

  /// Ends the thread after one last batch.
  void stop() { thread_ = {}; }

  /// The newest published record; none before the first. Call only in `on_pump`.
  [[nodiscard]] const std::optional<Record>& newest() const { return newest_; }

  /// One publication. Do not call while the thread runs.
  void pump() {
    Counters counters = counters_.load();
    if (add_counts) add_counts(counters);
    do {
      batch_.records.clear();
      Record record;
      while (batch_.records.size() < kMaxRecordsPerBatch && ticks_.take(record)) {
        batch_.records.push_back(record);
        if (recorder_ != nullptr) recorder_->keep(record);
      }
      if (!batch_.records.empty()) newest_ = batch_.records.back();
      batch_.counters = counters;
      batch_.records_lost = ticks_.lost();
      if (peers_refused) batch_.peers_refused = peers_refused();
      batch_.header.sampled_at = clock_.now();
      out_.send(batch_);
      ++batch_.header.sequence;
    } while (batch_.records.size() == kMaxRecordsPerBatch);
    events_.note(counters, batch_.header.sampled_at);
    if (on_pump) on_pump(batch_.header.sampled_at);
    if (recorder_ != nullptr) recorder_->write_if_due(counters);
  }

 private:
  const Clock& clock_;
  RingSink<Record>& ticks_;
  const Snapshot<Counters>& counters_;
  Sender<Batch>& out_;
  EventLog<Counters> events_;
  Batch batch_;
  std::optional<Record> newest_;
  FlightRecorder<Record>* recorder_ = nullptr;

  std::mutex mutex_;
  std::condition_variable_any stopped_;
  std::jthread thread_;  // last: ends before the members it uses
};

}  // namespace palpate
