// SPDX-License-Identifier: Apache-2.0
// hardware.h — the simulated device as hardware has it: motors that do what they want when nobody
// tells them anything, forces and positions that come late, currents that are held while the arm
// turns.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>

#include "common/core/clock.h"
#include "common/core/random.h"
#include "device_node/simulation/simulated_device.h"

namespace palpate::device {

/// Each on its own; the defaults are a device without vices.
struct HardwareVices {
  static constexpr Duration kNever = std::chrono::hours(24);
  /// After so long without a message the motors end their force.
  Duration watchdog = kNever;
  Duration sensing{};       ///< positions are older than their answer by at most so much
  Duration actuation{};     ///< forces begin later than their message by at most so much
  bool has_jitter = false;  ///< each of both is 0 … that, instead of always that
  /// A force ends by itself so long after it began; 0: it does not.
  Duration acts_for{};
  double gain = 1.0;  ///< of the motors; below 0: a wrong sign
  /// Of the arm, where nothing compensates it, D. It is conservative, and no force of the motors.
  Vector3 weight_newton = Vector3::Zero();
};

/// Catches up with the clock whenever it is read or told something, and then in the order in which
/// things happened. Positions are at most 0.1 ms older than `sensing` says. One thread.
class Hardware {
 public:
  /// The force that the motors make while the hand is at `hand_m`: held currents. D.
  using HeldForce = std::function<Vector3(const Vector3& hand_m)>;

  Hardware(const SimulatedDeviceConfig& device, const HandConfig& hand, const Clock& clock,
           std::uint64_t seed);

  /// From the last reading or switch on.
  void set(const HardwareVices& vices) {
    vices_ = vices;
    device_.set_weight(vices.weight_newton);
  }
  [[nodiscard]] const HardwareVices& vices() const noexcept { return vices_; }

  [[nodiscard]] DeviceSample read();
  /// The same force wherever the hand is.
  /// @return  the reading of its answer; its force is that of the message
  DeviceSample switch_to(const Vector3& force_newton);
  DeviceSample switch_to(HeldForce force_newton);
  /// The motors end their force now.
  void let_go();

  /// That acts now [N].
  [[nodiscard]] Vector3 force_newton() const noexcept {
    return device_.motor_force_on_hand_newton();
  }
  /// As of the last call.
  [[nodiscard]] TrueState true_state() const noexcept { return device_.true_state(); }

 private:
  struct Switch {
    TimePoint due{};
    HeldForce force;
    bool is_held = false;  ///< it changes with the position
  };
  void begin(Switch next);
  void catch_up();
  void advance_to(TimePoint to);
  void make(const Vector3& force_newton);
  [[nodiscard]] Duration drawn(Duration most);
  [[nodiscard]] DeviceSample seen();

  const Clock& clock_;
  ManualClock time_;  ///< of the plant
  Random random_;
  SimulatedDevice device_;
  HardwareVices vices_;
  std::deque<Switch> switches_;  ///< that have not begun
  Switch acting_;
  TimePoint told_at_{};            ///< the last message
  TimePoint ends_at_;              ///< of the acting force by itself
  TimePoint seen_at_{};            ///< of the last position that was shown
  std::deque<DeviceSample> past_;  ///< samples that `sensing` may still show
};

}  // namespace palpate::device
