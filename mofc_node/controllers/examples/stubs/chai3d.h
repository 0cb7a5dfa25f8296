// SPDX-License-Identifier: Apache-2.0
// chai3d.h — STUB of the few types of CHAI3D 3.2 that chai3d_device.h uses. Not CHAI3D.
#pragma once

#include <memory>

namespace chai3d {

struct cVector3d {
  double values[3] = {0.0, 0.0, 0.0};
  cVector3d() = default;
  cVector3d(double x, double y, double z) : values{x, y, z} {}
  double operator()(int i) const { return values[i]; }
};

class cGenericHapticDevice {
 public:
  virtual ~cGenericHapticDevice() = default;
  virtual bool getPosition(cVector3d& position) = 0;
  virtual bool setForceAndTorqueAndGripperForce(const cVector3d& force, const cVector3d& torque,
                                                double gripper) = 0;
};
using cGenericHapticDevicePtr = std::shared_ptr<cGenericHapticDevice>;

/// Of a loop at exactly 1 kHz.
class cPrecisionClock {
 public:
  double start(bool) { return 0.0; }
  double stop() { return 0.001; }
};

}  // namespace chai3d
