// SPDX-License-Identifier: Apache-2.0
// blocked_signals.h — keeps signals from threads that are not to handle them.
#pragma once

#include <csignal>
#include <initializer_list>

namespace palpate {

/// Blocks signals, in the thread that constructs it and in those that this one starts from then on,
/// until it is destroyed. Otherwise the kernel hands a signal of the process to its main thread
/// first, however long that thread has to wait for a processor.
class BlockedSignals {
 public:
  BlockedSignals(std::initializer_list<int> signals) {
    sigemptyset(&signals_);
    for (const int signal : signals) sigaddset(&signals_, signal);
    pthread_sigmask(SIG_BLOCK, &signals_, &before_);
  }
  ~BlockedSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  BlockedSignals(const BlockedSignals&) = delete;
  BlockedSignals& operator=(const BlockedSignals&) = delete;

  /// Lets the calling thread have them, and those that it starts from then on.
  void take() const { pthread_sigmask(SIG_UNBLOCK, &signals_, nullptr); }
  [[nodiscard]] const sigset_t& set() const { return signals_; }

 private:
  sigset_t signals_{};
  sigset_t before_{};
};

}  // namespace palpate
