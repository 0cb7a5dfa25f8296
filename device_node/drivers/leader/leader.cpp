// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/leader/leader.h"

#include <chrono>
#include <thread>

#include "device_node/drivers/leader/leader_arm.h"

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

}  // namespace

Clock& leader_clock() {
  static LeaderClock clock;
  return clock;
}

Leader::Leader(std::unique_ptr<LeaderArm> arm) : arm_(std::move(arm)) {}
Leader::~Leader() = default;

bool Leader::enable() noexcept { return arm_->enable(); }
bool Leader::read(LeaderReading& reading) noexcept { return arm_->read(reading); }
bool Leader::write(const LeaderValues& torque_newton_m, LeaderValues& made_newton_m) noexcept {
  return arm_->write(torque_newton_m, made_newton_m);
}
void Leader::release() noexcept { arm_->release(); }
bool Leader::is_enabled() const noexcept { return arm_->is_enabled(); }
LeaderFault Leader::fault() const noexcept { return arm_->fault(); }
std::size_t Leader::fault_joint() const noexcept { return arm_->fault_joint(); }
std::string Leader::fault_text() const { return arm_->fault_text(); }
std::size_t Leader::count() const noexcept { return arm_->count(); }
double Leader::lease_s() const noexcept { return arm_->lease_s(); }
double Leader::resolution_rad(std::size_t joint) const noexcept {
  return arm_->resolution_rad(joint);
}
double Leader::largest_torque_newton_m(std::size_t joint) const noexcept {
  return arm_->largest_torque_newton_m(joint);
}
std::string Leader::description() const { return arm_->description(); }

}  // namespace palpate::device
