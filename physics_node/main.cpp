// physics_node: simulates the tissue and computes the force on the tool for its motion. All logic
// is in the library; this file starts it as a process.
#include <CLI/CLI.hpp>

#include "physics_node/process.h"

int main(int argc, char** argv) {
  bool is_standby = false;
  return palpate::run_node(
      argc, argv,
      {.name = "physics",
       .description = "Simulates the tissue.",
       .signals = "SIGUSR1 writes the last ticks to a file (the log names it).",
       .add_options =
           [&](CLI::App& app) {
             app.add_flag("--standby", is_standby,
                          "be the second physics of a session with physics.standby: follow the "
                          "motions, speak when the first falls silent");
           },
       .name_in_log = [&] { return std::string(is_standby ? "standby" : "physics"); }},
      [&](palpate::NodeContext& context) {
        palpate::ProcessLinks links(context.session.side().realtime,
                                    palpate::tcp_rules(context.session.security,
                                                       {is_standby ? palpate::KeyRole::kStandby
                                                                   : palpate::KeyRole::kPhysics}));
        palpate::physics::run_process(
            context, links,
            is_standby ? palpate::PhysicsRole::kStandby : palpate::PhysicsRole::kFirst);
      });
}
