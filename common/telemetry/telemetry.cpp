// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/telemetry.h"

namespace palpate {

const char* name(GuardState state) {
  switch (state) {
    case GuardState::kLimp:
      return "limp";
    case GuardState::kAnswered:
      return "answered";
    case GuardState::kLeased:
      return "leased";
    case GuardState::kFallback:
      return "fallback";
    case GuardState::kFading:
      return "fading";
    case GuardState::kFault:
      return "fault";
  }
  return "?";
}

const char* name(DevicePhase phase) {
  switch (phase) {
    case DevicePhase::kUnknown:
      return "unknown";
    case DevicePhase::kClosed:
      return "closed";
    case DevicePhase::kConnected:
      return "connected";
    case DevicePhase::kCalibrated:
      return "calibrated";
    case DevicePhase::kEnabled:
      return "enabled";
    case DevicePhase::kFaulted:
      return "faulted";
    case DevicePhase::kChecking:
      return "checking";
  }
  return "?";
}

const char* name(FaultReason reason) {
  switch (reason) {
    case FaultReason::kNone:
      return "none";
    case FaultReason::kReadFailed:
      return "read failed";
    case FaultReason::kReadingNotFinite:
      return "reading not finite";
    case FaultReason::kPositionJumped:
      return "position jumped";
    case FaultReason::kWriteFailed:
      return "write failed";
    case FaultReason::kDeviceSilent:
      return "device silent";
    case FaultReason::kDeviceGone:
      return "device gone";
    case FaultReason::kDeviceCorrupt:
      return "device corrupt";
    case FaultReason::kDeviceNotReady:
      return "device not ready";
    case FaultReason::kSuspended:
      return "machine suspended";
    case FaultReason::kPositionFrozen:
      return "position frozen";
    case FaultReason::kMotorsWrongWay:
      return "motors push the wrong way";
    case FaultReason::kMotorsTooStrong:
      return "motors too strong";
    case FaultReason::kMotorsNotSeen:
      return "motors not seen to push";
    case FaultReason::kCheckInterrupted:
      return "check of the motors interrupted";
    case FaultReason::kAccountWrong:
      return "account of the energy is wrong";
    case FaultReason::kMotorsDiffer:
      return "measured forces differ from the commands";
  }
  return "?";
}

const char* name(MofcState state) {
  switch (state) {
    case MofcState::kNoPhysics:
      return "no physics";
    case MofcState::kFree:
      return "free";
    case MofcState::kContact:
      return "contact";
    case MofcState::kFading:
      return "fading";
    case MofcState::kClutched:
      return "clutched";
  }
  return "?";
}

}  // namespace palpate
