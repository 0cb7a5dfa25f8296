// SPDX-License-Identifier: Apache-2.0
// run_wire.h — internal header of the codecs: the run in Health.
#pragma once

#include "common/telemetry/run_messages.h"

namespace palpate::v1 {
class Health;
class TaskState;
}  // namespace palpate::v1

namespace palpate::wire {

/// Its markers and its replay.
void put(const RunState& run, v1::Health& to);
void put(const TaskState& task, v1::TaskState& to);

}  // namespace palpate::wire
