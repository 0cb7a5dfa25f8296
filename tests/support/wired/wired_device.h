// SPDX-License-Identifier: Apache-2.0
// wired_device.h — the driver of a real device, its wire and the emulator behind it, as one device
// of a lockstep run on virtual time: what the clamp and the node see came through the wire, and the
// truth is known.
#pragma once

#include <memory>

#include "common/core/clock.h"
#include "common/session/session.h"
#include "device_node/device.h"

namespace palpate::test {

enum class WiredDriver { kHaply, kHapi, kFalcon, kWooden };

/// The simulated device of the side behind the emulator; its hand moves it.
/// @param watchdog  after which the emulated motors end a force if no message comes
/// @param seed      of the hand
[[nodiscard]] std::unique_ptr<device::HapticDevice> open_wired(WiredDriver driver, const Side& side,
                                                               const Clock& clock,
                                                               std::uint64_t seed,
                                                               Duration watchdog);

}  // namespace palpate::test
