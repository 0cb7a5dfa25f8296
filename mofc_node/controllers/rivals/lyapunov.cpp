// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/lyapunov.h"

#include <algorithm>

namespace palpate::controllers {

ControlOutput LyapunovLimiter::step(const ControlInput& input) noexcept {
  const Vector3& requested = input.requested_force_on_hand_newton;
  const double newton = requested.norm();
  if (input.tissue == nullptr || newton == 0.0) return unbounded_output(input, requested, 0.0);
  const Vector3& x = input.hand_position_m;
  const Vector3& v = input.hand_velocity_m_per_s;
  const double stored = input.tissue->at(x, v).stored_energy_joule;
  const double slack = p_.slack_watt * p_.T;

  double scale = 1.0;
  for (const double mass : {p_.least_mass, p_.most_mass}) {
    for (const double sign : {-1.0, 0.0, 1.0}) {
      const Vector3 push = requested * (1.0 + sign * p_.hand_force / newton);  // F_e + f_h
      const Vector3 d = p_.T * v + p_.T * p_.T / (2.0 * mass) * push;
      const double given = requested.dot(d);
      if (given <= 0.0) continue;  // the hand presses
      const double released = stored - input.tissue->at(x + d, v).stored_energy_joule;
      scale = std::min(scale, std::max(0.0, (released + slack) / given));
    }
  }
  return unbounded_output(input, scale * requested, stored);
}

}  // namespace palpate::controllers
