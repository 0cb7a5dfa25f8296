// SPDX-License-Identifier: Apache-2.0
// wired_device.h — the driver of a real device, its wire and the emulator behind it, as one device
// of a lockstep run on virtual time: what the clamp and the node see came through the wire, and the
// truth is known.
#pragma once

#include <chrono>
#include <memory>
#include <vector>

#include "common/core/clock.h"
#include "common/session/session.h"
#include "device_node/device.h"
#include "device_node/emulators/emulated_device.h"

namespace palpate::test {

enum class WiredDriver { kHaply, kHapi, kFalcon, kWooden };

/// The hardware behind an emulator.
class WiredHardware {
 public:
  virtual ~WiredHardware() = default;
  /// What happened to the motors in the faults.
  [[nodiscard]] virtual std::vector<device::FaultOutcome> outcomes() = 0;
  /// The machine sleeps, the hardware does not.
  virtual void sleep(Duration duration) = 0;
};

/// The simulated device of the side behind the emulator; its hand moves it.
/// @param watchdog  after which the emulated motors end a force if no message comes
/// @param seed      of the hand
/// @param faults    of the wire and the hardware; the device is a WiredHardware
/// @param limit     of a transfer, in real time
[[nodiscard]] std::unique_ptr<device::HapticDevice> open_wired(
    WiredDriver driver, const Side& side, const Clock& clock, std::uint64_t seed, Duration watchdog,
    const std::vector<device::PlannedFault>& faults = {},
    Duration limit = std::chrono::seconds(20));

}  // namespace palpate::test
