// SPDX-License-Identifier: Apache-2.0
// device_error.h — a transfer's outcome as the device's error.
#pragma once

#include "device_node/device.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

[[nodiscard]] constexpr DeviceError device_error(Transfer transfer) noexcept {
  switch (transfer) {
    case Transfer::kDone:
      return DeviceError::kNone;
    case Transfer::kTimeout:
      return DeviceError::kTimeout;
    case Transfer::kClosed:
      return DeviceError::kUnplugged;
    case Transfer::kCorrupt:
      return DeviceError::kCorrupt;
    case Transfer::kNotReady:
      return DeviceError::kNotReady;
    case Transfer::kDown:
    case Transfer::kFull:
      return DeviceError::kFailed;
  }
  return DeviceError::kFailed;
}

}  // namespace palpate::device
