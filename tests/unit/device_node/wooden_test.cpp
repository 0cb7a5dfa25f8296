// SPDX-License-Identifier: Apache-2.0
// WoodenHaptics: the reports byte by byte, the arm, and the driver through the emulator.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/core/random.h"
#include "device_node/drivers/wooden/wooden_driver.h"
#include "device_node/emulators/wooden_emulator.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_conformance.h"
#include "tests/support/temp_folder.h"
#include "tests/support/wired/shared_clock.h"
#include "tests/unit/device_node/wired_driver.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

std::string first_bytes(std::span<const std::byte> bytes, std::size_t count) {
  std::string text;
  for (const std::byte b : bytes.first(count)) {
    text += "0123456789abcdef"[std::to_integer<unsigned>(b) >> 4U];
    text += "0123456789abcdef"[std::to_integer<unsigned>(b) & 15U];
  }
  return text;
}

// Report id 0; 1000 = 0x03e8, -2 = 0xfffe, little-endian.
TEST(WoodenWire, WritesCurrentsAndCommands) {
  const WoodenCommandBytes bytes = wooden_command(
      {.currents_ma = {1000, -2, 0}, .command = kWoodenSetCounters, .attributes = {6000, 0, -1}});
  EXPECT_EQ(bytes.size(), 65U);
  EXPECT_EQ(first_bytes(bytes, 17),
            "00"
            "e803feff0000"
            "0100"
            "70170000ffff"
            "0000");
  WoodenCommand read;
  ASSERT_TRUE(read_wooden_command(bytes, read));
  EXPECT_EQ(read.currents_ma, (WoodenCounts{1000, -2, 0}));
  EXPECT_EQ(read.command, 1);
  EXPECT_EQ(read.attributes, (WoodenCounts{6000, 0, -1}));
  EXPECT_FALSE(read_wooden_command(std::span(bytes).first(64), read));
}

TEST(WoodenWire, ReadsCountersAndRefusesWhatIsNone) {
  const WoodenReportBytes bytes = wooden_report({.encoders = {1, -1, 256, 10005, 5, 6}, .info = 1});
  EXPECT_EQ(first_bytes(bytes, 16),
            "0100ffff0001"
            "152705000600"
            "0100"
            "0000");
  WoodenReading reading;
  ASSERT_TRUE(read_wooden_report(bytes, reading));
  EXPECT_EQ(reading.encoders[2], 256);
  EXPECT_TRUE(is_wooden_button_held(reading));
  EXPECT_EQ(reading.info, 1);

  EXPECT_FALSE(read_wooden_report(std::span(bytes).first(63), reading));
  WoodenReportBytes garbage{};
  garbage.fill(std::byte{0xFF});
  EXPECT_FALSE(read_wooden_report(garbage, reading));
}

// b upright, c horizontal: the handle is 0.245 away from the upright axis, 0.08 + 0.205 high.
TEST(WoodenArm, HasItsHandleAtTheEndOfBothArms) {
  const WoodenArm arm({});
  const double right_angle = std::numbers::pi / 2;
  EXPECT_LT((arm.handle_m({0, 0, right_angle}) - Vector3(0.245, 0, 0.285)).norm(), 1e-12);
  EXPECT_LT((arm.handle_m({right_angle, 0, right_angle}) - Vector3(0, 0.245, 0.285)).norm(), 1e-12);
}

TEST(WoodenArm, AnglesLeadBackToTheHandleAndTheJacobianIsTheDerivative) {
  const WoodenArm arm({});
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Vector3 handle(0.22 + random.uniform(-0.08, 0.08), random.uniform(-0.08, 0.08),
                         0.08 + random.uniform(-0.08, 0.08));
    const std::optional<Vector3> angles = arm.angles_rad(handle);
    ASSERT_TRUE(angles);
    EXPECT_LT((arm.handle_m(*angles) - handle).norm(), 1e-12);
    const Matrix3 jacobian = *arm.jacobian(*angles);
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      Vector3 step = Vector3::Zero();
      step[axis] = 1e-6;
      const Vector3 slope = (arm.handle_m(*angles + step) - arm.handle_m(*angles - step)) / 2e-6;
      EXPECT_LT((jacobian.col(axis) - slope).norm(), 1e-8);
    }
  }
}

TEST(WoodenArm, OutOfReachAndStretchedThereIsNoAnswer) {
  const WoodenArm arm({});
  EXPECT_FALSE(arm.angles_rad(Vector3(0.5, 0, 0.08)));
  // both arms in one line
  EXPECT_FALSE(arm.jacobian({0, 0.5, std::numbers::pi - 0.5}));
}

/// The published design with the motors of 2019; x towards the person, D in the middle.
WoodenConfig wooden_on_desk() {
  WoodenConfig config;
  config.torque_constants_newton_m_per_a = {0.321, 0.0603, 0.0603};
  config.are_reversed = {false, true, false};
  config.calibration_counts = {0, -500, 6000};
  config.largest_current_a = 3.0;
  config.origin_m = Vector3(0.22, 0, 0.08);
  config.rotation = Quaternion(Eigen::AngleAxisd(-std::numbers::pi / 2, Vector3::UnitZ()));
  config.workspace_half_extent_m = Vector3::Constant(0.05);
  config.limits = {.peak_force_newton = 3.0, .continuous_force_newton = 2.0};
  config.position_resolution_m = 110e-6;
  config.transfer_limit = 5s;
  return config;
}

class EmulatedWooden {
 public:
  explicit EmulatedWooden(const Clock& clock, const Vector3& hand_m = Vector3::Zero(),
                          const std::vector<PlannedFault>& faults = {}, bool is_calibrated = false)
      : config_([&] {
          WoodenConfig config = wooden_on_desk();
          config.port = (folder_.path() / "hidraw").string();
          config.is_calibrated = is_calibrated;
          return config;
        }()),
        device_({.position_resolution_m = 0.0}, {.path = HoldPath{.position_m = hand_m}}, clock, 1,
                WoodenEmulator::kWatchdog, faults),
        emulator_(device_, config_),
        thread_([this](const std::stop_token& stop) { emulator_.run(stop); }) {}

  [[nodiscard]] const WoodenConfig& config() const { return config_; }
  [[nodiscard]] Vector3 motor_force_newton() const { return device_.force_newton(); }
  void press() { emulator_.press(); }

 private:
  test::TempFolder folder_;
  WoodenConfig config_;
  EmulatedDevice device_;
  WoodenEmulator emulator_;
  std::jthread thread_;
};

TEST(WoodenDriver, ReadsThePositionAndPushes) {
  const ManualClock clock;
  const Vector3 hand_m(0.03, -0.02, 0.04);
  EmulatedWooden emulated(clock, hand_m);
  const auto device = open_wooden(emulated.config(), clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - hand_m).cwiseAbs().maxCoeff(), 55e-6);

  const Vector3 asked(0.5, 1.0, -1.0);
  ASSERT_TRUE(device->apply(asked, 1s, sample));

  // whole milliamperes: half of one is 0.5e-3 · 0.321 · 16 N·m at a, at 0.2 m
  EXPECT_LT((sample.applied_force_newton - asked).norm(), 20e-3);
  EXPECT_NE(sample.applied_force_newton, asked);
  EXPECT_LT((emulated.motor_force_newton() - sample.applied_force_newton).norm(), 1e-9);
}

TEST(WoodenDriver, SaysWhatHeldCurrentsDoWhileTheArmTurns) {
  const test::TempFolder folder;
  WoodenConfig config = wooden_on_desk();
  config.port = (folder.path() / "hidraw").string();
  expect_turning_reported(
      config, 0.04,
      [&](EmulatedDevice& device) { return std::make_unique<WoodenEmulator>(device, config); },
      open_wooden);
}

TEST(WoodenDriver, ALargerCurrentThanAllowedIsScaledAndReported) {
  const ManualClock clock;
  EmulatedWooden emulated(clock);
  WoodenConfig config = emulated.config();
  config.largest_current_a = 0.2;
  const auto device = open_wooden(config, clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->apply({0, 0, 2.0}, 1s, sample));
  const Vector3 applied = sample.applied_force_newton;
  EXPECT_LT(applied.norm(), 1.0);
  EXPECT_GT(applied.z() / applied.norm(), 0.99);
  EXPECT_LT((emulated.motor_force_newton() - applied).norm(), 1e-9);
}

TEST(WoodenDriver, WholeMilliamperesKeepTheForceLimit) {
  Random random(1);
  for (int pose = 0; pose < 10; ++pose) {
    expect_force_limit_kept<EmulatedWooden, open_wooden>(
        random.uniform(0.0, 0.05) * random.direction(), random);
  }
}

/// What a start without success says.
std::string wooden_refusal(const WoodenConfig& config, const Clock& clock) {
  try {
    static_cast<void>(open_wooden(config, clock, {.limit = Duration::zero()}));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "opened";
}

TEST(WoodenDriver, KnowsWhatHeldCurrentsCanBeElsewhere) {
  const SteadyClock clock;
  const EmulatedWooden emulated(clock);
  const WoodenConfig& config = emulated.config();
  expect_held_force_ratio(
      config, open_wooden(config, clock, {})->specification().held_force_ratio,
      [arm = WoodenDrive(config).arm](const Vector3& m) { return arm.angles_rad(m); });
}

TEST(WoodenDriver, WaitsForItsCalibration) {
  const SteadyClock clock;
  const WoodenDrive drive(wooden_on_desk());
  const Vector3 held_at_m =
      wooden_on_desk().rotation *
      (drive.arm.handle_m(drive.rad_per_count.cwiseProduct(Vector3(0, -500, 6000))) -
       wooden_on_desk().origin_m);
  // counters that are set already are shown to be: the handle is held at the calibration position
  for (const auto& [hand_m, is_there] :
       {std::pair{held_at_m, true}, {Vector3(0.01, 0, 0), false}}) {
    EmulatedWooden held(clock, hand_m, {}, true);
    const auto device = open_wooden(held.config(), clock, {});
    EXPECT_EQ(device->phase(), DevicePhase::kConnected);
    EXPECT_EQ(device->calibrate(), is_there);
  }
  EmulatedWooden calibrated(clock, Vector3::Zero(), {}, true);
  WoodenConfig config = calibrated.config();
  config.is_calibrated = false;  // nobody presses the button
  EXPECT_THAT(wooden_refusal(config, clock), HasSubstr("not calibrated in time: hold the handle"));

  // other counts than those of the place where the handle is held: elsewhere
  EmulatedWooden emulated(clock);
  config = emulated.config();
  config.calibration_counts[0] = 100;
  const auto device = open_wooden(config, clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  // 100 counts of 2000 · 16 turn body a by 0.0196 rad, at 0.22 m
  EXPECT_NEAR(sample.hand_position_m.norm(), 0.22 * 2 * std::numbers::pi * 100 / 32000, 1e-4);
}

// The counters count from 0 after it: the calibration is gone, and nothing of the wire says so.
TEST(WoodenDriver, APowerCycleNeedsACalibration) {
  const SteadyClock clock;
  test::SharedClock time;
  const Vector3 hand_m(0.02, -0.01, 0.01);
  EmulatedWooden emulated(time, hand_m,
                          {{.kind = WireFault::kPowerCycle, .from_s = 1.0, .length_s = 1.0}});
  const auto device = open_wooden(emulated.config(), clock, {.limit = test::patience(20s)});
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  time.set(1500ms);
  EXPECT_FALSE(device->read(sample));
  time.set(3s);
  const TimePoint until = clock.now() + test::patience(20s);
  while (!device->reopen(kReopenLimit) && clock.now() < until) {
  }

  EXPECT_EQ(device->phase(), DevicePhase::kConnected);
  EXPECT_FALSE(device->read(sample)) << "no position without a calibration";
  EXPECT_FALSE(device->apply(Vector3(0, 0, 1), 1s, sample));
  EXPECT_FALSE(device->calibrate()) << "counters of another place";
  emulated.press();
  EXPECT_TRUE(device->calibrate());
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - hand_m).norm(), 200e-6);
}

TEST(WoodenDriver, AnotherDeviceIsRefused) {
  const SteadyClock clock;
  EmulatedWooden emulated(clock, Vector3::Zero(),
                          {{.kind = WireFault::kWrongId, .from_s = 0.0, .length_s = 1e3}});
  EXPECT_THAT(wooden_refusal(emulated.config(), clock),
              HasSubstr("hidraw is ffff:ffff, not 16c0:0486"));
  WoodenConfig config = emulated.config();
  config.port = "/dev/null";
  EXPECT_THAT(wooden_refusal(config, clock), HasSubstr("is no hidraw file"));
}

TEST(WoodenDriver, IsReleasedOnceTheDeviceConfirmsIt) {
  expect_release_confirmed_after<EmulatedWooden>({WireFault::kSilent, WireFault::kUnplugged},
                                                 open_wooden);
}

TEST(WoodenDriver, SaysHowATransferFailedAndOpensAgain) {
  const auto error_of = [](WireFault kind) {
    test::SharedClock time;
    EmulatedWooden emulated(time, Vector3::Zero(),
                            {{.kind = kind, .from_s = 1.0, .length_s = 1.0}});
    return error_in_fault(emulated.config(), time, open_wooden);
  };
  EXPECT_EQ(error_of(WireFault::kSilent), DeviceError::kTimeout);
  EXPECT_EQ(error_of(WireFault::kShort), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kGarbage), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kUnplugged), DeviceError::kUnplugged);
  EXPECT_EQ(error_of(WireFault::kMerged), DeviceError::kCorrupt);
}

TEST(WoodenDriver, AnswersThatComeTwiceAreAFault) {
  test::SharedClock time;
  EmulatedWooden emulated(time, Vector3::Zero(),
                          {{.kind = WireFault::kDoubled, .from_s = 1.0, .length_s = 1.0}});
  expect_doubled_answers_noticed(emulated.config(), time, open_wooden);
}

TEST(WoodenDriver, ALateAnswerWithinTheLimitIsNoFault) {
  const SteadyClock clock;
  test::SharedClock time;
  EmulatedWooden emulated(time, Vector3::Zero(),
                          {{.kind = WireFault::kDelayed, .from_s = 1.0, .length_s = 1.0}});
  const auto device = open_wooden(emulated.config(), clock, {});
  DeviceSample sample;
  time.set(1500ms);
  EXPECT_TRUE(device->read(sample));
}

std::unique_ptr<DeviceBench> open_emulated_wooden() {
  return std::make_unique<DriverUnderTest<EmulatedWooden, open_wooden>>();
}

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
PALPATE_DEVICE_CONFORMANCE(WoodenHaptics, device::open_emulated_wooden);
}  // namespace palpate::test
