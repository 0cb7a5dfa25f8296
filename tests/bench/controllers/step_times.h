// SPDX-License-Identifier: Apache-2.0
// step_times.h — processor time of one step of every controller.
#pragma once

#include "tests/bench/bench_output.h"

namespace palpate::bench {

/// Median and 99 % of 20,000 steps in contact, the local model of a wall behind them.
[[nodiscard]] Table step_time_table();

}  // namespace palpate::bench
