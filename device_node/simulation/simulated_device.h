// SPDX-License-Identifier: Apache-2.0
// simulated_device.h — a haptic device and the hand that holds it, as one mass with friction
// (plant.h). Has a motor-side watchdog and knows its true energy.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/core/clock.h"
#include "common/core/spsc_ring.h"
#include "common/session/simulation_config.h"
#include "device_node/device.h"
#include "device_node/simulation/hand.h"
#include "device_node/simulation/plant.h"
#include "device_node/simulation/simulated_wrist.h"
#include "device_node/simulation/true_state.h"

namespace palpate::device {

/// Where a pointer leads the hand, and what it does there.
struct HandGoal {
  Vector3 position_m = Vector3::Zero();  ///< D
  std::uint32_t buttons = 0;             ///< bit i: it presses button i
};
/// From the thread that receives a pointer's targets to the tick thread; none: it lets go.
using HandGoals = SpscRing<std::optional<HandGoal>>;

/// One inner step of the integration, as it ended.
struct InnerStep {
  double until_s = 0.0;  ///< since the start
  double duration_s = 0.0;
  Vector3 hand_position_m = Vector3::Zero();        ///< D
  Vector3 hand_velocity_m_per_s = Vector3::Zero();  ///< D
  Vector3 force_on_hand_newton = Vector3::Zero();   ///< D, acted in this step
  // with a wrist, per joint
  Vector3 wrist_angle_rad = Vector3::Zero();
  Vector3 wrist_velocity_rad_per_s = Vector3::Zero();
  Vector3 wrist_torque_newton_m = Vector3::Zero();  ///< on the hand, acted in this step
};

/// Integrates up to clock.now() whenever it is read, written or released, in equal inner steps of
/// at most `inner_step`; so it runs on virtual time and in real time. After the process was
/// stopped, the force has ended at the exact instant at which its lease did. Catching up takes less
/// than 0.1 µs of computing per inner step.
///
/// The encoder rounds each axis to the nearest multiple of the resolution. The workspace is
/// specified but has no walls. Motors have no thermal model: the continuous force is the peak
/// force.
class SimulatedDevice final : public HapticDevice, public MotorForceSource, public TrueStateSource {
 public:
  /// The hand rests on its path's start; its time starts now.
  /// @param goals  optional, must outlive the device: where a pointer leads the hand, D; read by
  ///               the thread that reads the device
  SimulatedDevice(const SimulatedDeviceConfig& device, const HandConfig& hand, const Clock& clock,
                  std::uint64_t seed, HandGoals* goals = nullptr);

  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return specification_;
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override;
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override;
  void set_wrist_torque(const Vector3& torque_on_hand_newton_m) noexcept override {
    next_torque_newton_m_ = torque_on_hand_newton_m;
  }
  [[nodiscard]] bool take_latched(DeviceSample& at_end) noexcept override;
  [[nodiscard]] bool release() noexcept override;
  [[nodiscard]] TrueState true_state() const noexcept override;

  /// From now on appends every inner step to `steps`, which allocates: for lockstep and
  /// recomputing.
  /// @param steps  null: no longer; must outlive the device otherwise
  void record_steps(std::vector<InnerStep>* steps) noexcept { steps_ = steps; }

  /// A constant force on the arm that is none of the motors', from the last reading or switch on,
  /// D.
  void set_weight(const Vector3& weight_newton) noexcept { plant_.set_weight(weight_newton); }

  [[nodiscard]] Vector3 motor_force_on_hand_newton() const noexcept override {
    return force_on_hand_newton_;
  }

 private:
  void catch_up() noexcept;
  void move_and_turn_until(TimePoint until) noexcept;
  void end_force() noexcept;
  [[nodiscard]] bool is_acting() const noexcept;
  void integrate_until(TimePoint until) noexcept;
  [[nodiscard]] DeviceSample sample() const noexcept;

  SimulatedDeviceConfig config_;
  DeviceSpecification specification_;
  const Clock& clock_;
  Hand hand_;
  HandGoals* goals_;
  Plant plant_;
  std::optional<SimulatedWrist> wrist_;
  double minimum_energy_joule_ = 0.0;  // with a wrist: of both, over all inner steps
  Vector3 next_torque_newton_m_ = Vector3::Zero();
  TimePoint start_;
  TimePoint integrated_until_;
  Vector3 force_on_hand_newton_ = Vector3::Zero();
  TimePoint lease_end_;
  std::optional<DeviceSample> latched_;  // as the watchdog ended the last force
  std::vector<InnerStep>* steps_ = nullptr;
};

}  // namespace palpate::device
