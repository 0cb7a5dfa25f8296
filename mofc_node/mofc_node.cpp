// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/mofc_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "mofc_node/make_controller.h"
#include "mofc_node/model_probe.h"

namespace palpate::mofc {
namespace {

/// A ledger that a disturbance has emptied fills by and by.
constexpr Duration kAftermath = std::chrono::milliseconds(100);

/// A wave for a tool that moves scale_ratio times as far with 1/force_ratio of the force; the
/// inverse with both ratios inverted.
Wave scaled(Wave wave, double scale_ratio, double force_ratio) noexcept {
  const double power = scale_ratio / force_ratio;
  wave.sum *= std::sqrt(power);
  wave.energy_joule *= power;
  wave.impedance_newton_s_per_m /= scale_ratio * force_ratio;
  return wave;
}

/// For the wire, never rounded up: what the acting force can draw in a nanosecond more nothing
/// pays. 0 is the device's own deadline.
Duration deadline_of(double begins_within_s) noexcept {
  constexpr double kRounding_ns = 1e-3;  // of what was whole nanoseconds
  const auto whole = Duration(static_cast<std::int64_t>(1e9 * begins_within_s + kRounding_ns));
  return begins_within_s > 0.0 ? std::max(whole, Duration(1)) : Duration{};
}

}  // namespace

MofcNode::MofcNode(const MofcConfig& mofc, const ClampedDevice& device, const Clock& clock,
                   Sender<ToolMotion>& motion_out, Inbox<Interaction>& interaction_in,
                   TickSink<MofcTick>& ticks, std::uint64_t session_id,
                   std::optional<StandbyLinks> standby,
                   std::unique_ptr<controllers::ForceController> controller)
    : interaction_use_(mofc.interaction),
      device_(device),
      clock_(clock),
      ticks_(ticks),
      session_id_(session_id),
      relay_(mofc, device, clock, motion_out, session_id),
      physics_(interaction_in, clock, mofc.wait_for_physics, mofc.stale_after),
      choice_(mofc.standby_after.value_or(Duration::max())),
      tissue_(mofc.interaction, standby.has_value(), mofc.handover_newton_per_s, session_id,
              from_seconds(1.0 / device.rate_hz)),
      controller_(controller ? std::move(controller) : make_controller(mofc, device)),
      still_after_(mofc.still_after),
      gone_after_(std::max(mofc.stale_after, mofc.still_after) + mofc.fade),
      fade_time_(mofc.fade),
      fade_(mofc.stale_after, mofc.fade),
      torque_fade_(mofc.stale_after, mofc.fade),
      period_(from_seconds(1.0 / device.rate_hz)) {
  if (device.wrist && mofc.controller != ControllerKind::kNone) {
    wrench_.emplace(mofc, device, *device.wrist);
  }
  if (!standby) return;
  standby_.emplace(standby->interaction_in, clock, Duration::zero(), mofc.stale_after);
  relay_.relay_to_standby(standby->motion_out);
}

ForceCommand MofcNode::answer(const Received<DeviceState>& received) noexcept {
  const DeviceState& state = received.value;
  if (!newest_state_ || state.header.session_id != newest_state_->session_id) {
    begin_device_session();
    disturbed_.reset();
    if (newest_state_) disturbed_ = state.header.sampled_at;  // restarted
  }
  newest_state_ = state.header;

  // what acted since the previous state
  const DeviceEcho::Report echo = echo_.take(state);
  if (echo.has_gap) ++counters_.ledger_resets;

  // what the tissue requests, perhaps computed for this very tick
  relay_.update(state, echo.mean_force_newton);
  if (physics_.waits()) relay_.send();
  const TimePoint now = clock_.now();
  const PhysicsAnswer physics = take_physics(state, now);
  const Request wanted = request(state, physics.interaction, echo.since_previous);
  const WorkspaceConfig& workspace = device_.workspace;
  const Vector3 requested = workspace.force_ratio * wanted.tissue.force_on_tool_newton;

  // what controllers with a model of the tissue may ask
  const ModelProbe probe(physics.interaction, state, relay_.tool_position_world_m(), workspace);
  const bool has_model = interaction_use_ == InteractionUse::kLocal;

  // the channel of wave variables is closed while the hand moves without the tool
  const Wave returned = returned_wave(physics.interaction);
  if (state.is_clutched) ++wave_stream_;

  // the clamp; the tissue's energy as the hand would get it: force × force_ratio, motion ÷
  // scale_ratio
  const controllers::ControlInput input{
      .hand_position_m = state.hand_position_m,
      .applied = echo.applied,
      .has_gap = echo.has_gap,
      .acting_force_on_hand_newton = state.acting_force_on_hand_newton,
      .acting_lease_s = to_seconds(state.acting_until - state.header.sampled_at),
      .energy_limit_joule = state.monitor_energy_joule,
      .requested_force_on_hand_newton = requested,
      .is_request_fresh = is_fresh(physics.interaction),
      .stored_energy_joule =
          wanted.tissue.stored_energy_joule * workspace.force_ratio / workspace.scale_ratio,
      .hand_velocity_m_per_s = relay_.tool_velocity_world().tip_m_per_s / workspace.scale_ratio,
      .evaluated_at_m = has_model ? state.hand_position_m : probe.evaluated_at_m(),
      .surface_normal = probe.surface_normal(),
      .tissue = has_model ? &probe : nullptr,
      .returned_wave = state.is_clutched ? nullptr : &returned};
  // with a wrist the torque too, per joint
  Vector3 requested_newton_m = Vector3::Constant(kNaN);
  WrenchClamp::Output wrench;
  if (state.wrist) {
    requested_newton_m = workspace.force_ratio / workspace.scale_ratio *
                         state.wrist->pose.axes.transpose() * wanted.tissue.torque_on_tool_newton_m;
    wrench.wrist_torque_newton_m = requested_newton_m;
  }
  if (state.wrist && wrench_) {
    // nobody pays for what the motors do not do
    wrench = wrench_->step(
        input, state, echo.reported,
        limited_per_component(requested_newton_m,
                              Vector3::Constant(device_.wrist->peak_torque_newton_m)));
  } else {
    wrench.force = controller_->step(input);
  }
  const controllers::ControlOutput& output = wrench.force;
  Wave sent = scaled(output.sent_wave, workspace.scale_ratio, workspace.force_ratio);
  sent.stream = wave_stream_;
  relay_.carry(sent);

  // late physics: no more than the device's own friction absorbs; then the fade. Both only reduce
  const Vector3 punctual =
      physics.is_late ? limited_to_norm(output.force_on_hand_newton, device_.profile.coulomb_newton)
                      : output.force_on_hand_newton;
  if (physics.is_late && device_.wrist) {
    wrench.wrist_torque_newton_m = limited_per_component(
        wrench.wrist_torque_newton_m, Vector3::Constant(device_.wrist->coulomb_newton_m));
  }
  const bool needs_no_news =
      physics.is_stepping && physics.silence <= std::min(still_after_, tissue_.holds_for());
  const SilenceFade::Output faded =
      fade_.step(punctual, physics.silence, needs_no_news, physics.lost_for, now);
  wrench.wrist_torque_newton_m =
      torque_fade_
          .step(wrench.wrist_torque_newton_m, physics.silence, needs_no_news, physics.lost_for, now)
          .force_newton;
  echo_.answered(requested);

  // the record of this turn
  MofcState after_fade = wanted.state;
  if (faded.phase == SilenceFade::Phase::kFading) after_fade = MofcState::kFading;
  if (faded.phase == SilenceFade::Phase::kFadedOut) after_fade = MofcState::kNoPhysics;
  turn_ = {.device_session_id = state.header.session_id,
           .device_sequence = state.header.sequence,
           .device_sampled_at = state.header.sampled_at,
           .requested_force_on_hand_newton = requested,
           .requested_wrist_torque_newton_m = requested_newton_m,
           .commanded_force_on_hand_newton = faded.force_newton,
           .f_max_newton = output.f_max_newton,
           .ledger_energy_joule = output.ledger_energy_joule,
           .force_age = physics.interaction != nullptr
                            ? state.header.sampled_at - physics.interaction->device_sampled_at
                            : Duration{},
           .state = after_fade,
           .is_clamped = output.is_clamped,
           .is_in_contact = wanted.tissue.is_touching,
           .is_from_standby = choice_.in_use() == PhysicsRole::kStandby,
           .grip = static_cast<GripState>(tissue_.held_tissue(choice_.in_use()).state())};
  count(*turn_, echo, physics, output, faded.phase);
  const Duration lease = output.lease_s > 0.0 ? from_seconds(output.lease_s) : device_.lease;
  ForceCommand command = make_command(state, faded.force_newton, lease, now);
  command.begins_within = deadline_of(output.begins_within_s);
  command.wrist_torque_newton_m = wrench.wrist_torque_newton_m;
  command.counted_energy_joule = output.counted_energy_joule;
  return command;
}

void MofcNode::finish_turn() noexcept {
  if (!turn_) return;
  relay_.send();
  ticks_.keep(*turn_);
  turn_.reset();
}

void MofcNode::read_ahead() noexcept {
  if (!newest_state_) return;
  Header next = *newest_state_;  // what is read now is first used for the next state
  next.sampled_at += period_;
  const auto read = [&](PhysicsInput& input, PhysicsRole role) {
    input.read_ahead(
        [&](const Interaction& interaction) { tissue_.receive(role, interaction, next); });
  };
  read(physics_, PhysicsRole::kFirst);
  if (standby_) read(*standby_, PhysicsRole::kStandby);
}

MofcCounters MofcNode::counters() const noexcept {
  MofcCounters counters = counters_;
  counters.interaction = physics_.counters();
  counters.motions_dropped = relay_.dropped();
  counters.motions_suppressed = relay_.suppressed();
  if (standby_) {
    counters.standby_interaction = standby_->counters();
    counters.physics_term = choice_.term();
    counters.physics_switches = choice_.switches();
  }
  const ForceComparison::Integrals& rendered = echo_.rendered().integrals();
  counters.transparency_integral_ns = 1e9 * rendered.transparency_s;
  counters.transparency_time_ns = static_cast<std::uint64_t>(std::llround(1e9 * rendered.judged_s));
  return counters;
}

void MofcNode::begin_device_session() noexcept {
  controller_->reset();
  if (wrench_) wrench_->reset();
  relay_.reset();
  choice_.begin_session();
  tissue_.reset();
  echo_.reset();
  has_lost_press_ = true;
  ++counters_.ledger_resets;
}

/// In the frame of the hand; none unless it answers the present stream.
Wave MofcNode::returned_wave(const Interaction* interaction) const noexcept {
  if (interaction == nullptr || !interaction->wave.is_present() ||
      interaction->wave.stream != wave_stream_) {
    return {};
  }
  const WorkspaceConfig& workspace = device_.workspace;
  Wave wave = scaled(interaction->wave, 1.0 / workspace.scale_ratio, 1.0 / workspace.force_ratio);
  wave.stream += interaction->header.session_id;  // its sums begin anew with each physics
  return wave;
}

/// The answer of the physics in use.
PhysicsAnswer MofcNode::take_physics(const DeviceState& state, TimePoint now) noexcept {
  const auto take = [&](PhysicsInput& input, PhysicsRole role) {
    return input.take(state, now, [&](const Interaction& interaction) {
      tissue_.receive(role, interaction, state.header);
    });
  };
  const auto is_gone = [&](const PhysicsAnswer& answer) {
    return answer.lost_for > fade_time_ || answer.silence > gone_after_;
  };
  std::array<PhysicsAnswer, kPhysicsRoles> answers{take(physics_, PhysicsRole::kFirst), {}};
  if (is_gone(answers[0])) tissue_.drop(PhysicsRole::kFirst, choice_.in_use());
  relay_.set_hints(PhysicsRole::kFirst,
                   {.receipts = tissue_.receipts(PhysicsRole::kFirst),
                    .elastic_receipts = tissue_.elastic_receipts(PhysicsRole::kFirst),
                    .grip = tissue_.held_tissue(PhysicsRole::kFirst).report()});
  newest_ = {answers[0].interaction, nullptr};
  if (!standby_) return answers[0];

  answers[1] = take(*standby_, PhysicsRole::kStandby);
  newest_[1] = answers[1].interaction;
  if (is_gone(answers[1])) tissue_.drop(PhysicsRole::kStandby, choice_.in_use());
  std::array<HeardPhysics, kPhysicsRoles> heard{};
  for (std::size_t i = 0; i < kPhysicsRoles; ++i) {
    heard[i] = {.has_answered = newest_[i] != nullptr,
                .is_lost = answers[i].lost_for > Duration::zero() ||
                           tissue_.costs_too_much(static_cast<PhysicsRole>(i)),
                .silence = answers[i].silence,
                .term = newest_[i] != nullptr ? newest_[i]->physics_term : 0};
  }
  const PhysicsRole in_use = choice_.step(heard, now);
  relay_.use(in_use, choice_.term());
  for (const PhysicsRole role : {PhysicsRole::kFirst, PhysicsRole::kStandby}) {
    relay_.set_hints(role, {.receipts = tissue_.receipts(role),
                            .elastic_receipts = tissue_.elastic_receipts(role),
                            .scene_time = tissue_.scene_time(role, in_use, state.header.sampled_at),
                            .grip = tissue_.held_tissue(role).report()});
  }
  return answers[index_of(in_use)];
}

MofcNode::Request MofcNode::request(const DeviceState& state, const Interaction* interaction,
                                    Duration since_previous) noexcept {
  if (interaction == nullptr || state.is_clutched) {
    tissue_.reset();
    return {.tissue = {},
            .state = interaction == nullptr ? MofcState::kNoPhysics : MofcState::kClutched};
  }
  const ModelForce tissue =
      tissue_.step(newest_, choice_.in_use(), state, relay_.tool_position_world_m(),
                   relay_.tool_velocity_world(), to_seconds(since_previous));
  return {.tissue = tissue, .state = tissue.is_touching ? MofcState::kContact : MofcState::kFree};
}

/// Whether the request was evaluated since the previous answer; a held force repeats the
/// Interaction.
bool MofcNode::is_fresh(const Interaction* interaction) noexcept {
  if (interaction == nullptr) return true;
  const bool is_new = interaction->header.sequence != used_interaction_;
  used_interaction_ = interaction->header.sequence;
  return is_new || interaction_use_ == InteractionUse::kLocal;
}

ForceCommand MofcNode::make_command(const DeviceState& state, const Vector3& force_newton,
                                    Duration lease, TimePoint now) noexcept {
  return {.header = {.session_id = session_id_, .sequence = next_command_++, .sampled_at = now},
          .answers_session_id = state.header.session_id,
          .answers_sequence = state.header.sequence,
          .answers_sampled_at = state.header.sampled_at,
          .force_on_hand_newton = force_newton,
          .valid_for = lease};
}

void MofcNode::count(const MofcTick& turn, const DeviceEcho::Report& echo,
                     const PhysicsAnswer& physics, const controllers::ControlOutput& output,
                     SilenceFade::Phase phase) noexcept {
  ++counters_.ticks;
  if (turn.is_in_contact) ++counters_.contact_ticks;
  if (turn.is_from_standby) ++counters_.standby_ticks;
  count_grip(turn.grip);
  if (turn.is_clamped) ++counters_.clamped_ticks;
  if (turn.is_clamped && turn.ledger_energy_joule < 0.0) ++counters_.debt_ticks;
  if (output.is_too_fast) ++counters_.too_fast_ticks;
  if (physics.is_late) ++counters_.late_physics_ticks;
  if (phase != SilenceFade::Phase::kPresent) ++counters_.stale_ticks;

  const bool is_silent = phase != SilenceFade::Phase::kPresent;
  if (is_silent || echo.since_answered > kAftermath) {
    has_lost_press_ = true;  // without its force nobody knows what energy a press has stored
  } else if (physics.interaction != nullptr && !turn.is_in_contact) {
    has_lost_press_ = false;
  }
  if (has_lost_press_ || physics.is_late || echo.has_gap || 2 * echo.since_answered > 3 * period_) {
    disturbed_ = turn.device_sampled_at;
  }
  if (!disturbed_ || turn.device_sampled_at - *disturbed_ > kAftermath) return;
  if (turn.is_in_contact) ++counters_.disturbed_contact_ticks;
  if (turn.is_clamped) ++counters_.disturbed_clamped_ticks;
}

void MofcNode::count_grip(GripState grip) noexcept {
  const GripState before = std::exchange(grip_, grip);
  if (grip == before) return;
  if (is_holding(grip) && !is_holding(before)) ++counters_.grips;
  if (grip == GripState::kTorn) ++counters_.grips_torn;
  if (grip == GripState::kSlipped) ++counters_.grips_slipped;
  if (is_pierced(grip) && !is_pierced(before)) ++counters_.punctures;
}

}  // namespace palpate::mofc
