// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/passivity_control.h"

#include <algorithm>

namespace palpate::controllers {

InjectedDamping inject_damping(const Vector3& requested_force_on_hand_newton,
                               const Vector3& velocity_m_per_s, double missing_joule,
                               const PassivityControlParameters& p) noexcept {
  InjectedDamping injected{.force_on_hand_newton = requested_force_on_hand_newton};
  const double v2 = velocity_m_per_s.squaredNorm();
  if (missing_joule < 0.0 && v2 > p.least_speed * p.least_speed) {
    injected.alpha = std::min(p.most_damping, -missing_joule / (p.T * v2));
    injected.force_on_hand_newton -= injected.alpha * velocity_m_per_s;
  }
  return injected;
}

void PassivityControl::reset() noexcept {
  interval_.reset();
  energy_joule_ = alpha_ = speed_ = reference_joule_ = 0.0;
  evaluated_at_m_.setZero();
  evaluated_newton_.setZero();
}

ControlOutput PassivityControl::step(const ControlInput& input) noexcept {
  using Observer = PassivityControlParameters::Observer;
  const Interval interval = interval_.read(input);
  const Vector3& requested = input.requested_force_on_hand_newton;
  Vector3 v = interval.velocity_m_per_s();
  double reference_joule = 0.0;
  if (p_.observer == Observer::kProduct) {
    v = input.hand_velocity_m_per_s;
    energy_joule_ += p_.T * (alpha_ * speed_ * speed_ - requested.dot(v));
  } else {
    energy_joule_ += interval.work_joule;
  }
  if (p_.observer == Observer::kReference) {
    if (requested.isZero(0.0)) energy_joule_ = reference_joule_ = 0.0;
    observe_reference(input);
    // since that evaluation F_e is held
    reference_joule =
        reference_joule_ - evaluated_newton_.dot(input.hand_position_m - evaluated_at_m_);
  }
  const double missing_joule = energy_joule_ - reference_joule;
  const InjectedDamping injected = inject_damping(requested, v, missing_joule, p_);
  alpha_ = injected.alpha;
  speed_ = v.norm();
  return unbounded_output(input, injected.force_on_hand_newton, missing_joule);
}

void PassivityControl::observe_reference(const ControlInput& input) noexcept {
  if (!input.is_request_fresh) return;
  const Vector3& requested = input.requested_force_on_hand_newton;
  const bool is_in_contact = !requested.isZero(0.0) || !evaluated_newton_.isZero(0.0);
  if (is_in_contact) {
    reference_joule_ -=
        0.5 * (requested + evaluated_newton_).dot(input.evaluated_at_m - evaluated_at_m_);
  }
  evaluated_at_m_ = input.evaluated_at_m;
  evaluated_newton_ = requested;
}

}  // namespace palpate::controllers
