// SPDX-License-Identifier: Apache-2.0
/// @file
/// dynamixel_leader.h — a motorised leader arm on a Dynamixel bus (Protocol 2.0): leader.h for
/// servos on one serial line. Never run on hardware: tested against the emulator of
/// device_node/emulators.
#pragma once

#include <cstddef>
#include <span>

#include "leader.h"

namespace palpate::device {

/// One servo and the joint that it drives.
struct DynamixelJoint : LeaderJoint {
  /// > 0: torque of the horn per ampere that is commanded, measured, within a factor of 3 of the
  /// manual's. 0: what the manual's stall
  /// torque and current say of the model, which nobody has measured on yours.
  double torque_newton_m_per_ampere = 0.0;
  double current_limit_ampere = 0.0;  ///< > 0: no more is commanded
};

/// The line. Of longest_delay_s, which is above 0.003, 3 ms are left to the servo and USB.
struct DynamixelSettings : LeaderSettings {
  unsigned bits_per_second = 1'000'000;  ///< of the bus
  /// 1 … 127: each servo ends its torque by itself so many times 20 ms after the last instruction.
  int watchdog_units = 1;
  /// Accepts that the operating mode and the return delay in the servos' EEPROM are changed.
  bool may_write_eeprom = false;
};

/// Leader over a serial line.
class DynamixelLeader : public Leader {
 public:
  /// Switches every torque off, then checks each servo's model, firmware and settings.
  /// @param joints  1 … kMostLeaderJoints, ids 0 … 252   @param settings  the line
  /// @throws std::runtime_error  what is wrong, of which joint, and the remedy
  DynamixelLeader(std::span<const DynamixelJoint> joints, const DynamixelSettings& settings);
};

/// Time that the bytes of one cycle take on the line, read and write, by arithmetic: 21 + 35 bytes
/// and 155 of the answer for seven servos, 10 bits each, and the servos' return delay once.
[[nodiscard]] double dynamixel_cycle_s(std::size_t servos, unsigned bits_per_second,
                                       double return_delay_s);

}  // namespace palpate::device
