// SPDX-License-Identifier: Apache-2.0
// log.h — the log of a process, for its slow threads. Lines have the form `event=… key=value`. A
// tick thread does not log: it increments counters, and event_log.h turns their changes into lines.
#pragma once

#include <spdlog/spdlog.h>

#include <memory>
#include <string>

namespace spdlog::details {
class thread_pool;
}

namespace palpate {

/// Writes lines to stderr (or `sink`) on a thread of its own. A full queue drops its oldest lines,
/// so logging never blocks. The destructor writes the queued lines.
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

}  // namespace palpate
