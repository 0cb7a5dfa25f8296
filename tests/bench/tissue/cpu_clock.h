// SPDX-License-Identifier: Apache-2.0
// cpu_clock.h — the CPU time of this program, of all its threads.
#pragma once

#include <ctime>

namespace palpate::bench {

inline double process_cpu_s() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace palpate::bench
