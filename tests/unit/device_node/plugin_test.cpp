// Drivers in shared libraries: the example, and libraries that are none.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/check.h"
#include "device_node/drivers/plugin/plugin_driver.h"
#include "tests/support/device_conformance.h"

namespace palpate::device {
namespace {

using ::testing::HasSubstr;

std::string refusal_of(const std::string& library, const std::string& options = "") {
  const ManualClock clock;
  try {
    static_cast<void>(open_plugin({.library = library, .options = options}, clock, {}));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "";
}

TEST(Plugin, ALibraryThatIsMissingOrNoDriverIsRefused) {
  EXPECT_THAT(refusal_of("/nowhere/driver.so"), HasSubstr("No such file"));
  EXPECT_THAT(refusal_of("libm.so.6"), HasSubstr("is it a driver for Palpate?"));
}

TEST(Plugin, WhatItsOpenRefusesIsSaid) {
  EXPECT_THAT(refusal_of(PALPATE_EXAMPLE_DEVICE, "speed=9"),
              HasSubstr("knows no option \"speed=9\""));
}

/// The fixture of the conformance suite.
struct PluginUnderTest {
  ManualClock manual_clock;
  std::unique_ptr<HapticDevice> plugin =
      open_plugin({.library = PALPATE_EXAMPLE_DEVICE, .options = ""}, manual_clock, {});

  HapticDevice& device() { return *plugin; }
  const Clock& clock() { return manual_clock; }
  void pass(Duration d) { manual_clock.advance(d); }
  Duration stamp_tolerance() { return {}; }
  std::optional<Vector3> motor_force() {
    DeviceSample sample;
    EXPECT_TRUE(plugin->read(sample));
    return sample.applied_force_newton;
  }
};

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
INSTANTIATE_TYPED_TEST_SUITE_P(Plugin, DeviceConformance, device::PluginUnderTest);
}  // namespace palpate::test
