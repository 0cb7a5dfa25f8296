// SPDX-License-Identifier: Apache-2.0
#include "device_node/simulation/simulated_device.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "device_node/simulation/wrist_kinematics.h"

namespace palpate::device {
namespace {

Vector3 rounded(Vector3 values, double step) noexcept {
  if (step > 0.0) {
    for (double& x : values) x = step * std::round(x / step);
  }
  return values;
}

}  // namespace

SimulatedDevice::SimulatedDevice(const SimulatedDeviceConfig& device, const HandConfig& hand,
                                 const Clock& clock, std::uint64_t seed, HandGoals* goals)
    : config_(device),
      specification_{.model_name = "simulated",
                     .workspace_half_extent_m = kSimulatedHalfExtent_m,
                     .peak_force_newton = device.peak_force_newton,
                     .continuous_force_newton = device.peak_force_newton,
                     .position_resolution_m = device.position_resolution_m,
                     .button_count = 32,
                     .is_simulated = true,
                     .has_motor_watchdog = true,
                     .has_position_latch = device.has_position_latch},
      clock_(clock),
      hand_(hand, device, seed),
      goals_(goals),
      plant_(plant_of(device, hand), hand_.start_position_m()),
      wrist_(SimulatedWrist::of(device, hand, seed)),
      start_(clock.now()),
      integrated_until_(start_),
      lease_end_(start_) {}

bool SimulatedDevice::read(DeviceSample& at_now) noexcept {
  catch_up();
  at_now = sample();
  return true;
}

bool SimulatedDevice::apply(const Vector3& force_on_hand_newton, Duration lease,
                            DeviceSample& at_switch) noexcept {
  catch_up();
  at_switch = sample();
  end_force();
  const Vector3 torque = std::exchange(next_torque_newton_m_, Vector3::Zero());
  if (!force_on_hand_newton.allFinite() || !torque.allFinite()) return false;
  if (lease > Duration::zero()) {
    force_on_hand_newton_ = limited_to_norm(force_on_hand_newton, config_.peak_force_newton);
    lease_end_ = integrated_until_ + lease;
    if (wrist_) wrist_->set_torque(torque);
  }
  at_switch.applied_force_newton = force_on_hand_newton_;
  if (wrist_) at_switch.wrist->acting_torque_newton_m = wrist_->torque_newton_m();
  return true;
}

bool SimulatedDevice::take_latched(DeviceSample& at_end) noexcept {
  if (!latched_) return false;
  at_end = *latched_;
  latched_.reset();
  return true;
}

bool SimulatedDevice::release() noexcept {
  catch_up();
  end_force();
  return true;
}

void SimulatedDevice::end_force() noexcept {
  force_on_hand_newton_.setZero();
  if (wrist_) wrist_->set_torque(Vector3::Zero());
}

bool SimulatedDevice::is_acting() const noexcept {
  return !force_on_hand_newton_.isZero(0.0) || (wrist_ && !wrist_->torque_newton_m().isZero(0.0));
}

TrueState SimulatedDevice::true_state() const noexcept {
  TrueState state = plant_.state();
  if (wrist_) {
    state.energy_joule += wrist_->energy_joule();
    state.minimum_energy_joule = minimum_energy_joule_;
    state.wrist = {.angle_rad = wrist_->angle_rad(),
                   .velocity_rad_per_s = wrist_->velocity_rad_per_s()};
  }
  return state;
}

void SimulatedDevice::catch_up() noexcept {
  const TimePoint now = clock_.now();
  std::optional<HandGoal> goal;
  while (goals_ != nullptr && goals_->pop(goal)) {
    if (goal) {
      hand_.lead_to(goal->position_m, goal->buttons);
    } else {
      hand_.let_go();
    }
  }

  // the motor-side watchdog: the force ends with its lease, whenever this code next runs
  if (lease_end_ <= now && is_acting()) {
    integrate_until(lease_end_);
    if (specification_.has_position_latch) latched_ = sample();
    end_force();
  }
  integrate_until(now);
}

void SimulatedDevice::integrate_until(TimePoint until) noexcept {
  if (until <= integrated_until_) return;
  if (wrist_) return move_and_turn_until(until);
  // copies, so that their values stay in registers
  Plant plant = plant_;
  const auto integrate = [&, force = force_on_hand_newton_](auto target_at, auto done) {
    in_equal_steps(start_, integrated_until_, until, config_.inner_step,
                   [&](double middle_s, double h_s) {
                     plant.step(h_s, target_at(middle_s), force);
                     done(middle_s, h_s);
                   });
  };
  const auto follow = [&](auto target_at) {
    if (steps_ == nullptr) return integrate(target_at, [](double, double) {});
    integrate(target_at, [&](double middle_s, double h_s) {
      steps_->push_back({.until_s = middle_s + 0.5 * h_s,
                         .duration_s = h_s,
                         .hand_position_m = plant.state().hand_position_m,
                         .hand_velocity_m_per_s = plant.state().hand_velocity_m_per_s,
                         .force_on_hand_newton = force_on_hand_newton_});
    });
  };
  if (HostileHand* const hostile = hand_.hostile(force_on_hand_newton_); hostile != nullptr) {
    follow([hostile](double t_s) { return hostile->target(t_s); });
  } else {
    follow([this](double t_s) { return hand_.target_without_sense(t_s); });
  }
  plant_ = plant;
  integrated_until_ = std::max(integrated_until_, until);
}

/// The same with a wrist: both plants step together, as what counts is the sum of their energies.
void SimulatedDevice::move_and_turn_until(TimePoint until) noexcept {
  in_equal_steps(
      start_, integrated_until_, until, config_.inner_step, [&](double middle_s, double h_s) {
        plant_.step(h_s, hand_.target(middle_s, force_on_hand_newton_), force_on_hand_newton_);
        wrist_->step(middle_s, h_s);
        minimum_energy_joule_ =
            std::min(minimum_energy_joule_, plant_.state().energy_joule + wrist_->energy_joule());
        if (steps_ == nullptr) return;
        steps_->push_back({.until_s = middle_s + 0.5 * h_s,
                           .duration_s = h_s,
                           .hand_position_m = plant_.state().hand_position_m,
                           .hand_velocity_m_per_s = plant_.state().hand_velocity_m_per_s,
                           .force_on_hand_newton = force_on_hand_newton_,
                           .wrist_angle_rad = wrist_->angle_rad(),
                           .wrist_velocity_rad_per_s = wrist_->velocity_rad_per_s(),
                           .wrist_torque_newton_m = wrist_->torque_newton_m()});
      });
  integrated_until_ = until;
}

DeviceSample SimulatedDevice::sample() const noexcept {
  DeviceSample sample{.hand_position_m = plant_.state().hand_position_m,
                      .buttons = hand_.buttons(to_seconds(integrated_until_ - start_)),
                      .sampled_at = integrated_until_};
  sample.hand_position_m = rounded(sample.hand_position_m, config_.position_resolution_m);
  if (wrist_) {
    const Vector3 angle_rad = rounded(wrist_->angle_rad(), config_.wrist->angle_resolution_rad);
    sample.orientation = orientation_of_wrist(angle_rad);
    sample.wrist = {.pose = {.angle_rad = angle_rad, .axes = axes_of_wrist(angle_rad)},
                    .acting_torque_newton_m = wrist_->torque_newton_m()};
  }
  return sample;
}

}  // namespace palpate::device
