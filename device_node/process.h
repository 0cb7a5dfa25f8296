// process.h — device_node connected to the world: sockets, real-time loop, telemetry.
#pragma once

#include "common/runtime/process_links.h"
#include "common/runtime/run_node.h"

namespace palpate::device {

/// Runs until context.stop. Motors are limp before the sockets close. Throws SetupError.
void run_process(NodeContext& context, ProcessLinks& links);

}  // namespace palpate::device
