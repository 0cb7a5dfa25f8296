// SPDX-License-Identifier: Apache-2.0
// lock_watch.h — how long a thread waits for mutexes. Link palpate::lock_watch: it replaces
// pthread_mutex_lock of the whole executable, which is also that of the shared libraries it is
// linked with, libzmq among them. Locks inside glibc, as of its malloc, are not seen.
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate::test {

/// Of one thread so far.
struct LockUse {
  std::uint64_t locks = 0;  ///< calls of pthread_mutex_lock
  std::uint64_t waits = 0;  ///< of these, that found the mutex taken
};
[[nodiscard]] LockUse locks_of_this_thread() noexcept;

/// The longest of this thread's waits since the last call.
[[nodiscard]] Duration take_longest_wait() noexcept;

}  // namespace palpate::test
