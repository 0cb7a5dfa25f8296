// SPDX-License-Identifier: Apache-2.0
// engine_process.h — a physics from elsewhere as a child process that a test starts and ends.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>

#include "deploy/launch/supervisor.h"

namespace palpate {

/// The kernel kills the program if this process dies; the destructor does if it still runs.
class EngineProcess {
 public:
  /// Throws SetupError if it cannot be started.
  explicit EngineProcess(const ChildSpec& program);
  ~EngineProcess();
  EngineProcess(const EngineProcess&) = delete;
  EngineProcess& operator=(const EngineProcess&) = delete;

  void send_signal(int signal) const;
  [[nodiscard]] bool is_running();
  /// Waits for its end.
  /// @return exit status, or 128 + the signal that ended it; none at the deadline
  [[nodiscard]] std::optional<int> wait(std::chrono::milliseconds deadline);
  /// How long the thread that waited longest for a processor has waited since it began; 0 where the
  /// kernel does not tell.
  [[nodiscard]] std::chrono::nanoseconds waited() const;

 private:
  pid_t pid_ = 0;
  std::optional<int> status_;
};

}  // namespace palpate
