// SPDX-License-Identifier: Apache-2.0
// paper_fit.h — parameters that the paper does not state, chosen so that all its statements hold at
// once, and what each of them matters.
#pragma once

#include "tests/bench/bench_output.h"

namespace palpate::bench {

/// Prints the statements of the paper beside what the fit gives, and the sensitivity of the fit;
/// writes what the options name.
void run_paper_fit(const BenchOptions& options);

}  // namespace palpate::bench
