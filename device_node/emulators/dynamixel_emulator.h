// SPDX-License-Identifier: Apache-2.0
// dynamixel_emulator.h — stands in for a leader arm on a Dynamixel bus, behind a pseudo-terminal:
// servos, a hand that moves the arm, and faults of the bus on request.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/core/random.h"
#include "device_node/drivers/dynamixel/dynamixel_bus.h"
#include "device_node/drivers/transport/serial_port.h"
#include "device_node/emulators/dynamixel_servo.h"
#include "device_node/emulators/emulated_arm.h"
#include "device_node/emulators/emulated_device.h"
#include "device_node/emulators/pseudo_terminal.h"

namespace palpate::device {

/// Seven servos as in a leader of XL330-M288.
[[nodiscard]] std::vector<ServoSettings> seven_servos();

struct BusEmulation {
  std::vector<ServoSettings> servos;
  JointHand hand;
  std::vector<PlannedFault> faults;  ///< of parse_fault(…, "dynamixel")
  /// Bits a second that answers take; 0: they take no time, nor does the servos' return delay.
  unsigned bits_per_second = 0;
};

class DynamixelEmulator {
 public:
  /// @throws SetupError  no pseudo-terminal to be had
  DynamixelEmulator(BusEmulation bus, const Clock& clock, std::uint64_t seed);
  DynamixelEmulator(const DynamixelEmulator&) = delete;
  DynamixelEmulator& operator=(const DynamixelEmulator&) = delete;

  /// What a driver opens.
  [[nodiscard]] const std::string& port() const noexcept { return terminal_.name(); }
  /// Serves until the stop.
  void run(const std::stop_token& stop);

  /// From now on. Any thread.
  void plan(const PlannedFault& fault);
  /// Does something with a servo, up to date. Any thread.
  void with_servo(std::size_t i, const std::function<void(EmulatedServo&)>& change);
  /// Moves the arm up to the clock's time. Any thread.
  void catch_up();
  /// Since the start. Any thread, as all that follows.
  [[nodiscard]] double now_s() const noexcept { return to_seconds(clock_.now() - start_); }
  /// Σ |torque| that acts, as of the last catch_up().
  [[nodiscard]] double acting_newton_m() const;
  /// The time until which some torque acted.
  [[nodiscard]] double torque_until_s() const;
  /// Least energy that the hand has put in so far; below 0 it has been driven.
  [[nodiscard]] double least_energy_joule() const;
  [[nodiscard]] double fastest_rad_per_s() const;
  [[nodiscard]] std::uint64_t messages() const;

 private:
  using Bytes = std::vector<std::byte>;
  void serve(std::span<std::byte> packet);
  [[nodiscard]] std::vector<Bytes> answers_to(const DynamixelMessage& message);
  [[nodiscard]] std::vector<Bytes> sync_read(const DynamixelMessage& message);
  [[nodiscard]] Bytes fast_sync_read(const DynamixelMessage& message);
  void sync_write(const DynamixelMessage& message);
  [[nodiscard]] Bytes status(const EmulatedServo& servo, std::uint8_t error,
                             std::span<const std::byte> data) const;
  [[nodiscard]] EmulatedServo* servo_of(unsigned id);
  void send(std::vector<Bytes> answers, WireFault fault, bool is_partial);
  void advance_to(double now_s);
  void apply_faults(double now_s);
  [[nodiscard]] bool has(WireFault kind, double now_s) const;
  [[nodiscard]] WireFault wire_fault(double now_s) const;

  const Clock& clock_;
  TimePoint start_;
  BusEmulation bus_;
  PseudoTerminal terminal_;
  SerialPort port_;
  DynamixelLine line_;
  mutable std::mutex lock_;  // over all that follows
  EmulatedArm<EmulatedServo> arm_;
  std::vector<bool> has_begun_;
  Random random_;
  std::uint64_t messages_ = 0;
};

}  // namespace palpate::device
