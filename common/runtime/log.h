// log.h — the slow side's voice. Lines read `event=… key=value`; nothing on a tick thread logs:
// what happens there becomes counters, and event_log.h turns their changes into lines.
#pragma once

#include <spdlog/spdlog.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "common/core/time.h"

namespace spdlog::details {
class thread_pool;
}

namespace palpate {

/// Lines to stderr (or `sink`), written by a thread of its own. A full queue loses its oldest
/// lines, so whoever logs is never stalled. The destructor writes what is queued.
class Log {
 public:
  explicit Log(const std::string& name, spdlog::sink_ptr sink = nullptr);
  ~Log();
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;

  [[nodiscard]] spdlog::logger& logger() const { return *logger_; }

 private:
  std::shared_ptr<spdlog::details::thread_pool> writer_;
  std::shared_ptr<spdlog::logger> logger_;
};

/// Lets a line out at once when something happens for the first time, then at most one per interval
/// with the number of occurrences since the last line.
class EventThrottle {
 public:
  explicit EventThrottle(Duration interval = std::chrono::seconds(1)) : interval_(interval) {}

  /// Notes `occurrences` more, possibly 0. Returns the number to report now; 0: no line is due.
  [[nodiscard]] std::uint64_t note(TimePoint now, std::uint64_t occurrences) noexcept {
    pending_ += occurrences;
    if (pending_ == 0 || (has_reported_ && now < reported_at_ + interval_)) return 0;
    has_reported_ = true;
    reported_at_ = now;
    return std::exchange(pending_, 0);
  }

 private:
  Duration interval_;
  bool has_reported_ = false;
  TimePoint reported_at_{};
  std::uint64_t pending_ = 0;
};

}  // namespace palpate
