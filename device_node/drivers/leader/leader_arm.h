// SPDX-License-Identifier: Apache-2.0
// leader_arm.h — what Leader does, over any bus and on any clock: the life of an arm, the place of
// its joints, what is known of the time for which a torque acts.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "device_node/drivers/leader/leader.h"
#include "device_node/drivers/leader/leader_bus.h"

namespace palpate::device {

/// Has no state.
[[nodiscard]] Clock& leader_clock();

/// "joint 2 (id 5)"
[[nodiscard]] std::string leader_joint_name(std::size_t joint, int id);
/// With %g.
[[nodiscard]] std::string leader_number(double value);

/// What holds of joints and settings on any bus; before a bus is opened.
/// @param least_id  of a motor on this bus   @param most_id  of a motor on this bus
/// @throws SetupError  what is wrong, of which joint, and the remedy
void check_leader(std::span<const LeaderJoint> joints, const LeaderSettings& settings, int least_id,
                  int most_id);

/// The common part of a bus' joints.
template <class Joint>
[[nodiscard]] std::vector<LeaderJoint> leader_joints(std::span<const Joint> joints) {
  return {joints.begin(), joints.end()};
}

/// The interface is that of Leader.
class LeaderArm {
 public:
  /// @param joints  checked   @param bus  open
  /// @throws SetupError  of the bus, or an angle out of its range
  LeaderArm(std::span<const LeaderJoint> joints, const LeaderSettings& settings,
            std::unique_ptr<LeaderBus> bus, Clock& clock);
  ~LeaderArm() { release(); }
  LeaderArm(const LeaderArm&) = delete;
  LeaderArm& operator=(const LeaderArm&) = delete;

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
  enum class Turns : std::uint8_t { kFind, kKeep };

  [[nodiscard]] bool take_states(Turns turns, double elapsed_s, LeaderReading& reading) noexcept;
  [[nodiscard]] LeaderFault place(std::size_t joint, double shaft_rad, Turns turns,
                                  double elapsed_s) noexcept;
  [[nodiscard]] bool send() noexcept;
  void let_go() noexcept;
  bool fail(LeaderFault fault, std::size_t joint) noexcept;
  bool fail_transfer(Transfer transfer) noexcept;

  std::array<LeaderJoint, kMostLeaderJoints> joints_{};
  std::size_t count_;
  LeaderSettings settings_;
  std::unique_ptr<LeaderBus> bus_;
  Clock& clock_;

  bool is_enabled_ = false;
  LeaderFault fault_ = LeaderFault::kNone;
  std::size_t fault_joint_ = 0;
  LeaderValues turns_rad_{};     // what the whole turns that a joint is in make
  LeaderValues position_rad_{};  // of the last reading
  std::array<int, kMostLeaderJoints> written_{};
  unsigned lost_commands_ = 0;  // reads in a row that found another command than was written
  bool is_known_ = false;       // the torques that were written act since they were
  TimePoint read_at_{};         // the last request
  TimePoint switched_at_{};     // the last write, when it began
  TimePoint spoken_at_{};       // after the last instruction
  std::uint64_t repeated_ = 0;
};

}  // namespace palpate::device
