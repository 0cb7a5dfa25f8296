// SPDX-License-Identifier: Apache-2.0
// plant.h — the mechanics that the simulated device and the ideal run share: device and hand are
// one rigid mass with set-valued friction, which the hand's spring and damper pull.
//
// Symbols, docs/theory.md §6 (three equal axes, friction isotropic or per axis):
//   m    device + hand                       [kg]
//   K,B  the hand's spring and damper        [N/m], [N·s/m]
//   f_d  viscous friction of the device      [N·s/m]
//   f_co Coulomb friction of the device      [N]
//   F    rendered force on the hand          [N]
//   W    weight of an arm without gravity compensation; 0 but in emulators  [N]
//   h    inner step                          [s]
//
//   m x'' = K (x_d − x) + B (x_d' − x') − f_d x' − f_co ξ + F + W ,   ξ = x'/|x'|, or any |ξ| ≤ 1
//   at rest; per axis: with f_d,i, f_co,i and ξ_i = sgn(x_i'), or any |ξ_i| ≤ 1 where the axis
//   rests
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/simulation_config.h"
#include "device_node/simulation/true_state.h"

namespace palpate::device {

/// The intended position and velocity of the hand. D.
struct Target {
  Vector3 position_m = Vector3::Zero();
  Vector3 velocity_m_per_s = Vector3::Zero();
};

struct PlantParameters {
  double mass_kg = 0.3;  ///< > 0
  double hand_stiffness_newton_per_m = 0.0;
  double hand_damping_newton_s_per_m = 0.0;
  double viscous_newton_s_per_m = 0.0;
  double coulomb_newton = 0.0;
  std::optional<FrictionPerAxis> per_axis = {};  ///< instead of the two above
  Vector3 weight_newton = Vector3::Zero();
};

/// Implicit midpoint, second order, with exact stick–slip: the mean velocity v̄ of a step solves
///
///   (2m/h)(v̄ − v) = K (x_d − x − h/2 v̄) + B (v_d − v̄) + F − f_d v̄ − f_co ξ ,   ξ ∈ ∂|v̄|
///
/// in closed form (soft threshold), targets taken in the middle of the step:
///
///   r = 2m/h v + K (x_d − x) + B v_d + F + W ,   A = 2m/h + f_d + B + K h/2
///   v̄ = max(0, 1 − f_co/|r|) r/A ,   Δx = h v̄ ,   v' = 2 v̄ − v ,   at rest v' = 0
///
/// With friction per axis each axis is such a plant by itself.
///
/// Energy E = Σ f_d |Δx|²/h + f_co |Δx| − F·Δx is exact for the step; what W does is stored. Coming
/// to rest inside a step drops ½ m v² of its kinetic energy unbooked, so E is never above the
/// energy that the hand gave less the change of kinetic energy, and below it by at most h²
/// |r|²/(8m) (≈ 1e-11 J) per stop. Lemma: supplied_energy.
class Plant {
 public:
  explicit Plant(const PlantParameters& parameters, const Vector3& position_m = Vector3::Zero(),
                 const Vector3& velocity_m_per_s = Vector3::Zero())
      : p_(parameters) {
    state_.hand_position_m = position_m;
    state_.hand_velocity_m_per_s = velocity_m_per_s;
  }

  /// One step of `h_s` > 0 under constant F; `target` is the hand's in the middle of the step.
  [[gnu::always_inline]] void step(double h_s, const Target& target,
                                   const Vector3& force_on_hand_newton) noexcept {
    advance(h_s, mean_velocity_m_per_s(h_s, target, force_on_hand_newton), force_on_hand_newton);
  }

  /// v̄ of the step that step() would take; zero where the hand sticks.
  [[nodiscard, gnu::always_inline]] Vector3 mean_velocity_m_per_s(double h, const Target& target,
                                                                  const Vector3& F) const noexcept {
    const double inertia = 2.0 * p_.mass_kg / h;
    const double K = p_.hand_stiffness_newton_per_m;
    const double B = p_.hand_damping_newton_s_per_m;
    const Vector3 r = inertia * state_.hand_velocity_m_per_s +
                      K * (target.position_m - state_.hand_position_m) +
                      B * target.velocity_m_per_s + F + p_.weight_newton;
    if (p_.per_axis) {
      Vector3 mean_velocity;
      for (int i = 0; i < 3; ++i) {
        const double A = inertia + p_.per_axis->viscous_newton_s_per_m[i] + B + 0.5 * K * h;
        const double moving = std::max(0.0, std::abs(r[i]) - p_.per_axis->coulomb_newton[i]);
        mean_velocity[i] = std::copysign(moving / A, r[i]);
      }
      return mean_velocity;
    }
    const double A = inertia + p_.viscous_newton_s_per_m + B + 0.5 * K * h;
    const double f_co = p_.coulomb_newton;
    if (f_co <= 0.0) return r / A;
    const double norm2 = r.squaredNorm();
    if (norm2 <= f_co * f_co) return Vector3::Zero();
    return r * ((1.0 - f_co / std::sqrt(norm2)) / A);
  }

  /// Takes the step whose mean velocity is known, and books its work.
  [[gnu::always_inline]] void advance(double h, const Vector3& mean_velocity,
                                      const Vector3& F) noexcept {
    if (p_.per_axis) return advance_per_axis(h, mean_velocity, F);
    const double speed2 = mean_velocity.squaredNorm();
    if (speed2 == 0.0) {
      state_.hand_velocity_m_per_s.setZero();
      return;
    }
    state_.hand_position_m += h * mean_velocity;
    state_.hand_velocity_m_per_s = 2.0 * mean_velocity - state_.hand_velocity_m_per_s;
    state_.energy_joule += h * (p_.viscous_newton_s_per_m * speed2 - F.dot(mean_velocity));
    if (p_.coulomb_newton > 0.0) {
      state_.energy_joule += h * p_.coulomb_newton * std::sqrt(speed2);
    }
    note_minimum();
  }

  [[nodiscard]] const TrueState& state() const noexcept { return state_; }

  void set_weight(const Vector3& weight_newton) noexcept { p_.weight_newton = weight_newton; }

 private:
  void advance_per_axis(double h, const Vector3& mean_velocity, const Vector3& F) noexcept {
    for (int i = 0; i < 3; ++i) {
      const double v = mean_velocity[i];
      double& after = state_.hand_velocity_m_per_s[i];
      after = v == 0.0 ? 0.0 : 2.0 * v - after;
      state_.hand_position_m[i] += h * v;
      state_.energy_joule += h * (p_.per_axis->viscous_newton_s_per_m[i] * v * v +
                                  p_.per_axis->coulomb_newton[i] * std::abs(v) - F[i] * v);
    }
    note_minimum();
  }

  void note_minimum() noexcept {
    if (state_.energy_joule < state_.minimum_energy_joule) {
      state_.minimum_energy_joule = state_.energy_joule;
    }
  }

  PlantParameters p_;
  TrueState state_;
};

/// Calls `step(middle, h_s)` for equal steps ≤ `longest` that fill [from, until]; `middle` is the
/// time of the step's middle [s] counted from `origin`. Nothing if until ≤ from.
template <class Step>
void in_equal_steps(TimePoint origin, TimePoint from, TimePoint until, Duration longest,
                    Step&& step) {
  if (until <= from) return;
  const std::int64_t n = ((until - from).count() + longest.count() - 1) / longest.count();
  const double h_s = to_seconds(until - from) / static_cast<double>(n);
  const double from_s = to_seconds(from - origin);
  for (std::int64_t i = 0; i < n; ++i) step(from_s + (static_cast<double>(i) + 0.5) * h_s, h_s);
}

}  // namespace palpate::device
