// SPDX-License-Identifier: Apache-2.0
// The drivers by name.
#include "device_node/drivers/driver_registry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <string>

#include "common/core/check.h"
#include "device_node/drivers/device_claim.h"
#include "tests/support/scripted_device.h"

namespace palpate::device {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

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

// A child process keeps the claim until it ends, however it ends.
TEST(DeviceClaim, OneProcessDrivesADevice) {
  const std::string place = "test " + std::to_string(::getpid());
  std::array<int, 2> ready{};
  ASSERT_EQ(::pipe(ready.data()), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const DeviceClaim claim(place);
    static_cast<void>(::write(ready[1], "!", 1));
    while (true) ::pause();
  }
  char told = 0;
  ASSERT_EQ(::read(ready[0], &told, 1), 1);
  EXPECT_THAT([&] { const DeviceClaim claim(place); },
              ThrowsMessage<SetupError>(AllOf(HasSubstr(place), HasSubstr("another process"))));
  const DeviceClaim other(place + " b");
  ::kill(child, SIGKILL);
  ASSERT_EQ(::waitpid(child, nullptr, 0), child);
  EXPECT_NO_THROW(const DeviceClaim claim(place));
  EXPECT_NO_THROW(const DeviceClaim claim(place + std::string(300, 'x')));
  for (const int end : ready) ::close(end);
}

TEST(DeviceClaim, TheDriverOfARealDeviceClaimsItBeforeItIsOpened) {
  HapiConfig config;
  config.port = "/tmp/palpate-no-port-" + std::to_string(::getpid());
  const DeviceClaim claim(place_of(config));
  DriverOptions options;
  options.driver = config;
  const DriverRegistry drivers = all_drivers(options);
  const SteadyClock clock;
  EXPECT_THAT([&] { static_cast<void>(drivers.at("hapi").open(clock, {})); },
              ThrowsMessage<SetupError>(HasSubstr("another process drives it")));
  EXPECT_EQ(place_of(DriverConfig{}), "");
  HapiConfig by_another_name;
  by_another_name.port = "/tmp/../" + config.port;
  EXPECT_EQ(place_of(by_another_name), place_of(config));
}

}  // namespace
}  // namespace palpate::device
