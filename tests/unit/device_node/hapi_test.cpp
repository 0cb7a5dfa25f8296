// SPDX-License-Identifier: Apache-2.0
// Pantographs on hAPI boards: the messages byte by byte, the links, and the driver through the
// emulator.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/core/random.h"
#include "device_node/drivers/hapi/hapi_driver.h"
#include "device_node/drivers/transport/serial_port.h"
#include "device_node/emulators/hapi_emulator.h"
#include "device_node/identification/hands_off_check.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_conformance.h"
#include "tests/support/wired/shared_clock.h"
#include "tests/unit/device_node/wired_driver.h"

namespace palpate::device {
namespace {

using ::testing::HasSubstr;

template <class Bytes>
std::string hex(const Bytes& bytes) {
  std::string text;
  for (const std::byte b : bytes) {
    text += "0123456789abcdef"[std::to_integer<unsigned>(b) >> 4U];
    text += "0123456789abcdef"[std::to_integer<unsigned>(b) & 15U];
  }
  return text;
}

// As a board that is unplugged: its terminal is ready to be read for ever, and has nothing.
TEST(SerialPort, ATerminalThatHungUpIsClosed) {
  const int board = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  ASSERT_EQ(::grantpt(board), 0);
  ASSERT_EQ(::unlockpt(board), 0);
  SerialPort port(::ptsname(board));
  std::array<std::byte, 2> bytes{};
  ASSERT_EQ(::write(board, "ab", 2), 2);
  EXPECT_EQ(port.read(bytes, std::chrono::seconds(5)), Transfer::kDone);
  EXPECT_EQ(port.read(bytes, std::chrono::milliseconds(1)), Transfer::kTimeout);

  ::close(board);

  EXPECT_EQ(port.read(bytes, std::chrono::seconds(5)), Transfer::kClosed);
  EXPECT_EQ(port.write(bytes, std::chrono::seconds(5)), Transfer::kClosed);
}

// [1][id 5], ports 1 and 2: mask 3 and their directions, twice; no sensors, no PWM; 180 and 13824,
// 0 and 13824 as little-endian float32.
TEST(HapiWire, SetsThePantographUp) {
  EXPECT_EQ(hex(hapi_set_up({})),
            "0105030001030001"
            "0000"
            "0000344300005846"
            "0000000000005846");
}

TEST(HapiWire, ListsPortsInTheirOrderWhateverTheOrderOfTheMotors) {
  HapiBoard board;
  board.motor_ports = {4, 2};
  board.motor_directions = {1, 0};
  EXPECT_EQ(hex(hapi_set_up(board)).substr(0, 10), "01050a0001");
}

TEST(HapiWire, WritesTorques) {
  EXPECT_EQ(hex(hapi_torques(5, {0.5F, -0.25F})), "02050000003f000080be");
}

TEST(HapiWire, ReadsAnglesAndRefusesWhatIsNone) {
  std::array<std::byte, kHapiReadingBytes> bytes{};
  const auto set = [&](std::size_t i, float value) { std::memcpy(&bytes[1 + 4 * i], &value, 4); };
  bytes[0] = std::byte{5};
  set(0, 121.5F);
  set(1, -3.25F);
  std::array<float, kHapiMotors> angles{};
  ASSERT_TRUE(read_hapi_angles(bytes, 5, angles));
  EXPECT_EQ(angles[0], 121.5F);
  EXPECT_EQ(angles[1], -3.25F);

  EXPECT_FALSE(read_hapi_angles(bytes, 4, angles));
  set(1, std::numeric_limits<float>::quiet_NaN());
  EXPECT_FALSE(read_hapi_angles(bytes, 5, angles));
  set(1, 1e9F);
  EXPECT_FALSE(read_hapi_angles(bytes, 5, angles));
}

// Arms straight outwards: elbows 12 cm apart, the handle √(7² − 6²) cm above their middle.
TEST(Pantograph, HasItsHandleWhereTheRodsMeet) {
  const Pantograph links({});
  const Vector2 handle = *links.handle_m(Vector2(std::numbers::pi, 0.0));
  EXPECT_NEAR(handle.x(), 0.01, 1e-12);
  EXPECT_NEAR(handle.y(), std::sqrt(0.07 * 0.07 - 0.06 * 0.06), 1e-12);
}

TEST(Pantograph, AnglesLeadBackToTheHandleAndTheJacobianIsTheDerivative) {
  const Pantograph links({});
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Vector2 handle(random.uniform(-0.03, 0.05), random.uniform(0.05, 0.09));
    const std::optional<Vector2> angles = links.angles_rad(handle);
    ASSERT_TRUE(angles);
    EXPECT_LT((*links.handle_m(*angles) - handle).norm(), 1e-12);
    const Matrix2 jacobian = *links.jacobian(*angles);
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      Vector2 step = Vector2::Zero();
      step[axis] = 1e-6;
      const Vector2 slope =
          (*links.handle_m(*angles + step) - *links.handle_m(*angles - step)) / 2e-6;
      EXPECT_LT((jacobian.col(axis) - slope).norm(), 1e-7);
    }
  }
}

TEST(Pantograph, OutOfReachThereIsNoAnswer) {
  const Pantograph links({});
  EXPECT_FALSE(links.angles_rad(Vector2(0.01, 0.2)));
  EXPECT_FALSE(Pantograph({.base_m = 0.1}).handle_m(Vector2(std::numbers::pi, 0.0)));
}

/// A pantograph in the vertical plane x, z of D, its origin in the middle of its reach.
HapiConfig upright_pantograph() {
  HapiConfig config;
  config.torque_gain = 0.5;
  config.origin_m = Vector3(0.01, 0.07, 0.0);
  config.rotation = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitX()));
  config.workspace_half_extent_m = Vector3(0.03, 1e-3, 0.02);
  config.limits = {.peak_force_newton = 3.0, .continuous_force_newton = 2.0};
  config.position_resolution_m = 50e-6;
  config.transfer_limit = std::chrono::seconds(5);
  return config;
}

class EmulatedHapi {
 public:
  explicit EmulatedHapi(const Clock& clock, const Vector3& hand_m = Vector3::Zero(),
                        const std::vector<PlannedFault>& faults = {},
                        const HapiConfig& board = upright_pantograph())
      : device_({}, {.path = HoldPath{.position_m = hand_m}}, clock, 1,
                std::chrono::milliseconds(20), faults),
        emulator_(device_, board),
        thread_([this](const std::stop_token& stop) { emulator_.run(stop); }) {}

  [[nodiscard]] HapiConfig config() const {
    HapiConfig config = upright_pantograph();
    config.port = emulator_.port();
    return config;
  }
  [[nodiscard]] Vector3 motor_force_newton() const { return device_.force_newton(); }
  [[nodiscard]] int set_ups() const { return emulator_.set_ups(); }

 private:
  EmulatedDevice device_;
  HapiEmulator emulator_;
  std::jthread thread_;
};

TEST(HapiDriver, ReadsThePlaneAndPushesInIt) {
  const ManualClock clock;
  EmulatedHapi emulated(clock, Vector3(0.01, 0.02, -0.005));
  const auto device = open_hapi(emulated.config(), clock, {});
  ASSERT_TRUE(device->calibrate());
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - Vector3(0.01, 0, -0.005)).norm(), 50e-6);

  ASSERT_TRUE(device->apply({0.5, 1.0, -1.0}, std::chrono::seconds(1), sample));

  // half a step of each motor, half as strong, by a lever of more than 3 cm
  EXPECT_LT((sample.applied_force_newton - Vector3(0.5, 0, -1.0)).norm(), 0.05);
  EXPECT_LT((emulated.motor_force_newton() - sample.applied_force_newton).norm(), 1e-5);
}

TEST(HapiDriver, ABoardThatSaturatesOrRoundsIsToldOnlyWhatItMakes) {
  const ManualClock clock;
  HapiConfig config = upright_pantograph();
  config.torque_gain = 1.0;
  config.largest_torque_newton_m = 0.06;  // 1.2 N at a lever of 5 cm
  config.torque_step_newton_m = 5e-3;
  EmulatedHapi emulated(clock, Vector3(0.01, 0, -0.005), {}, config);
  config.port = emulated.config().port;
  const auto device = open_hapi(config, clock, {});
  ASSERT_TRUE(device->calibrate());
  Random random(3);
  bool is_saturated = false;
  for (int i = 0; i < 200; ++i) {
    const double angle_rad = random.uniform(0.0, 2.0 * std::numbers::pi);
    const Vector3 force_newton =
        random.uniform(0.0, 3.0) * Vector3(std::cos(angle_rad), 0, std::sin(angle_rad));
    DeviceSample sample;

    ASSERT_TRUE(device->apply(force_newton, std::chrono::seconds(1), sample));

    const Vector3& told_newton = sample.applied_force_newton;
    EXPECT_LT((emulated.motor_force_newton() - told_newton).norm(), 1e-5);
    EXPECT_LE(told_newton.norm(), force_newton.norm() + 1e-9);
    is_saturated = is_saturated || told_newton.norm() < force_newton.norm() - 0.5;
  }
  EXPECT_TRUE(is_saturated);
}

TEST(HapiDriver, IsReleasedOnceTheDeviceConfirmsIt) {
  expect_release_confirmed_after<EmulatedHapi>({WireFault::kSilent}, open_hapi);
}

// The board takes the place where the handle is as its home: only a person knows that it is there.
TEST(HapiDriver, IsSetUpOnlyWhenAPersonSaysThatTheHandleIsAtHome) {
  const SteadyClock clock;
  test::SharedClock time;
  EmulatedHapi emulated(time, Vector3(0.01, 0, -0.005),
                        {{.kind = WireFault::kSetUpAnywhere, .from_s = 1.0, .length_s = 1e3},
                         {.kind = WireFault::kSilent, .from_s = 2.0, .length_s = 1.0}});
  HapiConfig config = emulated.config();
  config.transfer_limit = kPassingLimit;
  const auto device = open_hapi(config, clock, {.limit = test::patience(std::chrono::seconds(20))});
  DeviceSample sample;
  EXPECT_EQ(emulated.set_ups(), 0) << "opening is none";
  EXPECT_EQ(device->phase(), DevicePhase::kConnected);
  EXPECT_FALSE(device->read(sample));
  EXPECT_FALSE(device->apply(Vector3(0, 0, 1), std::chrono::seconds(1), sample));
  EXPECT_EQ(device->last_error(), DeviceError::kNotReady);
  EXPECT_THAT(device->specification().calibration, HasSubstr("left arm at 180"));

  ASSERT_TRUE(device->calibrate());
  ASSERT_TRUE(device->read(sample));
  EXPECT_LT((sample.hand_position_m - Vector3(0.01, 0, -0.005)).norm(), 50e-6);
  time.set(std::chrono::milliseconds(2500));
  EXPECT_FALSE(device->read(sample));
  time.set(std::chrono::seconds(4));
  const TimePoint until = clock.now() + test::patience(std::chrono::seconds(20));
  while (!device->reopen(kReopenLimit) && clock.now() < until) {
  }

  EXPECT_EQ(emulated.set_ups(), 1) << "opening it again is none either";
  EXPECT_EQ(device->phase(), DevicePhase::kConnected);
  EXPECT_FALSE(device->read(sample)) << "no position without a calibration";
}

TEST(HapiDriver, APowerCycleNeedsACalibration) {
  const SteadyClock clock;
  test::SharedClock time;
  EmulatedHapi emulated(time, Vector3::Zero(),
                        {{.kind = WireFault::kPowerCycle, .from_s = 1.0, .length_s = 1.0}});
  HapiConfig config = emulated.config();
  config.transfer_limit = kPassingLimit;
  const auto device = open_hapi(config, clock, {.limit = test::patience(std::chrono::seconds(20))});
  ASSERT_TRUE(device->calibrate());
  time.set(std::chrono::seconds(3));
  DeviceSample sample;
  EXPECT_FALSE(device->read(sample));
  EXPECT_FALSE(device->reopen(kReopenLimit)) << "a board without a set-up confirms nothing";
  EXPECT_EQ(device->phase(), DevicePhase::kConnected);
  EXPECT_TRUE(device->calibrate());
  EXPECT_TRUE(device->release());
}

TEST(HapiDriver, SaysHowATransferFailedAndOpensAgain) {
  const auto error_of = [](WireFault kind) {
    test::SharedClock time;
    EmulatedHapi emulated(time, Vector3::Zero(), {{.kind = kind, .from_s = 1.0, .length_s = 1.0}});
    return error_in_fault(emulated.config(), time, open_hapi);
  };
  EXPECT_EQ(error_of(WireFault::kSilent), DeviceError::kTimeout);
  EXPECT_EQ(error_of(WireFault::kShort), DeviceError::kTimeout);
  EXPECT_EQ(error_of(WireFault::kGarbage), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kWrongId), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kMerged), DeviceError::kCorrupt);
}

TEST(HapiDriver, AnswersThatComeTwiceAreAFault) {
  test::SharedClock time;
  EmulatedHapi emulated(time, Vector3::Zero(),
                        {{.kind = WireFault::kDoubled, .from_s = 1.0, .length_s = 1.0}});
  expect_doubled_answers_noticed(emulated.config(), time, open_hapi);
}

TEST(HapiDriver, IdentifiesTheFrictionInItsPlaneFromBelow) {
  test::SharedClock clock;
  EmulatedDevice emulated(
      {.viscous_newton_s_per_m = 0.2, .coulomb_newton = 0.15, .position_resolution_m = 0.0},
      nobody(), clock, 1, std::chrono::milliseconds(20), {});
  HapiEmulator emulator(emulated, upright_pantograph());
  const std::jthread server([&](const std::stop_token& stop) { emulator.run(stop); });
  HapiConfig config = upright_pantograph();
  config.port = emulator.port();
  const auto device = open_hapi(config, clock, {});
  ASSERT_TRUE(device->calibrate());
  SweepPlan plan = hands_off_plan(device->specification());
  ASSERT_EQ(plan.lines.size(), 2U) << "x and z";
  plan.lines.resize(1);

  const FrictionReport found =
      identify_friction(*device, clock, plan, {.may_move = true, .may_lack_watchdog = true});

  EXPECT_LE(found.viscous_bound_newton_s_per_m, 0.2);
  EXPECT_LE(found.coulomb_bound_newton, 0.15);
  EXPECT_GE(found.coulomb_bound_newton, 0.8 * 0.15);
}

TEST(HapiDriver, SaysWhatHeldCurrentsDoWhileTheArmTurns) {
  HapiConfig config = upright_pantograph();
  expect_turning_reported(
      config, 0.012,
      [&](EmulatedDevice& device) {
        auto emulator = std::make_unique<HapiEmulator>(device, config);
        config.port = emulator->port();
        return emulator;
      },
      open_hapi);
}

TEST(HapiDriver, KnowsWhatHeldCurrentsCanBeElsewhere) {
  const ManualClock clock;
  const EmulatedHapi emulated(clock);
  const HapiConfig& config = emulated.config();
  const auto device = open_hapi(config, clock, {});
  ASSERT_TRUE(device->calibrate());
  expect_held_force_ratio(
      config, device->specification().held_force_ratio,
      [links = Pantograph(pantograph_geometry(config))](const Vector3& m) {
        const std::optional<Vector2> angles_rad = links.angles_rad(m.head<2>());
        // the axis across the plane has no motor
        return angles_rad ? std::optional<Vector3>(Vector3(angles_rad->x(), angles_rad->y(), m.z()))
                          : std::nullopt;
      });
}

TEST(HapiDriver, AWorkspaceThatEndsAtAStretchedArmHasNoBoundOfHeldCurrents) {
  const ManualClock clock;
  const EmulatedHapi emulated(clock);
  HapiConfig config = emulated.config();
  config.workspace_half_extent_m.x() = 0.12;
  const auto device = open_hapi(config, clock, {});
  ASSERT_TRUE(device->calibrate());
  EXPECT_EQ(device->specification().held_force_ratio, std::numeric_limits<double>::infinity());
  EXPECT_EQ(device->specification().turning_per_m, std::numeric_limits<double>::infinity());
}

// 3.557 was found by a search of all pairs, and the worst pair lies between the places of any grid.
TEST(HapiDriver, TheWorstPairOfPlacesIsClimbedTo) {
  const ManualClock clock;
  const EmulatedHapi emulated(clock);
  HapiConfig config = emulated.config();
  config.origin_m = Vector3(0.0099, 0.0462, 0.0);
  config.workspace_half_extent_m = Vector3(0.0383, 0.001, 0.0198);
  const auto device = open_hapi(config, clock, {});
  ASSERT_TRUE(device->calibrate());
  EXPECT_GE(device->specification().held_force_ratio, 3.557);
  EXPECT_LE(device->specification().held_force_ratio, 3.7);
}

// The fold of an arm is a hole of 20 mm around its motor, between places 25 and 32 mm apart.
TEST(HapiDriver, AFoldedArmBetweenThePlacesOfACoarseGridHasNoBoundEither) {
  const ManualClock clock;
  const EmulatedHapi emulated(clock);
  HapiConfig config = emulated.config();
  config.origin_m.y() = 0.06;
  config.workspace_half_extent_m = Vector3(0.03, 0.001, 0.04);
  const auto device = open_hapi(config, clock, {});
  ASSERT_TRUE(device->calibrate());
  EXPECT_GT(device->specification().held_force_ratio, 1000.0);
}

TEST(HapiDriver, AFileThatIsNoPortIsRefused) {
  const ManualClock clock;
  HapiConfig config = upright_pantograph();
  config.port = "/dev/null";
  try {
    static_cast<void>(open_hapi(config, clock, {.limit = Duration::zero()}));
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("/dev/null is no serial port"));
  }
}

std::unique_ptr<DeviceBench> open_emulated_hapi() {
  return std::make_unique<DriverUnderTest<EmulatedHapi, open_hapi>>();
}

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
PALPATE_DEVICE_CONFORMANCE(HapiPantograph, device::open_emulated_hapi);
}  // namespace palpate::test
