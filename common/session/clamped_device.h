// SPDX-License-Identifier: Apache-2.0
// clamped_device.h — what mofc_node knows of the device whose force it limits.
#pragma once

#include <optional>

#include "common/core/time.h"
#include "common/core/workspace_map.h"
#include "common/session/device_profile.h"

namespace palpate {

struct DeviceConfig;

struct ClampedDevice {
  DeviceProfile profile{};
  std::optional<WristProfile> wrist{};  ///< none: the device gives no torque
  WorkspaceConfig workspace{};
  Duration lease{};                ///< T_hold: every command may act that long
  Duration longest_lease{};        ///< and none longer
  Duration reply{};                ///< δ_max: an answer begins to act by then after the reading
  Duration prompt{};               ///< δ_p: answers within it have the first claim to the credit
  double rate_hz = 1000.0;         ///< of its tick
  double peak_force_newton = 3.3;  ///< of this session
};

[[nodiscard]] ClampedDevice clamped_device(const DeviceConfig& device);

}  // namespace palpate
