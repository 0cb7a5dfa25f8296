// SPDX-License-Identifier: Apache-2.0
// device_telemetry.h — one record per tick of device_node, and its counters since the start. A
// simulated device's true state is in the record: only device_node fills it, only viewers read it.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/telemetry/loop_counters.h"

namespace palpate {

/// What the motors may do.
enum class GuardState : std::uint8_t {
  kLimp = 0,      ///< zero force: no command yet, or silence longer than limp_after + fade; a
                  ///< small push while the motors are checked
  kAnswered = 1,  ///< the command that answers this tick
  kLeased = 2,    ///< the previous command, within its lease
  kFallback = 3,  ///< at most the device's own Coulomb friction
  kFading = 4,    ///< fallback, fading to zero
  kFault = 5,     ///< zero force: a fault is latched until it is reset
};
[[nodiscard]] const char* name(GuardState state);

/// How far a device is on its way to a force.
enum class DevicePhase : std::uint8_t {
  kUnknown = 0,     ///< of a recording that does not tell
  kClosed = 1,      ///< no connection
  kConnected = 2,   ///< it answers, but its positions cannot be relied on: no force
  kCalibrated = 3,  ///< its positions are true; a person has not acknowledged that: no force
  kEnabled = 4,     ///< forces act
  kFaulted = 5,     ///< a fault is latched: motors released
  kChecking = 6,    ///< acknowledged: the motors push a little, to see whether they do it right
};
[[nodiscard]] const char* name(DevicePhase phase);
/// Whether an acknowledgement by a person would change it, of a real device.
[[nodiscard]] constexpr bool waits_for_acknowledgement(DevicePhase phase) {
  return phase == DevicePhase::kConnected || phase == DevicePhase::kCalibrated ||
         phase == DevicePhase::kFaulted;
}

/// Why device_node latched a fault.
enum class FaultReason : std::uint8_t {
  kNone = 0,
  kReadFailed = 1,         ///< the device returned no reading
  kReadingNotFinite = 2,   ///< the reading contained NaN or infinity
  kPositionJumped = 3,     ///< two readings further apart than v_fault allows
  kWriteFailed = 4,        ///< the device did not accept the force
  kDeviceSilent = 5,       ///< no answer of the device in time
  kDeviceGone = 6,         ///< unplugged, or the program that owns it ended
  kDeviceCorrupt = 7,      ///< the answer broke the rules of the device's wire
  kDeviceNotReady = 8,     ///< it lost its supply or its calibration
  kSuspended = 9,          ///< the machine slept: what acted meanwhile is not known
  kPositionFrozen = 10,    ///< readings repeated exactly while the hand moved, or was pushed
  kMotorsWrongWay = 11,    ///< the check of the motors: reversed, or along another axis
  kMotorsTooStrong = 12,   ///< the check of the motors: at least 1.5 times as strong as told
  kMotorsNotSeen = 13,     ///< the check of the motors: the readings do not follow the push
  kCheckInterrupted = 14,  ///< the check of the motors: it paused again and again
  kAccountWrong = 15,      ///< the monitor's account says more than the hand can have put in
  kMotorsDiffer = 16,      ///< the forces that the device measures are not those commanded
};
[[nodiscard]] const char* name(FaultReason reason);

/// Forces in one tick: the earlier one to the end of its lease, nothing, and what device_node
/// switches to, up to three times.
inline constexpr std::size_t kMaxActedForces = 8;

/// One device tick, the device's part of row k of the CSV.
struct DeviceTick {
  std::uint64_t sequence = 0;  ///< of the DeviceState; in kFault none is sent
  TimePoint sampled_at{};      ///< t_k, device's clock
  TimePoint switched_at{};     ///< when this tick's force began to act
  Duration lateness{};         ///< start of the tick after its scheduled time
  Duration reply_time{};       ///< from sending to the answer; undefined unless answered
  Vector3 measured_hand_position_m = Vector3::Zero();  ///< D; last finite reading
  Vector3 measured_tool_position_world_m = Vector3::Zero();
  Quaternion measured_tool_orientation_world = Quaternion::Identity();  ///< W from T; likewise
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< D, acting from switched_at on
  /// Likewise, per joint of the wrist; NaN without one.
  Vector3 wrist_torque_newton_m = Vector3::Constant(kNaN);
  /// What acted from the instant of the previous record until t_k, in order of time, without gaps:
  /// each lease that ended is the end of one of them. None in the first record, and in recordings
  /// of versions that did not keep them.
  std::array<AppliedForce, kMaxActedForces> acted{};
  std::uint32_t acted_count = 0;
  GuardState guard = GuardState::kLimp;
  bool is_answered = false;         ///< within this tick's deadline
  bool is_peak_limited = false;     ///< reduced by the device's peak or slew limit
  bool is_monitor_reduced = false;  ///< force or lease reduced by the monitor of the energy
  bool is_clutched = false;
  std::uint32_t buttons = 0;  ///< bit i is set while button i is held

  /// Simulated devices only; NaN otherwise. The controller never sees these.
  Vector3 true_tool_position_world_m = Vector3::Constant(kNaN);
  Vector3 true_tool_velocity_world_m_per_s = Vector3::Constant(kNaN);
  double true_energy_joule = kNaN;                         ///< docs/theory.md §1, at t_k
  double minimum_true_energy_joule = kNaN;                 ///< over all inner steps so far
  Vector3 true_wrist_angle_rad = Vector3::Constant(kNaN);  ///< per joint
  Vector3 true_wrist_velocity_rad_per_s = Vector3::Constant(kNaN);

  /// The device has one.
  [[nodiscard]] bool has_wrist() const noexcept { return !wrist_torque_newton_m.hasNaN(); }

  /// It does not act after all.
  void clear_force() noexcept {
    force_on_hand_newton.setZero();
    if (has_wrist()) wrist_torque_newton_m.setZero();
    is_peak_limited = false;
  }
};

/// Of DeviceCounters::has_no_motor_watchdog, for people.
[[nodiscard]] constexpr const char* no_watchdog_text(bool is_accepted) {
  return is_accepted ? "none, accepted: the guarantee is not available while the process is stopped"
                     : "none: forces stay within the dry friction; device { accept: "
                       "NO_MOTOR_WATCHDOG } allows more";
}

/// Of DeviceCounters::is_release_unconfirmed, for people.
inline constexpr const char* kReleaseUnconfirmedText =
    "the motors may still push: take the hand off, switch off their supply";

struct DeviceCounters {
  LoopCounters loop;
  std::uint64_t longest_skip_ticks = 0;  ///< skipped at a stretch, at most
  LinkCounters force_command;
  std::uint64_t answered_ticks = 0;
  std::uint64_t leased_ticks = 0;
  std::uint64_t fallback_ticks = 0;  ///< fallback or fading
  std::uint64_t limp_ticks = 0;
  std::uint64_t start_up_ticks = 0;  ///< of these: before the first answer
  std::uint64_t peak_limited_ticks = 0;
  std::uint64_t fault_ticks = 0;    ///< while a fault was latched
  std::uint64_t device_faults = 0;  ///< latched so far
  std::uint64_t fault_resets = 0;
  FaultReason last_fault = FaultReason::kNone;  ///< kept after the reset
  std::uint64_t non_finite_commands = 0;        ///< rejected answers with NaN or infinity
  /// Answers that began to act after the deadline although they were accepted before it: withdrawn
  /// at once.
  std::uint64_t late_switches = 0;
  bool is_monitor_off = false;
  std::uint64_t monitor_reductions = 0;  ///< commands that the monitor reduced, force or lease
  /// Answers of a clamp that counts on more energy than the hand can have put in.
  std::uint64_t ledger_excesses = 0;
  std::uint64_t too_fast_readings = 0;  ///< certainly faster than the monitor's v_max
  std::uint64_t coarse_readings = 0;    ///< steps of an encoder coarser than the profile says
  /// Beyond the workspace, of motors that hold currents: there nothing bounds what those do.
  std::uint64_t outside_readings = 0;
  /// Readings with the stamp of the reading of the tick before: the driver had no newer one.
  std::uint64_t repeated_readings = 0;
  /// Friction found by the hands-off check, as a share of the session's profile: 1 where the
  /// profile holds, less where it was lowered; 0: no check.
  double checked_friction_ratio = 0.0;
  /// By the check of the motors: as strong as told, times this, at least; 0: not known.
  double checked_motor_gain = 0.0;
  /// The motors do not end a force by themselves: while this process is stopped the force goes on,
  /// and the guarantee is not available.
  bool has_no_motor_watchdog = false;
  bool accepts_no_motor_watchdog = false;  ///< by the session: forces above f_co all the same
  std::uint64_t dead_man_ticks = 0;  ///< without force because the dead-man button was not held
  /// Without force because the readings stood still although it pushed.
  std::uint64_t frozen_ticks = 0;
  /// Without force after the first answer: the device waited for its connection or calibration;
  /// for a person's acknowledgement, the dead-man button being held if there is one; its motors
  /// were checked.
  std::uint64_t uncalibrated_ticks = 0;
  std::uint64_t unacknowledged_ticks = 0;
  std::uint64_t checking_ticks = 0;
  DevicePhase phase = DevicePhase::kUnknown;
  std::uint64_t page_acknowledgements = 0;          ///< by a person at a page
  std::uint64_t page_acknowledgements_refused = 0;  ///< the device was not as the page had shown
  /// The device has not confirmed the last release: its motors may still push.
  bool is_release_unconfirmed = false;
  double max_force_newton = 0.0;
  double largest_jump_newton = 0.0;  ///< change of the force from one tick to the next, its norm
  double minimum_true_energy_joule = kNaN;
};

/// What a person at a page saw of a device that waits for an acknowledgement.
struct SeenDevice {
  DevicePhase phase = DevicePhase::kUnknown;
  std::uint64_t device_faults = 0;  ///< DeviceCounters::device_faults
};

/// Hop 9: that person acknowledges it.
struct Acknowledgement {
  Header header;                        ///< viewer_node's
  std::uint64_t device_session_id = 0;  ///< of the device_node that was seen; not 0
  SeenDevice seen;
};

}  // namespace palpate
