// SPDX-License-Identifier: Apache-2.0
// acting_hands.h — rows of elastic_stress in which tools cut, hold, pull and tear as no careful
// hand does.
#pragma once

#include "tests/bench/bench_output.h"

namespace palpate::bench {

/// Prints a row for each hand and speed; open loop, on a virtual clock. A row is right if every
/// number is finite, no two solutions in a row have an element inside out, and what the hand came
/// for has happened.
void acting_hands(const BenchOptions& options);

}  // namespace palpate::bench
