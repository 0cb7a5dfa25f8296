// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/dynamixel/dynamixel_leader.h"

#include <chrono>
#include <thread>

#include "device_node/drivers/dynamixel/dynamixel_arm.h"

namespace palpate::device {
namespace {

/// CLOCK_MONOTONIC, of one's own: the library links nothing else of the project.
class LeaderClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override {
    return TimePoint(
        std::chrono::duration_cast<Duration>(std::chrono::steady_clock::now().time_since_epoch()));
  }
  void sleep_until(TimePoint deadline) override { std::this_thread::sleep_for(deadline - now()); }
};

/// Has no state.
Clock& leader_clock() {
  static LeaderClock clock;
  return clock;
}

}  // namespace

DynamixelLeader::DynamixelLeader(std::span<const DynamixelJoint> joints,
                                 const DynamixelSettings& settings)
    : arm_(std::make_unique<DynamixelArm>(joints, settings, leader_clock())) {}
DynamixelLeader::~DynamixelLeader() = default;

bool DynamixelLeader::enable() noexcept { return arm_->enable(); }
bool DynamixelLeader::read(LeaderReading& reading) noexcept { return arm_->read(reading); }
bool DynamixelLeader::write(const LeaderValues& torque_newton_m,
                            LeaderValues& made_newton_m) noexcept {
  return arm_->write(torque_newton_m, made_newton_m);
}
void DynamixelLeader::release() noexcept { arm_->release(); }
bool DynamixelLeader::is_enabled() const noexcept { return arm_->is_enabled(); }
LeaderFault DynamixelLeader::fault() const noexcept { return arm_->fault(); }
std::size_t DynamixelLeader::fault_joint() const noexcept { return arm_->fault_joint(); }
std::string DynamixelLeader::fault_text() const { return arm_->fault_text(); }
std::size_t DynamixelLeader::count() const noexcept { return arm_->count(); }
double DynamixelLeader::lease_s() const noexcept { return arm_->lease_s(); }
double DynamixelLeader::resolution_rad(std::size_t joint) const noexcept {
  return arm_->resolution_rad(joint);
}
double DynamixelLeader::largest_torque_newton_m(std::size_t joint) const noexcept {
  return arm_->largest_torque_newton_m(joint);
}
std::string DynamixelLeader::description() const { return arm_->description(); }

double dynamixel_cycle_s(std::size_t servos, unsigned bits_per_second, double return_delay_s) {
  const std::size_t request = kDynamixelHeaderBytes + 7 + servos;
  const std::size_t answer = fast_status_bytes(servos, kDynamixelBlock.size());
  const std::size_t goals = kDynamixelHeaderBytes + 7 + 3 * servos;
  return 10.0 * static_cast<double>(request + answer + goals) /
             static_cast<double>(bits_per_second) +
         return_delay_s;
}

}  // namespace palpate::device
