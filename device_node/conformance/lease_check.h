// SPDX-License-Identifier: Apache-2.0
// lease_check.h — when does a force end whose motors cannot be seen? By the motion of a device that
// nobody holds.
#pragma once

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

/// Compares a push that its lease ends with pushes that a force of zero ends, at the end of that
/// lease and 10 ms later: the way that the device goes tells when the first one ended.
[[nodiscard]] CheckOutcome check_lease_by_motion(DeviceBench& bench);

}  // namespace palpate::device
