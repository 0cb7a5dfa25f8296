// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/damiao/damiao_leader.h"

#include <memory>

#include "device_node/drivers/damiao/damiao_arm.h"
#include "device_node/drivers/damiao/damiao_motors.h"

namespace palpate::device {
namespace {

std::unique_ptr<LeaderBus> open_motors(std::span<const DamiaoJoint> joints,
                                       const DamiaoSettings& settings, Clock& clock) {
  check_leader(leader_joints(joints), settings, 1, static_cast<int>(damiao::kMostId));
  return std::make_unique<DamiaoMotors>(joints, settings, clock);
}

}  // namespace

DamiaoArm::DamiaoArm(std::span<const DamiaoJoint> joints, const DamiaoSettings& settings,
                     Clock& clock)
    : LeaderArm(leader_joints(joints), settings, open_motors(joints, settings, clock), clock) {}

DamiaoLeader::DamiaoLeader(std::span<const DamiaoJoint> joints, const DamiaoSettings& settings)
    : Leader(std::make_unique<DamiaoArm>(joints, settings, leader_clock())) {}

double damiao_cycle_s(std::size_t motors, unsigned bits_per_second, unsigned data_bits_per_second) {
  const double bit_s = 1.0 / bits_per_second;
  // classic: 1 start, 11 + 1 + 2 + 4 before 64 of data, 15 of CRC, 3, 7 at the end and 3 between
  // frames; of the first 98 one in four may be stuffed
  double frame_s = (111 + 24) * bit_s;
  if (data_bits_per_second > 0) {
    // FD: 17 before the switch and 4 stuffed, 13 after it; between them 1 + 4 + 64 with 17 stuffed,
    // 4 of the count of these, 17 of CRC and 6 fixed
    frame_s = (17 + 4 + 13) * bit_s + (69 + 17 + 4 + 17 + 6) / double{1.0 * data_bits_per_second};
  }
  return 4.0 * static_cast<double>(motors) * frame_s;
}

}  // namespace palpate::device
