// open_device.h — the driver that a session asks for.
#pragma once

#include <cstdint>
#include <memory>

#include "common/core/clock.h"
#include "common/session/simulation_config.h"
#include "device_node/device.h"
#include "device_node/simulation/simulated_device.h"

namespace palpate::device {

/// A device ready to be read, motors limp. The simulated device is the one driver so far; `hand`
/// `seed` (of the hand's random stream) and `goals` (where it is led, or none) matter to it alone.
/// `clock` and `goals` must outlive the device.
[[nodiscard]] std::unique_ptr<HapticDevice> open_device(
    const SimulatedDeviceConfig& config, const HandConfig& hand, const Clock& clock,
    std::uint64_t seed, HandGoals* goals = nullptr);

}  // namespace palpate::device
