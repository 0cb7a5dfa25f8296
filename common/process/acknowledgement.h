// SPDX-License-Identifier: Apache-2.0
// acknowledgement.h — a person at a terminal acknowledges a prompt: by Enter, or by SIGUSR2 from
// elsewhere.
#pragma once

#include <poll.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstddef>
#include <cstring>

namespace palpate {

/// At most one at a time. While it exists, SIGUSR2 acknowledges. Standard input at its end
/// acknowledges nothing.
class TerminalAcknowledgement {
 public:
  TerminalAcknowledgement() {
    signals_ = 0;
    struct sigaction action {};
    action.sa_handler = [](int) { signals_ = signals_ + 1; };
    action.sa_flags = SA_RESTART;
    sigaction(SIGUSR2, &action, &before_);
  }
  ~TerminalAcknowledgement() { sigaction(SIGUSR2, &before_, nullptr); }
  TerminalAcknowledgement(const TerminalAcknowledgement&) = delete;
  TerminalAcknowledgement& operator=(const TerminalAcknowledgement&) = delete;

  /// Whether the person has acknowledged since the last call.
  [[nodiscard]] bool take() {
    bool is_there = signals_ != 0;
    signals_ = 0;
    pollfd input{.fd = STDIN_FILENO, .events = POLLIN, .revents = 0};
    // all that was typed, and no more than that of an input without end
    for (int reads = 0; reads < kMostReads && !is_at_end_ && ::poll(&input, 1, 0) > 0; ++reads) {
      std::array<char, 1024> letters{};
      const ssize_t count = ::read(STDIN_FILENO, letters.data(), letters.size());
      if (count <= 0) {
        is_at_end_ = true;
      } else if (std::memchr(letters.data(), '\n', static_cast<std::size_t>(count)) != nullptr) {
        is_there = true;
      }
    }
    return is_there;
  }

 private:
  static constexpr int kMostReads = 64;
  static inline volatile std::sig_atomic_t signals_ = 0;
  struct sigaction before_ {};
  bool is_at_end_ = false;
};

}  // namespace palpate
