// SPDX-License-Identifier: Apache-2.0
// Friction identification: the arithmetic of the fit, and what aborts the sweeps. What they
// measure: tests/property/friction_properties_test.cpp.
#include "device_node/identification/friction_identification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "common/core/check.h"
#include "device_node/simulation/simulated_device.h"

namespace palpate::device {
namespace {

using ::testing::HasSubstr;

// --- fit --------------------------------------------------------------------------------------

FrictionFit fit_of(const std::vector<FrictionPoint>& points) { return fit_friction(points); }

TEST(FrictionFit, PointsOnALineGiveItLessTheSystematicErrors) {
  // F = 0.1 N + 0.2 N·s/m v; no scatter. F̄ = 0.105 over 0.03 m/s: the wobble term reduces f_d by
  // 0.00525. bounds 0.98 · 0.19475 = 0.190855 and 0.98 · 0.1
  const FrictionFit fit = fit_of({{0.01, 0.102}, {0.02, 0.104}, {0.03, 0.106}, {0.04, 0.108}});

  EXPECT_NEAR(fit.viscous_newton_s_per_m, 0.2, 1e-12);
  EXPECT_NEAR(fit.coulomb_newton, 0.1, 1e-12);
  EXPECT_NEAR(fit.viscous_bound_newton_s_per_m, 0.190855, 1e-9);
  EXPECT_NEAR(fit.coulomb_bound_newton, 0.098, 1e-9);
}

TEST(FrictionFit, ScatterLowersTheBoundsByThreeSigma) {
  // F = 10 + v ± 0.1. All: D = 4, s = √(0.06/4) = 0.122474, σ_co = s √(1/6 + 4/4) = 0.132288
  // faster two thirds: D = 1, s = √(0.04/2) = 0.141421 = σ_d; F̄ = 12 over 2
  // bounds 0.98 (1 − 0.424264 − 0.009) = 0.555401 and 0.98 (10 − 0.396863) = 9.411074
  const FrictionFit fit =
      fit_of({{1, 11.1}, {1, 10.9}, {2, 12.1}, {2, 11.9}, {3, 13.1}, {3, 12.9}});

  EXPECT_NEAR(fit.viscous_newton_s_per_m, 1.0, 1e-12);
  EXPECT_NEAR(fit.coulomb_newton, 10.0, 1e-12);
  EXPECT_NEAR(fit.viscous_bound_newton_s_per_m, 0.555401, 1e-6);
  EXPECT_NEAR(fit.coulomb_bound_newton, 9.411074, 1e-6);
}

TEST(FrictionFit, SlopeAtTheSlowEndAloneIsNoViscousFriction) {
  // all: f_d = 1, σ_d = √(4/3 / 4)/2 = 0.288675, so 1 − 3σ_d = 0.134; but nothing beyond v = 2
  const FrictionFit fit = fit_of({{1, 10}, {1, 10}, {2, 12}, {2, 12}, {3, 12}, {3, 12}});

  EXPECT_NEAR(fit.viscous_newton_s_per_m, 1.0, 1e-12);
  EXPECT_EQ(fit.viscous_bound_newton_s_per_m, 0.0);
}

TEST(FrictionFit, BoundsAreNeverNegative) {
  const FrictionFit fit = fit_of({{1, 0.1}, {2, -0.3}, {3, 0.1}, {4, -0.1}});

  EXPECT_EQ(fit.viscous_bound_newton_s_per_m, 0.0);
  EXPECT_EQ(fit.coulomb_bound_newton, 0.0);
}

TEST(FrictionFit, BoundStaysBelowEveryPointWhereFrictionFallsWithSpeed) {
  // f_co of the line is 0.11 N, but at 0.04 m/s there are only 0.07 N: 0.98 · 0.07 = 0.0686
  const FrictionFit fit = fit_of({{0.01, 0.10}, {0.02, 0.09}, {0.03, 0.08}, {0.04, 0.07}});

  EXPECT_NEAR(fit.viscous_newton_s_per_m, -1.0, 1e-9);
  EXPECT_EQ(fit.viscous_bound_newton_s_per_m, 0.0);
  EXPECT_NEAR(fit.coulomb_bound_newton, 0.0686, 1e-9);
}

// --- sweeps -----------------------------------------------------------------------------------

HandConfig no_hand(const Vector3& position_m = Vector3::Zero()) {
  HandConfig hand;
  hand.mass_kg = 0.0;
  hand.stiffness_newton_per_m = 0.0;
  hand.damping_newton_s_per_m = 0.0;
  hand.path = HoldPath{.position_m = position_m};
  return hand;
}

/// A simulated device (0.045 kg, 0.1 N·s/m, 0.1 N) with a defect, observed by the test.
class OddDevice final : public HapticDevice {
 public:
  explicit OddDevice(const Clock& clock, const SimulatedDeviceConfig& config = {},
                     const Vector3& start_m = Vector3::Zero())
      : inner_(config, no_hand(start_m), clock, 1), specification_(inner_.specification()) {}

  std::function<Vector3(const Vector3&)> motors = [](const Vector3& force) { return force; };
  int reads_left = -1;   ///< then they fail; −1: never
  int writes_left = -1;  ///< likewise
  int held_reads = -1;   ///< button 1 is released after so many; −1: never

  double largest_force_newton = 0.0;  ///< commanded
  double top_speed_m_per_s = 0.0;     ///< true
  Duration longest_lease{};
  int writes = 0;
  bool is_limp = true;

  [[nodiscard]] DeviceSpecification& editable_specification() { return specification_; }
  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return specification_;
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    if (reads_left == 0) return false;
    if (reads_left > 0) --reads_left;
    const bool is_read = inner_.read(sample);
    sample.buttons = held_reads == 0 ? 1U : 2U;
    if (held_reads > 0) --held_reads;
    top_speed_m_per_s =
        std::max(top_speed_m_per_s, inner_.true_state().hand_velocity_m_per_s.norm());
    return is_read;
  }
  [[nodiscard]] bool apply(const Vector3& force, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    if (writes_left == 0) return false;
    if (writes_left > 0) --writes_left;
    ++writes;
    is_limp = false;
    largest_force_newton = std::max(largest_force_newton, force.norm());
    longest_lease = std::max(longest_lease, lease);
    const bool is_applied = inner_.apply(motors(force), lease, at_switch);
    at_switch.applied_force_newton = force;  // its driver does not know of the defect
    return is_applied;
  }
  [[nodiscard]] bool release() noexcept override {
    is_limp = true;
    return inner_.release();
  }

 private:
  SimulatedDevice inner_;
  DeviceSpecification specification_;
};

class FrictionSweeps : public ::testing::Test {
 protected:
  /// One line along x through the origin, ±15 mm.
  static SweepPlan short_plan() {
    SweepPlan plan;
    plan.box_half_extent_m = Vector3(0.03, 0.02, 0.02);
    plan.lines = {SweepLine{}};
    plan.half_length_m = 0.015;
    plan.speeds_m_per_s = {0.02, 0.03, 0.05};
    return plan;
  }

  FrictionReport identify(OddDevice& device) {
    return identify_friction(device, clock_, plan_, consent_);
  }

  /// The text of the IdentificationError.
  std::string failure(OddDevice& device) {
    try {
      static_cast<void>(identify(device));
    } catch (const IdentificationError& error) {
      EXPECT_TRUE(device.is_limp);
      return error.what();
    }
    return "no failure";
  }

  /// The text of the SetupError.
  std::string refusal(OddDevice& device) {
    try {
      static_cast<void>(identify(device));
    } catch (const SetupError& error) {
      EXPECT_EQ(device.writes, 0);
      return error.what();
    }
    return "no refusal";
  }

  ManualClock clock_;
  SweepPlan plan_ = short_plan();
  SweepConsent consent_;
};

TEST_F(FrictionSweeps, StayWithinTheirBoundsAndEndLimp) {
  OddDevice device(clock_);

  const FrictionReport report = identify(device);

  // 0.1 N hold it. At 0.5 N/s it has gone 0.2 + 2 · 0.055 mm by t = ∛(6 m · 0.31 mm/0.5) = 55 ms
  // later: it is moving at ≤ 0.13 N, so the sweeps may use 0.26 N.
  EXPECT_LE(device.largest_force_newton, 0.26);
  EXPECT_LE(device.top_speed_m_per_s, 0.1);
  EXPECT_EQ(device.longest_lease, std::chrono::milliseconds(3));
  EXPECT_TRUE(device.is_limp);
  EXPECT_GT(report.coulomb_bound_newton, 0.08);
}

TEST_F(FrictionSweeps, WeightIsNoPartOfTheFriction) {
  OddDevice device(clock_);
  device.motors = [](const Vector3& force) -> Vector3 { return force + Vector3(0.05, 0, 0); };

  const FrictionReport report = identify(device);

  EXPECT_NEAR(report.lines[0].fit.coulomb_newton, 0.1, 1e-3);
  EXPECT_NEAR(report.lines[0].fit.viscous_newton_s_per_m, 0.1, 0.03);
}

TEST_F(FrictionSweeps, SmallestLineCounts) {
  // motors half as strong along y: it needs twice the force, so x has the smaller bounds
  plan_.lines.push_back({.middle_m = Vector3::Zero(), .direction = Vector3::UnitY()});
  OddDevice device(clock_);
  device.motors = [](const Vector3& force) -> Vector3 {
    return force.cwiseProduct(Vector3(1.0, 0.5, 1.0));
  };

  const FrictionReport report = identify(device);

  ASSERT_EQ(report.lines.size(), 2U);
  EXPECT_NEAR(report.lines[1].fit.coulomb_newton, 0.2, 2e-3);
  EXPECT_EQ(report.coulomb_bound_newton, report.lines[0].fit.coulomb_bound_newton);
}

TEST_F(FrictionSweeps, RealDeviceNeedsTheUsersAgreement) {
  OddDevice device(clock_);
  device.editable_specification().is_simulated = false;

  EXPECT_THAT(refusal(device), HasSubstr("give --i-understand-this-moves-the-device"));
  consent_.may_move = true;
  EXPECT_GT(identify(device).coulomb_bound_newton, 0.08);
}

TEST_F(FrictionSweeps, DeviceWithoutMotorWatchdogNeedsTheUsersAgreement) {
  OddDevice device(clock_);
  device.editable_specification().has_motor_watchdog = false;
  consent_.may_move = true;

  EXPECT_THAT(refusal(device), HasSubstr("has no motor-side watchdog"));
  consent_.may_lack_watchdog = true;
  EXPECT_GT(identify(device).coulomb_bound_newton, 0.08);
}

TEST_F(FrictionSweeps, DeviceOutsideTheBoxIsRefused) {
  OddDevice device(clock_, {}, Vector3(0, 0, 0.025));

  EXPECT_THAT(refusal(device), HasSubstr("(0.0, 0.0, 25.0) mm, outside the box"));
}

TEST_F(FrictionSweeps, DeviceThatDoesNotMoveAtOneNewtonEndsThem) {
  OddDevice device(clock_, {.coulomb_newton = 1.1});

  EXPECT_THAT(failure(device), HasSubstr("does not move at 1.00 N"));
  EXPECT_LE(device.largest_force_newton, 1.0);
}

TEST_F(FrictionSweeps, WeakMotorsAreNotCommandedBeyondTheirPeak) {
  OddDevice device(clock_, {.coulomb_newton = 0.5, .peak_force_newton = 0.3});

  EXPECT_THAT(failure(device), HasSubstr("does not move at 0.30 N"));
  EXPECT_LE(device.largest_force_newton, 0.3);
}

TEST_F(FrictionSweeps, ReversedMotorsEndThem) {
  OddDevice device(clock_);
  device.motors = [](const Vector3& force) -> Vector3 { return -force; };

  EXPECT_THAT(failure(device), HasSubstr("not where its motors push"));
}

TEST_F(FrictionSweeps, RunawayEndsThem) {
  // once it slides, the motors pull it away with 0.4 N, whatever the command
  OddDevice device(clock_);
  device.motors = [&](const Vector3& force) -> Vector3 {
    return device.top_speed_m_per_s > 0.025 ? Vector3(-0.4, 0, 0) : force;
  };

  EXPECT_THAT(failure(device), HasSubstr("ran faster than 0.1 m/s"));
  // (0.4 − 0.1) N on 0.045 kg: 6.7 m/s². 0.1 m/s on the mean of 10 ms and √3 q of the encoder is
  // seen by 0.1 + 0.0095 + 6.7 · 0.005, and a tick later it is limp
  EXPECT_LE(device.top_speed_m_per_s, 0.15);
}

TEST_F(FrictionSweeps, ObstacleEndsThem) {
  // an obstacle holds it once it slides
  OddDevice device(clock_);
  device.motors = [&](const Vector3& force) -> Vector3 {
    return device.top_speed_m_per_s > 0.025 ? Vector3(0.1 * force) : force;
  };

  EXPECT_THAT(failure(device), HasSubstr("stuck"));
  EXPECT_LE(device.largest_force_newton, 0.26);  // as above
  EXPECT_LT(clock_.now(), time_at(2.0));
}

TEST_F(FrictionSweeps, DeviceThatFallsEndsThem) {
  OddDevice device(clock_);
  device.motors = [](const Vector3& force) -> Vector3 { return force - Vector3(0, 0, 0.15); };

  EXPECT_THAT(failure(device), HasSubstr("not where its motors push"));
}

TEST_F(FrictionSweeps, LeavingTheBoxEndsThem) {
  plan_.box_half_extent_m.x() = 0.01;
  OddDevice device(clock_);

  EXPECT_THAT(failure(device), HasSubstr("left the box"));
}

TEST_F(FrictionSweeps, FailureToReadEndsThem) {
  for (const int reads : {0, 1, 700, 1500}) {
    SCOPED_TRACE(reads);
    OddDevice device(clock_);
    device.reads_left = reads;

    EXPECT_THAT(failure(device), HasSubstr("read"));
  }
}

TEST_F(FrictionSweeps, MoveOnlyWhileTheDeadManButtonIsHeld) {
  plan_.dead_man_button = 1;
  OddDevice held(clock_);
  EXPECT_EQ(identify(held).lines.size(), 1U);

  for (const int reads : {1, 300, 1500}) {
    SCOPED_TRACE(reads);
    OddDevice released(clock_);
    released.held_reads = reads;
    EXPECT_THAT(failure(released), HasSubstr("its dead-man button was released"));
    EXPECT_LE(released.writes, reads);
  }
  OddDevice not_held(clock_);
  not_held.held_reads = 0;
  EXPECT_THAT(refusal(not_held), HasSubstr("nobody holds the dead-man button, button 1"));
}

TEST_F(FrictionSweeps, FailureToWriteEndsThem) {
  OddDevice device(clock_);
  device.writes_left = 700;

  EXPECT_THAT(failure(device), HasSubstr("failed to take a force"));
}

/// Wakes 20 ms late every `every`-th time; 0: never.
class LateClock final : public Clock {
 public:
  explicit LateClock(int every) : every_(every) {}
  [[nodiscard]] TimePoint now() const noexcept override { return clock_.now(); }
  void sleep_until(TimePoint deadline) override {
    clock_.sleep_until(deadline);
    if (every_ > 0 && ++sleeps_ % every_ == 0) clock_.advance(std::chrono::milliseconds(20));
  }

 private:
  ManualClock clock_;
  int every_;
  int sleeps_ = 0;
};

// Each way by itself: a tick is late in every pair, which takes 2 s at least, but not always on
// both ways before the force is averaged.
TEST_F(FrictionSweeps, SweepDisturbedByALateTickIsRepeated) {
  LateClock late(1'700);
  LateClock never(0);
  OddDevice disturbed(late);
  OddDevice undisturbed(never);

  const FrictionReport report = identify_friction(disturbed, late, plan_, {});
  static_cast<void>(identify_friction(undisturbed, never, plan_, {}));

  EXPECT_GT(late.now(), never.now() + std::chrono::seconds(1));
  EXPECT_NEAR(report.lines[0].fit.coulomb_newton, 0.1, 1e-3);
  EXPECT_LE(report.viscous_bound_newton_s_per_m, 0.1);
}

TEST_F(FrictionSweeps, ComputerThatIsAlwaysLateEndsThem) {
  LateClock late(500);
  OddDevice device(late);

  try {
    static_cast<void>(identify_friction(device, late, plan_, {}));
    FAIL() << "no failure";
  } catch (const IdentificationError& error) {
    EXPECT_THAT(error.what(), HasSubstr("ticks come too late"));
  }
  EXPECT_TRUE(device.is_limp);
}

LineFriction line_along(const Vector3& direction, double viscous, double coulomb) {
  return {.line = {.direction = direction.normalized()},
          .fit = {.viscous_bound_newton_s_per_m = viscous, .coulomb_bound_newton = coulomb}};
}

TEST(FrictionPerAxisOf, IsTheSmallestOfEachAxisWhereTheModelFits) {
  // along the diagonal: Σ f_d,i/3 = 0.2 N·s/m, Σ f_co,i/√3 = 0.35 N
  const FrictionPerAxis found = friction_per_axis(
      {.lines = {line_along({1, 0, 0}, 0.1, 0.1), line_along({0, 1, 0}, 0.2, 0.2),
                 line_along({0, 0, -1}, 0.3, 0.3), line_along({1, 0, 0}, 0.12, 0.09),
                 line_along({1, 1, 1}, 0.2, 0.35)}});

  EXPECT_LT((found.viscous_newton_s_per_m - Vector3(0.1, 0.2, 0.3)).norm(), 1e-12);
  EXPECT_EQ(found.coulomb_newton, Vector3(0.09, 0.2, 0.3));
}

TEST(FrictionPerAxisOf, ADeviceWithIsotropicFrictionIsCreditedWithNoMoreOnTheDiagonal) {
  const FrictionPerAxis found = friction_per_axis(
      {.lines = {line_along({1, 0, 0}, 0.1, 0.1), line_along({0, 1, 0}, 0.1, 0.1),
                 line_along({0, 0, 1}, 0.1, 0.1), line_along({1, -1, 1}, 0.1, 0.1)}});

  EXPECT_LT((found.viscous_newton_s_per_m - Vector3::Constant(0.1)).norm(), 1e-12);
  EXPECT_LT((found.coulomb_newton - Vector3::Constant(0.1 / std::sqrt(3.0))).norm(), 1e-12);
}

TEST(FrictionPerAxisOf, AnAxisWithoutMotorsHasNone) {
  const FrictionPerAxis found = friction_per_axis(
      {.lines = {line_along({1, 0, 0}, 0.1, 0.1), line_along({0, 0, 1}, 0.1, 0.1)}});

  EXPECT_EQ(found.coulomb_newton, Vector3(0.1, 0.0, 0.1));
}

TEST(DefaultSweepPlan, StaysInThePlaneOfADeviceWithTwoMotors) {
  DeviceSpecification specification;
  specification.workspace_half_extent_m = Vector3(0.03, 0.001, 0.02);
  specification.force_axes = Vector3(1, 0, 1).asDiagonal();

  const SweepPlan plan = default_sweep_plan(specification);

  EXPECT_EQ(plan.lines.size(), 12U);
  EXPECT_EQ(plan.half_length_m, 0.01);
  for (const SweepLine& line : plan.lines) {
    EXPECT_EQ(line.middle_m.y(), 0.0);
    EXPECT_EQ(line.direction.y(), 0.0);
  }
}

TEST(DefaultSweepPlan, KeepsEveryLineInsideItsBox) {
  DeviceSpecification specification;
  specification.workspace_half_extent_m = Vector3(0.08, 0.06, 0.035);

  const SweepPlan plan = default_sweep_plan(specification);

  EXPECT_EQ(plan.lines.size(), 16U);
  for (const SweepLine& line : plan.lines) {
    for (const double side : {-1.0, 1.0}) {
      const Vector3 end_m = line.middle_m + side * plan.half_length_m * line.direction;
      EXPECT_TRUE((end_m.array().abs() < plan.box_half_extent_m.array()).all());
    }
  }
  EXPECT_TRUE(
      (plan.box_half_extent_m.array() < specification.workspace_half_extent_m.array()).all());
}

}  // namespace
}  // namespace palpate::device
