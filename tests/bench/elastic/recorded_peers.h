// SPDX-License-Identifier: Apache-2.0
// recorded_peers.h — what other programs reached on the same problems: measured earlier on a 2-core
// AMD EPYC (Zen 5), one thread, and recorded here; elastic_bench does not run them.
#pragma once

#include <array>
#include <cmath>

namespace palpate::bench {

struct PeerRow {
  const char* problem;
  const char* mesh;
  const char* solver;
  double median_us = NAN;  ///< of a step
  double p99_us = NAN;
  double total_s = NAN;      ///< to the answer
  double error_ratio = NAN;  ///< of the answer
  double kept_ratio = NAN;   ///< amplitude after one period
};

inline constexpr auto kPeers = std::to_array<PeerRow>({
    {"step 1 ms", "1,280 tets", "XPBD float", 881, 921},
    {"step 1 ms", "1,280 tets", "SOFA Fast corot + LDL", 1456, 1532},
    {"step 1 ms", "1,280 tets", "Vega corot + PCG", 1627, 3103},
    {"step 1 ms", "1,280 tets", "Bullet linear", 1969, 2097},
    {"step 1 ms", "10,240 tets", "XPBD float", 7169, 7643},
    {"step 1 ms", "10,240 tets", "Vega corot + PCG", 21716, 34199},
    {"step 1 ms", "10,240 tets", "Bullet linear", 23113, 28493},
    {"step 1 ms", "10,240 tets", "SOFA async, 2 threads", 32673, 68378},
    {"step 1 ms", "54,880 tets", "XPBD float", 39300},
    {"step 1 ms", "54,880 tets", "Bullet linear", 191000},
    {"step 1 ms", "54,880 tets", "Vega corot + PCG", 227000},
    {"static", "1,280 tets", "SOFA Fast corot + LDL", 1600, 3500, 0.054, -0.146},
    {"static", "1,280 tets", "Bullet linear", 6500, 7600, 0.21, -0.16},
    {"static", "1,280 tets", "XPBD double, steps of 1 ms", 1020, 1140, 1.1, -0.15},
    {"static", "1,280 tets", "Vega NH + Cholesky", 4400, 6500, 0.11, -0.16},
    {"static", "10,240 tets", "Vega NH + Cholesky", 54000, 69000, 1.5, -0.055},
    {"static", "10,240 tets", "SOFA Fast corot + LDL", 61000, 72000, 2.4, -0.044},
    {"static", "10,240 tets", "Bullet linear", 77000, 97000, 3.0, -0.055},
    {"static", "10,240 tets", "XPBD double, steps of 1 ms", 8000, 8800, 9.1, -0.015},
    {"static", "54,880 tets", "Vega NH + Cholesky", 490000, NAN, 14.0, -0.023},
    {"static", "54,880 tets", "Vega corot + Cholesky", 440000, NAN, 18.0, -0.023},
    {"released 5 ms", "1,280 tets", "backward Euler (any peer)", NAN, NAN, NAN, NAN, 0.64},
    {"released 5 ms", "1,280 tets", "Vega Newmark", NAN, NAN, NAN, 0.013, 0.87},
    {"released 5 ms", "1,280 tets", "SOFA Newmark", NAN, NAN, NAN, 0.013, 1.03},
    {"press 1 mm", "12,800 tets", "Vega NH", 105000, NAN, NAN, 0.23},
    {"press 1 mm", "12,800 tets", "SOFA NH, 100 N/m", 195000, NAN, NAN, 0.15},
    {"press 1 mm", "12,800 tets", "XPBD StVK", 10100, NAN, NAN, 0.04},
    {"press 3 mm", "12,800 tets", "Vega NH", 105000, NAN, NAN, 0.19},
    {"press 3 mm", "12,800 tets", "SOFA NH, 100 N/m", 195000, NAN, NAN, 0.10},
    {"press 3 mm", "12,800 tets", "XPBD StVK", 10100, NAN, NAN, -0.46},
    {"press 10 mm", "12,800 tets", "XPBD StVK", 10100, NAN, NAN, -0.54},
});

}  // namespace palpate::bench
