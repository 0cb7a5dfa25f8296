// SPDX-License-Identifier: Apache-2.0
// plain_loop — a loop of one's own in C++: a wall of 3000 N/m below z = 0 and a hand that shakes.
//   plain_loop [CONTROLLER]    prints the work of the hand; status 1 if it extracts energy
#include <palpate/controllers/catalogue.h>

#include <cmath>
#include <cstdio>

using namespace palpate::controllers;

int main(int argc, char** argv) {
  constexpr double T = 0.001;   // [s]
  constexpr double f_d = 0.1;   // friction of the device [N·s/m]
  constexpr double f_co = 0.1;  // [N]
  constexpr double K = 3000.0;  // of the wall [N/m]
  const auto controller = make_named(argc > 1 ? argv[1] : "guard", {.rate_hz = 1.0 / T,
                                                                    .viscous_newton_s_per_m = f_d,
                                                                    .coulomb_newton = f_co,
                                                                    .position_resolution_m = 0.0,
                                                                    .lease_s = T});
  if (controller == nullptr) return 2;

  double work_joule = 0.0;
  AppliedStretch last{.duration_s = T};
  for (int k = 0; k < 2000; ++k) {
    const double z = 0.003 * std::cos(0.1257 * k);  // here the position is read
    const double d = k == 0 ? 0.0 : z - last.hand_position_at_end_m.z();
    work_joule += f_d * d * d / T + f_co * std::abs(d) - last.force_on_hand_newton.z() * d;
    last.hand_position_at_end_m = {0.0, 0.0, z};
    const double depth = z < 0.0 ? -z : 0.0;
    const ControlOutput out =
        controller->step({.hand_position_m = {0.0, 0.0, z},
                          .applied = {&last, k > 0 ? 1U : 0U},
                          .requested_force_on_hand_newton = {0.0, 0.0, K * depth},
                          .stored_energy_joule = 0.5 * K * depth * depth});
    last.force_on_hand_newton = out.force_on_hand_newton;  // here it is commanded
  }
  std::printf("work of the hand: %.3f mJ\n", 1e3 * work_joule);
  return work_joule < -1e-6 ? 1 : 0;
}
