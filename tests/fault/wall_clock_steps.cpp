// SPDX-License-Identifier: Apache-2.0
// wall_clock_steps — a library to preload: the wall clock of the process jumps forth and back by an
// hour every 200 ms, so that waiting for a time of the wall clock takes an hour or no time.
#include <sys/syscall.h>
#include <sys/time.h>
#include <unistd.h>

#include <ctime>

namespace {

/// Current offset of the wall clock in s.
std::time_t step_s() {
  timespec now{};
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
  constexpr long kStepNanoseconds = 200'000'000;
  return now.tv_nsec / kStepNanoseconds % 2 == 1 ? 3600 : 0;
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec* now) noexcept {
  const long status = syscall(SYS_clock_gettime, clock, now);
  if (status == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
    now->tv_sec += step_s();
  }
  return static_cast<int>(status);
}

int gettimeofday(timeval* now, void* zone) noexcept {
  const long status = syscall(SYS_gettimeofday, now, zone);
  if (status == 0) now->tv_sec += step_s();
  return static_cast<int>(status);
}

std::time_t time(std::time_t* now) noexcept {
  timespec wall{};
  clock_gettime(CLOCK_REALTIME, &wall);
  if (now != nullptr) *now = wall.tv_sec;
  return wall.tv_sec;
}

}  // extern "C"
