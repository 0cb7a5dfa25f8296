// SPDX-License-Identifier: Apache-2.0
// physics_node: simulates the tissue and computes the force on the tool for its motion. All logic
// is in the library; this file starts it as a process.
#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/session/session.h"
#include "physics_node/process.h"

namespace {

/// The session of these sides only; of all if none is named.
palpate::Session with_sides(palpate::Session session, const std::vector<std::string>& names) {
  std::vector<palpate::Side> served;
  served.reserve(names.size());
  for (const std::string& name : names) {
    served.push_back(palpate::with_only_side(session, name).side());
  }
  if (!served.empty()) session.sides = std::move(served);
  return session;
}

}  // namespace

int main(int argc, char** argv) {
  bool is_standby = false;
  std::vector<std::string> sides;
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
             app.add_option("--side", sides,
                            "serve this side of the session, another physics_node the others; "
                            "repeatable (default: all)")
                 ->type_name("NAME");
           },
       .name_in_log = [&] { return std::string(is_standby ? "standby" : "physics"); }},
      [&](palpate::NodeContext& context) {
        palpate::ProcessLinks links(context.session.side().realtime,
                                    palpate::tcp_rules(context.session.security,
                                                       {is_standby ? palpate::KeyRole::kStandby
                                                                   : palpate::KeyRole::kPhysics}));
        const palpate::Session served = with_sides(context.session, sides);
        palpate::NodeContext serving{.session = served,
                                     .session_id = context.session_id,
                                     .clock = context.clock,
                                     .log = context.log,
                                     .stop = context.stop,
                                     .requests = context.requests,
                                     .is_unsafe = context.is_unsafe};
        palpate::physics::run_process(
            serving, links,
            is_standby ? palpate::PhysicsRole::kStandby : palpate::PhysicsRole::kFirst);
      });
}
