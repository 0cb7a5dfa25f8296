#include "mofc_node/mofc_node.h"

#include <algorithm>
#include <array>
#include <optional>

#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/paper_mofc.h"
#include "mofc_node/controllers/vector_mofc.h"
#include "mofc_node/motion_deadband.h"

namespace palpate::mofc {

using controllers::AppliedStretch;
using controllers::AxisFriction;
using controllers::ControlOutput;
using controllers::MofcParameters;
using controllers::PaperMofc;

namespace {

/// Time average of the force on the hand since the reading before; 0 without an echo.
Vector3 mean_applied_newton(const DeviceState& state) noexcept {
  Vector3 impulse = Vector3::Zero();
  double duration_s = 0.0;
  for (std::uint32_t i = 0; i < state.applied_count; ++i) {
    const double stretch_s = to_seconds(state.applied[i].until - state.applied[i].from);
    impulse += stretch_s * state.applied[i].force_on_hand_newton;
    duration_s += stretch_s;
  }
  return duration_s > 0.0 ? Vector3(impulse / duration_s) : Vector3(Vector3::Zero());
}

}  // namespace

std::unique_ptr<controllers::ForceController> make_controller(const MofcConfig& mofc,
                                                              const DeviceConfig& device) {
  const DeviceProfile& profile = device.profile;
  std::optional<AxisFriction> per_axis;
  if (profile.per_axis) {
    per_axis = {.f_d = profile.per_axis->viscous_newton_s_per_m,
                .f_co = profile.per_axis->coulomb_newton};
  }
  if (mofc.controller == ControllerKind::kNone) return std::make_unique<controllers::PassThrough>();
  if (mofc.mode == MofcMode::kPaper) {
    const MofcParameters parameters{.f_d = profile.viscous_newton_s_per_m,
                                    .f_co = profile.coulomb_newton,
                                    .T = 1.0 / device.rate_hz};
    if (per_axis) return std::make_unique<PaperMofc>(*per_axis, parameters.T);
    return std::make_unique<PaperMofc>(mofc.paper_friction == PaperFriction::kIsotropic
                                           ? PaperMofc::isotropic(parameters)
                                           : PaperMofc(parameters));
  }
  const MofcParameters parameters{.f_d = profile.viscous_newton_s_per_m,
                                  .f_co = profile.coulomb_newton,
                                  .T = to_seconds(device.lease)};
  if (mofc.mode == MofcMode::kVector) {
    return std::make_unique<controllers::VectorMofc>(parameters, profile.position_resolution_m,
                                                     to_seconds(mofc.delta_max), per_axis);
  }
  return std::make_unique<controllers::GuardMofc>(
      controllers::GuardParameters{.mofc = parameters,
                                   .per_axis = per_axis,
                                   .resolution_m = profile.position_resolution_m,
                                   .delta_max_s = to_seconds(mofc.delta_max),
                                   .v_max_m_per_s = mofc.guard.v_max_m_per_s,
                                   .credit_cap_joule = mofc.guard.credit_cap_joule,
                                   .gate_joule = mofc.guard.gate_joule,
                                   .gate_recovery_s = to_seconds(mofc.guard.gate_recovery)});
}

MofcNode::MofcNode(const MofcConfig& mofc, const DeviceConfig& device, const Clock& clock,
                   Sender<ToolMotion>& motion_out, Inbox<Interaction>& interaction_in,
                   TickSink<MofcTick>& ticks, std::uint64_t session_id)
    : config_(mofc),
      device_(device),
      clock_(clock),
      motion_out_(motion_out),
      interaction_in_(interaction_in),
      ticks_(ticks),
      session_id_(session_id),
      controller_(make_controller(mofc, device)),
      velocity_(make_velocity_estimator(
          mofc.velocity_estimator,
          device.profile.position_resolution_m * device.workspace.scale_ratio,
          device.workspace.scale_ratio)),
      handover_(mofc.handover_newton_per_s) {}

ForceCommand MofcNode::answer(const Received<DeviceState>& received) noexcept {
  const DeviceState& state = received.value;
  ++counters_.ticks;

  // who speaks: a new device session starts from nothing
  const bool is_new_session = state.header.session_id != command_.answers_session_id;
  if (is_new_session) begin_device_session();
  const bool has_gap = !is_new_session && (received.skipped_before > 0 || !continues_echo(state));
  if (has_gap) ++counters_.ledger_resets;
  note_echo(state);

  // what the physics says, perhaps of this very tick
  relay(state);
  const TimePoint now = clock_.now();
  const Interaction* interaction = physics_answer(state, now);
  const ModelForce tissue = tissue_force(state, interaction);
  const Vector3 asked = device_.workspace.force_ratio * tissue.force_on_tool_newton;

  // the clamp, then the fade: both only reduce
  const ControlOutput output =
      control(state, has_gap, interaction, asked, tissue.stored_energy_joule);
  const Vector3 force = faded(output.force_on_hand_newton, now);

  ++command_.header.sequence;
  command_.header.session_id = session_id_;
  command_.header.sampled_at = now;
  command_.answers_session_id = state.header.session_id;
  command_.answers_sequence = state.header.sequence;
  command_.force_on_hand_newton = force;
  command_.valid_for = device_.lease;

  // the record of this turn
  commanded_newton_ = force.norm();
  asked_before_newton_ = asked;
  has_asked_before_ = true;
  tick_.device_session_id = state.header.session_id;
  tick_.device_sequence = state.header.sequence;
  tick_.device_sampled_at = state.header.sampled_at;
  tick_.asked_force_on_hand_newton = asked;
  tick_.commanded_force_on_hand_newton = force;
  tick_.f_max_newton = output.f_max_newton;
  tick_.ledger_energy_joule = output.ledger_energy_joule;
  tick_.force_age = interaction != nullptr
                        ? state.header.sampled_at - interaction->device_sampled_at
                        : Duration{};
  tick_.is_clamped = output.is_clamped;
  tick_.is_in_contact = tissue.is_touching;
  if (tick_.is_clamped) ++counters_.clamped_ticks;
  if (output.is_too_fast) ++counters_.too_fast_ticks;
  if (tick_.is_in_contact) ++counters_.contact_ticks;
  has_turn_ = true;
  return command_;
}

void MofcNode::finish_turn() noexcept {
  if (!has_turn_) return;
  if (!is_motion_sent_) send_motion();
  ticks_.keep(tick_);
  has_turn_ = false;
}

MofcCounters MofcNode::counters() const noexcept {
  MofcCounters counters = counters_;
  counters.interaction = interaction_in_.counters();
  counters.transparency_sum = transparency_.sum();
  counters.transparency_samples = transparency_.samples();
  return counters;
}

void MofcNode::begin_device_session() noexcept {
  controller_->reset();
  velocity_->reset();
  handover_.reset();
  has_asked_before_ = false;
  ++counters_.ledger_resets;
}

bool MofcNode::continues_echo(const DeviceState& state) const noexcept {
  // a stretch told twice must not be booked twice
  TimePoint reached = echo_until_;
  for (std::uint32_t i = 0; i < state.applied_count; ++i) {
    if (state.applied[i].from != reached) return false;
    reached = state.applied[i].until;
  }
  return reached == state.header.sampled_at;
}

void MofcNode::note_echo(const DeviceState& state) noexcept {
  // an echo that does not end at its own reading is old: nothing may continue it
  const bool is_first = !has_asked_before_ && state.applied_count == 0;
  const bool is_current =
      is_first || (state.applied_count > 0 &&
                   state.applied[state.applied_count - 1].until == state.header.sampled_at);
  echo_until_ = is_current ? state.header.sampled_at : TimePoint::min();
  // the force that acts at t_k is the answer to the tick before, as the device let it through
  if (!has_asked_before_ || state.applied_count == 0) return;
  transparency_.add(asked_before_newton_,
                    state.applied[state.applied_count - 1].force_on_hand_newton);
}

void MofcNode::relay(const DeviceState& state) noexcept {
  const Vector3 velocity = velocity_->update(state.tool_position_world_m, state.header.sampled_at,
                                             mean_applied_newton(state));
  motion_.header.session_id = session_id_;
  motion_.header.sampled_at = clock_.now();
  motion_.device_session_id = state.header.session_id;
  motion_.device_sequence = state.header.sequence;
  motion_.device_sampled_at = state.header.sampled_at;
  motion_.tool_position_world_m = state.tool_position_world_m;
  motion_.tool_orientation_world = state.tool_orientation_world;
  motion_.tool_velocity_world_m_per_s = velocity;
  motion_.buttons = state.buttons;

  // normally after the answer (finish_turn); before it only if the answer waits for the physics
  is_motion_sent_ = config_.wait_for_physics.count() > 0;
  if (is_motion_sent_) send_motion();
}

void MofcNode::send_motion() noexcept {
  if (config_.motion_deadband && has_sent_motion_ &&
      !is_worth_sending(sent_motion_, motion_, *config_.motion_deadband)) {
    ++counters_.motions_suppressed;
    return;
  }
  motion_.header.sequence = next_motion_sequence_++;
  const SendResult result = motion_out_.send(motion_);
  if (result == SendResult::kDropped) ++counters_.motions_dropped;
  if (result != SendResult::kSent) return;
  sent_motion_ = motion_;
  has_sent_motion_ = true;
}

const Interaction* MofcNode::physics_answer(const DeviceState& state, TimePoint now) noexcept {
  const Received<Interaction>* newest = interaction_in_.newest();
  const auto answers_this_tick = [&](const Received<Interaction>* r) {
    return r != nullptr && r->value.device_session_id == state.header.session_id &&
           r->value.device_sequence == state.header.sequence;
  };

  // same tick: wait for it, but not longer than agreed
  is_late_ = false;
  if (config_.wait_for_physics.count() > 0) {
    const TimePoint deadline = now + config_.wait_for_physics;
    while (!answers_this_tick(newest) && clock_.now() < deadline) {
      interaction_in_.wait_until(deadline);
      newest = interaction_in_.newest();
    }
    is_late_ = !answers_this_tick(newest);
    if (is_late_) ++counters_.late_physics_ticks;
  }

  // only what answers this device's present session counts
  if (newest == nullptr || newest->value.device_session_id != state.header.session_id) {
    has_interaction_ = false;
    return nullptr;
  }
  // physics that goes on answering an old motion has nothing new to say
  if (!has_interaction_ || newest->value.device_sequence != answered_sequence_) {
    interaction_received_at_ = newest->received_at;
    answered_sequence_ = newest->value.device_sequence;
  }
  has_interaction_ = true;
  return &newest->value;
}

ModelForce MofcNode::tissue_force(const DeviceState& state,
                                  const Interaction* interaction) noexcept {
  const TimePoint now = state.header.sampled_at;
  const double dt_s = has_asked_before_ ? to_seconds(now - tick_.device_sampled_at) : 0.0;
  if (interaction == nullptr || state.is_clutched) {
    tick_.state = interaction == nullptr ? MofcState::kNoPhysics : MofcState::kClutched;
    handover_.reset();
    return {};
  }
  const ModelForce force = config_.interaction == InteractionUse::kHeld
                               ? held(*interaction)
                               : handover_.step(*interaction, state.tool_position_world_m,
                                                motion_.tool_velocity_world_m_per_s, dt_s, now);
  tick_.state = force.is_touching ? MofcState::kContact : MofcState::kFree;
  return force;
}

ControlOutput MofcNode::control(const DeviceState& state, bool has_gap,
                                const Interaction* interaction, const Vector3& asked_newton,
                                double stored_joule) noexcept {
  std::array<AppliedStretch, kMaxAppliedForces> stretches;
  for (std::uint32_t i = 0; i < state.applied_count; ++i) {
    const AppliedForce& applied = state.applied[i];
    stretches[i] = {.duration_s = to_seconds(applied.until - applied.from),
                    .force_on_hand_newton = applied.force_on_hand_newton,
                    .hand_position_at_end_m = applied.hand_position_at_end_m,
                    .has_position_at_end = applied.has_position_at_end};
  }
  // a force that is asked for the first time; a held one repeats the stamp of its Interaction
  const bool is_fresh = config_.interaction == InteractionUse::kLocal || interaction == nullptr ||
                        interaction->header.sequence != used_interaction_;
  if (interaction != nullptr) used_interaction_ = interaction->header.sequence;

  // the tissue's energy as the hand would get it: force × force_ratio, motion ÷ scale_ratio
  const WorkspaceConfig& workspace = device_.workspace;
  return controller_->step(
      {.hand_position_m = state.hand_position_m,
       .applied = {stretches.data(), state.applied_count},
       .has_gap = has_gap,
       .asked_force_on_hand_newton = asked_newton,
       .is_asked_fresh = is_fresh,
       .stored_energy_joule = stored_joule * workspace.force_ratio / workspace.scale_ratio});
}

Vector3 MofcNode::recovering(const Vector3& force_newton, TimePoint now) noexcept {
  if (!is_recovering_) return force_newton;
  const double share = to_seconds(now - recovering_since_) / to_seconds(config_.fade);
  const double rise = force_newton.norm() - newton_when_recovering_;
  is_recovering_ = share < 1.0;
  if (!is_recovering_ || rise <= 0.0) return force_newton;
  return limited_to_norm(force_newton, newton_when_recovering_ + share * rise);
}

Vector3 MofcNode::faded(const Vector3& force_newton, TimePoint now) noexcept {
  // late in this tick: no more than the device's own friction absorbs
  Vector3 force =
      is_late_ ? limited_to_norm(force_newton, device_.profile.coulomb_newton) : force_newton;

  // silent for too long: never more than at that instant, and fading
  const Duration silence = now - interaction_received_at_;
  if (!has_interaction_ || silence <= config_.stale_after) {
    if (is_stale_) {
      is_stale_ = false;
      recovering_since_ = now;
      newton_when_recovering_ = commanded_newton_;
      is_recovering_ = true;
    }
    return recovering(force, now);
  }
  if (!is_stale_) {
    is_stale_ = true;
    newton_when_declared_stale_ = commanded_newton_;
  }
  ++counters_.stale_ticks;
  const double left = 1.0 - to_seconds(silence - config_.stale_after) / to_seconds(config_.fade);
  if (left <= 0.0) {
    tick_.state = MofcState::kNoPhysics;
    return Vector3::Zero();
  }
  tick_.state = MofcState::kFading;
  return left * limited_to_norm(force, newton_when_declared_stale_);
}

}  // namespace palpate::mofc
