// SPDX-License-Identifier: Apache-2.0
// mofc_node: answers every DeviceState with a force that gives the hand no energy.
// All logic is in the library; this file only connects it to the outside.
#include "mofc_node/process.h"

int main(int argc, char** argv) {
  return palpate::run_node(
      argc, argv,
      {.name = "mofc",
       .description = "The clamp between the device and the physics.",
       .signals = "SIGUSR1 writes the last ticks to a file (the log names it).",
       .is_of_one_side = true},
      [](palpate::NodeContext& context) {
        palpate::ProcessLinks links(
            context.session.side().realtime,
            palpate::tcp_rules(context.session.security, {palpate::KeyRole::kDevice}));
        palpate::mofc::run_process(context, links);
      });
}
