// SPDX-License-Identifier: Apache-2.0
// black_box_rows.h — transparency_bench --black-box: tissue of which only the force is known.
#pragma once

#include "tests/bench/bench_output.h"

namespace palpate::bench {

/// Physics at 100 Hz, 20 ms away each way: the force held, the contact model estimated from the
/// force, from contact points too, and the tissue's own model.
void run_black_box(const BenchOptions& options);

}  // namespace palpate::bench
