// SPDX-License-Identifier: Apache-2.0
// elastic_rows.h — a row of elastic_bench, the beams it measures, clocks and memory.
#pragma once

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "tests/bench/elastic/recorded_peers.h"

namespace palpate::bench {

inline double seconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}
inline double cpu_s() { return seconds(CLOCK_THREAD_CPUTIME_ID); }
inline double process_cpu_s() { return seconds(CLOCK_PROCESS_CPUTIME_ID); }  ///< all threads
inline double wall_s() { return seconds(CLOCK_MONOTONIC); }

struct Samples {
  std::vector<double> values;
  double at(double quantile) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(quantile * static_cast<double>(values.size() - 1))];
  }
};

/// The most memory that was in use since construction, beyond what was in use then.
class PeakMemory {
 public:
  PeakMemory() {
    malloc_trim(0);
    std::ofstream reset("/proc/self/clear_refs");
    reset << 5 << std::flush;  // the peak is what is in use now
    is_known_ = reset.good();
    start_kib_ = kib("VmRSS:");
  }
  /// NaN where the kernel does not tell it.
  [[nodiscard]] double megabytes() const {
    return is_known_ ? 1.024e-3 * (kib("VmHWM:") - start_kib_) : NAN;
  }

 private:
  static double kib(std::string_view name) {
    std::ifstream status("/proc/self/status");
    std::string word;
    double value = NAN;
    while (status >> word && word != name) {
      status.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
    }
    status >> value;
    return value;
  }

  bool is_known_ = false;
  double start_kib_ = 0.0;
};

struct Row {
  PeerRow figures;
  double cpu_median_us = NAN;
  double cpu_p99_us = NAN;
  double peak_mb = NAN;  ///< memory
  bool is_recorded = false;
};

struct BeamSize {
  const char* name;
  int along;
  int across;
};
inline constexpr BeamSize kBeams[] = {
    {"1,280 tets", 16, 4}, {"10,240 tets", 32, 8}, {"54,880 tets", 56, 14}};

}  // namespace palpate::bench
