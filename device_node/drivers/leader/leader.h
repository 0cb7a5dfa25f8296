// SPDX-License-Identifier: Apache-2.0
/// @file
/// leader.h — a motorised leader arm on whatever bus: angles of its joints, torques of its motors,
/// limp at the first doubt. Buses: dynamixel_leader.h, damiao_leader.h. Never run on hardware:
/// tested against the emulators of device_node/emulators.
///
/// Standard library only. Torques are *on the hand*: what the motors do to it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace palpate::device {

/// More joints has no leader.
inline constexpr std::size_t kMostLeaderJoints = 8;
/// One number per joint; those beyond the last joint are 0.
using LeaderValues = std::array<double, kMostLeaderJoints>;

/// One motor and the joint that it drives: q = sign · p / gear + offset, with p the position of the
/// motor's shaft, behind its own gears (a servo's horn).
struct LeaderJoint {
  int id = 1;               ///< of the motor on its bus
  double sign = 1.0;        ///< 1 or −1
  double offset_rad = 0.0;  ///< q where the motor says 0, within one turn
  double gear = 1.0;        ///< > 0: turns of the shaft per turn of the joint
  /// The joint's own range, less than a turn of the shaft: which turn an angle belongs to follows
  /// from it. An angle beyond it is a fault.
  double lowest_rad = -1.5;
  double highest_rad = 1.5;        ///< > lowest_rad
  double fastest_rad_per_s = 6.0;  ///< > 0: the hand is never faster (v_max of the clamp)
  double play_rad = 0.0;           ///< ≥ 0: between the motor and the encoder, end to end
};

/// What the loop may take, on any bus.
struct LeaderSettings {
  std::string port;               ///< of the bus
  double answer_limit_s = 0.010;  ///< > 0: for each answer, beside the time of its bytes
  /// From an angle's sampling in the motor to the torque that answers it, of which a part is left
  /// to the motor. A write that comes later is told by LeaderReading::is_known.
  double longest_delay_s = 0.006;
  double longest_cycle_s = 0.020;  ///< > 0: from one write to the next; a longer one is limp
};

/// What made the arm limp.
enum class LeaderFault : std::uint8_t {
  kNone,
  kClosed,         ///< the port is gone
  kNoAnswer,       ///< a motor does not answer, twice
  kCorrupt,        ///< what comes is no answer, twice
  kServoError,     ///< a motor refuses an instruction, or loses it
  kHardwareError,  ///< overload, heat, voltage, encoder: the motor says which
  kTorqueOff,      ///< a motor has no torque, and nobody here has switched it off
  kRebooted,       ///< a motor has forgotten its watchdog
  kWatchdogFired,  ///< the motors heard nothing for the time of their watchdog
  kNoWatchdog,     ///< a motor does not keep its watchdog, or does not end its torque by it
  kStale,          ///< a motor repeats a status
  kWrapped,        ///< an angle is off by whole turns
  kJumped,         ///< an angle that no hand can have reached
  kOutOfRange,     ///< an angle beyond the joint's range
  kBusDown,        ///< the interface of the bus is down, or off the bus after errors
  kBusFull,        ///< what is sent does not leave: nobody acknowledges it
};

/// One reading of all joints.
struct LeaderReading {
  LeaderValues position_rad{};        ///< angles of the joints, without jumps
  LeaderValues velocity_rad_per_s{};  ///< as the motors say; the clamp does not need it
  LeaderValues torque_newton_m{};     ///< as the motors say, by what they measure of their currents
  /// ≥ the time since the switch to the last torques, up to the switch that this reading is for:
  /// the elapsed time of the clamp's step.
  double elapsed_s = 0.0;
  /// The last torques that were written acted all that time; false: the clamp is told of a gap.
  bool is_known = false;
  std::uint64_t repeated = 0;  ///< reads so far that were answered the second time only
};

class LeaderArm;

/// Limp when it is made, limp after the first fault, limp when it is destroyed. A fault is the end
/// of the object: remove the cause and make a new one. One thread. read() and write() neither
/// allocate nor throw, and end within 2 · answer_limit_s and the time of the bytes; those that find
/// a fault also ask each motor once.
class Leader {
 public:
  ~Leader();
  Leader(const Leader&) = delete;
  Leader& operator=(const Leader&) = delete;

  /// The person holds the arm: the watchdogs first, then the torque, with none requested. From now
  /// on the watchdog counts.
  /// @return false: limp, fault() says why
  [[nodiscard]] bool enable() noexcept;
  /// Reads every joint; also without torque.
  /// @return false: limp, fault() says why, the reading is not to be used
  [[nodiscard]] bool read(LeaderReading& reading) noexcept;
  /// Sends these torques, rounded towards 0 and cut off at the limits. A torque that is not finite
  /// is 0. Nothing acts unless enable() was called.
  /// @param torque_newton_m  on the hand   @param made_newton_m  receives what they become
  /// @return false: limp, fault() says why
  [[nodiscard]] bool write(const LeaderValues& torque_newton_m,
                           LeaderValues& made_newton_m) noexcept;
  /// No torque, then the motors off. The object can still read.
  void release() noexcept;

  /// Whether the motors have torque.
  [[nodiscard]] bool is_enabled() const noexcept;
  /// What made it limp; the first one.
  [[nodiscard]] LeaderFault fault() const noexcept;
  /// Which joint it was; count(): the line or all of them.
  [[nodiscard]] std::size_t fault_joint() const noexcept;
  /// One line for a person; empty without a fault. Allocates.
  [[nodiscard]] std::string fault_text() const;

  /// How many joints there are.
  [[nodiscard]] std::size_t count() const noexcept;
  /// The longest time for which a torque acts once it is written, whatever becomes of the program:
  /// the lease_s of the clamp. A cycle, the delay, and the watchdog with its doubt.
  [[nodiscard]] double lease_s() const noexcept;
  /// The resolution of the clamp's port: that of the encoder, the play, and how far the hand moves
  /// in longest_delay_s to either side.
  [[nodiscard]] double resolution_rad(std::size_t joint) const noexcept;
  /// What the limit makes, at the joint.
  [[nodiscard]] double largest_torque_newton_m(std::size_t joint) const noexcept;
  /// The model of each motor, its firmware, and what was assumed of it; one line a joint.
  [[nodiscard]] std::string description() const;

 protected:
  /// @param arm  set up
  explicit Leader(std::unique_ptr<LeaderArm> arm);

 private:
  std::unique_ptr<LeaderArm> arm_;
};

}  // namespace palpate::device
