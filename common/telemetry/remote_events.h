// SPDX-License-Identifier: Apache-2.0
// remote_events.h — the events of another node: the log lines that event_log.h writes there,
// derived here from the counters in its telemetry.
#pragma once

#include <spdlog/details/null_mutex.h>
#include <spdlog/sinks/base_sink.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "common/telemetry/event_log.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

using OnEventLine = std::function<void(spdlog::level::level_enum level, const std::string& text)>;

template <class Record, class Counters>
class RemoteEvents {
 public:
  explicit RemoteEvents(OnEventLine on_line)
      : log_("remote", std::make_shared<LineSink>(std::move(on_line))) {}
  RemoteEvents(const RemoteEvents&) = delete;
  RemoteEvents& operator=(const RemoteEvents&) = delete;

  /// Ignores batches that are not newer. Events before the first batch are not reported, unless
  /// that batch is the first of its session.
  void note(const TelemetryBatch<Record, Counters>& batch, TimePoint now) {
    if (!events_ || batch.header.session_id != session_id_) {
      session_id_ = batch.header.session_id;
      events_.emplace(log_);
      if (batch.header.sequence > 0) take_as_history(batch.counters, now);
    } else if (batch.header.sequence <= sequence_) {
      return;
    }
    sequence_ = batch.header.sequence;
    events_->note(batch.counters, now);
  }

 private:
  class LineSink final : public spdlog::sinks::base_sink<spdlog::details::null_mutex> {
   public:
    explicit LineSink(OnEventLine on_line) : on_line_(std::move(on_line)) {}

   private:
    void sink_it_(const spdlog::details::log_msg& line) override {
      on_line_(line.level, std::string(line.payload.data(), line.payload.size()));
    }
    void flush_() override {}
    OnEventLine on_line_;
  };

  /// Starts and ends every earlier episode without a line.
  void take_as_history(const Counters& counters, TimePoint now) {
    log_.set_level(spdlog::level::off);
    events_->note(counters, now - std::chrono::seconds(10));
    events_->note(counters, now);
    log_.set_level(spdlog::level::info);
  }

  spdlog::logger log_;
  std::optional<EventLog<Counters>> events_;
  std::uint64_t session_id_ = 0;
  std::uint64_t sequence_ = 0;
};

}  // namespace palpate
