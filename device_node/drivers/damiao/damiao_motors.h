// SPDX-License-Identifier: Apache-2.0
// damiao_motors.h — the motors of a leader arm on one CAN bus: LeaderBus over DamiaoBus.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "common/core/clock.h"
#include "device_node/drivers/damiao/damiao_bus.h"
#include "device_node/drivers/damiao/damiao_frame.h"
#include "device_node/drivers/damiao/damiao_leader.h"
#include "device_node/drivers/leader/leader_bus.h"

namespace palpate::device {

class DamiaoMotors final : public LeaderBus {
 public:
  /// @param joints  checked by check_leader()
  /// @throws SetupError  what is wrong with joints and settings, or with the port
  DamiaoMotors(std::span<const DamiaoJoint> joints, const DamiaoSettings& settings, Clock& clock);
  /// The CAN timeouts are again what they were.
  ~DamiaoMotors() override;
  DamiaoMotors(const DamiaoMotors&) = delete;
  DamiaoMotors& operator=(const DamiaoMotors&) = delete;

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
  /// What is known of one motor.
  struct Motor {
    DamiaoRange range;
    std::uint32_t software = 0;
    std::uint32_t former_timeout = 0;  // in units of the register
    bool has_timeout = false;          // it is ours now
    unsigned most_code = 0;            // of the torque; the least is its mirror image
    bool has_command = false;          // it has answered the last one
    // a status that does not change while torques do
    std::uint64_t said = 0;
    TimePoint said_since{};
    unsigned least_told = 0;  // torque codes since then
    unsigned most_told = 0;
    TimePoint told_since{};   // that they differ by what must be seen
    bool has_varied = false;  // they do
    bool is_probed = false;   // its torque is less, to see whether its status follows
  };

  void check_joints() const;
  void identify(std::size_t joint);
  void check_ranges(std::size_t joint);
  void set_mode(std::size_t joint);
  [[nodiscard]] std::uint32_t ask_register(std::size_t joint, std::uint8_t which);
  [[nodiscard]] std::string name_of(std::size_t joint) const;
  [[nodiscard]] std::uint32_t timeout_units() const noexcept;
  [[nodiscard]] MotorOutcome set_timeout(std::size_t joint) noexcept;
  [[nodiscard]] MotorOutcome switch_on() noexcept;
  [[nodiscard]] double unit_newton_m(std::size_t joint) const noexcept;
  [[nodiscard]] std::span<const DamiaoAddress> addresses() const noexcept {
    return std::span(addresses_).first(count_);
  }

  std::array<DamiaoJoint, kMostLeaderJoints> joints_{};
  std::array<Motor, kMostLeaderJoints> motors_{};
  std::array<DamiaoAddress, kMostLeaderJoints> addresses_{};
  std::array<DamiaoFeedback, kMostLeaderJoints> feedback_{};
  std::size_t count_;
  DamiaoSettings settings_;
  Clock& clock_;
  DamiaoBus bus_;
  unsigned fault_detail_ = 0;
};

}  // namespace palpate::device
