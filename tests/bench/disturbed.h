// disturbed.h — rows of transparency_bench: real and rough surfaces, disturbed links, disturbed
// ticks.
#pragma once

#include <string>
#include <vector>

#include "tests/bench/bench_output.h"

namespace palpate::bench {

/// Each row of a surface beside the surface's own undisturbed run, in mode guard with the defaults.
/// @param meshes  tetrahedral meshes (.msh, .vtk), scaled to a largest extent of 120 mm
/// @param only    surfaces whose name contains this
/// @throws SetupError  if a mesh cannot be read
void run_disturbed(const BenchOptions& options, const std::vector<std::string>& meshes,
                   const std::string& only);

}  // namespace palpate::bench
