// SPDX-License-Identifier: Apache-2.0
// damiao_emulator.h — stands in for a leader arm of Damiao motors, behind a socket that carries the
// frames of the CAN bus: motors, a hand that moves the arm, and faults of the bus on request.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/core/random.h"
#include "device_node/drivers/transport/can_port.h"
#include "device_node/drivers/transport/packet_port.h"
#include "device_node/emulators/damiao_motor.h"
#include "device_node/emulators/emulated_arm.h"
#include "device_node/emulators/emulated_device.h"
#include "device_node/emulators/packet_listener.h"

namespace palpate::device {

/// Seven motors as in an OpenArm: two DM8009, two DM4340, three DM4310.
[[nodiscard]] std::vector<DamiaoMotorSettings> seven_damiao_motors();

struct CanEmulation {
  std::vector<DamiaoMotorSettings> motors;
  JointHand hand;
  std::vector<PlannedFault> faults;  ///< of parse_fault(…, "openarm")
};

class DamiaoEmulator {
 public:
  /// @param path  of the socket that a driver opens   @param setting  that says it, for messages
  /// @throws SetupError  it cannot be had
  DamiaoEmulator(CanEmulation bus, const std::string& path, const std::string& setting,
                 const Clock& clock, std::uint64_t seed);
  DamiaoEmulator(const DamiaoEmulator&) = delete;
  DamiaoEmulator& operator=(const DamiaoEmulator&) = delete;

  /// What a driver opens.
  [[nodiscard]] const std::string& port() const noexcept { return listener_.path(); }
  /// Serves until the stop.
  void run(const std::stop_token& stop);

  /// From now on. Any thread.
  void plan(const PlannedFault& fault);
  /// Does something with a motor, up to date. Any thread.
  void with_motor(std::size_t i, const std::function<void(EmulatedDamiaoMotor&)>& change);
  /// Moves the arm up to the clock's time. Any thread.
  void catch_up();
  /// Since the start. Any thread, as all that follows.
  [[nodiscard]] double now_s() const noexcept { return to_seconds(clock_.now() - start_); }
  /// As of the last catch_up(): those of EmulatedArm.
  [[nodiscard]] double acting_newton_m() const;
  [[nodiscard]] double torque_until_s() const;
  [[nodiscard]] double least_energy_joule() const;
  [[nodiscard]] double fastest_rad_per_s() const;
  [[nodiscard]] std::uint64_t messages() const;

 private:
  void serve(PacketPort& client, const std::stop_token& stop);
  /// @return  false: the connection breaks
  [[nodiscard]] bool answer(PacketPort& client, const CanFrame& frame);
  void advance_to(double now_s);
  void apply_faults(double now_s);
  [[nodiscard]] bool has(WireFault kind, double now_s) const;

  const Clock& clock_;
  TimePoint start_;
  CanEmulation bus_;
  PacketListener listener_;
  mutable std::mutex lock_;  // over all that follows
  EmulatedArm<EmulatedDamiaoMotor> arm_;
  std::vector<bool> has_begun_;
  Random random_;
  std::uint64_t messages_ = 0;
};

}  // namespace palpate::device
