// SPDX-License-Identifier: Apache-2.0
// shaking_hand.h — a device in the grip of a hand that shakes, at 1 kHz; a wall of 3000 N/m.
#pragma once

#include <cmath>
#include <cstdio>

struct ShakingHand {
  static constexpr double T = 0.001, f_d = 0.1, f_co = 0.1, K = 3000.0;
  int k = 0;
  double force_newton = 0.0;
  double work_joule = 0.0;
  [[nodiscard]] double z() const { return 0.003 * std::cos(0.1257 * k); }
  [[nodiscard]] static double wall_newton(double z) { return z < 0.0 ? -K * z : 0.0; }
  /// One period with the force.
  void move(double newton) {
    const double before = z();
    ++k;
    const double d = z() - before;
    work_joule += f_d * d * d / T + f_co * std::abs(d) - newton * d;
  }
  [[nodiscard]] int verdict() const {
    std::printf("work of the hand: %.3f mJ\n", 1e3 * work_joule);
    return work_joule < -1e-6 ? 1 : 0;
  }
};
