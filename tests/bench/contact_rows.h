// SPDX-License-Identifier: Apache-2.0
// contact_rows.h — the table of contact_bench: timing of single calls, and rows.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

#include "common/core/vector.h"
#include "common/telemetry/quantile.h"
#include "tests/bench/bench_output.h"

namespace palpate::bench {

using BenchClock = std::chrono::steady_clock;

inline double seconds_since(BenchClock::time_point start) {
  return std::chrono::duration<double>(BenchClock::now() - start).count();
}

struct Times {
  double median_us = kNaN;
  double p99_us = kNaN;
};

/// Times of single calls work(i).
template <class Work>
Times time_each(std::size_t calls, const Work& work) {
  std::vector<double> seconds(calls);
  for (std::size_t i = 0; i < calls; ++i) {
    const BenchClock::time_point start = BenchClock::now();
    work(i);
    seconds[i] = seconds_since(start);
  }
  return {1e6 * quantile(seconds, 0.5), 1e6 * quantile(seconds, 0.99)};
}

/// Results are written here, so that the compiler does not remove their computation.
inline volatile double sink = 0.0;

inline Table make_table() {
  return Table({{"group", "group", ""},
                {"case", "case", ""},
                {"method", "method", ""},
                {"points", "points", "{:.0f}"},
                {"spacing_m", "spacing m", "{:.2e}"},
                {"noise_m", "noise m", "{:.1e}"},
                {"force_error_rms_percent", "force rms %", "{:.3f}"},
                {"force_error_max_percent", "max %", "{:.2f}"},
                {"normal_error_rms_deg", "normal °", "{:.3f}"},
                {"curvature_error_rms_ratio", "curv.", "{:.3f}"},
                {"median_us", "median µs", "{:.2f}"},
                {"p99_us", "p99 µs", "{:.2f}"},
                {"build_s", "build s", "{:.3f}"},
                {"bytes_per_point", "B/point", "{:.1f}"},
                {"wrong_neighbors", "wrong", "{:.0f}"}});
}

/// A row of the table; NaN is printed as empty.
struct Row {
  std::string group;
  std::string name;
  std::string method;
  double points = kNaN;
  double spacing_m = kNaN;
  double noise_m = kNaN;
  double force_rms_percent = kNaN;
  double force_max_percent = kNaN;
  double normal_rms_deg = kNaN;
  double curvature_rms_ratio = kNaN;
  Times times{};
  double build_s = kNaN;
  double bytes_per_point = kNaN;
  double wrong_neighbors = kNaN;

  void add_to(Table& table) const {
    table.add({group, name, method, points, spacing_m, noise_m, force_rms_percent,
               force_max_percent, normal_rms_deg, curvature_rms_ratio, times.median_us,
               times.p99_us, build_s, bytes_per_point, wrong_neighbors});
  }
};

/// Whole steps of a scene: idle and sleeping tissue, the proxy, the shaft, viewers.
void measure_steps(const BenchOptions& options, Table& table);

}  // namespace palpate::bench
