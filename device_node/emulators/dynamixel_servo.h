// SPDX-License-Identifier: Apache-2.0
// dynamixel_servo.h — one emulated Dynamixel servo: its control table with its rules, its Bus
// Watchdog, and the joint that its motor moves. Nothing here is of the driver.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "device_node/emulators/emulated_arm.h"

namespace palpate::device {

struct ServoSettings {
  std::uint8_t id = 1;
  std::uint16_t model = 1200;  ///< XL330-M288
  std::uint8_t firmware = 52;
  double ampere_per_unit = 1e-3;
  double newton_m_per_ampere = 0.354;  ///< of its motor and gears, truly
  unsigned current_limit = 1750;
  unsigned indirect_data = 208;
  double zero_rad = 3.14;     ///< of the horn, where the joint is at 0
  double tick_phase_s = 0.0;  ///< of its control cycle of 1 ms
  GearedJoint joint{};
};

/// One thread; times are seconds since the servo was made.
class EmulatedServo {
 public:
  explicit EmulatedServo(const ServoSettings& settings);

  /// A packet has come, for whichever servo.
  void hear(double now_s) noexcept { heard_at_s_ = now_s; }
  /// @return  the error of a status
  std::uint8_t write(unsigned address, std::span<const std::byte> data) noexcept;
  std::uint8_t read(unsigned address, std::span<std::byte> data) noexcept;
  /// As the instruction, or a supply that was gone for a moment.
  void reboot() noexcept;
  /// It protects itself: torque off, until it reboots.
  void protect(std::uint8_t hardware_error) noexcept;
  [[nodiscard]] bool has_alert() const noexcept { return table_[70] != 0; }
  [[nodiscard]] std::uint8_t id() const noexcept { return settings_.id; }
  [[nodiscard]] std::uint16_t model() const noexcept { return settings_.model; }
  [[nodiscard]] std::uint8_t firmware() const noexcept { return settings_.firmware; }
  [[nodiscard]] double return_delay_s() const noexcept { return 2e-6 * table_[9]; }

  /// Moves the joint, and does what is due in its control cycle.
  void advance(double now_s, double step_s, double hand_newton_m) noexcept;
  /// Whole turns that the counter is off by.
  void turn(int turns) noexcept { turns_ += turns; }

  [[nodiscard]] const JointPlant& joint() const noexcept { return plant_; }
  /// That acts now, at the horn.
  [[nodiscard]] double torque_newton_m() const noexcept { return torque_newton_m_; }

  bool is_there = true;   ///< false: unplugged: no answer, no torque
  bool is_stuck = false;  ///< its state is not renewed
  bool has_watchdog = true;
  bool was_unguarded = false;  ///< it got torque while its watchdog was off
  double gain = 1.0;           ///< of the motor; below 0: a wrong sign

 private:
  void cycle(double now_s) noexcept;
  [[nodiscard]] unsigned u16(unsigned address) const noexcept;
  void set(unsigned address, unsigned bytes, std::uint32_t value) noexcept;
  [[nodiscard]] unsigned target_of(unsigned address) const noexcept;
  [[nodiscard]] std::uint8_t write_entry(unsigned address,
                                         std::span<const std::byte> data) noexcept;

  ServoSettings settings_;
  JointPlant plant_;
  std::array<std::uint8_t, 256> table_{};
  double heard_at_s_ = 0.0;
  double next_cycle_s_ = 0.0;
  double torque_newton_m_ = 0.0;
  int turns_ = 0;
};

}  // namespace palpate::device
