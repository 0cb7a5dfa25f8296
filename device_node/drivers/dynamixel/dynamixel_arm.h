// SPDX-License-Identifier: Apache-2.0
// dynamixel_arm.h — what DynamixelLeader does, on any clock.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "common/core/clock.h"
#include "device_node/drivers/dynamixel/dynamixel_bus.h"
#include "device_node/drivers/dynamixel/dynamixel_leader.h"
#include "device_node/drivers/dynamixel/dynamixel_models.h"

namespace palpate::device {

/// Of longest_delay_s: how old a position may be in the servo, until a goal is a current, and a
/// frame of USB. Two cycles of a control loop of 1 kHz and 1 ms; nobody documents it.
inline constexpr double kLeaderServoDelayS = 0.003;

/// The interface is that of DynamixelLeader.
class DynamixelArm {
 public:
  /// @throws SetupError
  DynamixelArm(std::span<const DynamixelJoint> joints, const DynamixelSettings& settings,
               Clock& clock);
  ~DynamixelArm() { release(); }
  DynamixelArm(const DynamixelArm&) = delete;
  DynamixelArm& operator=(const DynamixelArm&) = delete;

  [[nodiscard]] bool enable() noexcept;
  [[nodiscard]] bool read(LeaderReading& reading) noexcept;
  [[nodiscard]] bool write(const LeaderValues& torque_newton_m,
                           LeaderValues& made_newton_m) noexcept;
  void release() noexcept;

  [[nodiscard]] bool is_enabled() const noexcept { return is_enabled_; }
  [[nodiscard]] LeaderFault fault() const noexcept { return fault_; }
  [[nodiscard]] std::size_t fault_joint() const noexcept { return fault_joint_; }
  [[nodiscard]] std::string fault_text() const;
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] double lease_s() const noexcept;
  [[nodiscard]] double resolution_rad(std::size_t joint) const noexcept;
  [[nodiscard]] double largest_torque_newton_m(std::size_t joint) const noexcept;
  [[nodiscard]] std::string description() const;

 private:
  /// What is known of one servo.
  struct Servo {
    const DynamixelModel* model = nullptr;
    unsigned firmware = 0;
    unsigned return_delay = 0;
    int current_limit = 0;           // in units of the model
    double newton_m_per_unit = 0.0;  // at the joint, without the sign
    double rad_per_step = 0.0;       // of the joint
    double turns_rad = 0.0;          // of the joint: what the whole turns that it is in make
    std::int16_t written = 0;        // the last goal current
    std::uint16_t tick_ms = 0;
    TimePoint tick_changed_at{};
    double position_rad = 0.0;
  };
  enum class Turns : std::uint8_t { kFind, kKeep };

  void check_joints() const;
  void set_up();
  void identify(std::size_t joint);
  void check_settings(std::size_t joint);
  void check_line() const;
  void prepare(std::size_t joint);
  void ask_register(std::size_t joint, unsigned address, std::span<std::byte> data);
  void set_register(std::size_t joint, unsigned address, std::span<const std::byte> data);
  [[nodiscard]] std::string name_of(std::size_t joint) const;

  [[nodiscard]] Transfer read_blocks() noexcept;
  [[nodiscard]] DynamixelBlock block_of(std::size_t joint) const noexcept;
  [[nodiscard]] bool take_blocks(Turns turns, double elapsed_s, LeaderReading& reading) noexcept;
  [[nodiscard]] LeaderFault state_fault(std::size_t joint, const DynamixelBlock& block) noexcept;
  [[nodiscard]] LeaderFault place(std::size_t joint, std::int32_t steps, Turns turns,
                                  double elapsed_s) noexcept;
  [[nodiscard]] bool send_currents() noexcept;
  [[nodiscard]] bool write_all(unsigned address, unsigned value) noexcept;
  void let_go() noexcept;
  bool fail(LeaderFault fault, std::size_t joint) noexcept;
  bool fail_transfer(Transfer transfer) noexcept;

  std::array<DynamixelJoint, kMostLeaderJoints> joints_{};
  std::array<Servo, kMostLeaderJoints> servos_{};
  std::array<std::uint8_t, kMostLeaderJoints> ids_{};
  std::array<DynamixelAnswer, kMostLeaderJoints> answers_{};
  std::size_t count_ = 0;
  DynamixelSettings settings_;
  Clock& clock_;
  DynamixelBus bus_;
  bool is_fast_ = false;
  bool is_set_up_ = false;
  unsigned block_address_ = 0;

  bool is_enabled_ = false;
  LeaderFault fault_ = LeaderFault::kNone;
  std::size_t fault_joint_ = 0;
  unsigned fault_detail_ = 0;
  std::array<bool, kMostLeaderJoints> has_read_{};
  unsigned lost_goals_ = 0;  // reads in a row that found another goal than was written
  bool is_known_ = false;    // the torques that were written act since they were
  TimePoint read_at_{};      // the last request
  TimePoint switched_at_{};  // the last write, when it began
  std::uint64_t repeated_ = 0;
};

}  // namespace palpate::device
