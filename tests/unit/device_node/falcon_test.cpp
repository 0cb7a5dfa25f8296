// SPDX-License-Identifier: Apache-2.0
// Novint Falcon: the messages byte by byte, the legs, the boot loader, and the driver through the
// emulator.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/core/random.h"
#include "device_node/drivers/falcon/falcon_delta.h"
#include "device_node/drivers/falcon/falcon_driver.h"
#include "device_node/emulators/falcon_emulator.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_conformance.h"
#include "tests/support/machine/machine.h"
#include "tests/support/temp_folder.h"
#include "tests/support/wired/shared_clock.h"
#include "tests/unit/device_node/wired_driver.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string as_text(const FalconMessage& message) {
  return {reinterpret_cast<const char*>(message.data()), message.size()};
}
FalconMessage as_message(std::string_view text) {
  FalconMessage message{};
  std::transform(text.begin(), text.end(), message.begin(),
                 [](char letter) { return static_cast<std::byte>(letter); });
  return message;
}

// 0xFA59 as nibbles 9, 5, A, F; + 0x41: J F K P. 1 is B A A A, 0 is A A A A. Green and homing are
// 3: D.
TEST(FalconWire, WritesMotorsAsNibbles) {
  EXPECT_EQ(as_text(falcon_command({-1447, 1, 0}, kFalconHoming | kFalconGreen)),
            "<JFKPBAAAAAAADA>");
}

// 0x41 + 0b111'0010: all homed, button 1.
TEST(FalconWire, ReadsEncodersButtonsAndHoming) {
  FalconReading reading;
  ASSERT_TRUE(read_falcon_answer(as_message("<JFKPPPPHAAAI\xB3X>"), reading));
  EXPECT_EQ(reading.encoders, (FalconCounts{-1447, 0x7FFF, -0x8000}));
  EXPECT_EQ(reading.buttons, 2);
  EXPECT_EQ(reading.homed, kFalconAllHomed);
}

TEST(FalconWire, RefusesWhatIsNoMessage) {
  FalconReading reading;
  EXPECT_TRUE(read_falcon_answer(as_message("<AAAAAAAAAAAAAA>"), reading));
  for (const char* text : {"xAAAAAAAAAAAAAA>", "<AAAAAAAAAAAAAAx", "<@AAAAAAAAAAAAA>",
                           "<AAAQAAAAAAAAAA>", "<AAAAAAAAAAAA@A>", "<AAAAAAAAAAAA\301A>"}) {
    EXPECT_FALSE(read_falcon_answer(as_message(text), reading)) << text;
  }
}

TEST(FalconWire, AnswersAndCommandsReadBackAsTheyWereWritten) {
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    FalconReading sent;
    for (std::int16_t& count : sent.encoders) {
      count = static_cast<std::int16_t>(random.uniform(-32768, 32767));
    }
    sent.buttons = static_cast<std::uint8_t>(i % 16);
    sent.homed = static_cast<std::uint8_t>(i % 8);
    FalconReading got;
    ASSERT_TRUE(read_falcon_answer(falcon_answer(sent), got));
    EXPECT_EQ(got.encoders, sent.encoders);
    EXPECT_EQ(got.buttons, sent.buttons);
    EXPECT_EQ(got.homed, sent.homed);
    FalconCounts motors{};
    std::uint8_t flags = 0;
    ASSERT_TRUE(read_falcon_command(falcon_command(sent.encoders, sent.buttons), motors, flags));
    EXPECT_EQ(motors, sent.encoders);
    EXPECT_EQ(flags, sent.buttons);
  }
}

/// [Stamper97]'s solution of the arm's angle by its half tangent, with the dimensions of the
/// Falcon.
double half_tangent_angle_rad(const Vector3& grip_m, int leg) {
  constexpr double kPi = std::numbers::pi;
  constexpr double a = 0.060, b = 0.1025, c = 0.01443, d = 0.01125, e = 0.01125, f = -0.025,
                   r = 0.0400, s = -0.02309;
  const double phi =
      std::vector{kPi / 2, -kPi / 6, -5 * kPi / 6}[static_cast<std::size_t>(leg)] + kPi / 12;
  const double u = std::cos(phi) * grip_m.x() + std::sin(phi) * grip_m.y() - r;
  const double v = -std::sin(phi) * grip_m.x() + std::cos(phi) * grip_m.y() - s;
  const double w = grip_m.z();
  const double sin3 = std::sin(std::acos((v + f) / b));
  const double common = w * w + u * u + 2 * c * u + a * a + c * c - d * d - e * e -
                        b * b * sin3 * sin3 - 2 * b * e * sin3 - 2 * b * d * sin3 - 2 * d * e;
  const double l0 = common - 2 * a * u - 2 * a * c;
  const double l1 = -4 * a * w;
  const double l2 = common + 2 * a * u + 2 * a * c;
  return 2 * std::atan((-l1 - std::sqrt(l1 * l1 - 4 * l0 * l2)) / (2 * l2));
}

TEST(FalconDelta, AnglesLeadBackToTheGripAndTheJacobianIsTheDerivative) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Vector3 grip(random.uniform(-0.03, 0.03), random.uniform(-0.03, 0.03),
                       random.uniform(0.09, 0.15));
    const std::optional<Vector3> angles = FalconDelta::angles_rad(grip);
    ASSERT_TRUE(angles);
    for (int leg = 0; leg < 3; ++leg) {
      EXPECT_NEAR((*angles)[leg], half_tangent_angle_rad(grip, leg), 1e-12);
    }
    EXPECT_LT((*FalconDelta::grip_m(*angles, FalconDelta::middle_m()) - grip).norm(), 1e-12);
    const Matrix3 jacobian = *FalconDelta::jacobian(grip, *angles);
    for (Eigen::Index leg = 0; leg < 3; ++leg) {
      Vector3 step = Vector3::Zero();
      step[leg] = 1e-6;
      const Vector3 slope = (*FalconDelta::grip_m(*angles + step, grip) -
                             *FalconDelta::grip_m(*angles - step, grip)) /
                            2e-6;
      EXPECT_LT((jacobian.col(leg) - slope).norm(), 1e-7);
    }
  }
}

TEST(FalconDelta, OutOfReachThereIsNoAnswer) {
  EXPECT_FALSE(FalconDelta::angles_rad(Vector3(0, 0, 0.4)));
  EXPECT_FALSE(FalconDelta::angles_rad(Vector3(0.2, 0, 0.12)));
  EXPECT_FALSE(FalconDelta::grip_m(Vector3(0, 3, 0), FalconDelta::middle_m()));
}

// One count turns an arm by 360°/1280 · 14.25/110; at 0 counts it is at 35°.
TEST(FalconDriver, EncodersTurnTheArmsByTheirCables) {
  const Vector3 angles = falcon_angles_rad({}, {0, 1280, -1280});
  EXPECT_NEAR(angles[0] * 180 / std::numbers::pi, 35.0, 1e-12);
  EXPECT_NEAR(angles[1] * 180 / std::numbers::pi, 35.0 + 360.0 * 14.25 / 110.0, 1e-9);
  EXPECT_NEAR(angles[2] * 180 / std::numbers::pi, 35.0 - 360.0 * 14.25 / 110.0, 1e-9);
}

/// x to the right, y up, z towards the person; D in the middle.
FalconConfig falcon_on_desk() {
  FalconConfig config;
  config.torque_gain = -10000.0;
  config.origin_m = FalconDelta::middle_m();
  config.rotation = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitX()));
  config.workspace_half_extent_m = Vector3::Constant(0.03);
  config.limits = {.peak_force_newton = 3.0, .continuous_force_newton = 2.0};
  config.position_resolution_m = 110e-6;
  config.transfer_limit = test::patience(5s);
  return config;
}

class EmulatedFalcon {
 public:
  explicit EmulatedFalcon(const Clock& clock, const Vector3& hand_m = Vector3::Zero(),
                          const std::vector<PlannedFault>& faults = {},
                          const FalconEmulator::State& state = {})
      : config_([&] {
          FalconConfig config = falcon_on_desk();
          config.port = (folder_.path() / "usb").string();
          return config;
        }()),
        device_({.position_resolution_m = 0.0}, {.path = HoldPath{.position_m = hand_m}}, clock, 1,
                20ms, faults),
        emulator_(device_, config_, state),
        thread_([this](const std::stop_token& stop) { emulator_.run(stop); }) {}

  [[nodiscard]] const FalconConfig& config() const { return config_; }
  [[nodiscard]] Vector3 motor_force_newton() const { return device_.force_newton(); }
  /// After a driver has opened it.
  [[nodiscard]] const std::vector<std::byte>& image() const { return emulator_.image(); }

 private:
  test::TempFolder folder_;
  FalconConfig config_;
  EmulatedDevice device_;
  FalconEmulator emulator_;
  std::jthread thread_;
};

TEST(FalconDriver, ReadsThePositionAndPushes) {
  const ManualClock clock;
  const Vector3 hand_m(0.011, -0.02, 0.017);
  EmulatedFalcon emulated(clock, hand_m);
  const auto device = open_falcon(emulated.config(), clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - hand_m).cwiseAbs().maxCoeff(), 55e-6);

  const Vector3 asked(0.5, 1.0, -1.0);
  ASSERT_TRUE(device->apply(asked, 1s, sample));

  // whole counts: half a count is 1e-4/2 N·m, and legs of 2 cm/rad at least
  EXPECT_LT((sample.applied_force_newton - asked).norm(), 5e-3);
  EXPECT_NE(sample.applied_force_newton, asked);
  EXPECT_LT((emulated.motor_force_newton() - sample.applied_force_newton).norm(), 1e-9);
}

TEST(FalconDriver, SaysWhatHeldCurrentsDoWhileTheArmTurns) {
  const test::TempFolder folder;
  FalconConfig config = falcon_on_desk();
  config.port = (folder.path() / "usb").string();
  expect_turning_reported(
      config, 0.02,
      [&](EmulatedDevice& device) {
        return std::make_unique<FalconEmulator>(device, config, FalconEmulatorState{});
      },
      open_falcon);
}

TEST(FalconDriver, KnowsWhatHeldCurrentsCanBeElsewhere) {
  const ManualClock clock;
  const EmulatedFalcon emulated(clock);
  const FalconConfig& config = emulated.config();
  expect_held_force_ratio(config, open_falcon(config, clock, {})->specification().held_force_ratio,
                          FalconDelta::angles_rad);
}

TEST(FalconDriver, WholeTorquesKeepTheForceLimit) {
  Random random(1);
  for (int pose = 0; pose < 10; ++pose) {
    expect_force_limit_kept<EmulatedFalcon, open_falcon>(
        random.uniform(0.0, 0.03) * random.direction(), random);
  }
}

TEST(FalconDriver, ALargerTorqueThanTheMotorsTakeIsScaledAndReported) {
  const ManualClock clock;
  EmulatedFalcon emulated(clock);
  FalconConfig config = emulated.config();
  config.largest_torque = 500;
  const auto device = open_falcon(config, clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->apply({0, 0, 2.0}, 1s, sample));
  const Vector3 applied = sample.applied_force_newton;
  EXPECT_LT(applied.norm(), 1.5);
  EXPECT_GT(applied.z() / applied.norm(), 0.999);
  EXPECT_LT((emulated.motor_force_newton() - applied).norm(), 1e-9);
}

/// What a start without success says.
std::string falcon_refusal(const FalconConfig& config, const Clock& clock,
                           const StartUp& start_up = {.limit = Duration::zero()}) {
  try {
    static_cast<void>(open_falcon(config, clock, start_up));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "opened";
}

class FalconFirmware : public testing::Test {
 protected:
  FalconFirmware() { std::ofstream(file_, std::ios::binary) << image_; }
  static FalconConfig with_file(const EmulatedFalcon& emulated, const std::filesystem::path& file) {
    FalconConfig config = emulated.config();
    config.firmware_file = file.string();
    config.transfer_limit = kPassingLimit;  // passes twice before it is loaded
    return config;
  }

  static constexpr FalconEmulator::State kUnloaded{.is_loaded = false};
  test::TempFolder folder_;
  std::filesystem::path file_ = folder_.path() / "novint.bin";
  // two full packets and a rest
  std::string image_ = std::string(100, 'x') + std::string(50, '\0') + "end";
  SteadyClock clock_;
};

TEST_F(FalconFirmware, IsLoadedByteByByteAndThenRuns) {
  const test::QuietMachine machine;
  EmulatedFalcon emulated(clock_, Vector3::Zero(), {}, kUnloaded);
  std::vector<std::string> prompts;
  const auto device =
      open_falcon(with_file(emulated, file_), clock_,
                  {.prompt = [&](const std::string& text) { prompts.push_back(text); }});
  // the boot loader has a second for each answer
  if (machine.may_check("firmware loaded at the first attempt")) {
    EXPECT_THAT(prompts, testing::IsEmpty());
  }
  const std::vector<std::byte>& loaded = emulated.image();
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(loaded.data()), loaded.size()), image_);
  DeviceSample sample;
  EXPECT_TRUE(device->read(sample));
}

TEST_F(FalconFirmware, WrongEchoesEndInAnErrorAfterThreeAttemptsEachWithItsReason) {
  EmulatedFalcon emulated(clock_, Vector3::Zero(),
                          {{.kind = WireFault::kEcho, .from_s = 0.0, .length_s = 1e3}}, kUnloaded);
  std::vector<std::string> prompts;
  const std::string error =
      falcon_refusal(with_file(emulated, file_), clock_,
                     {.prompt = [&](const std::string& text) { prompts.push_back(text); }});
  EXPECT_THAT(error, HasSubstr("attempt 3 of 3: wrong echo of the bytes from 0 on"));
  EXPECT_THAT(prompts, testing::ElementsAre(HasSubstr("attempt 1"), HasSubstr("attempt 2")));
}

TEST_F(FalconFirmware, WithoutAnImageTheStartSaysWhatIsNeeded) {
  EmulatedFalcon emulated(clock_, Vector3::Zero(), {}, kUnloaded);
  FalconConfig config = emulated.config();
  config.transfer_limit = 20ms;
  EXPECT_THAT(falcon_refusal(config, clock_),
              AllOf(HasSubstr("device.falcon: no firmware answers"), HasSubstr("firmware_file")));
  EXPECT_THAT(falcon_refusal(with_file(emulated, folder_.path() / "missing"), clock_),
              HasSubstr("missing: No such file"));
  const std::ofstream emptied(file_, std::ios::trunc);
  EXPECT_THAT(falcon_refusal(with_file(emulated, file_), clock_),
              HasSubstr("is no firmware of a Falcon: it has 0 bytes"));
}

TEST(FalconDriver, WaitsForHomingAndSaysHow) {
  const SteadyClock clock;
  test::SharedClock time;
  EmulatedFalcon emulated(time, Vector3::Zero(), {}, {.homing = 50ms});
  std::string prompt;
  const auto home = [&](const std::string& text) {
    prompt = text;
    time.sleep_until(time.now() + 51ms);
  };
  const auto device =
      open_falcon(emulated.config(), clock, {.prompt = home, .limit = test::patience(20s)});
  EXPECT_THAT(prompt, HasSubstr("pull the Falcon's grip out"));
  DeviceSample sample;
  EXPECT_TRUE(device->read(sample));

  EmulatedFalcon never(time, Vector3::Zero(), {}, {.homing = 1h});
  EXPECT_THAT(falcon_refusal(never.config(), clock), HasSubstr("not homed in time"));
}

TEST(FalconDriver, WithoutItsHomingThereIsNoPositionUntilItIsHomedAgain) {
  const SteadyClock clock;
  test::SharedClock time;
  EmulatedFalcon emulated(time, Vector3::Zero(),
                          {{.kind = WireFault::kEncoderZero, .from_s = 1.0, .length_s = 1.0}});
  const auto device = open_falcon(emulated.config(), clock, {.limit = test::patience(20s)});
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  time.set(1500ms);

  EXPECT_FALSE(device->read(sample));
  EXPECT_EQ(device->last_error(), DeviceError::kNotReady);
  EXPECT_TRUE(device->release()) << "the motors are reached";
  EXPECT_TRUE(device->reopen(kReopenLimit));
  EXPECT_EQ(device->phase(), DevicePhase::kConnected);
  EXPECT_FALSE(device->calibrate()) << "nobody has homed it";
  time.set(2min);
  EXPECT_TRUE(device->calibrate());
  EXPECT_TRUE(device->read(sample));
}

TEST(FalconDriver, AnotherDeviceIsRefused) {
  const SteadyClock clock;
  EmulatedFalcon emulated(clock, Vector3::Zero(),
                          {{.kind = WireFault::kWrongId, .from_s = 0.0, .length_s = 1e3}});
  EXPECT_THAT(falcon_refusal(emulated.config(), clock),
              HasSubstr("usb is ffff:ffff, not 0403:cb48"));
  FalconConfig config = emulated.config();
  config.port = "/dev/null";
  EXPECT_THAT(falcon_refusal(config, clock), HasSubstr("/dev/null is no USB device"));
}

TEST(FalconDriver, IsReleasedOnceTheDeviceConfirmsIt) {
  expect_release_confirmed_after<EmulatedFalcon>({WireFault::kSilent, WireFault::kUnplugged},
                                                 open_falcon);
}

TEST(FalconDriver, SaysHowATransferFailedAndOpensAgain) {
  const auto error_of = [](WireFault kind, Duration limit) {
    test::SharedClock time;
    EmulatedFalcon emulated(time, Vector3::Zero(),
                            {{.kind = kind, .from_s = 1.0, .length_s = 1.0}});
    return error_in_fault(emulated.config(), time, open_falcon, limit);
  };
  EXPECT_EQ(error_of(WireFault::kSilent, kPassingLimit), DeviceError::kTimeout);
  EXPECT_EQ(error_of(WireFault::kShort, kPassingLimit), DeviceError::kTimeout);
  EXPECT_EQ(error_of(WireFault::kGarbage, kAmpleLimit), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kUnplugged, kAmpleLimit), DeviceError::kUnplugged);
  EXPECT_EQ(error_of(WireFault::kMerged, kAmpleLimit), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kDoubled, kAmpleLimit), DeviceError::kCorrupt);
}

TEST(FalconDriver, ALateAnswerWithinTheLimitIsNoFault) {
  const SteadyClock clock;
  test::SharedClock time;
  EmulatedFalcon emulated(time, Vector3::Zero(),
                          {{.kind = WireFault::kDelayed, .from_s = 1.0, .length_s = 1.0}});
  const auto device = open_falcon(emulated.config(), clock, {});
  DeviceSample sample;
  time.set(1500ms);
  EXPECT_TRUE(device->read(sample));
}

std::unique_ptr<DeviceBench> open_emulated_falcon() {
  return std::make_unique<DriverUnderTest<EmulatedFalcon, open_falcon>>();
}

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
PALPATE_DEVICE_CONFORMANCE(NovintFalcon, device::open_emulated_falcon);
}  // namespace palpate::test
