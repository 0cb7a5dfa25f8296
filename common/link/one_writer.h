// SPDX-License-Identifier: Apache-2.0
// one_writer.h — limits a link with several possible senders to one at a time.
#pragma once

#include <chrono>
#include <cstdint>

#include "common/core/time.h"

namespace palpate {

/// Admits one sender at a time to a link to which several may connect: messages of another session
/// are refused until the admitted one has been silent for kSilence.
class OneWriter {
 public:
  /// Shorter than the restart of a process.
  static constexpr Duration kSilence = std::chrono::milliseconds(100);

  [[nodiscard]] bool admit(std::uint64_t session_id, TimePoint now) noexcept {
    if (session_id != session_id_ && is_held_ && now - heard_at_ < kSilence) return false;
    is_held_ = true;
    session_id_ = session_id;
    heard_at_ = now;
    return true;
  }

 private:
  bool is_held_ = false;
  std::uint64_t session_id_ = 0;
  TimePoint heard_at_{};
};

}  // namespace palpate
