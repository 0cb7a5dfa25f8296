// SPDX-License-Identifier: Apache-2.0
// lag_check.h — is a position as young as its stamp, its skew and the latency of the session say?
#pragma once

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

/// By the begin of the motion after a switch. From rest, a constant force moves a mass with
/// friction at most as fast as t²: x(t) ≥ x(T) (t/T)² for t ≤ T. A device that has gone less at t
/// began to move, or shows its motion, later than the switch by at least
///
///   d = (t − s T) / (1 − s) ,   s = √(x(t)/x(T))
///
/// Fails where the least d of six pushes exceeds the skew and the latency of the session by more
/// than 1 ms and the tolerance of stamps.
[[nodiscard]] CheckOutcome check_lag(DeviceBench& bench);

}  // namespace palpate::device
