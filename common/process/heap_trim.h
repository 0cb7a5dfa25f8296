// heap_trim.h — keeps a process that serves bursts as small as it was before them.
#pragma once

#include <malloc.h>

#include <chrono>

#include "common/core/time.h"

namespace palpate {

/// A stopped viewer's backlog, a scene that comes again with every restart: glibc keeps what such
/// a burst took, in pieces. This one gives it back. Not in a process with a tick, which would wait
/// for the allocator's lock.
class HeapTrim {
 public:
  static constexpr Duration kInterval = std::chrono::seconds(5);

  HeapTrim() noexcept {
    // large buffers go back as soon as they are free, whatever the allocator has seen before
    constexpr int kLargeBytes = 128 << 10;
    mallopt(M_MMAP_THRESHOLD, kLargeBytes);
  }

  /// Call it often; it does something every kInterval, for some 0.1 ms.
  void note(TimePoint now) noexcept {
    if (now < next_at_) return;
    next_at_ = now + kInterval;
    malloc_trim(0);
  }

 private:
  TimePoint next_at_{};
};

}  // namespace palpate
