// disturbed.h — rows of transparency_bench: real and rough surfaces and each property of tissue,
// disturbed links, disturbed ticks.
#pragma once

#include <string>
#include <vector>

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

}  // namespace palpate::bench
