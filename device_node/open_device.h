// open_device.h — the driver that a session asks for.
#pragma once

#include <cstdint>
#include <memory>

#include "common/core/clock.h"
#include "common/core/session.h"
#include "device_node/device.h"

namespace palpate::device {

/// A device ready to be read, motors limp. The simulated device is the one driver so far; `hand`
/// and `seed` (of the hand's random stream) matter to it alone. `clock` must outlive the device.
[[nodiscard]] std::unique_ptr<HapticDevice> open_device(const DeviceConfig& config,
                                                        const HandConfig& hand, const Clock& clock,
                                                        std::uint64_t seed);

}  // namespace palpate::device
