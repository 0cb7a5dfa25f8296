// SPDX-License-Identifier: Apache-2.0
// device_node.h — the tick that owns the motors.
//
//   out  hop 1  DeviceState   device → mofc     every tick
//   in   hop 4  ForceCommand  mofc → device     answers that DeviceState, within the tick
//   out  hop 5  DeviceTick    device → viewers  every tick, through a sink
//
// No answer by the deadline: the earlier command continues while its lease runs to the next
// reading, then the fallback and the fade of force_guard.h apply. Where the lease ends while the
// node waits, it lets go at that instant, with a reading, and goes on waiting. Answers to another
// tick are dropped, and so is an answer read after the deadline; an answer to a state that was
// never sent is counted besides. If the process is preempted between that check and the switch, the
// stamp of the switch shows that the answer began to act too late: the motors are released at once,
// the echo reports what acted, and the switch is counted. So no answer acts that began later than
// `reply` after the reading it answers, except until the release takes effect. While the switches
// of a device take longer than `reply`, five in a row, no answer acts. Every force passes the
// monitor before it is applied: force_monitor.h reduces what the energy that the hand has put in
// does not cover, whoever commanded it. Fault: no reading; a reading that is not finite, or that
// only a hand faster than v_fault could have made; motors that refuse a force. Where the session
// has a dead-man button, an answer acts only while it is held; the tick that reads it released ends
// the force at once. A fault is latched: the motors are released, in every tick until the device
// confirms it, and nothing is sent. The node keeps reading and leaves records until acknowledge().
// A real device gives no force before a person has acknowledged it, after the start and after each
// fault, and before motor_check.h has pushed it a little and seen that it gives way. Nothing is
// sent while it pushes, and the accounts begin anew after it: the promise about energy is one from
// then on. While it is not calibrated, nothing is sent either. Readings of a real device that stand
// still although a force acts end the force until they differ: frozen_watch.h. Measured forces that
// are not those that the accounts count are a fault: measured_work.h. Thread: everything runs on
// the caller's thread. step() does not allocate, lock, log or throw; it waits up to `reply` for the
// answer. Only where a fault has cost the connection to motors that have not confirmed their
// release, step() opens it again, twice a second, which may allocate.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/core/tick_schedule.h"
#include "common/core/workspace_map.h"
#include "common/session/device_config.h"
#include "common/telemetry/device_telemetry.h"
#include "device_node/applied_forces.h"
#include "device_node/device.h"
#include "device_node/force_guard.h"
#include "device_node/journal.h"
#include "device_node/monitor/assumption_watch.h"
#include "device_node/monitor/force_monitor.h"
#include "device_node/monitor/frozen_watch.h"
#include "device_node/monitor/measured_work.h"
#include "device_node/monitor/reading_judge.h"
#include "device_node/motor_check.h"
#include "device_node/reading_observer.h"

namespace palpate::device {

/// The largest force that the session and the device allow [N]: f_co / held_force_ratio where the
/// motors end no force by themselves, unless the session accepts that and something bounds how
/// their force turns.
[[nodiscard]] double largest_force_newton(const DeviceConfig& config,
                                          const DeviceSpecification& specification) noexcept;

/// The same with no more torque than f_co of each joint where the motors end none by themselves.
[[nodiscard]] DeviceConfig with_torque_limit(DeviceConfig config,
                                             const DeviceSpecification& specification);

/// What holds the force of motors that end none by themselves to the friction.
struct FrictionLimit {
  double newton = 0.0;             ///< at most, by the session's peak force too
  bool is_below_friction = false;  ///< because of what held currents can be elsewhere
  std::string why;                 ///< for people
  std::string remedy;              ///< likewise; empty: the limit is as it should be
};
/// @param driver  its name in sessions
/// @return        nothing with a motor watchdog, or where the session accepts that there is none
///                and it can
[[nodiscard]] std::optional<FrictionLimit> friction_limit(const DeviceConfig& config,
                                                          const DeviceSpecification& specification,
                                                          const std::string& driver);

/// @throws SetupError  a real device without the monitor, unless `is_unsafe`
void refuse_unmonitored(const DeviceConfig& config, const DeviceSpecification& specification,
                        bool is_unsafe);

/// @throws SetupError  the session's dead-man button is none of the device's
void refuse_missing_button(const DeviceConfig& config, const DeviceSpecification& specification);

/// @throws SetupError  the friction of the profile is more than kMostFriction_ratio of the peak
/// force
void refuse_unlikely_friction(const DeviceConfig& config, const DeviceSpecification& specification);
/// @throws SetupError  the profile claims a finer resolution than the device says it has
void refuse_finer_resolution(const DeviceConfig& config, const DeviceSpecification& specification);
/// Forces up to f_co need neither a motor watchdog nor a check of the motors: so a friction that is
/// none would open the way for a force that nobody checked.
inline constexpr double kMostFriction_ratio = 0.25;

class DeviceNode {
 public:
  /// All references must outlive the node.
  /// @param session_id  random per process start, not 0
  /// @param observer    may be null
  /// @param journal     receives what decides about faults; may be null
  DeviceNode(const DeviceConfig& config, HapticDevice& device, const Clock& clock,
             Sender<DeviceState>& state_out, Inbox<ForceCommand>& force_in,
             TickSink<DeviceTick>& ticks_out, std::uint64_t session_id,
             ReadingObserver* observer = nullptr, Journal* journal = nullptr);
  ~DeviceNode() { static_cast<void>(stop()); }
  DeviceNode(const DeviceNode&) = delete;
  DeviceNode& operator=(const DeviceNode&) = delete;

  /// One tick: read, send, wait, switch, record.
  void step(const Tick& tick) noexcept;

  /// Motors limp, at once. A later step() starts limp.
  /// @return  whether the device confirmed it; call it again otherwise
  [[nodiscard]] bool stop() noexcept {
    release_motors();
    return is_released_;
  }

  [[nodiscard]] bool has_fault() const noexcept { return fault_ != FaultReason::kNone; }
  [[nodiscard]] DevicePhase phase() const noexcept;
  /// A person says that the device may go on, one step at a time: a latched fault is cleared, if
  /// the motors confirm their release, or can only be silent until they are calibrated; a device
  /// that is not calibrated takes its calibration, which the person has made possible
  /// (DeviceSpecification::calibration); a calibrated one is enabled.
  /// The next step() takes the device from where it is, with a limp start. Where a fault leaves the
  /// device calibrated, and where it is simulated, the same call enables it. A real device whose
  /// force may exceed f_co has its motors checked first, in the following ticks: kChecking.
  void acknowledge() noexcept;
  /// The same, by a person who saw the device at a distance: only while it is still as seen. Else,
  /// and where it waits for nothing, the acknowledgement is refused and counted.
  void acknowledge(const SeenDevice& seen) noexcept;

  /// Acknowledgements that changed nothing: the fault stays, or the calibration was not taken.
  [[nodiscard]] std::uint64_t vain_acknowledgements() const noexcept {
    return vain_acknowledgements_;
  }

  /// The machine slept for so long, which the clock did not count: a fault of the next step().
  void suspended(Duration slept) noexcept { slept_ += slept; }

  /// The result of a hands-off check, for the counters.
  void report_checked_friction(double ratio) noexcept { counters_.checked_friction_ratio = ratio; }

  [[nodiscard]] DeviceCounters counters() const noexcept;
  /// M of the monitor at the last reading [J].
  [[nodiscard]] double monitor_joule() const noexcept { return monitor_.joule(); }

 private:
  void count_appointment(const Tick& tick) noexcept;
  [[nodiscard]] FaultReason exchange(TimePoint next_reading, DeviceTick& record) noexcept;
  [[nodiscard]] FaultReason switch_to(const GuardedForce& commanded, TimePoint deadline,
                                      DeviceTick& record) noexcept;
  [[nodiscard]] GuardedForce monitored(const GuardedForce& guarded, DeviceTick& record) noexcept;
  [[nodiscard]] FaultReason withdraw_late_answer(DeviceTick& record) noexcept;
  [[nodiscard]] bool may_push(const DeviceSample& sample) noexcept;
  [[nodiscard]] FaultReason check_motors(const DeviceSample& sample, bool may_push_now,
                                         TimePoint deadline, DeviceTick& record) noexcept;
  [[nodiscard]] bool reset_fault() noexcept;
  [[nodiscard]] bool calibrate_or_enable() noexcept;
  void begin_anew() noexcept;
  [[nodiscard]] double motor_limit_newton() const noexcept;
  [[nodiscard]] bool has_motor_check() const noexcept;
  void record_without_exchange(DeviceTick& record) noexcept;
  void record_unsent(DeviceTick& record) noexcept;
  /// Of the last failure of the device. @param otherwise  where the driver knows no more than that
  [[nodiscard]] FaultReason reason_of_last(FaultReason otherwise) const noexcept;
  [[nodiscard]] FaultReason judge(const DeviceSample& sample) noexcept;
  [[nodiscard]] FaultReason judge_with_latched(const DeviceSample& sample) noexcept;
  [[nodiscard]] const DeviceState& make_state(const DeviceSample& sample,
                                              std::uint64_t sequence) noexcept;
  [[nodiscard]] const Received<ForceCommand>* wait_for_answer(std::uint64_t sequence,
                                                              TimePoint until) noexcept;
  void restart_frozen() noexcept;
  void note(const JournalEntry& entry) noexcept;
  void note_state(TimePoint now) noexcept;
  void record_last_reading(DeviceTick& record) const noexcept;
  void record_acted(DeviceTick& record) noexcept;
  void follow_applied(const DeviceSample& sample, const ReadingDetails& details) noexcept;
  [[nodiscard]] ReadingDetails details_of(const DeviceSample& sample) const noexcept;
  void notify_observer(DeviceTick& record) noexcept;
  void count(const DeviceTick& record) noexcept;
  void count_waiting(const DeviceTick& record) noexcept;
  void count_force(const Vector3& force_newton) noexcept;
  void latch(FaultReason reason, DeviceTick& record) noexcept;
  void release_motors() noexcept;
  bool release_once() noexcept;
  void release_again() noexcept;

  DeviceConfig config_;
  HapticDevice& device_;
  const Clock& clock_;
  Sender<DeviceState>& state_out_;
  Inbox<ForceCommand>& force_in_;
  TickSink<DeviceTick>& ticks_out_;
  std::uint64_t session_id_;
  ReadingObserver* observer_;
  Journal* journal_;

  WorkspaceMap workspace_;
  ForceGuard guard_;
  JournaledMonitor monitor_;
  AssumptionWatch watch_;
  FrozenWatch frozen_;
  MeasuredWork measured_;
  MotorCheck motor_check_;
  AppliedForces applied_;
  ReadingJudge judge_;
  DeviceState state_{};  // of this tick; kilobytes, so it is not made anew
  std::uint64_t sequence_ = 0;
  std::uint64_t next_index_ = 0;
  FaultReason fault_ = FaultReason::kNone;
  Quaternion last_orientation_ = Quaternion::Identity();
  std::optional<TimePoint> recorded_until_;  // what acted, by the records
  int slow_switches_ = 0;                    // in a row
  bool is_acknowledged_;                     // by a person, since the start or the last fault
  bool was_let_go_ = false;                  // the dead-man button, since then
  bool must_check_motors_;                   // before a force, since the start or the last fault
  bool is_unbooked_ = false;                 // the check's own force, which no account counts
  bool is_released_ = true;                  // the device confirmed the last release
  Duration slept_{};                         // since the last step
  TimePoint reopens_at_{};                   // next attempt to reach a lost device
  Vector3 counted_force_newton_ = Vector3::Zero();  // of the last tick
  std::uint64_t vain_acknowledgements_ = 0;
  DeviceCounters counters_;
};

}  // namespace palpate::device
