// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/emulated_arm.h"

namespace palpate::device {

double JointPlant::gap_rad() const noexcept {
  const double apart = rotor_rad_ - link_rad_;
  return std::copysign(std::max(0.0, std::abs(apart) - 0.5 * joint_.play_rad), apart);
}

void JointPlant::move(const Mass& mass, double newton_m, double step_s, double& rad,
                      double& rad_per_s) noexcept {
  const double before = rad_per_s;
  const double gain = step_s / (2.0 * mass.kg_m2);
  const double free = before + gain * newton_m;
  double mean = 0.0;
  rad_per_s = 0.0;
  if (std::abs(free) > gain * mass.coulomb) {
    mean = (free - std::copysign(gain * mass.coulomb, free)) / (1.0 + gain * mass.viscous);
    rad_per_s = 2.0 * mean - before;
  }
  const double moved = mean * step_s;
  rad += moved;
  dissipated_joule_ +=
      newton_m * moved - 0.5 * mass.kg_m2 * (rad_per_s * rad_per_s - before * before);
}

void JointPlant::advance(double step_s, double motor_newton_m, double hand_newton_m) noexcept {
  // teeth push where they meet; they never pull
  const double gap = gap_rad();
  double tooth = 0.0;
  if (gap != 0.0) {
    const double closing = rotor_rad_per_s_ - link_rad_per_s_;
    const double elastic = joint_.tooth_newton_m_per_rad * gap;
    tooth = elastic + joint_.tooth_newton_m_s_per_rad * closing;
    if (tooth * gap < 0.0) tooth = 0.0;
  }
  const double elastic_before = 0.5 * joint_.tooth_newton_m_per_rad * gap * gap;
  const double rotor_before = rotor_rad_;
  const double link_before = link_rad_;
  move({joint_.rotor_kg_m2, joint_.rotor_coulomb_newton_m, joint_.rotor_viscous_newton_m_s_per_rad},
       motor_newton_m - tooth, step_s, rotor_rad_, rotor_rad_per_s_);
  move({joint_.link_kg_m2, joint_.link_coulomb_newton_m, joint_.link_viscous_newton_m_s_per_rad},
       hand_newton_m + tooth, step_s, link_rad_, link_rad_per_s_);
  const double rotor = rotor_rad_ - rotor_before;
  const double link = link_rad_ - link_before;
  motor_joule_ += motor_newton_m * rotor;
  hand_joule_ += hand_newton_m * link;
  const double after = gap_rad();
  const double elastic_gain = 0.5 * joint_.tooth_newton_m_per_rad * after * after - elastic_before;
  dissipated_joule_ += tooth * (rotor - link) - elastic_gain;  // what the teeth lose
}

double JointPlant::energy_by_hand_joule() const noexcept {
  const double gap = gap_rad();
  return hand_joule_ - 0.5 * joint_.rotor_kg_m2 * rotor_rad_per_s_ * rotor_rad_per_s_ -
         0.5 * joint_.link_kg_m2 * link_rad_per_s_ * link_rad_per_s_ -
         0.5 * joint_.tooth_newton_m_per_rad * gap * gap;
}

JointHand leading_hand() {
  return [](std::size_t joint, double rad, double rad_per_s, double time_s) {
    const double pace = 1.2 + 0.25 * static_cast<double>(joint);
    const double target = 0.5 * std::sin(pace * time_s);
    return 2.0 * (target - rad) - 0.03 * rad_per_s;
  };
}

}  // namespace palpate::device
