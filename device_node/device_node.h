// device_node.h — the tick that owns the motors.
//
//   out  hop 1  DeviceState   device → mofc     every tick
//   in   hop 4  ForceCommand  mofc → device     answers that DeviceState, within the tick
//   out  hop 5  DeviceTick    device → viewers  every tick, through a sink
//
// No answer by the deadline: the earlier command while its lease runs, then the fallback and the
// fade of force_guard.h. Answers to another tick are dropped, so is an answer read after the
// deadline: no force begins to act later than `reply` after the reading it answers.
// Fault — no reading, one that is not finite or that only a hand faster than v_fault could have
// made, motors that refuse: latched. Motors released, nothing sent; the tick goes on reading and
// leaves its records until reset_fault().
// Thread: everything runs on the caller's thread. step() does not allocate, lock, log or throw; it
// waits for the answer, up to `reply`.
#pragma once

#include <cstdint>

#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/session/device_config.h"
#include "common/telemetry/device_telemetry.h"
#include "common/core/tick_schedule.h"
#include "common/core/workspace_map.h"
#include "device_node/applied_forces.h"
#include "device_node/device.h"
#include "device_node/force_guard.h"

namespace palpate::device {

class DeviceNode {
 public:
  /// All references must outlive the node. @param session_id  random per process start, not 0
  DeviceNode(const DeviceConfig& config, HapticDevice& device, const Clock& clock,
             Sender<DeviceState>& state_out, Inbox<ForceCommand>& force_in,
             TickSink<DeviceTick>& ticks_out, std::uint64_t session_id);
  ~DeviceNode() { stop(); }
  DeviceNode(const DeviceNode&) = delete;
  DeviceNode& operator=(const DeviceNode&) = delete;

  /// One tick: read, send, wait, switch, record.
  void step(const Tick& tick) noexcept;

  /// Motors limp, at once. A later step() begins with a limp start.
  void stop() noexcept { release_motors(); }

  [[nodiscard]] bool has_fault() const noexcept { return fault_ != FaultReason::kNone; }
  /// Lets a device that failed be tried again, from wherever it now is, with a limp start. Without
  /// a fault nothing happens.
  void reset_fault() noexcept;

  [[nodiscard]] DeviceCounters counters() const noexcept;

 private:
  void note_appointment(const Tick& tick) noexcept;
  [[nodiscard]] FaultReason exchange(DeviceTick& record) noexcept;
  void look_on(DeviceTick& record) noexcept;
  [[nodiscard]] FaultReason judge(const DeviceSample& sample) noexcept;
  [[nodiscard]] DeviceState make_state(const DeviceSample& sample, std::uint64_t sequence) noexcept;
  [[nodiscard]] const Received<ForceCommand>* wait_for_answer(const DeviceState& state,
                                                              TimePoint deadline) noexcept;
  void note_last_reading(DeviceTick& record) const noexcept;
  void note_true_state(DeviceTick& record) noexcept;
  void count(const DeviceTick& record) noexcept;
  void latch(FaultReason reason, DeviceTick& record) noexcept;
  void release_motors() noexcept;

  DeviceConfig config_;
  HapticDevice& device_;
  const Clock& clock_;
  Sender<DeviceState>& state_out_;
  Inbox<ForceCommand>& force_in_;
  TickSink<DeviceTick>& ticks_out_;
  std::uint64_t session_id_;

  WorkspaceMap workspace_;
  ForceGuard guard_;
  AppliedForces applied_;
  double rounding_m_;  // by which the distance of two readings may be too large
  std::uint64_t sequence_ = 0;
  std::uint64_t next_index_ = 0;
  FaultReason fault_ = FaultReason::kNone;
  Vector3 last_position_m_ = Vector3::Zero();  // of the last finite reading
  Quaternion last_orientation_ = Quaternion::Identity();
  TimePoint last_reading_at_{};
  bool has_reading_ = false;  // since the start or the last reset
  DeviceCounters counters_;
};

}  // namespace palpate::device
