// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/energy_tank.h"

#include <algorithm>

namespace palpate::controllers {

ControlOutput EnergyTank::step(const ControlInput& input) noexcept {
  const Interval interval = interval_.read(input);
  level_joule_ = std::min(p_.most_joule, level_joule_ + interval.work_joule);
  const Vector3 v = interval.velocity_m_per_s();
  const Vector3& requested = input.requested_force_on_hand_newton;
  const double valve = std::clamp(level_joule_ / p_.valve_joule, 0.0, 1.0);
  const double passed = requested.dot(v) > 0.0 ? valve : 1.0;
  return unbounded_output(input, passed * requested - (1.0 - valve) * p_.damping * v, level_joule_);
}

}  // namespace palpate::controllers
