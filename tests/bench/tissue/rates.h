// SPDX-License-Identifier: Apache-2.0
// rates.h — the tissue library by itself: steps per second of one and of many scenes, memory,
// states, and whether anything is kept in many steps.
#pragma once

#include <cstddef>
#include <vector>

#include "tests/bench/bench_output.h"

namespace palpate::bench {

struct RateOptions {
  std::vector<std::size_t> copies{1, 16, 1000};
  std::size_t threads = 1;
  double seconds = 0.4;     ///< of each row, simulated
  double many_steps = 0.0;  ///< of keep_memory()
};

[[nodiscard]] Table rates(const RateOptions& options, bool is_quick);

/// Makes many steps of one scene and prints the memory before and after.
void keep_memory(const RateOptions& options);

}  // namespace palpate::bench
