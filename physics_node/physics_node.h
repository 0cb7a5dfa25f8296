// SPDX-License-Identifier: Apache-2.0
// physics_node.h — answers the motion of the tool with the force that an engine computes for it.
//
//   in   hop 2  ToolMotion   mofc → physics   the newest counts
//   out  hop 3  Interaction  physics → mofc   every step after the first motion; with a deadband
//   only
//                                            when mofc_node's force would be wrong, and as
//                                            keep-alive
//   out  hop 5  PhysicsTick  to the sink      every step after the first motion
//
// Before the first motion: sends nothing.
// No new motion since the last step: sends the force for the newest motion again with a new header,
// so that mofc_node can distinguish a slow hand from a stopped physics_node.
// Motion from a restarted mofc_node: accepted at once.
// Motion with wave variables: the waves move the tool in the tissue, and a wave goes back.
// Thread: everything runs on the caller's thread. step() is real-time safe if its engine's is.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/core/tick_schedule.h"
#include "common/session/scene_config.h"
#include "common/telemetry/physics_telemetry.h"
#include "physics_node/answer/speaker.h"
#include "physics_node/answer/wave_end.h"
#include "physics_node/engine.h"

namespace palpate::physics {

class PhysicsNode {
 public:
  /// All references must outlive the node.
  /// @param use         how mofc_node uses an Interaction
  /// @param session_id  random, not 0
  /// @param speaker     of this physics, shared by its tools; null: there is no standby
  PhysicsNode(Engine& engine, const PhysicsConfig& physics, InteractionUse use, const Clock& clock,
              Inbox<ToolMotion>& motion_in, Sender<Interaction>& interaction_out,
              TickSink<PhysicsTick>& ticks_out, std::uint64_t session_id,
              Speaker* speaker = nullptr);

  /// Newest motion → force → hop 3. Called at the physics rate, or on arrival of a motion
  /// (has_new_motion).
  /// No allocation, no lock, no throw but in the engine.
  void step(const Tick& tick) noexcept;

  /// A motion has arrived that no step has used yet.
  [[nodiscard]] bool has_new_motion() noexcept;

  [[nodiscard]] const PhysicsCounters& counters() const noexcept { return counters_; }

 private:
  void count_turn(const Tick& tick) noexcept;
  void send(Interaction& interaction, const ToolMotion& motion) noexcept;

  Engine& engine_;
  InteractionUse use_;
  const Clock& clock_;
  Inbox<ToolMotion>& motion_in_;
  Sender<Interaction>& interaction_out_;
  TickSink<PhysicsTick>& ticks_out_;
  std::uint64_t session_id_;
  Speaker* speaker_;
  std::optional<InteractionDeadband> deadband_;
  WaveEnd waves_;
  Interaction interaction_;               // of this step; kilobytes, so it is not made anew
  Interaction sent_;                      // the last one that was sent; with a deadband only
  std::uint64_t sent_to_session_id_ = 0;  // session of the mofc_node it was for; 0: none yet
  std::uint64_t next_interaction_sequence_ = 0;
  std::uint64_t steps_ = 0;
  std::uint64_t next_step_ = 0;         // sequence of the next record
  std::uint64_t motions_answered_ = 0;  // motions accepted up to the last step
  std::uint64_t next_index_ = 0;        // tick expected next
  PhysicsCounters counters_;
};

}  // namespace palpate::physics
