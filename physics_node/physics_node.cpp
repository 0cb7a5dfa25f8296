#include "physics_node/physics_node.h"

#include <algorithm>
#include <span>
#include <utility>

#include "common/core/message_copy.h"
#include "physics_node/interaction_deadband.h"

namespace palpate::physics {
namespace {

// Of lengths in a contact, on the wire [m].
constexpr double kLongest_m = 1e3;

/// Scales down to components within ±most; rounding may leave one just beyond, so it cuts too.
template <class M>
void reduce(M& m, double most) noexcept {
  const double largest = m.cwiseAbs().maxCoeff();
  if (largest > most) m = (most / largest * m).cwiseMax(-most).cwiseMin(most).eval();
}

/// Reduces what no real tissue has, as of a tool metres deep in stiffening tissue, to the ranges of
/// hop 3, so that mofc_node never refuses the message.
void reduce_to_range(Interaction& interaction) noexcept {
  for (std::size_t i = 0; i < interaction.listed_count; ++i) {
    Contact& contact = interaction.contacts[i];
    reduce(contact.force_on_tool_newton, kMaxTissueForceNewton);
    reduce(contact.elastic_force_on_tool_newton, kMaxTissueForceNewton);
    reduce(contact.curvature_per_m, kMaxCurvaturePerM);
    reduce(contact.stretch_m, kLongest_m);
    reduce(contact.held_m, kLongest_m);
    contact.penetration_m = std::clamp(contact.penetration_m, -kLongest_m, kLongest_m);
    contact.relaxed_m = std::clamp(contact.relaxed_m, -kLongest_m, kLongest_m);
    reduce(contact.d_force_d_position, kMaxSlopeNewtonPerM);
    reduce(contact.d_force_d_velocity, kMaxDampingNewtonSPerM);
    contact.stiffening_newton_per_m2 = std::clamp(
        contact.stiffening_newton_per_m2, -kMaxStiffeningNewtonPerM2, kMaxStiffeningNewtonPerM2);
    // a stiffness map may multiply it
    contact.hunt_crossley_stiffness_newton_per_m =
        std::min(contact.hunt_crossley_stiffness_newton_per_m, kMaxStiffnessNewtonPerM);
    contact.stored_energy_joule = std::min(contact.stored_energy_joule, kMaxStoredEnergyJoule);
  }
  reduce(interaction.force_on_tool_newton, kMaxTissueForceNewton);
  interaction.stored_energy_joule =
      std::min(interaction.stored_energy_joule, kMaxStoredEnergyJoule);
}

/// What the last step filled in.
void clear(SurfaceNews& news) noexcept {
  news.store_id = 0;
  news.number = 0;
  news.has_description = false;
  news.tile_count = news.coverage_count = news.pending_count = 0;
}

}  // namespace

PhysicsNode::PhysicsNode(const SceneConfig& scene, const PhysicsConfig& physics, InteractionUse use,
                         const Clock& clock, Inbox<ToolMotion>& motion_in,
                         Sender<Interaction>& interaction_out, TickSink<PhysicsTick>& ticks_out,
                         std::uint64_t session_id)
    : PhysicsNode(std::make_shared<const Scene>(
                      scene, use == InteractionUse::kLocal ? physics.reach_m : 0.0),
                  physics, use, clock, motion_in, interaction_out, ticks_out, session_id) {}

PhysicsNode::PhysicsNode(std::shared_ptr<const Scene> scene, const PhysicsConfig& physics,
                         InteractionUse use, const Clock& clock, Inbox<ToolMotion>& motion_in,
                         Sender<Interaction>& interaction_out, TickSink<PhysicsTick>& ticks_out,
                         std::uint64_t session_id)
    : scene_(std::move(scene)),
      memory_(scene_->new_memory()),
      use_(use),
      clock_(clock),
      motion_in_(motion_in),
      interaction_out_(interaction_out),
      ticks_out_(ticks_out),
      session_id_(session_id),
      surface_(use == InteractionUse::kLocal ? scene_->descriptions()
                                             : std::span<const DescribedTissue>{},
               physics.rate_hz),
      deadband_(physics.interaction_deadband) {
  counters_.surfaces_shared = scene_->shared_surface_count();
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
  motions_answered_ = counters_.tool_motion.accepted;
  const ToolMotion& motion = received->value;

  const double time_s = to_seconds(tick.now.time_since_epoch());
  const Vector3 shaft_to_handle = motion.tool_orientation_world * Vector3::UnitZ();
  const SceneForce force =
      scene_->step(memory_, motion.tool_position_world_m, motion.tool_velocity_world_m_per_s,
                   time_s, shaft_to_handle);

  // send: hop 3. A message that the link drops shows as skipped at the receiver.
  Interaction& interaction = interaction_;
  interaction.header = {.session_id = session_id_, .sampled_at = tick.now};
  interaction.device_session_id = motion.device_session_id;
  interaction.device_sequence = motion.device_sequence;
  interaction.device_sampled_at = motion.device_sampled_at;
  interaction.tool_position_world_m = motion.tool_position_world_m;
  interaction.tool_orientation_world = motion.tool_orientation_world;
  interaction.force_on_tool_newton = force.force_on_tool_newton;
  interaction.stored_energy_joule = force.stored_energy_joule;
  std::copy_n(force.contacts.begin(), force.listed_count, interaction.contacts.begin());
  interaction.listed_count = force.listed_count;
  interaction.contact_count = force.contact_count;
  reduce_to_range(interaction);
  clear(interaction.surface);
  surface_.fill(motion, tick.now, interaction);
  send(interaction, motion);

  // record: hop 5
  const Duration compute_time = clock_.now() - tick.now;
  counters_.worst_compute_time = std::max(counters_.worst_compute_time, compute_time);
  counters_.tissues_skipped += force.tissues_skipped;
  counters_.tissues_visited += force.tissues_visited;
  counters_.octree_cells_visited += force.octree_cells_visited;
  counters_.octree_last_cell_hits += force.octree_last_cell_hits;
  counters_.tissues_asleep += force.tissues_asleep;
  if (force.contact_count > 0) ++counters_.contact_steps;
  ticks_out_.keep({.sequence = next_step_++,
                   .stepped_at = tick.now,
                   .device_sequence = motion.device_sequence,
                   .tool_position_world_m = motion.tool_position_world_m,
                   .force_on_tool_newton = force.force_on_tool_newton,
                   .stored_energy_joule = force.stored_energy_joule,
                   .contact_count = force.contact_count,
                   .compute_time = compute_time});
}

void PhysicsNode::send(Interaction& interaction, const ToolMotion& motion) noexcept {
  if (deadband_ && interaction.surface.number == 0 &&
      motion.header.session_id == sent_to_session_id_ &&
      !is_worth_sending(sent_, interaction, motion.tool_velocity_world_m_per_s, *deadband_, use_)) {
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
