// SPDX-License-Identifier: Apache-2.0
/// @file
/// dynamixel_leader.h — a motorised leader arm on a Dynamixel bus (Protocol 2.0): angles of its
/// joints, torques of its motors, limp at the first doubt. Never run on hardware: tested against
/// the emulator of device_node/emulators.
///
/// Standard library only. Torques are *on the hand*: what the motors do to it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace palpate::device {

/// More joints has no leader.
inline constexpr std::size_t kMostLeaderJoints = 8;
/// One number per joint; those beyond the last joint are 0.
using LeaderValues = std::array<double, kMostLeaderJoints>;

/// One servo and the joint that it drives: q = sign · p / gear + offset, with p the position of the
/// servo's horn.
struct DynamixelJoint {
  int id = 1;               ///< 0 … 252, of the servo
  double sign = 1.0;        ///< 1 or −1
  double offset_rad = 0.0;  ///< q where the servo says 0
  double gear = 1.0;        ///< > 0: turns of the horn per turn of the joint
  /// > 0: torque of the horn per ampere that is commanded, measured. 0: what the manual's stall
  /// torque and current say of the model, which nobody has measured on yours.
  double torque_newton_m_per_ampere = 0.0;
  double current_limit_ampere = 0.0;  ///< > 0: no more is commanded
  /// The joint's own range, less than a turn of the horn: which turn an angle belongs to follows
  /// from it. An angle beyond it is a fault.
  double lowest_rad = -1.5;
  double highest_rad = 1.5;        ///< > lowest_rad
  double fastest_rad_per_s = 6.0;  ///< > 0: the hand is never faster (v_max of the clamp)
  double play_rad = 0.0;           ///< ≥ 0: between the motor and the encoder, end to end
};

/// The line, and what the loop may take.
struct DynamixelSettings {
  std::string port = "/dev/ttyUSB0";     ///< serial port
  unsigned bits_per_second = 1'000'000;  ///< of the bus
  /// 1 … 127: each servo ends its torque by itself so many times 20 ms after the last instruction.
  int watchdog_units = 1;
  double answer_limit_s = 0.010;  ///< > 0: for each answer, beside the time of its bytes
  /// > 0.003: from an angle's sampling in the servo to the current that answers it, of which 3 ms
  /// are left to the servo and USB. A write that comes later is told by LeaderReading::is_known.
  double longest_delay_s = 0.006;
  double longest_cycle_s = 0.020;  ///< > 0: from one write to the next; a longer one is limp
  /// Accepts that the operating mode and the return delay in the servos' EEPROM are changed.
  bool may_write_eeprom = false;
};

/// What made the arm limp.
enum class LeaderFault : std::uint8_t {
  kNone,
  kClosed,         ///< the serial port is gone
  kNoAnswer,       ///< a servo does not answer, twice
  kCorrupt,        ///< what comes is no answer, twice
  kServoError,     ///< a servo refuses an instruction
  kHardwareError,  ///< overload, heat, voltage, encoder: the servo says which
  kWrongMode,      ///< no current control, or a drive mode that is not supported
  kTorqueOff,      ///< a servo has no torque, and nobody here has switched it off
  kRebooted,       ///< a servo has forgotten its watchdog
  kWatchdogFired,  ///< the servos heard nothing for the time of their watchdog
  kStale,          ///< a servo repeats a status: its clock stands still
  kWrapped,        ///< an angle is off by whole turns
  kJumped,         ///< an angle that no hand can have reached
  kOutOfRange,     ///< an angle beyond the joint's range
};

/// One reading of all joints.
struct LeaderReading {
  LeaderValues position_rad{};        ///< angles of the joints, without jumps
  LeaderValues velocity_rad_per_s{};  ///< as the servos say; the clamp does not need it
  LeaderValues current_ampere{};      ///< present, as the servos say
  /// ≥ the time since the switch to the last torques, up to the switch that this reading is for:
  /// the elapsed time of the clamp's step.
  double elapsed_s = 0.0;
  /// The last torques that were written acted all that time; false: the clamp is told of a gap.
  bool is_known = false;
  std::uint64_t repeated = 0;  ///< reads so far that were answered the second time only
};

class DynamixelArm;

/// Limp when it is made, limp after the first fault, limp when it is destroyed. A fault is the end
/// of the object: remove the cause and make a new one. One thread. read() and write() neither
/// allocate nor throw, and end within 2 · answer_limit_s and the time of the bytes; those that find
/// a fault also ask each servo once.
class DynamixelLeader {
 public:
  /// Switches every torque off, then checks each servo's model, firmware and settings.
  /// @param joints  1 … kMostLeaderJoints   @param settings  the line
  /// @throws std::runtime_error  what is wrong, of which joint, and the remedy
  DynamixelLeader(std::span<const DynamixelJoint> joints, const DynamixelSettings& settings);
  ~DynamixelLeader();
  DynamixelLeader(const DynamixelLeader&) = delete;
  DynamixelLeader& operator=(const DynamixelLeader&) = delete;

  /// The person holds the arm: the watchdogs first, then the torque, with current 0. From now on
  /// the watchdog counts.
  /// @return false: limp, fault() says why
  [[nodiscard]] bool enable() noexcept;
  /// Reads every joint; also without torque.
  /// @return false: limp, fault() says why, the reading is not to be used
  [[nodiscard]] bool read(LeaderReading& reading) noexcept;
  /// Sends the currents that make these torques, rounded towards 0 and cut off at the limits. A
  /// torque that is not finite is 0. Nothing acts unless enable() was called.
  /// @param torque_newton_m  on the hand   @param made_newton_m  receives what they make
  /// @return false: limp, fault() says why
  [[nodiscard]] bool write(const LeaderValues& torque_newton_m,
                           LeaderValues& made_newton_m) noexcept;
  /// Current 0, then torque off. The object can still read.
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
  /// the lease_s of the clamp. A cycle, the watchdog, and one unit of it, as nobody says when
  /// within a unit it counts.
  [[nodiscard]] double lease_s() const noexcept;
  /// The resolution of the clamp's port: the encoder's step, the play, and how far the hand moves
  /// in longest_delay_s to either side.
  [[nodiscard]] double resolution_rad(std::size_t joint) const noexcept;
  /// What the current limit makes, at the joint.
  [[nodiscard]] double largest_torque_newton_m(std::size_t joint) const noexcept;
  /// The model of each servo, its firmware, and what was assumed of it; one line a joint.
  [[nodiscard]] std::string description() const;

 private:
  std::unique_ptr<DynamixelArm> arm_;
};

/// Time that the bytes of one cycle take on the line, read and write, by arithmetic: 21 + 35 bytes
/// and 155 of the answer for seven servos, 10 bits each, and the servos' return delay once.
[[nodiscard]] double dynamixel_cycle_s(std::size_t servos, unsigned bits_per_second,
                                       double return_delay_s);

}  // namespace palpate::device
