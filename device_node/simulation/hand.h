// SPDX-License-Identifier: Apache-2.0
// hand.h — hands that hold a simulated device: their intended position, and the buttons they press.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "common/core/random.h"
#include "common/session/simulation_config.h"
#include "device_node/simulation/plant.h"

namespace palpate::device {

/// Of a simulated device that nobody holds.
[[nodiscard]] inline HandConfig nobody() {
  HandConfig hand;
  hand.mass_kg = 0.0;
  hand.stiffness_newton_per_m = 0.0;
  hand.damping_newton_s_per_m = 0.0;
  hand.wrist = {
      .inertia_kg_m2 = 0.0, .stiffness_newton_m_per_rad = 0.0, .damping_newton_m_s_per_rad = 0.0};
  return hand;
}

/// The same, while a person beside the device presses its buttons as this hand does.
[[nodiscard]] inline HandConfig beside(const HandConfig& hand) {
  HandConfig let_go = nobody();
  let_go.presses = hand.presses;
  return let_go;
}

/// Intended point at `t_s` ≥ 0 seconds after the start.
///
/// V: the V starts at s = apex − half_width·tangent + height·normal. For the first t_free seconds
/// the point moves on a circle of radius `amplitude` in the V's plane, through s and above it;
/// then it moves s → apex → end at constant speed and stays at the end. If the circle does not end
/// at s, the remaining offset is removed smoothly (3u² − 2u³) over its last quarter turn, or over
/// all of it if it is shorter. So the position is continuous; the velocity jumps at s, at the apex
/// and at the end, as the paper's V does.
[[nodiscard]] Target target_on(const VPath& path, double t_s) noexcept;
[[nodiscard]] Target target_on(const HoldPath& path, double t_s) noexcept;
[[nodiscard]] Target target_on(const SinusoidPath& path, double t_s) noexcept;
/// Between samples the velocity is constant; at the held ends it is zero. A loop jumps from the
/// last sample to the first.
[[nodiscard]] Target target_on(const RecordedPath& path, double t_s) noexcept;

/// target_on() of a sinusoid path at a series of times. Where they are equally spaced each is
/// turned from the one before, and every 65th is computed anew: within 1e-13 of the amplitude at
/// first, and 1e-9 after an hour, when times are rounded that much.
class SinusoidSteps {
 public:
  explicit SinusoidSteps(const SinusoidPath& path);
  [[nodiscard]] Target at(double t_s) noexcept;

 private:
  struct Phasor {
    double sin = 0.0;
    double cos = 1.0;
  };
  SinusoidPath path_;
  Vector3 omega_rad_per_s_;
  std::array<Phasor, 3> now_{};
  std::array<Phasor, 3> turn_{};  // of a step
  double t_s_ = 0.0;
  double step_s_ = 0.0;
  bool has_turn_ = false;
  int left_ = 0;  // steps until one is computed anew
};

/// Tries to draw energy from the rendered force. At random times it picks one of three ways:
///
///   drain   follow the force at the speed that draws most from a held force against the device's
///           friction, v* = (|F| − f_co)/(2 f_d) ([MOFC] eq. (12)), per axis where the
///           friction is
///   press   back into the scene, roughly against the last rendered force, or in any direction
///   shake   to and fro along the force, reversing every 0.5 … 25 ms, near sampling periods
///
/// The intended point is never faster than v_max and never farther than radius from the centre.
class HostileHand {
 public:
  /// @param device  the hand knows its true friction
  HostileHand(const HostilePath& path, const SimulatedDeviceConfig& device, std::uint64_t seed);

  /// The force that the hand feels from now on.
  /// @param force_on_hand_newton  rendered, D
  void feel(const Vector3& force_on_hand_newton) noexcept {
    if (force_on_hand_newton != sensed_newton_) sense(force_on_hand_newton);
  }
  /// Call with growing `t_s`.
  [[nodiscard]] Target target(double t_s) noexcept {
    const double dt_s = t_s - t_s_;
    if (!(dt_s > 0.0)) return {position_m_, Vector3::Zero()};
    t_s_ = t_s;
    if (t_s >= turns_s_) turn(t_s);

    // move, but stay inside the ball: at its surface the outward part of the motion is removed
    const Vector3 moved = position_m_ + dt_s * wanted_m_per_s_;
    Vector3 from_center = moved - path_.center_m;
    if (from_center.squaredNorm() > surely_inside_m2_) {
      from_center = limited_to_norm(from_center, path_.radius_m);
    }
    const Vector3 next = path_.center_m + from_center;
    const Vector3 velocity = (next - position_m_) / dt_s;
    position_m_ = next;
    return {next, velocity};
  }
  /// Intended at t_s().
  [[nodiscard]] const Vector3& position_m() const noexcept { return position_m_; }
  [[nodiscard]] double t_s() const noexcept { return t_s_; }

 private:
  enum class Way : std::uint8_t { kDrain, kPress, kShake };
  void sense(const Vector3& force_on_hand_newton) noexcept;
  void choose(double t_s) noexcept;
  void turn(double t_s) noexcept;
  [[nodiscard]] Vector3 most_draining_velocity(const Vector3& force_on_hand_newton) const noexcept;

  HostilePath path_;
  double viscous_newton_s_per_m_;
  double coulomb_newton_;
  std::optional<FrictionPerAxis> per_axis_;
  Random random_;
  Way way_ = Way::kPress;
  double t_s_ = 0.0;
  double since_s_ = 0.0;
  double until_s_ = 0.0;
  double half_period_s_ = 0.0;
  double speed_m_per_s_ = 0.0;
  Vector3 direction_ = Vector3::UnitZ();
  Vector3 sensed_newton_ = Vector3::Zero();         ///< the force now
  Vector3 last_force_direction_ = Vector3::Zero();  ///< zero: no force rendered yet
  Vector3 most_draining_m_per_s_ = Vector3::Zero();
  Vector3 wanted_m_per_s_ = Vector3::Zero();
  double turns_s_ = 0.0;  ///< when wanted_m_per_s_ may change
  Vector3 position_m_;
  double surely_inside_m2_;  ///< squared distance from the centre, less than radius² by rounding
};

/// A hand that a pointer leads: the intended point follows the goal with a time constant of 50 ms,
/// which smooths the steps of the pointer, never faster than `speed` and never farther than `reach`
/// from the centre.
class LedHand {
 public:
  /// @param from_m  the present intended point
  LedHand(const PointerConfig& config, const Vector3& from_m, double t_s)
      : config_(config), position_m_(from_m), goal_m_(from_m), t_s_(t_s) {}

  /// Finite.
  void lead_to(const Vector3& goal_m) noexcept;
  /// Call with growing `t_s`.
  [[nodiscard]] Target target(double t_s) noexcept;
  /// The same on the way back to a path, within the same limits; call instead of target().
  /// @param path  where it is at `t_s`
  [[nodiscard]] Target target_towards(const Target& path, double t_s) noexcept;

 private:
  PointerConfig config_;
  Vector3 position_m_;
  Vector3 goal_m_;
  double t_s_;
};

/// The hand of a session: on its path until a pointer leads it. The same configuration and seed
/// give the same motion, to the bit.
class Hand {
 public:
  /// @param device  a hostile hand knows its true friction
  Hand(const HandConfig& config, const SimulatedDeviceConfig& device, std::uint64_t seed);

  /// Position of the hand before it starts.
  [[nodiscard]] const Vector3& start_position_m() const noexcept { return start_position_m_; }
  /// The hand as a hostile one that feels this force from now on; null if it is none.
  /// @param force_on_hand_newton  rendered, D
  [[nodiscard]] HostileHand* hostile(const Vector3& force_on_hand_newton) noexcept {
    if (!is_hostile_ || led_) return nullptr;
    hostile_.feel(force_on_hand_newton);
    return &hostile_;
  }
  /// Call once per inner step, in order, with the time of its middle since the device's start.
  /// No allocation, no throw.
  /// @param force_on_hand_newton  rendered, D
  [[nodiscard]] Target target(double t_s, const Vector3& force_on_hand_newton) noexcept {
    HostileHand* const hostile_hand = hostile(force_on_hand_newton);
    return hostile_hand != nullptr ? hostile_hand->target(t_s) : target_without_sense(t_s);
  }
  /// The same for a hand that is no hostile one.
  [[nodiscard]] Target target_without_sense(double t_s) noexcept;
  /// From now on the hand moves to this goal (D) and stays there, until it is let go. Does nothing
  /// without hand.pointer in the session.
  /// @param buttons  bit i: button i is pressed until then, too
  void lead_to(const Vector3& goal_m, std::uint32_t buttons = 0) noexcept;
  /// The hand returns to where its path is by then, and follows it. A hostile hand stays where it
  /// was led.
  void let_go() noexcept;
  /// Bit i set while button i is pressed: from ≤ t < until, or by the pointer.
  [[nodiscard]] std::uint32_t buttons(double t_s) const noexcept;

 private:
  [[nodiscard]] Target on_path(double t_s) const noexcept;

  HandConfig config_;
  std::optional<SinusoidSteps> sinusoid_;  ///< if that is the path
  bool is_hostile_;
  HostileHand hostile_;  ///< at rest unless the path is a hostile one
  Vector3 start_position_m_;
  Vector3 intended_m_;  ///< by the path, at t_s_; a hostile hand has its own
  double t_s_ = 0.0;
  std::optional<LedHand> led_;
  std::uint32_t led_buttons_ = 0;
  bool is_returning_ = false;  ///< to its path
};

/// The joints of a device's wrist as such a device, and the hand that turns them as such a hand:
/// rad for m, N·m for N, kg·m² for kg.
/// @param device  has a wrist
[[nodiscard]] SimulatedDeviceConfig joints_of(const SimulatedDeviceConfig& device);
[[nodiscard]] HandConfig turning_of(const HandConfig& hand);

/// Device and hand as one mass.
[[nodiscard]] PlantParameters plant_of(const SimulatedDeviceConfig& device, const HandConfig& hand);

}  // namespace palpate::device
