// SPDX-License-Identifier: Apache-2.0
// ideal_run.h — the ideal run of docs/theory.md §7.1: the same hand and the same device in direct
// contact with the continuous tissue. No network, no sampling, no encoder, no controller. For
// comparison only.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "common/session/simulation_config.h"
#include "device_node/simulation/hand.h"
#include "device_node/simulation/plant.h"
#include "device_node/simulation/simulated_wrist.h"

namespace palpate::device {

class IdealRun {
 public:
  /// Force of the tissue on the hand [N] at a time since the start [s], a hand position [m] and
  /// velocity [m/s], all in D. Evaluated several times for one instant.
  using ForceField = std::function<Vector3(double time_s, const Vector3& hand_position_m,
                                           const Vector3& hand_velocity_m_per_s)>;
  /// Called with the position reached in each step; for tissue with memory.
  using StepDone = std::function<void(double time_s, const Vector3& hand_position_m)>;

  /// Torque of the tissue on the joints of the wrist [N·m], as of the last call of ForceField; that
  /// one finds their angles in wrist_angle_rad().
  using TorqueField = std::function<Vector3()>;

  /// @param seed  of the hand's random stream, the same as the device's
  /// @param peak_force_newton  the session's; the device's own limit holds too
  IdealRun(const SimulatedDeviceConfig& simulated, double peak_force_newton, const HandConfig& hand,
           std::uint64_t seed, TimePoint start, ForceField force, StepDone step_done = {},
           TorqueField torque = {})
      : inner_step_(simulated.inner_step),
        peak_newton_(std::min(peak_force_newton, simulated.peak_force_newton)),
        hand_(hand, simulated, seed),
        plant_(plant_of(simulated, hand), hand_.start_position_m()),
        start_(start),
        reached_(start),
        force_(std::move(force)),
        step_done_(std::move(step_done)),
        torque_(std::move(torque)) {
    if (torque_) wrist_ = SimulatedWrist::of(simulated, hand, seed);
  }

  /// Integrates up to `until`; does nothing if that has passed.
  void advance_to(TimePoint until) {
    in_equal_steps(start_, reached_, until, inner_step_,
                   [this](double middle_s, double h_s) { step(middle_s, h_s); });
    reached_ = std::max(reached_, until);
  }

  [[nodiscard]] const TrueState& state() const noexcept { return plant_.state(); }
  /// Zero without a wrist.
  [[nodiscard]] Vector3 wrist_angle_rad() const noexcept {
    return wrist_ ? wrist_->angle_rad() : Vector3(Vector3::Zero());
  }
  [[nodiscard]] Vector3 wrist_velocity_rad_per_s() const noexcept {
    return wrist_ ? wrist_->velocity_rad_per_s() : Vector3(Vector3::Zero());
  }
  /// Limited to the device's peak; mean of the last inner step.
  [[nodiscard]] const Vector3& force_on_hand_newton() const noexcept {
    return force_on_hand_newton_;
  }

 private:
  /// Force and mean velocity of a step depend on each other: iterated to a fixed point at the
  /// step's middle. Each pass shrinks the error by b h/(2m) for a damper b, 1/80 for the paper's
  /// 150 N·s/m on 0.3 kg at 50 µs, so three leave less than 2e-6 of it.
  void step(double middle_s, double h_s) {
    const TrueState before = plant_.state();
    const Target target = hand_.target(middle_s, force_on_hand_newton_);
    Vector3 mean_velocity = before.hand_velocity_m_per_s;
    for (int pass = 0; pass < 3; ++pass) {
      const Vector3 middle_m = before.hand_position_m + 0.5 * h_s * mean_velocity;
      force_on_hand_newton_ =
          limited_to_norm(force_(middle_s, middle_m, mean_velocity), peak_newton_);
      mean_velocity = plant_.mean_velocity_m_per_s(h_s, target, force_on_hand_newton_);
    }
    plant_.advance(h_s, mean_velocity, force_on_hand_newton_);
    if (wrist_) {
      wrist_->set_torque(torque_());
      wrist_->step(middle_s, h_s);
    }
    if (step_done_) step_done_(middle_s + 0.5 * h_s, plant_.state().hand_position_m);
  }

  Duration inner_step_;
  double peak_newton_;
  Hand hand_;
  Plant plant_;
  TimePoint start_;
  TimePoint reached_;
  ForceField force_;
  StepDone step_done_;
  TorqueField torque_;
  std::optional<SimulatedWrist> wrist_;  // its torque is of half an inner step before
  Vector3 force_on_hand_newton_ = Vector3::Zero();
};

}  // namespace palpate::device
