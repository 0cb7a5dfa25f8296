// SPDX-License-Identifier: Apache-2.0
// process.h — a physics connected to the world: sockets, the step loop, telemetry, viewers.
#pragma once

#include <functional>
#include <memory>

#include "common/core/physics_term.h"
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
  /// Optional: on the publisher's thread, before the display publishes.
  std::function<void(TimePoint now)> on_pump{};
  /// Optional: on the thread of the steps, before each of them. Must be real-time safe.
  std::function<void()> before_step{};
  PhysicsRole role = PhysicsRole::kFirst;  ///< of physics.standby: which of the two
  /// Optional: sets counters, on the publisher's thread.
  std::function<void(PhysicsCounters& counters)> count_into{};
};

/// Runs until context.stop: at physics.rate_hz, or, where mofc waits for this tick's physics, when
/// a motion arrives. Throws SetupError, and what an engine throws.
void run_process(NodeContext& context, ProcessLinks& links, const PhysicsProgram& program);

}  // namespace palpate::physics
