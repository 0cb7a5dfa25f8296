// SPDX-License-Identifier: Apache-2.0
// Mode paper: where it keeps the energy and where it does not; and what turning the frame changes.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <vector>

#include "mofc_node/controllers/paper_mofc.h"
#include "tests/property/controller_cases.h"

namespace palpate::controllers {
namespace {

Timing exact_timing(double T) {
  return {.shortest_interval_s = 0.5 * T, .longest_interval_s = T, .lease_s = T};
}

Case paper_case(std::uint64_t seed, bool is_on_rail) {
  Case a_case(seed);
  a_case.timing = exact_timing(a_case.assumed.T);
  a_case.q = 0.0;
  a_case.hand.f_d = a_case.assumed.f_d;
  a_case.hand.f_co = a_case.assumed.f_co;
  a_case.hand.is_on_rail = is_on_rail;
  return a_case;
}

double least_energy_of_paper_joule(Case a_case, PaperMofc controller) {
  ClosedLoop loop(a_case.random, a_case.hand, a_case.timing, a_case.q, a_case.assumed.f_co);
  loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
  return loop.least_energy_joule();
}

TEST(PaperMofcLaws, OnOneAxisWithExactPositionsAndTimingNoEnergyIsDrawn) {
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const Case c = paper_case(seed, true);
    EXPECT_GE(least_energy_of_paper_joule(c, PaperMofc(c.assumed)), -kRoundingJoule);
  }
}

TEST(PaperMofcLaws, OnThreeAxesWithFrictionPerAxisNoEnergyIsDrawn) {
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c = paper_case(seed, false);
    give_friction_per_axis(c, seed, true);
    EXPECT_GE(least_energy_of_paper_joule(c, PaperMofc(*c.assumed_per_axis, c.assumed.T)),
              -kRoundingJoule);
  }
}

// Three axes on a device whose friction is isotropic: motion along (1, 1, 1) is booked
// f_co (|x| + |y| + |z|) = √3 f_co |d|, and with all pools empty a force of f_co on each axis, √3
// f_co together, may still push. Both are √3 of what friction takes.
TEST(PaperMofcLaws, OnThreeAxesWithIsotropicFrictionEnergyIsDrawnUnlessEachCountsOneOverSqrt3) {
  double least_joule = 0.0;
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const Case c = paper_case(seed, false);
    least_joule = std::min(least_joule, least_energy_of_paper_joule(c, PaperMofc(c.assumed)));
    EXPECT_GE(least_energy_of_paper_joule(c, PaperMofc::isotropic(c.assumed)), -kRoundingJoule);
  }
  EXPECT_LT(least_joule, -1e-3);
}

// f_d = f_co = 0.1, empty pools, F = (0.1, 0.1, 0.1) for ever: the hand goes with it at
// v* = (√3 − 1)·0.1/0.2 = 0.366 m/s and draws ((√3 − 1)·0.1)²/0.4 = 13.4 mW, 13.4 mJ in a second.
TEST(PaperMofcLaws, AlongTheDiagonalEnergyIsDrawnWithoutEnd) {
  const MofcParameters p{.f_d = 0.1, .f_co = 0.1, .T = 0.001};
  const auto energy_after_a_second = [&](PaperMofc paper) {
    Hand hand{.f_d = p.f_d, .f_co = p.f_co};
    std::vector<AppliedStretch> echo;
    for (int k = 0; k < 1000; ++k) {
      const ControlOutput out = paper.step({.hand_position_m = hand.position_m,
                                            .applied = echo,
                                            .requested_force_on_hand_newton = {0.1, 0.1, 0.1}});
      const Vector3 F = out.force_on_hand_newton;
      hand.move(p.T, hand.most_draining_velocity(F), F);
      echo = {{p.T, F, hand.position_m, true}};
    }
    return hand.energy_joule;
  };
  EXPECT_NEAR(energy_after_a_second(PaperMofc(p)), -13.4e-3, 0.05e-3);
  // with f_co/√3 each: f_co together, which friction takes
  EXPECT_NEAR(energy_after_a_second(PaperMofc::isotropic(p)), 0.0, 1e-9);
}

/// The forces that a controller gives on a fixed path under fixed requests, both turned by R, and
/// turned back. The echo is what the controller gave.
std::vector<Vector3> forces_in_frame(ForceController& controller, std::uint64_t seed,
                                     const Eigen::Matrix3d& R, double T) {
  Random random(seed);
  std::vector<Vector3> forces;
  std::vector<AppliedStretch> echo;
  Vector3 x = Vector3::Zero();
  Vector3 direction = random.direction();
  for (int k = 0; k < 500; ++k) {
    if (random.chance(0.05)) direction = random.direction();
    const Vector3 ask = random.uniform(0.0, 3.0) * random.direction();
    const ControlOutput out = controller.step(
        {.hand_position_m = R * x, .applied = echo, .requested_force_on_hand_newton = R * ask});
    forces.push_back(R.transpose() * out.force_on_hand_newton);
    x += random.uniform(0.0, 0.2) * T * direction;
    echo = {{T, out.force_on_hand_newton, R * x, true}};
  }
  return forces;
}

double largest_difference_newton(ForceController& a, ForceController& b, std::uint64_t seed,
                                 double T) {
  Random random(~seed);
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(random.uniform(0.5, 2.5), random.direction()).toRotationMatrix();
  const auto plain = forces_in_frame(a, seed, Eigen::Matrix3d::Identity(), T);
  const auto turned = forces_in_frame(b, seed, R, T);
  double largest = 0.0;
  for (std::size_t k = 0; k < plain.size(); ++k) {
    largest = std::max(largest, (plain[k] - turned[k]).norm());
  }
  return largest;
}

TEST(FrameLaws, TurningTheFrameChangesNothingInVectorModeWithAnExactEncoder) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const MofcParameters p{.f_d = 0.1, .f_co = 0.1, .T = 2e-3};
    VectorMofc a(p, 0.0, 0.5e-3);
    VectorMofc b(p, 0.0, 0.5e-3);
    // an empty pool amplifies rounding: √(1e−17 J · 4 f_d/T) is 0.04 µN
    EXPECT_LT(largest_difference_newton(a, b, seed, p.T), 1e-6);
  }
}

TEST(FrameLaws, TurningTheFrameChangesTheForceInPaperMode) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const MofcParameters p{.f_d = 0.1, .f_co = 0.1, .T = 2e-3};
    PaperMofc a(p);
    PaperMofc b(p);
    EXPECT_GT(largest_difference_newton(a, b, seed, p.T), 0.01);
  }
}

}  // namespace
}  // namespace palpate::controllers
