// SPDX-License-Identifier: Apache-2.0
#include "physics_node/physics_node.h"

#include <algorithm>

#include "common/core/messages.h"
#include "physics_node/answer/interaction_deadband.h"

namespace palpate::physics {
namespace {

double stiffness_along_normal(const Contact& contact) noexcept {
  return -contact.normal_world.dot(contact.d_force_d_position * contact.normal_world);
}

/// For a receiver whose device renders no torque: nobody needs to know where contacts act.
void leave_out_torque(Interaction& answer) noexcept {
  answer.torque_on_tool_newton_m.setZero();
  for (std::size_t i = 0; i < answer.listed_count; ++i) answer.contacts[i].arm_m.setZero();
}

/// What the engine filled in at the last step.
void clear(Interaction& answer) noexcept {
  answer.force_on_tool_newton.setZero();
  answer.torque_on_tool_newton_m.setZero();
  answer.stored_energy_joule = 0.0;
  answer.listed_count = answer.contact_count = 0;
  SurfaceNews& news = answer.surface;
  news.store_id = news.number = 0;
  news.has_description = false;
  news.tile_count = news.coverage_count = news.pending_count = 0;
  answer.elastic.store_id = answer.elastic.number = 0;
}

}  // namespace

PhysicsNode::PhysicsNode(Engine& engine, const PhysicsConfig& physics, InteractionUse use,
                         const Clock& clock, Inbox<ToolMotion>& motion_in,
                         Sender<Interaction>& interaction_out, TickSink<PhysicsTick>& ticks_out,
                         std::uint64_t session_id, Speaker* speaker)
    : engine_(engine),
      use_(use),
      clock_(clock),
      motion_in_(motion_in),
      interaction_out_(interaction_out),
      ticks_out_(ticks_out),
      session_id_(session_id),
      speaker_(speaker),
      deadband_(physics.interaction_deadband) {
  engine_.count_into(counters_);
}

bool PhysicsNode::has_new_motion() noexcept {
  motion_in_.newest();
  return motion_in_.counters().accepted > motions_answered_;
}

void PhysicsNode::step(const Tick& tick) noexcept {
  count_turn(tick);

  // read: hop 2
  const Received<ToolMotion>* received = motion_in_.newest();
  counters_.tool_motion = motion_in_.counters();
  if (received == nullptr) return;
  const bool is_new = counters_.tool_motion.accepted > motions_answered_;
  motions_answered_ = counters_.tool_motion.accepted;

  // with wave variables the tool is elsewhere
  const ToolMotion& motion = waves_.advance(received->value, interaction_, tick.now);

  if (speaker_ != nullptr && is_new) speaker_->hear(*received);

  // send: hop 3. A message that the link drops shows as skipped at the receiver.
  Interaction& interaction = interaction_;
  interaction.header = {.session_id = session_id_, .sampled_at = tick.now};
  interaction.steps = ++steps_;
  interaction.device_session_id = motion.device_session_id;
  interaction.device_sequence = motion.device_sequence;
  interaction.device_sampled_at = motion.device_sampled_at;
  interaction.tool_position_world_m = motion.tool_position_world_m;
  interaction.tool_orientation_world = motion.tool_orientation_world;
  if (speaker_ != nullptr) {
    interaction.physics_term = speaker_->term();
    interaction.scene_ahead = speaker_->scene_ahead();
  }
  clear(interaction);
  const bool has_answer = engine_.step(motion, is_new, tick.now, interaction);
  engine_.count_into(counters_);
  if (!has_answer) return;
  if (!motion.wants_torque) leave_out_torque(interaction);
  waves_.answer(interaction);
  send(interaction, motion);

  // record: hop 5
  const Duration compute_time = clock_.now() - tick.now;
  counters_.worst_compute_time = std::max(counters_.worst_compute_time, compute_time);
  const bool is_touching = interaction.contact_count > 0 && interaction.listed_count > 0;
  const Contact& deepest = interaction.contacts.front();
  const bool is_held = is_touching && deepest.grip.number != 0;  // in jaws, which have no depth
  if (interaction.contact_count > 0) {
    if (steps_ == 1) counters_.is_started_in_contact = true;
    ++counters_.contact_steps;
  }
  ticks_out_.keep({.sequence = next_step_++,
                   .stepped_at = tick.now,
                   .device_sequence = motion.device_sequence,
                   .tool_position_world_m = motion.tool_position_world_m,
                   .force_on_tool_newton = interaction.force_on_tool_newton,
                   .stored_energy_joule = interaction.stored_energy_joule,
                   .contact_count = interaction.contact_count,
                   .compute_time = compute_time,
                   .penetration_m = is_held       ? kNaN
                                    : is_touching ? deepest.penetration_m
                                                  : 0.0,
                   .stiffness_newton_per_m = is_held       ? kNaN
                                             : is_touching ? stiffness_along_normal(deepest)
                                                           : 0.0});
}

void PhysicsNode::send(Interaction& interaction, const ToolMotion& motion) noexcept {
  if (deadband_ && interaction.surface.number == 0 && interaction.elastic.number == 0 &&
      interaction.physics_term == sent_.physics_term &&
      motion.header.session_id == sent_to_session_id_ &&
      !is_worth_sending(sent_, interaction, motion.tool_velocity_world(), *deadband_, use_)) {
    ++counters_.interactions_suppressed;
    return;
  }
  interaction.header.sequence = next_interaction_sequence_++;
  if (interaction_out_.send(interaction) != SendResult::kSent) return;
  if (deadband_) copy_message(interaction, sent_);
  sent_to_session_id_ = motion.header.session_id;
}

void PhysicsNode::count_turn(const Tick& tick) noexcept {
  ++counters_.loop.ticks;
  if (tick.index > next_index_) counters_.loop.skipped_ticks += tick.index - next_index_;
  next_index_ = tick.index + 1;
  counters_.loop.worst_lateness =
      std::max(counters_.loop.worst_lateness, tick.now - tick.scheduled_at);
}

}  // namespace palpate::physics
