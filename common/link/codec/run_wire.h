// SPDX-License-Identifier: Apache-2.0
// run_wire.h — internal header of the codecs: the run in Health.
#pragma once

#include "common/telemetry/run_messages.h"

namespace palpate::v1 {
class Health;
}

namespace palpate::wire {

/// Its markers and its replay.
void put(const RunState& run, v1::Health& to);

}  // namespace palpate::wire
