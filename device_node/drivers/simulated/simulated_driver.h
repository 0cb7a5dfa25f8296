// SPDX-License-Identifier: Apache-2.0
// simulated_driver.h — the driver of the simulated device.
#pragma once

#include <cstdint>
#include <memory>

#include "common/core/clock.h"
#include "common/session/simulation_config.h"
#include "device_node/device.h"
#include "device_node/simulation/simulated_device.h"

namespace palpate::device {

inline constexpr const char* kSimulatedDriver = "simulated";

struct SimulatedDriverOptions {
  SimulatedDeviceConfig device = {};
  HandConfig hand = {};
  std::uint64_t seed = 0;      ///< of the hand's random stream
  HandGoals* goals = nullptr;  ///< where a pointer leads the hand; must outlive the device
};

[[nodiscard]] inline std::unique_ptr<HapticDevice> open_simulated_device(
    const SimulatedDriverOptions& options, const Clock& clock) {
  return std::make_unique<SimulatedDevice>(options.device, options.hand, clock, options.seed,
                                           options.goals);
}

}  // namespace palpate::device
