// SPDX-License-Identifier: Apache-2.0
#include "common/core/clock.h"

#include <sched.h>

#include <cerrno>
#include <chrono>
#include <ctime>

namespace palpate {

TimePoint SteadyClock::now() const noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return TimePoint(std::chrono::seconds(t.tv_sec) + Duration(t.tv_nsec));
}

void SteadyClock::sleep_until(TimePoint deadline) {
  if (wait_ == WaitStrategy::kSpin) {
    while (now() < deadline) sched_yield();
    return;
  }
  const Duration ahead = wait_ == WaitStrategy::kHybrid ? kSpinAhead : Duration::zero();
  const std::int64_t ns = (deadline - ahead).time_since_epoch().count();
  const timespec t{.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
  }
  while (now() < deadline) {
  }
}

std::uint64_t wall_clock_ns() noexcept {
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                        std::chrono::system_clock::now().time_since_epoch())
                                        .count());
}

}  // namespace palpate
