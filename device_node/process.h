// SPDX-License-Identifier: Apache-2.0
// process.h — device_node connected to the world: sockets, real-time loop, telemetry.
#pragma once

#include <functional>

#include "common/link/rejections.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"

namespace palpate::device {

/// The links to the clamp and back: hops 1 and 4.
struct Exchange {
  Sender<DeviceState>& states;
  Source<ForceCommand>& commands;
  const Rejections& refused;                ///< of `commands`
  std::function<void()> after_switch = {};  ///< called in every tick, after the switch
};

/// Runs until context.stop. Motors are limp before the sockets close. Throws SetupError.
void run_process(NodeContext& context, ProcessLinks& links);
/// The same with a clamp in this process.
/// @param side  for all links except the exchange
void run_with(const Exchange& exchange, NodeContext& context, ZmqContext& side);

}  // namespace palpate::device
