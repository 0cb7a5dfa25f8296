// SPDX-License-Identifier: Apache-2.0
// one_source.h — of a topic that anybody may write, one publisher counts, and its messages in
// order.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/time.h"

namespace palpate::ros {

/// A source that has sent nothing acceptable for so long may be replaced by another one.
inline constexpr Duration kSourceSilence = std::chrono::seconds(1);

class OneSource {
 public:
  [[nodiscard]] bool is(std::uint64_t source) const noexcept { return source == source_; }
  /// Another one is heard.
  [[nodiscard]] bool is_taken(std::uint64_t source, TimePoint now) const noexcept {
    return !is(source) && taken_at_ && now - *taken_at_ < kSourceSilence;
  }
  /// Not later than what was taken of it last: repeated or reordered.
  [[nodiscard]] bool is_repeated(std::uint64_t source, std::int64_t stamp_ns) const noexcept {
    return is(source) && stamp_ns <= last_stamp_ns_;
  }
  /// @param source  not 0
  void take(std::uint64_t source, std::int64_t stamp_ns, TimePoint now) noexcept {
    source_ = source;
    last_stamp_ns_ = stamp_ns;
    taken_at_ = now;
  }
  /// 0: none yet.
  [[nodiscard]] std::uint64_t source() const noexcept { return source_; }
  [[nodiscard]] std::int64_t last_stamp_ns() const noexcept { return last_stamp_ns_; }
  [[nodiscard]] std::optional<TimePoint> taken_at() const noexcept { return taken_at_; }

 private:
  std::uint64_t source_ = 0;
  std::int64_t last_stamp_ns_ = 0;
  std::optional<TimePoint> taken_at_;
};

}  // namespace palpate::ros
