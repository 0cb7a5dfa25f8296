// SPDX-License-Identifier: Apache-2.0
// rejections.h — counters of the frames that one end of a link refused.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "common/link/codec/codec.h"

namespace palpate {

/// Refused frames by reason. Written by the thread of the link, read by any thread.
class Rejections {
 public:
  [[nodiscard]] std::uint64_t total() const noexcept;
  [[nodiscard]] std::uint64_t of(DecodeError error) const noexcept;
  /// Valid frames of a second sender while the first one is served.
  [[nodiscard]] std::uint64_t second_writer() const noexcept;
  /// Reason of the latest rejection; kNone if there was none or it was a second writer.
  [[nodiscard]] DecodeError latest() const noexcept;
  /// protocol_major of the latest frame of another version, for explain(); 0 if there was none.
  [[nodiscard]] std::uint32_t peer_major() const noexcept;

  void count(DecodeError error, std::uint32_t peer_major = 0) noexcept;
  void count_second_writer() noexcept;

 private:
  std::array<std::atomic<std::uint64_t>, kDecodeErrors> by_reason_{};
  std::atomic<std::uint64_t> second_writer_{0};
  std::atomic<DecodeError> latest_{DecodeError::kNone};
  std::atomic<std::uint32_t> peer_major_{0};
};

}  // namespace palpate
