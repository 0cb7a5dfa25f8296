// SPDX-License-Identifier: Apache-2.0
// The mechanics behind the emulated arms: their energy is what the tests of the clamp judge by.
#include <gtest/gtest.h>

#include <cmath>

#include "common/core/random.h"
#include "device_node/emulators/emulated_arm.h"

namespace palpate::device {
namespace {

// What the hand has put in is its work, less what moves and is tense: to the bit of the arithmetic.
TEST(JointPlant, ItsEnergyIsTheWorkOfTheHand) {
  Random random(3);
  JointPlant plant{GearedJoint{}};
  for (int k = 0; k < 200'000; ++k) {
    const double time_s = 50e-6 * k;
    const double motor = 0.4 * std::sin(37.0 * time_s) + 0.1 * random.uniform(-1.0, 1.0);
    const double hand = 2.0 * (0.5 * std::sin(2.0 * time_s) - plant.link_rad());
    plant.advance(50e-6, motor, hand);
  }
  EXPECT_NEAR(plant.energy_joule(), plant.energy_by_hand_joule(), 1e-9);
  EXPECT_GT(std::abs(plant.energy_joule()), 0.01);
}

// Friction and teeth take, whatever pushes.
TEST(JointPlant, WithoutAMotorTheHandPays) {
  JointPlant plant{GearedJoint{}};
  double before = 0.0;
  for (int k = 0; k < 100'000; ++k) {
    const double time_s = 50e-6 * k;
    plant.advance(50e-6, 0.0, 0.5 * std::sin(11.0 * time_s));
    if (k % 200 == 0) {
      EXPECT_GE(plant.energy_joule(), before - 1e-9);
      before = plant.energy_joule();
    }
  }
  EXPECT_GT(before, 0.1);
}

}  // namespace
}  // namespace palpate::device
