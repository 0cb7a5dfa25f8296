// SPDX-License-Identifier: Apache-2.0
// chai3d_device.h — a CHAI3D device that limits the force on its way to another one:
// tool->setHapticDevice(std::make_shared<PassiveDevice>(device, "guard")).
// Compiled here against stubs/chai3d.h, not against CHAI3D.
#pragma once

#include <chai3d.h>
#include <palpate_controllers.h>

class PassiveDevice : public chai3d::cGenericHapticDevice {
 public:
  PassiveDevice(const chai3d::cGenericHapticDevicePtr& device, const char* controller)
      : device_(device), controller_(palpate_controller_create(controller)) {}
  ~PassiveDevice() override { palpate_controller_destroy(controller_); }
  bool getPosition(chai3d::cVector3d& position) override { return device_->getPosition(position); }
  bool setForceAndTorqueAndGripperForce(const chai3d::cVector3d& force,
                                        const chai3d::cVector3d& torque, double gripper) override {
    chai3d::cVector3d position;
    if (!device_->getPosition(position)) return false;
    last_.duration_s = clock_.stop();  // since the force before was sent
    clock_.start(true);
    for (int i = 0; i < 3; ++i) {
      last_.hand_position_at_end_m[i] = input_.hand_position_m[i] = position(i);
      input_.requested_force_on_hand_newton[i] = force(i);
    }
    palpate_output out;
    palpate_controller_step(controller_, &input_, &out);  // no force if it fails
    const double(&f)[3] = out.force_on_hand_newton;
    for (int i = 0; i < 3; ++i) last_.force_on_hand_newton[i] = f[i];
    input_.applied = &last_;
    input_.applied_count = 1;
    return device_->setForceAndTorqueAndGripperForce({f[0], f[1], f[2]}, torque, gripper);
  }

 private:
  chai3d::cGenericHapticDevicePtr device_;
  palpate_controller* controller_;
  palpate_input input_ = {};
  palpate_stretch last_ = {};
  chai3d::cPrecisionClock clock_;
};
