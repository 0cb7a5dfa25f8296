// elastic_rows.h — a row of elastic_bench, the beams it measures, and clocks.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <vector>

#include "tests/bench/elastic/recorded_peers.h"

namespace palpate::bench {

inline double seconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}
inline double cpu_s() { return seconds(CLOCK_THREAD_CPUTIME_ID); }
inline double wall_s() { return seconds(CLOCK_MONOTONIC); }

struct Samples {
  std::vector<double> values;
  double at(double quantile) {
    std::sort(values.begin(), values.end());
    return values[static_cast<std::size_t>(quantile * static_cast<double>(values.size() - 1))];
  }
};

struct Row {
  PeerRow figures;
  double cpu_median_us = NAN;
  double cpu_p99_us = NAN;
  double megabytes = NAN;
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
