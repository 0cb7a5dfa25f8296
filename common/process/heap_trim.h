// SPDX-License-Identifier: Apache-2.0
// heap_trim.h — returns unused heap to the system after bursts of memory use.
#pragma once

#include <malloc.h>

#include <chrono>

#include "common/core/time.h"

namespace palpate {

/// glibc keeps the memory of a burst, such as the backlog of a stopped viewer or a scene that is
/// sent again after a restart, as fragments. HeapTrim returns it. Not for a process with a tick:
/// the tick would wait for the allocator's lock.
class HeapTrim {
 public:
  static constexpr Duration kInterval = std::chrono::seconds(5);

  HeapTrim() noexcept {
    // a fixed threshold: glibc would raise it, and large buffers would no longer be returned
    constexpr int kLargeBytes = 128 << 10;
    mallopt(M_MMAP_THRESHOLD, kLargeBytes);
  }

  /// Call it often; it trims every kInterval, which takes about 0.1 ms.
  void note(TimePoint now) noexcept {
    if (now < next_at_) return;
    next_at_ = now + kInterval;
    malloc_trim(0);
  }

 private:
  TimePoint next_at_{};
};

}  // namespace palpate
