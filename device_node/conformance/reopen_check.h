// SPDX-License-Identifier: Apache-2.0
// reopen_check.h — does a device know after reopen() where it is?
#pragma once

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

/// Opens a device again that a small push has moved: it stays where it is, or says that it needs a
/// calibration. The checks after it may find one that does.
[[nodiscard]] CheckOutcome check_reopen(DeviceBench& bench);

}  // namespace palpate::device
