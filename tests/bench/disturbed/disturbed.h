// SPDX-License-Identifier: Apache-2.0
// disturbed.h — rows of transparency_bench: real and rough surfaces and each property of tissue,
// disturbed links, disturbed ticks.
#pragma once

#include <string>
#include <vector>

#include "common/core/fault_line.h"
#include "tests/bench/bench_output.h"

namespace palpate::bench {

struct DisturbedRows {
  std::string only;         ///< scenes whose name contains this
  bool is_excerpt = false;  ///< 3 s each: undisturbed, and 50 and 100 ms with loss
};

/// Each row of a scene beside the scene's own undisturbed run, in mode guard with the defaults.
/// @param meshes  further scenes: tetrahedral meshes (.msh, .vtk), scaled to an extent of 120 mm
/// @throws SetupError  if a mesh cannot be read
void run_disturbed(const BenchOptions& options, const std::vector<std::string>& meshes,
                   const DisturbedRows& rows);

/// The shipped sessions with holes in their ticks and with disturbed links, each beside a goal.
void run_disturbed_sessions(const BenchOptions& options);

/// Stalls as the Wi-Fi hop of a campus makes them. Every 100 ms the latency of the hop is drawn
/// from the log-normal distribution whose 90th and 99th percentiles are 20 and 250 ms
/// (docs/theory.md §8, [Sui16]); its median is 0.9 ms. Messages of that time wait in order until it
/// is over.
std::vector<FaultWindow> wifi_stalls(double seconds);

}  // namespace palpate::bench
