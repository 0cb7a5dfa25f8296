// SPDX-License-Identifier: Apache-2.0
// telemetry_message.h — any message of hop 5.
#pragma once

#include <variant>

#include "common/core/scene_messages.h"
#include "common/telemetry/run_messages.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

using TelemetryMessage =
    std::variant<DeviceBatch, MofcBatch, PhysicsBatch, SceneState, MeshFrame, RunState>;

}  // namespace palpate
