// SPDX-License-Identifier: Apache-2.0
// guarded_motors.h — a guard before ideal motors: they do what it says, at once, for its lease.
#pragma once

#include "device_node/force_guard.h"

namespace palpate::test {

class GuardedMotors {
 public:
  GuardedMotors(const DeviceConfig& config, double device_peak_newton)
      : guard_(config, device_peak_newton) {}

  device::GuardedForce answered(const ForceCommand& command, TimePoint now) {
    return act(guard_.answered(command, now, now < until_ ? newton_ : Vector3(Vector3::Zero())),
               now);
  }
  device::GuardedForce missed(TimePoint now, TimePoint next_reading) {
    return act(guard_.missed(now, next_reading), now);
  }
  void reduced(const device::GuardedForce& less) {
    guard_.reduced(less);
    act(less, since_);
  }
  void withdraw_answer() {
    guard_.withdraw_answer();
    newton_.setZero();
  }
  void reset() {
    guard_.reset();
    newton_.setZero();
  }
  [[nodiscard]] std::uint64_t non_finite_commands() const { return guard_.non_finite_commands(); }

 private:
  const device::GuardedForce& act(const device::GuardedForce& force, TimePoint now) {
    if (!force.is_switch) return force;
    newton_ = force.force_on_hand_newton;
    since_ = now;
    until_ = now + force.lease;
    return force;
  }

  device::ForceGuard guard_;
  Vector3 newton_ = Vector3::Zero();
  TimePoint since_{};
  TimePoint until_{};
};

}  // namespace palpate::test
