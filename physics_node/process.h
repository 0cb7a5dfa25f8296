// SPDX-License-Identifier: Apache-2.0
// process.h — physics_node connected to the world: sockets, the step loop, telemetry.
#pragma once

#include "common/core/physics_term.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"

namespace palpate::physics {

/// Runs until context.stop: at physics.rate_hz, or, where mofc waits for this tick's physics, when
/// a motion arrives. Throws SetupError.
/// @param role  kStandby: the physics of physics.standby
void run_process(NodeContext& context, ProcessLinks& links, PhysicsRole role);

}  // namespace palpate::physics
