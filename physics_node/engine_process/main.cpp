// SPDX-License-Identifier: Apache-2.0
// palpate::sdk::run: an engine from elsewhere as a process.
#include <CLI/CLI.hpp>
#include <utility>

#include "common/core/check.h"
#include "common/process/run_node.h"
#include "physics_node/engine_process/launched_session.h"
#include "physics_node/engine_process/process.h"
#include "physics_node/foreign/foreign_display.h"
#include "physics_node/foreign/foreign_engine.h"
#include "physics_node/sdk/physics.h"

namespace palpate::sdk {
namespace {

Setup setup_of(const Session& session, const Side& side, std::vector<std::string> arguments) {
  return {.session_file = session.file,
          .side = side.name,
          .arguments = std::move(arguments),
          .rate_hz = session.physics.rate_hz,
          .tip_radius_m = session.scene.tip_radius_m,
          .shaft_length_m = session.scene.shaft_length_m,
          .shaft_radius_m = session.scene.shaft_radius_m,
          .has_estimate = side.mofc.interaction == InteractionUse::kLocal};
}

void serve(NodeContext& context, const MakeEngine& make_engine,
           const std::vector<std::string>& arguments) {
  const Session& session = context.session;
  ProcessLinks links(session.side().realtime, tcp_rules(session.security, {KeyRole::kPhysics}));
  const auto moved = std::make_shared<physics::MovedSurfaces>();
  std::vector<Surface> surfaces;
  bool is_first = true;
  physics::run_process(
      context, links,
      {.make_engine =
           [&](const Side& side) {
             const Setup setup = setup_of(session, side, arguments);
             std::unique_ptr<Engine> engine = make_engine(setup);
             const bool is_shown = std::exchange(is_first, false);
             if (is_shown) {
               surfaces = engine->surfaces();
               moved->reset(surfaces);
             }
             return std::make_unique<physics::ForeignEngine>(std::move(engine), setup.has_estimate,
                                                             is_shown ? moved : nullptr);
           },
       .make_display =
           [&](Sender<SceneState>& scene_out, Sender<MeshFrame>& mesh_out) {
             return std::make_unique<physics::ForeignDisplay>(session, context.session_id, surfaces,
                                                              moved, scene_out, mesh_out);
           }});
}

}  // namespace

int run(int argc, char** argv, const Program& program, const MakeEngine& make_engine) {
  std::vector<std::string> arguments;
  return run_node(argc, argv,
                  {.name = "physics",
                   .program = program.name,
                   .description = program.description,
                   .signals = "SIGUSR1 writes the last ticks to a file (the log names it).",
                   .launched = physics::launched_session,
                   .add_options =
                       [&](CLI::App& app) {
                         if (!program.arguments.empty()) {
                           app.add_option("arguments", arguments, program.arguments);
                         }
                       }},
                  [&](NodeContext& context) {
                    try {
                      serve(context, make_engine, arguments);
                    } catch (const SetupError& error) {
                      throw palpate::SetupError(error.what());
                    }
                  });
}

}  // namespace palpate::sdk
