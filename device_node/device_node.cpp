// SPDX-License-Identifier: Apache-2.0
#include "device_node/device_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>

namespace palpate::device {

namespace {

/// So many switches in a row, each of which took longer than an answer may: the device is slow.
constexpr int kSlowSwitches = 5;
constexpr int kFirstReleases = 5;

}  // namespace

DeviceNode::DeviceNode(const DeviceConfig& config, HapticDevice& device, const Clock& clock,
                       Sender<DeviceState>& state_out, Inbox<ForceCommand>& force_in,
                       TickSink<DeviceTick>& ticks_out, std::uint64_t session_id,
                       ReadingObserver* observer, Journal* journal)
    : config_(with_torque_limit(config, device.specification())),
      device_(device),
      clock_(clock),
      state_out_(state_out),
      force_in_(force_in),
      ticks_out_(ticks_out),
      session_id_(session_id),
      observer_(observer),
      journal_(journal),
      workspace_(config.workspace),
      guard_(config_, largest_force_newton(config, device.specification()),
             device.specification().has_motor_watchdog),
      monitor_(ForceMonitor(config,
                            {.are_by_themselves = device.specification().has_motor_watchdog,
                             .reach_m = 2.0 * device.specification().workspace_half_extent_m.norm(),
                             .held_ratio = device.specification().held_force_ratio,
                             .turning_per_m = std::isfinite(device.specification().turning_per_m)
                                                  ? device.specification().turning_per_m
                                                  : 0.0}),  // no force then
               journal,
               config_.wrist ? std::optional(ForceMonitor(wrist_as_axes(config_))) : std::nullopt),
      watch_(config, device.specification().bounded_reach_m()),
      frozen_(config),
      measured_(config),
      motor_check_({.rate_hz = config.rate_hz,
                    .profile = config.profile,
                    .force_axes = device.specification().force_axes,
                    .limit_newton = motor_limit_newton(),
                    .latency = config.latency}),
      applied_(device.specification().has_motor_watchdog),
      judge_(config.v_fault_m_per_s,
             std::sqrt(3.0) * std::max(config.profile.position_resolution_m,
                                       device.specification().position_resolution_m)),
      is_acknowledged_(device.specification().is_simulated),
      must_check_motors_(has_motor_check()) {
  if (device.specification().is_simulated) return;
  // an earlier process may have left a force
  for (int attempts = 0; attempts < kFirstReleases && !release_once(); ++attempts) {
  }
  // one that waits for its calibration may be silent until then
  is_released_ = is_released_ || device.phase() == DevicePhase::kConnected;
}

void DeviceNode::step(const Tick& tick) noexcept {
  count_appointment(tick);
  note_state(tick.now);
  DeviceTick record{.sequence = sequence_++,
                    .sampled_at = tick.now,
                    .switched_at = tick.now,
                    .lateness = tick.now - tick.scheduled_at};
  if (config_.wrist) record.wrist_torque_newton_m.setZero();

  const TimePoint next_reading = tick.scheduled_at + from_seconds(1.0 / config_.rate_hz);
  if (has_fault() || device_.phase() == DevicePhase::kConnected) {
    record_without_exchange(record);
  } else if (const FaultReason reason = exchange(next_reading, record);
             reason != FaultReason::kNone) {
    latch(reason, record);
  }
  slept_ = Duration::zero();
  // record: hop 5
  count(record);
  ticks_out_.keep(record);

  // the expected deadline of the next answer; the real one may be a little later
  force_in_.prepare_wait(next_reading + config_.reply);
}

/// The exchange of a tick; returns the reason if it failed.
FaultReason DeviceNode::exchange(TimePoint next_reading, DeviceTick& record) noexcept {
  // an earlier stop(), or a device that was calibrated and then did not confirm its release
  if (!is_released_) return reason_of_last(FaultReason::kWriteFailed);
  if (slept_ > Duration::zero()) {
    monitor_.slept(slept_);
    return FaultReason::kSuspended;
  }
  // read: t_k
  DeviceSample sample;
  if (!device_.read(sample)) return reason_of_last(FaultReason::kReadFailed);
  const FaultReason reading = judge_with_latched(sample);
  record.sampled_at = sample.sampled_at;
  if (recorded_until_ == sample.sampled_at) ++counters_.repeated_readings;
  if (reading == FaultReason::kPositionJumped && frozen_.is_frozen()) {
    return FaultReason::kPositionFrozen;  // it stood still until now
  }
  if (reading != FaultReason::kNone) return reading;
  const TimePoint deadline = sample.sampled_at + config_.reply;
  const bool may_push_now = may_push(sample);
  if (is_unbooked_ || (must_check_motors_ && may_push_now)) {
    return check_motors(sample, may_push_now, deadline, record);
  }
  const DeviceState& state = make_state(sample, record.sequence);
  // its check judges the motors by the positions
  if (must_check_motors_) {
    measured_.begin();
  } else if (!measured_.message(sample.hand_position_m, state.acting_force_on_hand_newton,
                                sample.measured_newton)) {
    return FaultReason::kMotorsDiffer;
  }
  if (config_.monitor.is_on && !monitor_.is_account_plausible()) return FaultReason::kAccountWrong;
  record.measured_hand_position_m = state.hand_position_m;
  record.measured_tool_position_world_m = state.tool_position_world_m;
  record.measured_tool_orientation_world = state.tool_orientation_world;
  record.is_clutched = state.is_clutched;
  record.buttons = state.buttons;
  record_acted(record);
  notify_observer(record);

  // send: hop 1. What has arrived by now cannot be an answer to it
  force_in_.newest();
  force_in_.reject_answers_newer_than(
      {session_id_, state.header.sequence, state.header.sampled_at});
  const TimePoint sent_at = clock_.now();
  state_out_.send(state);

  // wait: hop 4
  if (!device_.specification().is_simulated) {
    const bool is_plausible =
        frozen_.read(sample.sampled_at, sample.hand_position_m, counted_force_newton_);
    note({.kind = JournalKind::kFrozen,
          .at = sample.sampled_at,
          .position_m = sample.hand_position_m,
          .force_newton = counted_force_newton_,
          .is_good = is_plausible});
    if (!is_plausible) return FaultReason::kPositionFrozen;
  }
  if (must_check_motors_) motor_check_.begin();
  const bool has_consent = may_push_now && !frozen_.is_frozen();
  if (frozen_.is_frozen()) ++counters_.frozen_ticks;
  // whatever acts ends now, and what follows starts limp: no fallback either
  if (!has_consent) guard_.reset();
  if (!has_consent && applied_.lease_end() != TimePoint::max()) {
    const FaultReason reason = switch_to({.lease = config_.lease}, deadline, record);
    if (reason != FaultReason::kNone) return reason;
  }
  const Received<ForceCommand>* answer =
      wait_for_answer(record.sequence, std::min(deadline, applied_.lease_end()));
  if (answer == nullptr && clock_.now() < deadline) {
    // the lease ends while the answer may still come: lets go, with a reading
    const GuardedForce less = guard_.missed(clock_.now(), next_reading);
    if (less.is_switch) {
      const FaultReason reason = switch_to(less, deadline, record);
      if (reason != FaultReason::kNone) return reason;
    }
    answer = wait_for_answer(record.sequence, deadline);
  }
  const TimePoint now = clock_.now();
  const TimePoint due =
      answer != nullptr ? latest_beginning(answer->value, sample.sampled_at, deadline) : deadline;
  // a slow device counts as silence
  record.is_answered =
      answer != nullptr && now <= due && slow_switches_ < kSlowSwitches && has_consent;
  if (record.is_answered) {
    monitor_.begins_within(due - sample.sampled_at);
    record.reply_time = answer->received_at - sent_at;
    if (!monitor_.is_ledger_plausible(answer->value.counted_energy_joule))
      ++counters_.ledger_excesses;
  }

  // switch: to the command, or to less
  const GuardedForce guarded =
      record.is_answered ? guard_.answered(answer->value, now, applied_.acting_newton(now),
                                           applied_.acting_newton_m(now))
                         : guard_.missed(now, next_reading);
  record.switched_at = now;
  record.force_on_hand_newton = guarded.force_on_hand_newton;
  if (record.has_wrist()) record.wrist_torque_newton_m = guarded.wrist_torque_newton_m;
  record.guard = guarded.state;
  record.is_peak_limited = guarded.is_limited;
  return guarded.is_switch ? switch_to(guarded, due, record) : FaultReason::kNone;
}

FaultReason DeviceNode::switch_to(const GuardedForce& commanded, TimePoint deadline,
                                  DeviceTick& record) noexcept {
  GuardedForce guarded = monitored(commanded, record);
  DeviceSample at_switch;
  const TimePoint asked_at = clock_.now();
  device_.set_wrist_torque(guarded.wrist_torque_newton_m);
  const bool is_applied = device_.apply(guarded.force_on_hand_newton, guarded.lease, at_switch);
  const FaultReason reason =
      is_applied ? judge_with_latched(at_switch) : reason_of_last(FaultReason::kWriteFailed);
  if (reason != FaultReason::kNone) {
    if (!is_applied && !is_unbooked_) {
      monitor_.failed(guarded.force_on_hand_newton, guarded.wrist_torque_newton_m);
    }
    record.clear_force();
    return reason;
  }
  slow_switches_ = at_switch.sampled_at - asked_at > config_.reply ? slow_switches_ + 1 : 0;
  const Vector3 made_newton_m =
      at_switch.wrist ? at_switch.wrist->acting_torque_newton_m : guarded.wrist_torque_newton_m;
  if (at_switch.applied_force_newton != guarded.force_on_hand_newton ||
      made_newton_m != guarded.wrist_torque_newton_m) {
    // limited or quantised by the motors
    guarded.force_on_hand_newton = at_switch.applied_force_newton;
    guarded.wrist_torque_newton_m = made_newton_m;
    guard_.reduced(guarded);
    record.force_on_hand_newton = guarded.force_on_hand_newton;
    if (record.has_wrist()) record.wrist_torque_newton_m = made_newton_m;
  }
  applied_.switched(at_switch.sampled_at, at_switch.hand_position_m, guarded.force_on_hand_newton,
                    guarded.lease, at_switch.wrist);
  if (!is_unbooked_) {
    monitor_.switched(at_switch.sampled_at, at_switch.hand_position_m, guarded.force_on_hand_newton,
                      guarded.lease, details_of(at_switch), at_switch.wrist);
  }
  record.switched_at = at_switch.sampled_at;
  if (!must_check_motors_ &&
      !measured_.message(at_switch.hand_position_m, guarded.force_on_hand_newton,
                         at_switch.measured_newton)) {
    return FaultReason::kMotorsDiffer;
  }
  return record.is_answered && at_switch.sampled_at > deadline ? withdraw_late_answer(record)
                                                               : FaultReason::kNone;
}

/// What the monitor lets through of a force.
GuardedForce DeviceNode::monitored(const GuardedForce& guarded, DeviceTick& record) noexcept {
  if (!config_.monitor.is_on || is_unbooked_) return guarded;
  const auto covered =
      monitor_.cover(guarded.force_on_hand_newton, guarded.lease, guarded.wrist_torque_newton_m);
  if (!covered.is_reduced && covered.lease == guarded.lease) return guarded;
  GuardedForce less = guarded;
  less.force_on_hand_newton = covered.force_on_hand_newton;
  less.wrist_torque_newton_m = covered.torque_newton_m;
  less.lease = covered.lease;
  guard_.reduced(less);
  if (covered.is_reduced) ++counters_.monitor_reductions;
  record.is_monitor_reduced = covered.is_reduced;
  record.force_on_hand_newton = less.force_on_hand_newton;
  if (record.has_wrist()) record.wrist_torque_newton_m = less.wrist_torque_newton_m;
  return less;
}

/// The clamp paid in advance for the whole lease of the force that acted before the switch, and for
/// an answer that begins to act by the deadline. A later answer is not paid for.
FaultReason DeviceNode::withdraw_late_answer(DeviceTick& record) noexcept {
  const bool is_released = release_once();
  const TimePoint released_at = clock_.now();
  guard_.withdraw_answer();
  ++counters_.late_switches;
  count_force(record.force_on_hand_newton);
  record.switched_at = released_at;
  record.clear_force();
  record.guard = GuardState::kLimp;
  record.is_answered = false;
  return is_released ? FaultReason::kNone : reason_of_last(FaultReason::kWriteFailed);
}

/// A tick of a latched fault or without a calibration: only a reading, if there is one, for the
/// record.
void DeviceNode::record_without_exchange(DeviceTick& record) noexcept {
  if (!is_released_) release_again();
  DeviceSample sample;
  if (is_released_ && device_.phase() == DevicePhase::kCalibrated && device_.read(sample)) {
    static_cast<void>(judge(sample));
  }
  record.guard = has_fault() ? GuardState::kFault : GuardState::kLimp;
  record_unsent(record);
}

/// Of a tick that sends nothing: the last reading, and what acted until it.
void DeviceNode::record_unsent(DeviceTick& record) noexcept {
  record_last_reading(record);
  record.is_clutched = workspace_.is_clutched();
  record_acted(record);
  notify_observer(record);
}

/// Whether a hand can have made this reading after the last one.
FaultReason DeviceNode::judge(const DeviceSample& sample) noexcept {
  if (!sample.is_finite()) return FaultReason::kReadingNotFinite;
  const bool has_earlier = judge_.has_reading();
  const Duration late = sample.skew + config_.latency;
  const bool is_possible = judge_.read(sample.sampled_at, sample.hand_position_m, late);
  note({.kind = JournalKind::kJudge,
        .at = sample.sampled_at,
        .position_m = sample.hand_position_m,
        .lease = late,
        .is_good = is_possible});
  if (has_earlier) watch_.moved(judge_.moved_m(), judge_.elapsed());
  watch_.is_at(sample.hand_position_m);
  last_orientation_ = sample.orientation;
  return is_possible ? FaultReason::kNone : FaultReason::kPositionJumped;
}

/// judge(), after the position that the device latched as the last force ended by itself, if it
/// did.
FaultReason DeviceNode::judge_with_latched(const DeviceSample& sample) noexcept {
  DeviceSample latched;
  if (applied_.has_run_out(sample.sampled_at) && device_.take_latched(latched) &&
      latched.sampled_at >= judge_.read_at() && latched.sampled_at <= sample.sampled_at) {
    const FaultReason reason = judge(latched);
    if (reason != FaultReason::kNone) return reason;
    applied_.ran_out(latched.hand_position_m, latched.wrist);
    if (!is_unbooked_) monitor_.ended(latched.hand_position_m, latched.wrist);
  }
  return judge(sample);
}

void DeviceNode::count_appointment(const Tick& tick) noexcept {
  LoopCounters& loop = counters_.loop;
  if (loop.ticks > 0) {
    const std::uint64_t skipped = tick.index - next_index_;
    loop.skipped_ticks += skipped;
    counters_.longest_skip_ticks = std::max(counters_.longest_skip_ticks, skipped);
  }
  next_index_ = tick.index + 1;
  ++loop.ticks;
  loop.worst_lateness = std::max(loop.worst_lateness, tick.now - tick.scheduled_at);
}

const DeviceState& DeviceNode::make_state(const DeviceSample& sample,
                                          std::uint64_t sequence) noexcept {
  const auto& clutch = config_.workspace.clutch_button;
  workspace_.update(sample.hand_position_m,
                    clutch.has_value() && ((sample.buttons >> *clutch) & 1U) != 0);

  DeviceState& state = state_;
  state.header = {.session_id = session_id_, .sequence = sequence, .sampled_at = sample.sampled_at};
  state.hand_position_m = sample.hand_position_m;
  state.tool_position_world_m = workspace_.tool_position_world_m(sample.hand_position_m);
  state.tool_orientation_world = sample.orientation;
  state.buttons = sample.buttons;
  state.is_clutched = workspace_.is_clutched();
  state.wrist = sample.wrist;
  const ReadingDetails details = details_of(sample);
  follow_applied(sample, details);
  applied_.report_in(state);
  monitor_.read(sample.sampled_at, sample.hand_position_m, details, sample.wrist);
  if (config_.monitor.is_on) state.monitor_energy_joule = monitor_.coverable_joule();
  return state;
}

void DeviceNode::follow_applied(const DeviceSample& sample,
                                const ReadingDetails& details) noexcept {
  if (applied_.has_begun()) {
    applied_.read(sample.sampled_at, sample.hand_position_m, sample.wrist);
  } else {
    applied_.begin(sample.sampled_at);
  }
  if (details.acting_newton) applied_.acts_on(*details.acting_newton);
}

ReadingDetails DeviceNode::details_of(const DeviceSample& sample) const noexcept {
  ReadingDetails details{.skew = sample.skew + config_.latency,
                         .turning_joule = sample.turning_joule,
                         .turned_newton = sample.turned_newton};
  if (!device_.specification().has_motor_watchdog) {
    details.acting_newton = sample.applied_force_newton;
  }
  return details;
}

/// Every answer acknowledges what its state reported, even one that comes too late to act.
const Received<ForceCommand>* DeviceNode::wait_for_answer(std::uint64_t sequence,
                                                          TimePoint until) noexcept {
  for (;;) {
    const Received<ForceCommand>* newest = force_in_.newest();
    if (newest != nullptr && newest->value.answers_session_id == session_id_) {
      if (newest->value.answers_sampled_at <= judge_.read_at()) {
        applied_.acknowledged(newest->value.answers_sampled_at);
      }
      if (newest->value.answers_sequence == sequence) return newest;
    }
    if (clock_.now() >= until) return nullptr;
    force_in_.wait_until(until);
  }
}

void DeviceNode::note(const JournalEntry& entry) noexcept {
  if (journal_ == nullptr) return;
  JournalEntry noted = entry;
  noted.monitor_joule = monitor_.joule();
  journal_->keep(noted);
}

/// From which the entries that follow can be computed again.
void DeviceNode::note_state(TimePoint now) noexcept {
  if (journal_ == nullptr || !journal_->is_state_due(now)) return;
  journal_->keep(JournalState{.index = journal_->next_index(),
                              .at = now,
                              .monitor = monitor_.monitor(),
                              .frozen = frozen_,
                              .judge = judge_});
}

void DeviceNode::restart_frozen() noexcept {
  frozen_.begin();
  note({.kind = JournalKind::kBegin});
}

void DeviceNode::record_last_reading(DeviceTick& record) const noexcept {
  record.measured_hand_position_m = judge_.position_m();
  record.measured_tool_position_world_m = workspace_.tool_position_world_m(judge_.position_m());
  record.measured_tool_orientation_world = last_orientation_;
}

/// What acted since the previous record. The motors are released before the echo begins.
void DeviceNode::record_acted(DeviceTick& record) noexcept {
  if (recorded_until_ && record.sampled_at > *recorded_until_) {
    if (applied_.has_begun()) applied_.report_in(record, *recorded_until_, record.sampled_at);
    if (record.acted_count == 0) {
      record.acted[record.acted_count++] = {
          .from = *recorded_until_, .until = record.sampled_at, .has_position_at_end = false};
    }
  }
  recorded_until_ = record.sampled_at;
}

void DeviceNode::notify_observer(DeviceTick& record) noexcept {
  if (observer_ != nullptr) observer_->on_reading(workspace_, record);
}

void DeviceNode::count(const DeviceTick& record) noexcept {
  switch (record.guard) {
    case GuardState::kAnswered:
      ++counters_.answered_ticks;
      break;
    case GuardState::kLeased:
      ++counters_.leased_ticks;
      break;
    case GuardState::kFallback:
    case GuardState::kFading:
      ++counters_.fallback_ticks;
      break;
    case GuardState::kLimp:
      ++counters_.limp_ticks;
      if (counters_.answered_ticks == 0) ++counters_.start_up_ticks;
      break;
    case GuardState::kFault:
      ++counters_.fault_ticks;
      break;
  }
  if (counters_.answered_ticks > 0) count_waiting(record);
  if (record.is_peak_limited) ++counters_.peak_limited_ticks;
  count_force(record.force_on_hand_newton);
  counters_.minimum_true_energy_joule = record.minimum_true_energy_joule;
}

void DeviceNode::count_force(const Vector3& force_newton) noexcept {
  counters_.max_force_newton = std::max(counters_.max_force_newton, force_newton.norm());
  counters_.largest_jump_newton =
      std::max(counters_.largest_jump_newton, (force_newton - counted_force_newton_).norm());
  counted_force_newton_ = force_newton;
}

DeviceCounters DeviceNode::counters() const noexcept {
  DeviceCounters counters = counters_;
  counters.force_command = force_in_.counters();
  counters.non_finite_commands = guard_.non_finite_commands();
  counters.is_monitor_off = !config_.monitor.is_on;
  counters.phase = phase();
  counters.is_release_unconfirmed = !is_released_;
  counters.has_no_motor_watchdog = !device_.specification().has_motor_watchdog;
  counters.accepts_no_motor_watchdog = config_.accepts_no_motor_watchdog;
  counters.too_fast_readings = watch_.too_fast_readings();
  counters.coarse_readings = watch_.coarse_readings();
  counters.outside_readings = watch_.outside_readings();
  return counters;
}

}  // namespace palpate::device
