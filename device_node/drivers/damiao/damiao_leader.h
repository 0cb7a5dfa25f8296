// SPDX-License-Identifier: Apache-2.0
/// @file
/// damiao_leader.h — a motorised leader arm of Damiao motors on a CAN bus, such as OpenArm:
/// leader.h for the MIT mode with both gains 0, so that a frame is a torque and nothing else. Never
/// run on hardware: tested against the emulator of device_node/emulators.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "leader.h"

namespace palpate::device {

/// One motor and the joint that it drives. Its id is 1 … 15.
struct DamiaoJoint : LeaderJoint {
  int feedback_id = 0;                 ///< of the frames that it sends (Master ID); 0: id + 16
  std::string model = "DM4310";        ///< as openarm_can names it: DM4310, DM4340, DM8009 …
  double torque_limit_newton_m = 0.0;  ///< > 0: no more is commanded, at the shaft
  /// > 0: the torque that the shaft truly makes per N·m that is commanded, measured. 1: as the
  /// motor's own constants have it, which nobody has measured on yours.
  double torque_ratio = 1.0;
};

/// The bus. Of longest_delay_s, which is above 0.001, 1 ms is left to the motor.
struct DamiaoSettings : LeaderSettings {
  bool is_fd = true;  ///< CAN FD with the interface's two bit rates; false: classic
  /// 0.002 … 1: the CAN timeout, after which each motor ends its torque by itself. Written into the
  /// motors' memory, not their flash, and what was there before comes back at the end.
  double timeout_s = 0.020;
};

/// Leader over SocketCAN. The port is the name of an interface, such as can0; a path: the socket of
/// an emulator.
class DamiaoLeader : public Leader {
 public:
  /// Switches every motor off, then checks each motor's ranges, mode and state.
  /// @param joints  1 … kMostLeaderJoints   @param settings  the bus
  /// @throws std::runtime_error  what is wrong, of which joint, and the remedy
  DamiaoLeader(std::span<const DamiaoJoint> joints, const DamiaoSettings& settings);
};

/// Time that the frames of one cycle take on the bus, read and write, with the most bits stuffed,
/// by arithmetic: four frames of 8 bytes for each motor.
/// @param motors  on the bus   @param bits_per_second  of the bus
/// @param data_bits_per_second  after the switch, of CAN FD; 0: classic frames
[[nodiscard]] double damiao_cycle_s(std::size_t motors, unsigned bits_per_second,
                                    unsigned data_bits_per_second);

}  // namespace palpate::device
