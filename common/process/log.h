// log.h — the slow side's voice. Lines read `event=… key=value`; nothing on a tick thread logs:
// what happens there becomes counters, and event_log.h turns their changes into lines.
#pragma once

#include <spdlog/spdlog.h>

#include <memory>
#include <string>

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

}  // namespace palpate
