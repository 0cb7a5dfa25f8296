// SPDX-License-Identifier: Apache-2.0
// damiao_motor.h — one emulated Damiao motor on a CAN bus: what it does with frames, its registers,
// its CAN timeout, its errors, and the joint that it moves. Nothing here is of the driver.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "device_node/drivers/transport/can_port.h"
#include "device_node/emulators/emulated_arm.h"

namespace palpate::device {

struct DamiaoMotorSettings {
  unsigned id = 1;
  unsigned feedback_id = 0x11;
  float position_range_rad = 12.5F;
  float velocity_range_rad_per_s = 30.0F;
  float torque_range_newton_m = 10.0F;
  double torque_ratio = 1.0;   ///< that the shaft truly makes of what is commanded
  double zero_rad = 0.3;       ///< of the shaft, where the joint is at 0
  double cycle_phase_s = 0.0;  ///< of its control cycle of 0.1 ms
  GearedJoint joint{};
};

/// One thread; times are seconds since the motor was made.
class EmulatedDamiaoMotor {
 public:
  explicit EmulatedDamiaoMotor(const DamiaoMotorSettings& settings);

  /// A frame on the bus, for whichever motor.
  /// @return  what it answers
  std::optional<CanFrame> hear(const CanFrame& frame, double now_s) noexcept;
  /// The supply was gone for a moment.
  void power_cycle() noexcept;
  /// It protects itself: no torque until the error is cleared. @param state  8 … 14
  void protect(unsigned state) noexcept;
  /// Moves the joint, and does what is due in its control cycle.
  void advance(double now_s, double step_s, double hand_newton_m) noexcept;
  /// Whole turns that its counter is off by.
  void turn(int turns) noexcept { turns_ += turns; }

  [[nodiscard]] const JointPlant& joint() const noexcept { return plant_; }
  /// That acts now, at the shaft.
  [[nodiscard]] double torque_newton_m() const noexcept { return torque_newton_m_; }
  [[nodiscard]] unsigned state() const noexcept { return state_; }
  [[nodiscard]] std::uint32_t reg(std::uint8_t which) const noexcept { return registers_[which]; }
  void set_reg(std::uint8_t which, std::uint32_t value) noexcept { registers_[which] = value; }

  bool is_there = true;   ///< false: unplugged: no answer, no torque
  bool is_stuck = false;  ///< what it says is not renewed
  bool has_timeout = true;
  bool keeps_registers = true;  ///< false: it answers a write, and forgets it
  bool was_unguarded = false;   ///< it made a torque beyond half a unit while its timeout was 0
  double gain = 1.0;            ///< of the motor; below 0: a wrong sign

 private:
  void cycle(double now_s) noexcept;
  void control(const CanFrame& frame) noexcept;
  [[nodiscard]] CanFrame answer(const std::array<unsigned, 8>& bytes) const noexcept;
  [[nodiscard]] CanFrame feedback() const noexcept;
  [[nodiscard]] std::optional<CanFrame> hear_of_registers(const CanFrame& frame) noexcept;
  [[nodiscard]] double shaft_rad() const noexcept;

  DamiaoMotorSettings settings_;
  JointPlant plant_;
  std::array<std::uint32_t, 256> registers_{};
  unsigned state_ = 0;
  // the last control frame
  double goal_rad_ = 0.0;
  double goal_rad_per_s_ = 0.0;
  double stiffness_ = 0.0;
  double damping_ = 0.0;
  double goal_newton_m_ = 0.0;
  // what it measured last
  double said_rad_ = 0.0;
  double said_rad_per_s_ = 0.0;
  double said_newton_m_ = 0.0;
  double heard_at_s_ = 0.0;
  double next_cycle_s_ = 0.0;
  double torque_newton_m_ = 0.0;
  int turns_ = 0;
};

}  // namespace palpate::device
