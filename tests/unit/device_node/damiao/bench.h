// SPDX-License-Identifier: Apache-2.0
// bench.h — an emulated arm of Damiao motors on virtual time, and the driver at the other end of
// its bus.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "device_node/drivers/damiao/damiao_arm.h"
#include "device_node/emulators/damiao_emulator.h"
#include "tests/support/machine/machine.h"
#include "tests/support/temp_folder.h"
#include "tests/support/wired/shared_clock.h"
#include "tests/unit/device_node/leader/leader_runs.h"

namespace palpate::test {

/// What the driver is told of the seven motors of seven_damiao_motors().
inline std::vector<device::DamiaoJoint> seven_damiao_joints() {
  std::vector<device::DamiaoJoint> joints(7);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    joints[i] = {{.id = static_cast<int>(i + 1),
                  .offset_rad = -0.3,  // DamiaoMotorSettings::zero_rad
                  .lowest_rad = -2.0,
                  .highest_rad = 2.0,
                  .fastest_rad_per_s = 6.0,
                  .play_rad = 0.001}};
    joints[i].model = i < 2 ? "DM8009" : i < 4 ? "DM4340" : "DM4310";
    joints[i].torque_limit_newton_m = 1.0;
  }
  return joints;
}

class DamiaoBench {
 public:
  explicit DamiaoBench(
      std::vector<device::DamiaoMotorSettings> motors = device::seven_damiao_motors(),
      device::JointHand hand = holding_hand)
      : emulator_(std::make_unique<device::DamiaoEmulator>(
            device::CanEmulation{
                .motors = std::move(motors), .hand = std::move(hand), .faults = {}},
            (folder_.path() / "bus").string(), "--leader", time, 7)) {
    settings.port = emulator_->port();
    settings.answer_limit_s = std::min(0.8, to_seconds(patience(std::chrono::milliseconds(30))));
    server_ = std::jthread([this](const std::stop_token& stop) { emulator_->run(stop); });
  }

  device::DamiaoArm& open() {
    arm_.emplace(joints, settings, time);
    return *arm_;
  }
  /// The text with which it cannot be opened.
  std::string refusal() {
    try {
      open();
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "it opens";
  }
  device::DamiaoArm& enabled() {
    open();
    EXPECT_TRUE(arm_->enable()) << arm_->fault_text();
    return *arm_;
  }
  device::DamiaoArm& arm() { return *arm_; }
  void close() { arm_.reset(); }
  device::DamiaoEmulator& emulator() { return *emulator_; }

  void pass(Duration duration) { time.sleep_until(time.now() + duration); }
  bool write(const device::LeaderValues& torque_newton_m) {
    return arm_->write(torque_newton_m, made);
  }
  /// One cycle of 2 ms with this torque on every joint.
  bool cycle(double torque_newton_m = 0.0) {
    device::LeaderValues torque;
    torque.fill(torque_newton_m);
    const bool is_written = arm_->read(reading) && write(torque);
    if (!is_written) settle();
    pass(std::chrono::milliseconds(2));
    return is_written;
  }
  /// Until the motors have had all that was sent.
  void settle() {
    std::uint64_t before = 0;
    do {
      before = emulator_->messages();
      std::this_thread::sleep_for(patience(std::chrono::milliseconds(3)));
    } while (emulator_->messages() != before);
  }
  void plan(device::WireFault kind) {
    emulator_->plan({.kind = kind, .from_s = emulator_->now_s(), .length_s = 1e3});
  }
  [[nodiscard]] double acting_newton_m() {
    emulator_->catch_up();
    return emulator_->acting_newton_m();
  }
  [[nodiscard]] unsigned state(std::size_t motor) {
    unsigned state = 0;
    emulator_->with_motor(motor, [&](device::EmulatedDamiaoMotor& m) { state = m.state(); });
    return state;
  }
  [[nodiscard]] std::uint32_t reg(std::size_t motor, std::uint8_t which) {
    std::uint32_t value = 0;
    emulator_->with_motor(motor, [&](device::EmulatedDamiaoMotor& m) { value = m.reg(which); });
    return value;
  }

  SharedClock time;
  std::vector<device::DamiaoJoint> joints = seven_damiao_joints();
  device::DamiaoSettings settings;
  device::LeaderReading reading;
  device::LeaderValues made{};

 private:
  TempFolder folder_;
  std::unique_ptr<device::DamiaoEmulator> emulator_;
  std::jthread server_;
  std::optional<device::DamiaoArm> arm_;
};

}  // namespace palpate::test
