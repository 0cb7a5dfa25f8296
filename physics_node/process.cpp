#include "physics_node/process.h"

#include <algorithm>
#include <memory>

#include "common/core/check.h"
#include "physics_node/display/scene_display.h"
#include "physics_node/scene_engine.h"
#include "physics_node/sdk/process.h"

namespace palpate::physics {

void run_process(NodeContext& context, ProcessLinks& links) {
  const Session& session = context.session;
  if (!session.physics_command.empty()) {
    throw SetupError(session.file +
                     ": physics.command names another program as the physics of this session; "
                     "start it with `palpate launch`, or take the field out");
  }
  const bool is_any_local =
      std::any_of(session.sides.begin(), session.sides.end(),
                  [](const Side& side) { return side.mofc.interaction == InteractionUse::kLocal; });
  const auto scene =
      std::make_shared<const Scene>(session.scene, is_any_local ? session.physics.reach_m : 0.0);
  run_process(context, links,
              {.make_engine =
                   [&](const Side& side) {
                     return std::make_unique<SceneEngine>(scene, session.physics.rate_hz,
                                                          side.mofc.interaction);
                   },
               .make_display =
                   [&](Sender<SceneState>& scene_out, Sender<MeshFrame>& mesh_out) {
                     return std::make_unique<SceneDisplay>(session, context.session_id, scene_out,
                                                           mesh_out);
                   }});
}

}  // namespace palpate::physics
