// SPDX-License-Identifier: Apache-2.0
// simulated_wrist.h — the joints of a simulated wrist and the hand that turns them.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>

#include "common/core/vector.h"
#include "common/session/simulation_config.h"
#include "device_node/simulation/hand.h"
#include "device_node/simulation/plant.h"

namespace palpate::device {

/// Each joint is an inertia with friction by itself: a plant with rad for m and N·m for N.
class SimulatedWrist {
 public:
  /// @param seed  of the device; the hand turns by a random stream of its own
  /// @return      none: the device has no wrist
  [[nodiscard]] static std::optional<SimulatedWrist> of(const SimulatedDeviceConfig& device,
                                                        const HandConfig& hand,
                                                        std::uint64_t seed) {
    if (!device.wrist) return std::nullopt;
    return SimulatedWrist(joints_of(device), turning_of(hand), seed + 1);
  }

  /// From now on, on the hand, per joint; each at most its peak.
  void set_torque(const Vector3& torque_newton_m) noexcept {
    torque_newton_m_ = limited_per_component(torque_newton_m, Vector3::Constant(peak_newton_m_));
  }
  [[nodiscard]] const Vector3& torque_newton_m() const noexcept { return torque_newton_m_; }
  void step(double middle_s, double h_s) noexcept {
    plant_.step(h_s, hand_.target(middle_s, torque_newton_m_), torque_newton_m_);
  }
  [[nodiscard]] const Vector3& angle_rad() const noexcept { return plant_.state().hand_position_m; }
  [[nodiscard]] const Vector3& velocity_rad_per_s() const noexcept {
    return plant_.state().hand_velocity_m_per_s;
  }
  [[nodiscard]] double energy_joule() const noexcept { return plant_.state().energy_joule; }

 private:
  SimulatedWrist(const SimulatedDeviceConfig& joints, const HandConfig& turning, std::uint64_t seed)
      : peak_newton_m_(joints.peak_force_newton),
        hand_(turning, joints, seed),
        plant_(plant_of(joints, turning), hand_.start_position_m()) {}

  double peak_newton_m_;
  Hand hand_;
  Plant plant_;
  Vector3 torque_newton_m_ = Vector3::Zero();
};

}  // namespace palpate::device
