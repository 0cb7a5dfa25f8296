// physics_node: simulates the tissue and computes the force on the tool for its motion. All logic
// is in the library; this file starts it as a process.
#include "physics_node/process.h"

int main(int argc, char** argv) {
  return palpate::run_node(
      argc, argv,
      {.name = "physics",
       .description = "Simulates the tissue.",
       .signals = "SIGUSR1 writes the last ticks to a file (the log names it)."},
      [](palpate::NodeContext& context) {
        palpate::ProcessLinks links(
            context.session.side().realtime,
            palpate::tcp_rules(context.session.security, {palpate::KeyRole::kPhysics}));
        palpate::physics::run_process(context, links);
      });
}
