// SPDX-License-Identifier: Apache-2.0
// The drivers by name.
#include "device_node/drivers/driver_registry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/check.h"
#include "tests/support/scripted_device.h"

namespace palpate::device {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(DriverRegistry, OpensTheSimulatedDeviceOfTheSession) {
  ManualClock clock;
  SimulatedDeviceConfig config;
  config.peak_force_newton = 2.5;
  const DriverRegistry drivers =
      all_drivers({.simulated = {.device = config,
                                 .hand = {.path = HoldPath{.position_m = Vector3(0.011, 0, 0)}},
                                 .seed = 1}});

  const Driver& driver = drivers.at("simulated");
  const auto device = driver.open(clock, {});

  EXPECT_TRUE(driver.is_simulated);
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_EQ(device->specification().peak_force_newton, 2.5);
  EXPECT_TRUE(device->specification().is_simulated);
  EXPECT_TRUE(device->specification().has_motor_watchdog);
  EXPECT_NEAR(sample.hand_position_m.x(), 0.011, 1e-12);
}

TEST(DriverRegistry, OpensADriverThatWasAddedOnTheGivenClock) {
  ManualClock clock;
  clock.advance(std::chrono::milliseconds(7));
  DriverRegistry drivers = all_drivers({});
  drivers.add("scripted", {.open = [](const Clock& c, const StartUp&) {
                return std::make_unique<test::ScriptedDevice>(c);
              }});

  const auto device = drivers.at("scripted").open(clock, {});

  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_EQ(sample.sampled_at, clock.now());
  EXPECT_FALSE(drivers.at("scripted").is_simulated);
}

TEST(DriverRegistry, AnUnknownNameIsASetupErrorThatListsTheKnownOnes) {
  DriverRegistry drivers = all_drivers({});
  drivers.add("other", {});
  try {
    static_cast<void>(drivers.at("omni"));
    FAIL() << "no exception";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("\"omni\""), HasSubstr("other, plugin, simulated")));
  }
}

}  // namespace
}  // namespace palpate::device
