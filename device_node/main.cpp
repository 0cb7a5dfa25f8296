// SPDX-License-Identifier: Apache-2.0
// device_node: reads the haptic device, sends its state to mofc_node, applies the force it
// receives. All logic is in the library; this file only connects it to the outside.
#include "device_node/process.h"

int main(int argc, char** argv) {
  return palpate::run_node(
      argc, argv,
      {.name = "device",
       .description = "Owns the haptic device and its motors.",
       .signals = "SIGUSR1 writes the last ticks to a file (the log names it).\n"
                  "SIGUSR2 acknowledges: resets a latched fault, takes the calibration that the "
                  "device asked for, lets a real device give force, which grows from zero.",
       .is_of_one_side = true,
       .moves_device = true},
      [](palpate::NodeContext& context) {
        palpate::ProcessLinks links(
            context.session.side().realtime,
            palpate::tcp_rules(context.session.security, {palpate::KeyRole::kDevice}));
        palpate::device::run_process(context, links);
      });
}
