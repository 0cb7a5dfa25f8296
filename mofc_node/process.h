// process.h — mofc_node connected to the world: sockets, the answering loop, telemetry.
#pragma once

#include "common/runtime/process_links.h"
#include "common/runtime/run_node.h"

namespace palpate::mofc {

/// Runs until context.stop. Throws SetupError.
void run_process(NodeContext& context, ProcessLinks& links);

}  // namespace palpate::mofc
