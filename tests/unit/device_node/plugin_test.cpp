// SPDX-License-Identifier: Apache-2.0
// Drivers in shared libraries: the example, and libraries that are none.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <dlfcn.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <iterator>
#include <limits>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "deploy/ros/device/device_wire.h"
#include "device_node/drivers/plugin/palpate_device.h"
#include "device_node/drivers/plugin/plugin_driver.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_conformance.h"
#include "tests/support/machine/machine.h"
#include "tests/support/temp_folder.h"
#include "tests/support/wired/shared_clock.h"

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

// --- members that palpate_device.h has got since its first version ------------------------------

constexpr std::size_t kFirstReadingBytes = 96;
static_assert(offsetof(palpate_device_reading, measured_force_newton) == kFirstReadingBytes,
              "libraries and programs that were built before know the members before it");

std::unique_ptr<HapticDevice> open_wrong(const std::string& fault, const Clock& clock) {
  return open_plugin({.library = PALPATE_WRONG_DEVICE, .options = fault}, clock, {});
}

TEST(Plugin, WhatItsSensorsMeasureIsPassedOn) {
  ManualClock clock;
  const auto device = open_plugin({.library = PALPATE_EXAMPLE_DEVICE, .options = ""}, clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->apply({0.5, 0, -1.0}, std::chrono::milliseconds(3), sample));
  EXPECT_EQ(sample.measured_newton, Vector3(0.5, 0, -1.0));
  clock.advance(std::chrono::milliseconds(4));
  ASSERT_TRUE(device->read(sample));
  EXPECT_EQ(sample.measured_newton, Vector3(0, 0, 0)) << "its watchdog has ended the force";
}

TEST(Plugin, ALibraryFromBeforeMeasuresNothing) {
  const ManualClock clock;
  const auto device = open_wrong("older", clock);
  DeviceSample sample;
  ASSERT_TRUE(device->apply({0.5, 0, -1.0}, std::chrono::milliseconds(3), sample));
  EXPECT_EQ(sample.measured_newton, std::nullopt);
  ASSERT_TRUE(device->read(sample));
  EXPECT_EQ(sample.measured_newton, std::nullopt);
  EXPECT_EQ(sample.applied_force_newton, Vector3(0.5, 0, -1.0));
}

// A Palpate from before the member has a shorter reading.
TEST(Plugin, TheExampleWritesNothingThatItsCallerDoesNotKnow) {
  void* const library = dlopen(PALPATE_EXAMPLE_DEVICE, RTLD_NOW | RTLD_LOCAL);
  ASSERT_NE(library, nullptr);
  const auto driver_of =
      reinterpret_cast<palpate_device_driver_of_function>(dlsym(library, PALPATE_DEVICE_ENTRY));
  const palpate_device_driver* const driver = driver_of(PALPATE_DEVICE_ABI);
  palpate_device_host host{};
  host.size = sizeof(host);
  host.clock_ns = [](void* /*context*/) { return std::int64_t{0}; };
  palpate_device* const device = driver->open("", &host, nullptr, 0);
  ASSERT_NE(device, nullptr);
  palpate_device_reading reading{};
  reading.size = kFirstReadingBytes;
  std::fill(std::begin(reading.measured_force_newton), std::end(reading.measured_force_newton),
            7.0);
  const double force_newton[3] = {1.0, 0.0, 0.0};
  EXPECT_EQ(driver->apply(device, force_newton, 1000, &reading), PALPATE_DEVICE_OK);
  EXPECT_EQ(reading.applied_force_newton[0], 1.0);
  EXPECT_EQ(reading.measured_force_newton[0], 7.0);
  driver->close(device);
  dlclose(library);
}

TEST(Plugin, HeldCurrentsAndTheTimeOfATransferArePassedOn) {
  const ManualClock clock;
  const auto device = open_wrong("held currents", clock);
  EXPECT_EQ(device->specification().held_force_ratio, 2.5);
  EXPECT_EQ(device->specification().turning_per_m, 21.0);
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_EQ(sample.turning_joule, 0.25);
  EXPECT_EQ(sample.skew, std::chrono::microseconds(300));
  EXPECT_EQ(open_wrong("", clock)->specification().held_force_ratio, 1.0);
  EXPECT_EQ(sample.turned_newton, Vector3(0, 0.5, 0));
  for (const char* fault : {"held less", "held no number", "turns endlessly"}) {
    EXPECT_THAT(refusal_of(PALPATE_WRONG_DEVICE, fault), HasSubstr("turning_per_m ≥ 0")) << fault;
  }
}

// --- a wrist
// --------------------------------------------------------------------------------------

std::unique_ptr<HapticDevice> open_wrist(const Clock& clock,
                                         const char* library = PALPATE_EXAMPLE_DEVICE,
                                         const std::string& fault = "") {
  return open_plugin({.library = library, .options = fault, .uses_wrist = true}, clock, {});
}

// 0.1 N·m is the peak of its motors; they turn it by 1 rad/s for 0.05 N·m.
TEST(PluginWrist, TurnsItsJointsForTheLeaseAndNoLonger) {
  ManualClock clock;
  const auto device = open_wrist(clock);
  DeviceSample sample;
  device->set_wrist_torque({0.05, 0.0, -0.2});
  ASSERT_TRUE(device->apply({0, 0, 0}, std::chrono::milliseconds(3), sample));
  ASSERT_TRUE(sample.wrist);
  EXPECT_EQ(sample.wrist->acting_torque_newton_m, Vector3(0.05, 0.0, -0.1));
  EXPECT_EQ(sample.wrist->pose.axes, Matrix3::Identity());
  clock.advance(std::chrono::milliseconds(2));
  ASSERT_TRUE(device->read(sample));
  EXPECT_NEAR((sample.wrist->pose.angle_rad - Vector3(2e-3, 0.0, -4e-3)).norm(), 0.0, 1e-12);
  EXPECT_EQ(sample.wrist->acting_torque_newton_m, Vector3(0.05, 0.0, -0.1));
  clock.advance(std::chrono::milliseconds(2));
  ASSERT_TRUE(device->read(sample));
  EXPECT_NEAR((sample.wrist->pose.angle_rad - Vector3(3e-3, 0.0, -6e-3)).norm(), 0.0, 1e-12);
  EXPECT_EQ(sample.wrist->acting_torque_newton_m, Vector3(0, 0, 0));
}

TEST(PluginWrist, ATorqueIsForOneCommandAndARelease) {
  ManualClock clock;
  const auto device = open_wrist(clock);
  DeviceSample sample;
  const auto apply = [&] { return device->apply({0, 0, 1}, std::chrono::milliseconds(3), sample); };
  device->set_wrist_torque({0.05, 0.0, 0.0});
  ASSERT_TRUE(apply());
  ASSERT_TRUE(apply());
  EXPECT_EQ(sample.wrist->acting_torque_newton_m, Vector3(0, 0, 0)) << "given before each";
  device->set_wrist_torque({0.0, std::numeric_limits<double>::quiet_NaN(), 0.01});
  ASSERT_TRUE(apply());
  EXPECT_EQ(sample.wrist->acting_torque_newton_m, Vector3(0, 0, 0)) << "not a number";
  device->set_wrist_torque({0.05, 0.0, 0.0});
  ASSERT_TRUE(apply());
  device->set_wrist_torque({0.05, 0.0, 0.0});
  EXPECT_TRUE(device->release());
  ASSERT_TRUE(device->read(sample));
  EXPECT_EQ(sample.wrist->acting_torque_newton_m, Vector3(0, 0, 0));
  ASSERT_TRUE(apply());
  EXPECT_EQ(sample.wrist->acting_torque_newton_m, Vector3(0, 0, 0));
}

TEST(PluginWrist, OfADeviceWhoseSessionHasNoneIsLeftAlone) {
  ManualClock clock;
  const auto device = open_plugin({.library = PALPATE_EXAMPLE_DEVICE, .options = ""}, clock, {});
  DeviceSample sample;
  device->set_wrist_torque({0.05, 0.0, 0.0});
  ASSERT_TRUE(device->apply({0, 0, 0}, std::chrono::milliseconds(3), sample));
  EXPECT_FALSE(sample.wrist);
}

TEST(PluginWrist, ThatIsMissingOrCannotBeIsRefused) {
  const auto refusal = [](const std::string& fault) -> std::string {
    const ManualClock clock;
    try {
      static_cast<void>(open_wrist(clock, PALPATE_WRONG_DEVICE, fault));
    } catch (const SetupError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal("no wrist"), HasSubstr("has no wrist with motors; leave it out"));
  EXPECT_THAT(refusal(""), HasSubstr("lacks set_wrist_torque"));
  EXPECT_THAT(refusal("wrist without motors"), HasSubstr("peak_torque_newton_m > 0"));
  EXPECT_EQ(refusal("wrist"), "");
}

TEST(PluginWrist, AReadingThatNoWristTakesReleasesTheMotors) {
  for (const char* fault :
       {"wrist turns endlessly", "wrist angle is no number", "wrist axis is short",
        "wrist axis is no number", "wrist is too strong"}) {
    const ManualClock clock;
    const auto device = open_wrist(clock, PALPATE_WRONG_DEVICE, fault);
    DeviceSample sample;
    EXPECT_FALSE(device->read(sample)) << fault;
    EXPECT_EQ(device->last_error(), DeviceError::kCorrupt) << fault;
  }
}

// No plug-in says what its motors do: its motion does.
TEST(Plugin, AReleaseThatDoesNotReleaseAndOldPositionsAreNamedByTheChecks) {
  const auto failed_with = [](const std::string& fault) {
    ManualClock clock;
    const auto device = open_wrong(fault, clock);
    OpenedDevice bench(*device, clock, std::chrono::milliseconds(1), {});
    std::vector<std::string> failed;
    for (const DeviceCheck& check : device_checks()) {
      if (check.run(bench).verdict == CheckVerdict::kFailed) failed.emplace_back(check.name);
    }
    return failed;
  };
  EXPECT_THAT(failed_with(""), testing::IsEmpty());
  EXPECT_THAT(failed_with("does not release"), testing::ElementsAre("no lease", "release"));
  EXPECT_THAT(failed_with("positions 3 ms old"), testing::Contains("lag"));
}

TEST(Plugin, AReadingThatNoDeviceTakesReleasesTheMotors) {
  for (const char* fault : {"measures no number", "measures too much", "turns no number",
                            "skew of the past", "skew of hours"}) {
    const ManualClock clock;
    const auto device = open_wrong(fault, clock);
    DeviceSample sample;
    EXPECT_FALSE(device->read(sample)) << fault;
    EXPECT_EQ(device->last_error(), DeviceError::kCorrupt) << fault;
    EXPECT_FALSE(device->apply({0, 0, 1}, std::chrono::milliseconds(1), sample)) << fault;
  }
}

// --- plug-ins for vendors' libraries, with a stand-in of these ----------------------------------

const std::string kStub = std::string(" library=") + PALPATE_VENDOR_STUB;
const std::string kForceDimensionOptions =
    "peak_newton=12 continuous_newton=8 half_extent_m=0.05 resolution_m=1e-5";

TEST(VendorPlugins, WithoutTheLibraryTheDeviceOrAnOptionTheErrorSaysWhatToDo) {
  EXPECT_THAT(refusal_of(PALPATE_OPEN_HAPTICS, "resolution_m=55e-6"),
              HasSubstr("install the vendor's library"));
  EXPECT_THAT(refusal_of(PALPATE_OPEN_HAPTICS, "resolution_m=55e-6 library=libm.so.6"),
              HasSubstr("has no function hdInitDevice"));
  EXPECT_THAT(refusal_of(PALPATE_OPEN_HAPTICS, "resolution_m=-1" + kStub),
              HasSubstr("give resolution_m"));
  EXPECT_THAT(refusal_of(PALPATE_OPEN_HAPTICS, "resolution_m=55e-6 device=absent" + kStub),
              HasSubstr("libHD opens no device"));
  EXPECT_THAT(refusal_of(PALPATE_FORCE_DIMENSION, "peak_newton=12" + kStub),
              HasSubstr("give peak_newton, continuous_newton"));
}

TEST(VendorPlugins, OpenHapticsHasItsOwnFrameAndEndsAForceWithItsLease) {
  test::SharedClock clock;  // no lease or limit passes while the library's thread is kept waiting
  const auto device = open_plugin(
      {.library = PALPATE_OPEN_HAPTICS, .options = "resolution_m=55e-6 held_force_ratio=3" + kStub},
      clock, {});
  const DeviceSpecification& specification = device->specification();
  EXPECT_LT((specification.workspace_half_extent_m - Vector3(0.08, 0.03, 0.06)).norm(), 1e-12);
  EXPECT_EQ(specification.peak_force_newton, 3.3);
  EXPECT_EQ(specification.continuous_force_newton, 0.88);
  EXPECT_FALSE(specification.has_motor_watchdog);
  EXPECT_EQ(specification.held_force_ratio, 3.0);
  // at (1, 2, 3) mm, the middle of the workspace is at (0, 10, 0) mm
  const Vector3 rest_m(0.001, -0.003, -0.008);
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - rest_m).norm(), 1e-12);
  EXPECT_EQ(sample.buttons, 2U);

  ASSERT_TRUE(device->apply({0.5, 0.25, -1.0}, std::chrono::hours(1), sample));
  EXPECT_LT((sample.applied_force_newton - Vector3(0.5, 0.25, -1.0)).norm(), 1e-12);
  const auto moves_to = [&](const Vector3& target_m) {
    const SteadyClock steady;
    const TimePoint until = steady.now() + test::patience(std::chrono::seconds(20));
    while (device->read(sample) && (sample.hand_position_m - target_m).norm() > 1e-9) {
      if (steady.now() > until) return false;
    }
    return (sample.hand_position_m - target_m).norm() <= 1e-9;
  };
  // the stand-in moves by 10 mm/N
  EXPECT_TRUE(moves_to(rest_m + Vector3(0.005, 0.0025, -0.01)));
  ASSERT_TRUE(device->apply({0, 0, 99.0}, std::chrono::milliseconds(10), sample));
  EXPECT_NEAR(sample.applied_force_newton.z(), 3.3, 1e-12);
  clock.set(std::chrono::milliseconds(11));
  EXPECT_TRUE(moves_to(rest_m));
}

TEST(VendorPlugins, ForceDimensionHasItsOwnFrameAndEndsAForceWithItsLease) {
  ManualClock clock;
  const auto device = open_plugin(
      {.library = PALPATE_FORCE_DIMENSION, .options = kForceDimensionOptions + kStub}, clock, {});
  EXPECT_EQ(device->specification().workspace_half_extent_m, Vector3::Constant(0.05));
  EXPECT_FALSE(device->specification().has_motor_watchdog);
  EXPECT_EQ(device->specification().held_force_ratio, std::numeric_limits<double>::infinity());
  const Vector3 rest_m(0.002, -0.001, 0.003);
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - rest_m).norm(), 1e-12);

  ASSERT_TRUE(device->apply({0.5, 0.25, -1.0}, std::chrono::milliseconds(3), sample));
  EXPECT_LT((sample.hand_position_m - rest_m - Vector3(0.005, 0.0025, -0.01)).norm(), 1e-12);
  clock.advance(std::chrono::milliseconds(3));
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - rest_m).norm(), 1e-12);
  ASSERT_TRUE(device->apply({0, 0, 99}, std::chrono::milliseconds(3), sample));
  EXPECT_EQ(sample.applied_force_newton, Vector3(0, 0, 12));
}

/// Each look takes 10 µs.
class SlowClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override { return now_ += kLook; }
  void sleep_until(TimePoint deadline) override { now_ = deadline; }
  static constexpr Duration kLook = std::chrono::microseconds(10);

 private:
  mutable TimePoint now_{};
};

TEST(VendorPlugins, ForceDimensionReportsTheTimeOfItsCalls) {
  const SlowClock clock;
  const auto device = open_plugin(
      {.library = PALPATE_FORCE_DIMENSION, .options = kForceDimensionOptions + kStub}, clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_GE(sample.skew, SlowClock::kLook);
  const TimePoint before = clock.now();
  ASSERT_TRUE(device->apply({0, 0, 1}, std::chrono::milliseconds(3), sample));
  EXPECT_EQ(sample.sampled_at - sample.skew, before + SlowClock::kLook) << "before the force";
}

/// `palpate ros device` for a plug-in that asks for one pose.
class OnePoseBridge {
 public:
  OnePoseBridge() : listener_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path().copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    EXPECT_EQ(::listen(listener_, 1), 0);
    thread_ = std::jthread([this] {
      client_ = ::accept(listener_, nullptr, nullptr);
      ros_device_pose pose{};
      pose.wire = ROS_DEVICE_WIRE;
      pose.is_ready = 1;
      pose.orientation_wxyz[0] = 1.0;
      EXPECT_EQ(::send(client_, &pose, sizeof(pose), MSG_NOSIGNAL),
                static_cast<ssize_t>(sizeof(pose)));
    });
  }
  ~OnePoseBridge() {
    ::shutdown(listener_, SHUT_RDWR);  // of a plug-in that never came
    thread_.join();
    ::close(client_);
    ::close(listener_);
  }
  OnePoseBridge(const OnePoseBridge&) = delete;
  OnePoseBridge& operator=(const OnePoseBridge&) = delete;
  [[nodiscard]] std::string path() const { return (folder_.path() / "arm").string(); }

 private:
  test::TempFolder folder_;
  int listener_;
  int client_ = -1;
  std::jthread thread_;
};

double ros_ratio_with(const std::string& option) {
  const OnePoseBridge bridge;
  const SteadyClock clock;
  return open_plugin({.library = PALPATE_ROS_PLUGIN,
                      .options = "socket=" + bridge.path() +
                                 " peak_newton=3 continuous_newton=1 half_extent_m=0.1 "
                                 "resolution_m=1e-4" +
                                 option},
                     clock, {.limit = test::patience(std::chrono::seconds(20))})
      ->specification()
      .held_force_ratio;
}

TEST(VendorPlugins, WhatAnArmBehindRosHoldsIsUnknownUnlessAnOptionSaysIt) {
  EXPECT_EQ(ros_ratio_with(""), std::numeric_limits<double>::infinity());
  EXPECT_EQ(ros_ratio_with(" held_force_ratio=2.5"), 2.5);
  EXPECT_THAT(refusal_of(PALPATE_ROS_PLUGIN, "held_force_ratio=-1"), HasSubstr("held_force_ratio"));
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

/// By the motion alone, as `palpate conform device` does it; what each check found.
std::map<std::string, CheckOutcome> outcomes_of(const std::string& fault) {
  ManualClock time;
  const auto plugin = open_wrong(fault, time);
  OpenedDevice bench(*plugin, time, std::chrono::milliseconds(1), {});
  std::map<std::string, CheckOutcome> outcomes;
  for (const DeviceCheck& check : device_checks()) outcomes[check.name] = check.run(bench);
  return outcomes;
}

TEST(PluginConformanceByMotion, TheExampleWithoutAWatchdogPasses) {
  ManualClock time;
  const auto plugin =
      open_plugin({.library = PALPATE_EXAMPLE_DEVICE, .options = "no watchdog"}, time, {});
  EXPECT_FALSE(plugin->specification().has_motor_watchdog);
  OpenedDevice bench(*plugin, time, std::chrono::milliseconds(1), {});
  for (const DeviceCheck& check : device_checks()) {
    const CheckOutcome outcome = check.run(bench);
    EXPECT_NE(outcome.verdict, CheckVerdict::kFailed) << check.name << ": " << outcome.text;
  }
}

TEST(Plugin, WhatItSaysOfItsOpeningIsOneLineWithoutControlCharacters) {
  EXPECT_THAT(refusal_of(PALPATE_WRONG_DEVICE, "control characters"),
              HasSubstr("no board?at ?[31mport 3"));
}

TEST(PluginConformanceByMotion, TheEndOfAForceIsSeen) {
  const CheckOutcome right = outcomes_of("")["lease"];
  EXPECT_EQ(right.verdict, CheckVerdict::kGood) << right.text;
  for (const char* fault : {"no watchdog", "late", "lease in software"}) {
    const CheckOutcome found = outcomes_of(fault)["lease"];
    EXPECT_EQ(found.verdict, CheckVerdict::kFailed) << fault << ": " << found.text;
  }
}

TEST(PluginConformanceByMotion, AMeasuredForceThatIsNotTheAppliedOneIsNamed) {
  EXPECT_EQ(outcomes_of("")["applied"].verdict, CheckVerdict::kGood);
  const CheckOutcome found = outcomes_of("measures another force")["applied"];
  EXPECT_EQ(found.verdict, CheckVerdict::kFailed);
  EXPECT_THAT(found.text, HasSubstr("measured_newton is"));
}

TEST(PluginConformanceByMotion, PositionsThatBecomeNotFiniteFail) {
  const auto outcomes = outcomes_of("not finite");
  EXPECT_EQ(outcomes.at("reading").verdict, CheckVerdict::kGood) << "the first one is right";
  EXPECT_EQ(outcomes.at("lease").verdict, CheckVerdict::kFailed) << outcomes.at("lease").text;
  EXPECT_THAT(outcomes.at("lease").text, HasSubstr("not finite"));
}

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
PALPATE_DEVICE_CONFORMANCE(Plugin, device::open_example);
}  // namespace palpate::test
