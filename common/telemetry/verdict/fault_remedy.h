// SPDX-License-Identifier: Apache-2.0
// fault_remedy.h — what a person does about a fault of the device.
#pragma once

#include "common/telemetry/device_telemetry.h"

namespace palpate {

[[nodiscard]] inline const char* remedy_of(FaultReason reason) {
  switch (reason) {
    case FaultReason::kPositionJumped:
      return "check the encoders and their cables; no hand is faster than device.v_fault_m_per_s";
    case FaultReason::kReadFailed:
    case FaultReason::kWriteFailed:
    case FaultReason::kDeviceSilent:
    case FaultReason::kDeviceGone:
    case FaultReason::kDeviceNotReady:
      return "check cable, supply and calibration of the device, then reset the fault (SIGUSR2)";
    case FaultReason::kReadingNotFinite:
    case FaultReason::kDeviceCorrupt:
      return "check the driver and its connection: `palpate conform device`";
    case FaultReason::kSuspended:
      return "keep the machine awake while a session runs, then reset the fault (SIGUSR2)";
    case FaultReason::kPositionFrozen:
      return "check the encoders and what passes on their positions, then reset the fault "
             "(SIGUSR2)";
    case FaultReason::kMotorsWrongWay:
      return "correct the signs and axes of the session; `palpate conform device` shows them";
    case FaultReason::kMotorsTooStrong:
      return "correct the session's gain with a known weight, or measure the friction again: "
             "`palpate identify`";
    case FaultReason::kMotorsNotSeen:
      return "check the supply of the motors, hold the handle loosely and still, then reset the "
             "fault (SIGUSR2)";
    case FaultReason::kCheckInterrupted:
      return "the ticks pause too often: `palpate doctor` checks the machine; then reset the fault "
             "(SIGUSR2)";
    case FaultReason::kAccountWrong:
      return "a fault of device_node itself: keep the flight recording (`palpate report FILE`) and "
             "report it";
    case FaultReason::kMotorsDiffer:
      return "check supply, amplifiers and cables of the motors, and whether another program sends "
             "forces or changes them, then reset the fault (SIGUSR2)";
    case FaultReason::kNone:
      break;
  }
  return "see the log of device_node";
}

}  // namespace palpate
