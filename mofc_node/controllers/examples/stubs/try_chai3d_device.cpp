// SPDX-License-Identifier: Apache-2.0
// try_chai3d_device [CONTROLLER] — the wrapper on a shaking hand; status 1 if it extracts energy.
#include <chai3d_device.h>

#include "shaking_hand.h"

struct ShakenDevice : chai3d::cGenericHapticDevice {
  ShakingHand hand;
  bool getPosition(chai3d::cVector3d& position) override {
    position = {0.0, 0.0, hand.z()};
    return true;
  }
  bool setForceAndTorqueAndGripperForce(const chai3d::cVector3d& force, const chai3d::cVector3d&,
                                        double) override {
    hand.move(force(2));
    return true;
  }
};

int main(int argc, char** argv) {
  const auto shaken = std::make_shared<ShakenDevice>();
  PassiveDevice device(shaken, argc > 1 ? argv[1] : "guard");
  for (int k = 0; k < 2000; ++k) {
    chai3d::cVector3d position;
    const bool is_good = device.getPosition(position) &&
                         device.setForceAndTorqueAndGripperForce(
                             {0.0, 0.0, ShakingHand::wall_newton(position(2))}, {}, 0.0);
    if (!is_good) return 2;
  }
  return shaken->hand.verdict();
}
