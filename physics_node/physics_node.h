// physics_node.h — where the tissue is: answers the tool's motion with the force on the tool.
//
//   in   hop 2  ToolMotion   mofc → physics   newest wins
//   out  hop 3  Interaction  physics → mofc   every step, once there was a motion; with a deadband
//                                            only when mofc_node's force is off, and to keep alive
//   out  hop 5  PhysicsTick  to the sink      every step, once there was a motion
//
// Before the first motion: sends nothing.
// No new motion since the last step: the force for the newest one is sent again under a fresh
// header, so mofc_node can tell a slow hand from dead physics.
// Motion from a restarted mofc_node: accepted at once. What is kept from one step to the next is
// what tissue remembers of the tool (TissueMemory): where it holds it, sticks to it, was punctured,
// and how far it has relaxed. Where moving tissue is comes from this node's clock.
// Thread: everything runs on the caller's thread. step() is real-time safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/session/scene_config.h"
#include "common/telemetry/physics_telemetry.h"
#include "common/core/tick_schedule.h"
#include "physics_node/scene/scene.h"

namespace palpate::physics {

class PhysicsNode {
 public:
  /// Everything handed in by reference must outlive the node.
  /// @param use         what mofc_node makes of an Interaction: only a model is told of tissue that
  ///                    is near and not yet touched
  /// @param session_id  random, not 0
  PhysicsNode(const SceneConfig& scene, const PhysicsConfig& physics, InteractionUse use,
              const Clock& clock, Inbox<ToolMotion>& motion_in,
              Sender<Interaction>& interaction_out, TickSink<PhysicsTick>& ticks_out,
              std::uint64_t session_id);
  /// In a scene that the tools of other nodes are in too. No tool feels another one's dent: tissue
  /// gives way where it is touched, and to each tool by itself.
  PhysicsNode(std::shared_ptr<const Scene> scene, const PhysicsConfig& physics, InteractionUse use,
              const Clock& clock, Inbox<ToolMotion>& motion_in,
              Sender<Interaction>& interaction_out, TickSink<PhysicsTick>& ticks_out,
              std::uint64_t session_id);

  /// Newest motion → force → hop 3. Called at the physics rate, or on arrival (has_new_motion).
  /// No allocation, no lock, no throw.
  void step(const Tick& tick) noexcept;

  /// Has a motion arrived that no step has answered yet? For stepping on arrival.
  [[nodiscard]] bool has_new_motion() noexcept;

  [[nodiscard]] const PhysicsCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] const Scene& scene() const noexcept { return *scene_; }

 private:
  void count_turn(const Tick& tick) noexcept;
  void send(Interaction& interaction, const ToolMotion& motion) noexcept;

  std::shared_ptr<const Scene> scene_;
  TissueMemory memory_;
  InteractionUse use_;
  const Clock& clock_;
  Inbox<ToolMotion>& motion_in_;
  Sender<Interaction>& interaction_out_;
  TickSink<PhysicsTick>& ticks_out_;
  std::uint64_t session_id_;
  std::optional<InteractionDeadband> deadband_;
  Interaction sent_;                      // the last that the link took
  std::uint64_t sent_to_session_id_ = 0;  // mofc_node that it answered; 0 before the first
  std::uint64_t next_interaction_sequence_ = 0;
  std::uint64_t next_step_ = 0;         // sequence of the next record
  std::uint64_t motions_answered_ = 0;  // accepted by the inbox up to the last step
  std::uint64_t next_index_ = 0;        // appointment expected next
  PhysicsCounters counters_;
};

}  // namespace palpate::physics
