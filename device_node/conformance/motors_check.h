// SPDX-License-Identifier: Apache-2.0
// motors_check.h — the check that enables a device (device_node/motor_check.h), of a driver.
#pragma once

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

[[nodiscard]] CheckOutcome check_motors(DeviceBench& bench);

}  // namespace palpate::device
