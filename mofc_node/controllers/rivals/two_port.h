// SPDX-License-Identifier: Apache-2.0
/// @file
/// two_port.h — time-domain passivity of the two ports of a delayed channel, hand and physics.
#pragma once

#include "passivity_control.h"

namespace palpate::controllers {

/// The energy of each port, separated by its direction; M: at the hand, S: at the physics.
///
///     M:  w = −F(k−1)·Δx(k)                              w > 0: E_in^M += w    else E_out^M −= w
///     S:  w = −½(F_e(k) + F_e(k−1))·Δx_S, per answer     w > 0: E_out^S += w   else E_in^S −= w
///
///     missing = E_in^S − (E_out^S − E_in^M)₊ − E_out^M
///     F       = F_e − α v,   α as in PassivityControl where missing < 0
///
/// What leaves at the hand must have entered at the physics, less what the physics received and the
/// hand did not give. Each sum only grows, so a port that dissipates now cannot hide what the other
/// leaked before, at any delay.
///
/// Property: after the correction the hand has not received more than the tissue gave, for any
/// delay and loss, a sample late. Broken by: tissue that generates energy itself, α_max, v near 0.
/// Source: [Ryu10]. Differs: hop 3 says where and what the physics evaluated, so both observers are
/// here; the published one sends the energies and has a second controller at the other end.
class TwoPort final : public ForceController {
 public:
  /// @param parameters  observer is not used
  explicit TwoPort(const PassivityControlParameters& parameters) : p_(parameters) {}
  void reset() noexcept override { *this = TwoPort(p_); }
  /// Needs ControlInput::evaluated_at_m of every fresh force.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  struct Port {
    double towards_physics_joule = 0.0;
    double towards_hand_joule = 0.0;
    void add(double work_joule) noexcept {
      (work_joule > 0.0 ? towards_physics_joule : towards_hand_joule) +=
          work_joule > 0.0 ? work_joule : -work_joule;
    }
  };

  PassivityControlParameters p_;
  IntervalReader interval_;
  Port hand_;
  Port physics_;
  bool has_evaluation_ = false;
  Vector3 evaluated_at_m_ = Vector3::Zero();
  Vector3 evaluated_newton_ = Vector3::Zero();
};

}  // namespace palpate::controllers
