// SPDX-License-Identifier: Apache-2.0
// device_mofc_node: device_node and mofc_node in one thread. The tick calls the clamp where two
// processes would exchange messages; the links to physics have threads of their own, so that the
// tick does not call libzmq: it neither allocates nor locks. `palpate launch --together
// device,mofc` starts it.
//
// This gives up the isolation of two processes: if the clamp hangs or crashes, the tick does too,
// and the force ends only when the motors' watchdog ends its lease.
#include <algorithm>

#include "common/core/memory_link.h"
#include "common/process/process_links.h"
#include "device_node/process.h"
#include "mofc_node/process.h"

namespace {

using namespace palpate;

void run_together(NodeContext& context) {
  const Log mofc_log(with_side(context.session.side().name, "mofc"));
  NodeContext mofc_context{.session = context.session,
                           .session_id = random_session_id(),
                           .clock = context.clock,
                           .log = mofc_log.logger(),
                           .stop = context.stop,
                           .requests = context.requests};
  ZmqContext side(tcp_rules(context.session.security, {KeyRole::kDevice}));
  MemoryLink<DeviceState> states(context.clock);
  MemoryLink<ForceCommand> commands(context.clock);
  const Rejections none;  // nothing is decoded
  mofc::Clamp clamp(mofc_context, side, states, commands, none, mofc::ClampThreads::kOfPhysics);

  commands.on_wait = [&](TimePoint deadline) {
    if (!clamp.answer_next()) context.clock.sleep_until(std::min(deadline, clamp.next_due()));
  };
  device::run_with({.states = states,
                    .commands = commands,
                    .refused = none,
                    .after_switch = [&] { clamp.finish_turn(); }},
                   context, side);
}

}  // namespace

int main(int argc, char** argv) {
  return run_node(
      argc, argv,
      {.name = "device_mofc",
       .description = "Owns the haptic device, its motors and the clamp before them.",
       .signals = "SIGUSR1 writes the last ticks to files (the log names them).\n"
                  "SIGUSR2 acknowledges: resets a latched fault, takes the calibration that the "
                  "device asked for, lets a real device give force, which grows from zero.",
       .is_of_one_side = true,
       .moves_device = true},
      run_together);
}
