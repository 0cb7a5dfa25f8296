// SPDX-License-Identifier: Apache-2.0
#include "tests/support/machine/lock_watch.h"

#include <dlfcn.h>
#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <utility>

namespace {

thread_local palpate::test::LockUse use;
thread_local palpate::Duration longest{};

}  // namespace

namespace palpate::test {

LockUse locks_of_this_thread() noexcept { return use; }
Duration take_longest_wait() noexcept { return std::exchange(longest, Duration::zero()); }

}  // namespace palpate::test

// The sanitizers replace it themselves.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
namespace {

using Lock = int (*)(pthread_mutex_t*);
Lock next_lock() noexcept {
  static const auto next = reinterpret_cast<Lock>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
  return next;
}

}  // namespace

extern "C" int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  ++use.locks;
  if (const int taken = pthread_mutex_trylock(mutex); taken != EBUSY) return taken;
  ++use.waits;
  const auto began_at = std::chrono::steady_clock::now();
  const int result = next_lock()(mutex);
  longest = std::max<palpate::Duration>(longest, std::chrono::steady_clock::now() - began_at);
  return result;
}
#endif
