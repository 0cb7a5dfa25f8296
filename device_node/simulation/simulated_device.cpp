// SPDX-License-Identifier: Apache-2.0
#include "device_node/simulation/simulated_device.h"

#include <algorithm>
#include <cmath>

namespace palpate::device {

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
  force_on_hand_newton_.setZero();
  if (!force_on_hand_newton.allFinite()) return false;
  if (lease > Duration::zero()) {
    force_on_hand_newton_ = limited_to_norm(force_on_hand_newton, config_.peak_force_newton);
    lease_end_ = integrated_until_ + lease;
  }
  at_switch.applied_force_newton = force_on_hand_newton_;
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
  force_on_hand_newton_.setZero();
  return true;
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
  if (lease_end_ <= now && !force_on_hand_newton_.isZero(0.0)) {
    integrate_until(lease_end_);
    if (specification_.has_position_latch) latched_ = sample();
    force_on_hand_newton_.setZero();
  }
  integrate_until(now);
}

void SimulatedDevice::integrate_until(TimePoint until) noexcept {
  if (until <= integrated_until_) return;
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

DeviceSample SimulatedDevice::sample() const noexcept {
  DeviceSample sample{.hand_position_m = plant_.state().hand_position_m,
                      .buttons = hand_.buttons(to_seconds(integrated_until_ - start_)),
                      .sampled_at = integrated_until_};
  const double q = config_.position_resolution_m;
  if (q > 0.0) {
    for (double& x : sample.hand_position_m) x = q * std::round(x / q);
  }
  return sample;
}

}  // namespace palpate::device
