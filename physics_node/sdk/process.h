// process.h — a physics connected to the world: sockets, the step loop, telemetry, viewers.
#pragma once

#include <functional>
#include <memory>

#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "physics_node/display/display.h"
#include "physics_node/engine.h"

namespace palpate::physics {

/// What differs between physics_node and a program from elsewhere.
struct PhysicsProgram {
  /// The tissue of the tool of a side; called once for each.
  std::function<std::unique_ptr<Engine>(const Side& side)> make_engine;
  /// Called after all engines are made.
  std::function<std::unique_ptr<Display>(Sender<SceneState>& scene_out,
                                         Sender<MeshFrame>& mesh_out)>
      make_display;
};

/// Runs until context.stop: at physics.rate_hz, or, where mofc waits for this tick's physics, when
/// a motion arrives. Throws SetupError, and what an engine throws.
void run_process(NodeContext& context, ProcessLinks& links, const PhysicsProgram& program);

}  // namespace palpate::physics
