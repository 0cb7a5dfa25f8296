// Drivers in shared libraries: the example, and libraries that are none.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/check.h"
#include "device_node/drivers/plugin/plugin_driver.h"
#include "tests/support/alloc_guard.h"
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

struct PluginParts {
  ManualClock time;
  std::unique_ptr<HapticDevice> plugin =
      open_plugin({.library = PALPATE_EXAMPLE_DEVICE, .options = ""}, time, {});
};

class PluginUnderTest : private PluginParts, public OpenedDevice {
 public:
  PluginUnderTest() : OpenedDevice(*plugin, time, std::chrono::milliseconds(1), {}) {}
  [[nodiscard]] std::optional<Vector3> motor_force_newton() override {
    DeviceSample sample;
    EXPECT_TRUE(plugin->read(sample));
    return sample.applied_force_newton;
  }
  [[nodiscard]] std::optional<std::uint64_t> allocations() const override {
    return test::allocations_of_this_thread();
  }
};
std::unique_ptr<DeviceBench> open_example() { return std::make_unique<PluginUnderTest>(); }

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
PALPATE_DEVICE_CONFORMANCE(Plugin, device::open_example);
}  // namespace palpate::test
