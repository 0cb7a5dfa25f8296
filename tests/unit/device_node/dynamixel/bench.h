// SPDX-License-Identifier: Apache-2.0
// bench.h — an emulated arm on virtual time, and the driver at the other end of its wire.
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

#include "device_node/drivers/dynamixel/dynamixel_arm.h"
#include "device_node/emulators/dynamixel_emulator.h"
#include "tests/support/machine/machine.h"
#include "tests/support/wired/shared_clock.h"
#include "tests/unit/device_node/leader/leader_runs.h"

namespace palpate::test {

/// What the driver is told of the seven servos of seven_servos().
inline std::vector<device::DynamixelJoint> seven_joints() {
  std::vector<device::DynamixelJoint> joints(7);
  for (std::size_t i = 0; i < joints.size(); ++i) {
    joints[i] = {{.id = static_cast<int>(i + 1),
                  .offset_rad = -3.14,  // ServoSettings::zero_rad
                  .lowest_rad = -2.0,
                  .highest_rad = 2.0,
                  .fastest_rad_per_s = 6.0,
                  .play_rad = 0.0044}};
    joints[i].current_limit_ampere = 1.0;
  }
  return joints;
}

class LeaderBench {
 public:
  explicit LeaderBench(std::vector<device::ServoSettings> servos = device::seven_servos(),
                       device::JointHand hand = holding_hand)
      : emulator_(std::make_unique<device::DynamixelEmulator>(
            device::BusEmulation{
                .servos = std::move(servos), .hand = std::move(hand), .faults = {}},
            time, 7)) {
    settings.port = emulator_->port();
    settings.bits_per_second = 4'000'000;
    settings.answer_limit_s = std::min(0.8, to_seconds(patience(std::chrono::milliseconds(30))));
    server_ = std::jthread([this](const std::stop_token& stop) { emulator_->run(stop); });
  }

  device::DynamixelArm& open() {
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
  device::DynamixelArm& enabled() {
    open();
    EXPECT_TRUE(arm_->enable()) << arm_->fault_text();
    return *arm_;
  }
  device::DynamixelArm& arm() { return *arm_; }
  device::DynamixelEmulator& emulator() { return *emulator_; }

  void pass(Duration duration) { time.sleep_until(time.now() + duration); }
  /// One cycle of 2 ms with this torque on every joint.
  bool cycle(double torque_newton_m = 0.0) {
    device::LeaderValues torque;
    torque.fill(torque_newton_m);
    const bool is_written = arm_->read(reading) && write(torque);
    if (!is_written) settle();
    pass(std::chrono::milliseconds(2));
    return is_written;
  }
  /// Writes, and waits until the servos have it: nothing answers.
  bool write(const device::LeaderValues& torque_newton_m) {
    const std::uint64_t before = emulator_->messages();
    const bool is_expected = arm_->is_enabled();
    if (!arm_->write(torque_newton_m, made)) return false;
    const auto until = std::chrono::steady_clock::now() + patience(std::chrono::seconds(5));
    while (is_expected && emulator_->messages() == before &&
           std::chrono::steady_clock::now() < until) {
      std::this_thread::yield();
    }
    return true;
  }
  /// Until the servos have had all that was sent.
  void settle() {
    std::uint64_t before = 0;
    do {
      before = emulator_ ? emulator_->messages() : 0;
      std::this_thread::sleep_for(patience(std::chrono::milliseconds(3)));
    } while (emulator_ && emulator_->messages() != before);
  }
  void plan(device::WireFault kind) {
    emulator_->plan({.kind = kind, .from_s = emulator_->now_s(), .length_s = 1e3});
  }
  /// The plug of the adapter is pulled out.
  void unplug() {
    server_.request_stop();
    server_.join();
    emulator_.reset();
  }
  [[nodiscard]] double acting_newton_m() {
    emulator_->catch_up();
    return emulator_->acting_newton_m();
  }
  /// Whether some servo has torque, by its control table.
  [[nodiscard]] unsigned entry(std::size_t servo, unsigned address) {
    std::array<std::byte, 1> value{};
    emulator_->with_servo(
        servo, [&](device::EmulatedServo& s) { static_cast<void>(s.read(address, value)); });
    return std::to_integer<unsigned>(value[0]);
  }

  SharedClock time;
  std::vector<device::DynamixelJoint> joints = seven_joints();
  device::DynamixelSettings settings;
  device::LeaderReading reading;
  device::LeaderValues made{};

 private:
  std::unique_ptr<device::DynamixelEmulator> emulator_;
  std::jthread server_;
  std::optional<device::DynamixelArm> arm_;
};

}  // namespace palpate::test
