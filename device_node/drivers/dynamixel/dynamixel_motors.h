// SPDX-License-Identifier: Apache-2.0
// dynamixel_motors.h — the servos of a leader arm on one line: LeaderBus over DynamixelBus.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "common/core/clock.h"
#include "device_node/drivers/dynamixel/dynamixel_bus.h"
#include "device_node/drivers/dynamixel/dynamixel_leader.h"
#include "device_node/drivers/dynamixel/dynamixel_models.h"
#include "device_node/drivers/leader/leader_bus.h"

namespace palpate::device {

/// Of longest_delay_s: how old a position may be in the servo, until a goal is a current, and a
/// frame of USB. Two cycles of a control loop of 1 kHz and 1 ms; nobody documents it.
inline constexpr double kDynamixelDelayS = 0.003;

class DynamixelMotors final : public LeaderBus {
 public:
  /// @param joints  checked by check_leader()
  /// @throws SetupError  what is wrong with joints and settings, or with the port
  DynamixelMotors(std::span<const DynamixelJoint> joints, const DynamixelSettings& settings,
                  Clock& clock);

  void set_up() override;
  [[nodiscard]] MotorOutcome enable() noexcept override;
  void let_go() noexcept override;
  [[nodiscard]] Transfer read() noexcept override;
  [[nodiscard]] Transfer write(std::span<const int> units) noexcept override;
  [[nodiscard]] MotorState state(std::size_t joint) const noexcept override;
  [[nodiscard]] LeaderFault check(std::size_t joint, bool is_enabled,
                                  TimePoint now) noexcept override;
  [[nodiscard]] MotorOutcome find_silent() noexcept override;
  [[nodiscard]] MotorCommand command(std::size_t joint, double newton_m) const noexcept override;
  [[nodiscard]] double largest_newton_m(std::size_t joint) const noexcept override;
  [[nodiscard]] double step_rad() const noexcept override;
  [[nodiscard]] double delay_s() const noexcept override;
  [[nodiscard]] double watchdog_s() const noexcept override;
  [[nodiscard]] std::string model_text(std::size_t joint) const override;
  [[nodiscard]] std::string scale_text(std::size_t joint) const override;
  [[nodiscard]] std::string detail_text(LeaderFault fault) const override;

 private:
  /// What is known of one servo.
  struct Servo {
    const DynamixelModel* model = nullptr;
    unsigned firmware = 0;
    unsigned return_delay = 0;
    int current_limit = 0;           // in units of the model
    double newton_m_per_unit = 0.0;  // at the horn
    std::int16_t written = 0;        // the last goal current
    bool has_read = false;
    std::uint16_t tick_ms = 0;
    TimePoint tick_changed_at{};
  };

  void check_currents() const;
  void identify(std::size_t joint);
  void check_settings(std::size_t joint);
  void check_line() const;
  void prepare(std::size_t joint);
  void ask_register(std::size_t joint, unsigned address, std::span<std::byte> data);
  void set_register(std::size_t joint, unsigned address, std::span<const std::byte> data);
  [[nodiscard]] std::string name_of(std::size_t joint) const;
  [[nodiscard]] DynamixelBlock block_of(std::size_t joint) const noexcept;
  [[nodiscard]] MotorOutcome set_entry(std::size_t joint, unsigned address,
                                       std::span<const std::byte> data) noexcept;
  [[nodiscard]] MotorOutcome set_watchdogs() noexcept;
  [[nodiscard]] MotorOutcome try_watchdogs() noexcept;
  [[nodiscard]] Transfer send_currents() noexcept;
  [[nodiscard]] Transfer write_all(unsigned address, unsigned value) noexcept;

  std::array<DynamixelJoint, kMostLeaderJoints> joints_{};
  std::array<Servo, kMostLeaderJoints> servos_{};
  std::array<std::uint8_t, kMostLeaderJoints> ids_{};
  std::array<DynamixelAnswer, kMostLeaderJoints> answers_{};
  std::size_t count_;
  DynamixelSettings settings_;
  Clock& clock_;
  DynamixelBus bus_;
  bool is_fast_ = false;
  unsigned block_address_ = 0;
  unsigned fault_detail_ = 0;
};

}  // namespace palpate::device
