// SPDX-License-Identifier: Apache-2.0
// force_end_check.h — when does a force end whose motors cannot be observed? Judged by the motion
// of a device that nobody holds.
#pragma once

#include <cstdint>
#include <initializer_list>

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

/// What ends a push.
enum class PushEnd : std::uint8_t {
  kZeroForce,
  kLease,       ///< that nothing renews
  kLeaseAlone,  ///< nor does a call come in it, nor for thrice as long after it
  kRelease,
  kZeroLease,  ///< of an apply() of the same force
  kNegativeLease,
};

/// Compares a push of 10 ms that ends in each of these ways with pushes of 10 and of 20 ms that a
/// force of zero ends: how far the device goes tells when the force ended. A driver that ends a
/// force in its own next call is no watchdog; of kLeaseAlone the motion is seen only afterwards.
[[nodiscard]] CheckOutcome check_ends_by_motion(DeviceBench& bench,
                                                std::initializer_list<PushEnd> ends);

}  // namespace palpate::device
