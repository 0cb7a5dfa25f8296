// SPDX-License-Identifier: Apache-2.0
// The controllers through their C interface, by name.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "mofc_node/controllers/named/catalogue.h"
#include "mofc_node/controllers/named/palpate_controllers.h"
#include "tests/support/alloc_guard.h"

namespace palpate::controllers {
namespace {

struct Destroy {
  void operator()(palpate_controller* controller) const { palpate_controller_destroy(controller); }
};
using Handle = std::unique_ptr<palpate_controller, Destroy>;

Handle create(const char* name) { return Handle(palpate_controller_create(name)); }

constexpr double kWall = 2000.0;

/// A wall below z = 0, as both interfaces see it.
struct Wall final : TissueProbe {
  [[nodiscard]] Force at(const Vector3& x, const Vector3&) const noexcept override {
    const double depth = std::max(0.0, -x.z());
    return {{0.0, 0.0, kWall * depth}, 0.5 * kWall * depth * depth};
  }
};
void wall_of_c(void*, const double x[3], const double*, double force[3], double* stored_joule) {
  const double depth = std::max(0.0, -x[2]);
  force[0] = force[1] = 0.0;
  force[2] = kWall * depth;
  *stored_joule = 0.5 * kWall * depth * depth;
}

double shaking_z(int k) { return 0.002 * std::cos(0.05 * k) + 0.001 * std::sin(0.31 * k); }

palpate_input input_of_c(int k, palpate_stretch& last) {
  const double z = shaking_z(k);
  const double velocity = k > 0 ? (z - shaking_z(k - 1)) / 0.001 : 0.0;
  last.duration_s = 0.001;
  last.hand_position_at_end_m[2] = z;
  palpate_input input{};
  input.hand_position_m[2] = input.evaluated_at_m[2] = z;
  input.hand_velocity_m_per_s[2] = velocity;
  input.applied = &last;
  input.applied_count = k > 0 ? 1 : 0;
  input.acting_force_on_hand_newton[2] = last.force_on_hand_newton[2];
  input.tissue = wall_of_c;
  wall_of_c(nullptr, input.hand_position_m, nullptr, input.requested_force_on_hand_newton,
            &input.stored_energy_joule);
  input.surface_normal[2] = z < 0.0 ? 1.0 : 0.0;
  return input;
}

TEST(CInterface, AnswersAsTheClassesDoForEveryName) {
  ASSERT_GE(palpate_controller_count(), 12U);
  EXPECT_EQ(palpate_controller_name(palpate_controller_count()), nullptr);
  for (std::size_t i = 0; i < palpate_controller_count(); ++i) {
    const char* name = palpate_controller_name(i);
    SCOPED_TRACE(name);
    const Handle handle = create(name);
    const auto made = make_named(name, {});
    ASSERT_NE(handle, nullptr);
    ASSERT_NE(made, nullptr);
    const Wall wall;
    palpate_stretch last{};
    AppliedStretch stretch;
    double largest_newton = 0.0;
    for (int k = 0; k < 400; ++k) {
      const palpate_input input = input_of_c(k, last);
      const Vector3 x(0.0, 0.0, input.hand_position_m[2]);
      stretch.duration_s = 0.001;
      stretch.hand_position_at_end_m = x;
      const auto force = wall.at(x, {});
      const ControlOutput expected =
          made->step({.hand_position_m = x,
                      .applied = {&stretch, input.applied_count},
                      .acting_force_on_hand_newton = stretch.force_on_hand_newton,
                      .requested_force_on_hand_newton = force.force_on_hand_newton,
                      .stored_energy_joule = force.stored_energy_joule,
                      .hand_velocity_m_per_s = {0.0, 0.0, input.hand_velocity_m_per_s[2]},
                      .evaluated_at_m = x,
                      .surface_normal = {0.0, 0.0, input.surface_normal[2]},
                      .tissue = &wall});
      palpate_output output{};
      ASSERT_EQ(palpate_controller_step(handle.get(), &input, &output), PALPATE_OK);
      ASSERT_EQ(output.force_on_hand_newton[2], expected.force_on_hand_newton.z()) << k;
      ASSERT_EQ(output.is_clamped != 0, expected.is_clamped) << k;
      ASSERT_EQ(output.lease_s, expected.lease_s) << k;
      stretch.force_on_hand_newton = expected.force_on_hand_newton;
      last.force_on_hand_newton[2] = output.force_on_hand_newton[2];
      largest_newton = std::max(largest_newton, output.force_on_hand_newton[2]);
    }
    EXPECT_GT(largest_newton, 0.0);
  }
}

TEST(CInterface, EverySettingIsReadBackAndRefusedOutsideOfItsRange) {
  ASSERT_GT(palpate_setting_count(), 20U);
  for (std::size_t i = 0; i < palpate_setting_count(); ++i) {
    const char* name = palpate_setting_name(i);
    SCOPED_TRACE(name);
    const Handle handle = create("guard");
    double before = 0.0;
    ASSERT_EQ(palpate_controller_get(handle.get(), name, &before), PALPATE_OK);
    const double changed = std::string(name) == "least_mass_kg" ? 0.5 : 1.5 * before + 0.001;
    ASSERT_EQ(palpate_controller_set(handle.get(), name, changed), PALPATE_OK)
        << palpate_controller_error(handle.get());
    double after = 0.0;
    ASSERT_EQ(palpate_controller_get(handle.get(), name, &after), PALPATE_OK);
    EXPECT_EQ(after, changed);
    for (const double bad : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
      EXPECT_EQ(palpate_controller_set(handle.get(), name, bad), PALPATE_OUT_OF_RANGE);
      EXPECT_NE(std::string(palpate_controller_error(handle.get())).find(name), std::string::npos);
    }
    ASSERT_EQ(palpate_controller_get(handle.get(), name, &after), PALPATE_OK);
    EXPECT_EQ(after, changed);
  }
}

TEST(CInterface, SettingsThatContradictOneAnotherAreRefused) {
  const Handle tank = create("energy_tank");
  EXPECT_EQ(palpate_controller_set(tank.get(), "tank_initial_joule", 0.2), PALPATE_OUT_OF_RANGE);
  EXPECT_STREQ(palpate_controller_error(tank.get()),
               "tank_initial_joule = 0.2 J: must leave tank_initial_joule and tank_valve_joule ≤ "
               "tank_most_joule");
  EXPECT_EQ(palpate_controller_set(tank.get(), "least_mass_kg", 2.0), PALPATE_OUT_OF_RANGE);
  EXPECT_EQ(palpate_controller_set(tank.get(), "rate_hz", 0.0), PALPATE_OUT_OF_RANGE);
}

TEST(CInterface, UnknownNamesAndNullPointersAreRefused) {
  EXPECT_EQ(palpate_controller_create("nobody"), nullptr);
  EXPECT_EQ(palpate_controller_create(nullptr), nullptr);
  const Handle guard = create("guard");
  EXPECT_EQ(palpate_controller_set(guard.get(), "colour", 1.0), PALPATE_UNKNOWN_NAME);
  EXPECT_STREQ(palpate_controller_error(guard.get()),
               "colour: there is no such setting; palpate_setting_name lists them");
  EXPECT_EQ(palpate_controller_set(nullptr, "rate_hz", 1.0), PALPATE_NULL_POINTER);
  EXPECT_EQ(palpate_controller_step(guard.get(), nullptr, nullptr), PALPATE_NULL_POINTER);
  palpate_output output{};
  EXPECT_EQ(palpate_controller_step(guard.get(), nullptr, &output), PALPATE_NULL_POINTER);
  palpate_controller_destroy(nullptr);
}

// A credit of 5 mJ and more would allow the second request in full; after the bad input it is not
// known what acted, so what friction absorbs is all that may act.
TEST(CInterface, ABadInputGivesNoForceAndLeavesNoCredit) {
  for (const bool is_bad : {false, true}) {
    const Handle vector = create("vector");
    palpate_stretch last{};
    palpate_input input{};
    palpate_output output{};
    input.applied = &last;
    last.duration_s = 0.001;
    for (int k = 0; k < 500; ++k) {  // free motion: 0.1 N over 0.2 m
      last.hand_position_at_end_m[0] = input.hand_position_m[0] = 4e-4 * k;
      input.applied_count = k > 0 ? 1 : 0;
      ASSERT_EQ(palpate_controller_step(vector.get(), &input, &output), PALPATE_OK);
    }
    input.requested_force_on_hand_newton[0] = 1.0;
    if (is_bad) {
      palpate_input bad = input;
      bad.requested_force_on_hand_newton[0] = std::nan("");
      ASSERT_EQ(palpate_controller_step(vector.get(), &bad, &output), PALPATE_NOT_FINITE);
      EXPECT_EQ(output.force_on_hand_newton[0], 0.0);
    }
    ASSERT_EQ(palpate_controller_step(vector.get(), &input, &output), PALPATE_OK);
    EXPECT_NEAR(output.force_on_hand_newton[0], is_bad ? 0.1 : 1.0, 1e-9);
  }
}

TEST(CInterface, AStepDoesNotAllocate) {
  for (std::size_t i = 0; i < palpate_controller_count(); ++i) {
    const Handle handle = create(palpate_controller_name(i));
    ASSERT_EQ(palpate_controller_set(handle.get(), "safety_net", 1.0), PALPATE_OK);
    palpate_stretch last{};
    palpate_output output{};
    const test::AllocGuard none;
    for (int k = 0; k < 100; ++k) {
      const palpate_input input = input_of_c(k, last);
      ASSERT_EQ(palpate_controller_step(handle.get(), &input, &output), PALPATE_OK);
      last.force_on_hand_newton[2] = output.force_on_hand_newton[2];
    }
    EXPECT_EQ(none.count(), 0U) << palpate_controller_name(i);
  }
  const test::AllocGuard some;
  EXPECT_NE(create("guard"), nullptr);
  EXPECT_GT(some.count(), 0U) << "allocations of the shared library are not counted";
}

}  // namespace
}  // namespace palpate::controllers
