// SPDX-License-Identifier: Apache-2.0
// engine.h — what computes the tissue: the scene of the session, or a program from elsewhere
// (sdk/).
#pragma once

#include "common/core/messages.h"
#include "common/core/time.h"
#include "common/telemetry/physics_telemetry.h"

namespace palpate::physics {

/// The tissue of one tool, as PhysicsNode calls it, once per step.
class Engine {
 public:
  virtual ~Engine() = default;

  /// The action of the tissue on the tool.
  /// @param motion  the newest; `is_new` if no step has used it
  /// @param now     physics' clock, time of this step; moving tissue is where it is at
  ///                now + answer.scene_ahead, which may go back while a standby does not speak
  /// @param answer  force, energy, contacts and surface are to be filled, within the ranges of
  ///                hop 3; the rest is there
  /// @return false: no answer, the receiver keeps what it has
  virtual bool step(const ToolMotion& motion, bool is_new, TimePoint now,
                    Interaction& answer) noexcept = 0;
  /// Sets the counters that only the engine knows.
  virtual void count_into(PhysicsCounters& counters) const noexcept { static_cast<void>(counters); }
  /// Throws what step() could not. Called after every step, outside real time.
  virtual void rethrow() {}
};

}  // namespace palpate::physics
