// SPDX-License-Identifier: Apache-2.0
// Haply Inverse3: the messages byte by byte, and the driver through the emulator.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <numbers>
#include <string>
#include <thread>

#include "common/core/check.h"
#include "common/core/random.h"
#include "device_node/drivers/haply/haply_driver.h"
#include "device_node/drivers/haply/haply_wire.h"
#include "device_node/drivers/haply/json_reader.h"
#include "device_node/emulators/haply_emulator.h"
#include "device_node/identification/hands_off_check.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_conformance.h"
#include "tests/support/wired/shared_clock.h"
#include "tests/unit/device_node/wired_driver.h"

namespace palpate::device {
namespace {

using ::testing::HasSubstr;

constexpr const char* kUpdate =
    R"({"inverse3":[{"device_id":"0001","state":{"cursor_position":{"x":9,"y":9,"z":9}}},)"
    R"({"state":{"cursor_velocity":{"x":0,"y":-1.5e-2,"z":0},"control_mode":"idle","transform":{},)"
    R"("cursor_position":{"z":0.03,"x":0.01,"y":-0.02}},"device_id":"049D"}],)"
    R"("wireless_verse_grip":[{"device_id":"61576","state":{"orientation":{"w":0,"x":0,"y":0,"z":1},)"
    R"("buttons":{"a":false,"b":true,"c":true}}}],"verse_grip":[]})";

TEST(HaplyWire, ReadsTheUpdateOfItsOwnDeviceAndGrip) {
  HaplyState state;
  ASSERT_TRUE(read_haply_state(kUpdate, "049D", "61576", state));

  EXPECT_EQ(state.cursor_position_m, Vector3(0.01, -0.02, 0.03));
  EXPECT_EQ(state.cursor_velocity_m_per_s, Vector3(0, -0.015, 0));
  EXPECT_EQ(state.orientation->coeffs(), Quaternion(0, 0, 0, 1).coeffs());
  EXPECT_EQ(state.buttons, 6u);
}

TEST(HaplyWire, AnUpdateWithoutTheDeviceOrItsPositionIsRefused) {
  HaplyState state;
  EXPECT_FALSE(read_haply_state(kUpdate, "FFFF", "", state));
  EXPECT_FALSE(
      read_haply_state(R"({"inverse3":[{"device_id":"049D","state":{}}]})", "049D", "", state));
  EXPECT_FALSE(state.is_gone) << "it is listed";
  EXPECT_FALSE(read_haply_state(R"({"inverse3":[]})", "049D", "", state));
  EXPECT_TRUE(state.is_gone);
  EXPECT_FALSE(read_haply_state(R"({"inverse3":[])", "049D", "", state));
  EXPECT_FALSE(state.is_gone) << "cut off";
  EXPECT_FALSE(read_haply_state(R"({"session":{}})", "049D", "", state));
  EXPECT_FALSE(state.is_gone) << "without a list";
  EXPECT_FALSE(read_haply_state(
      R"({"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":0,"y":0}}}]})", "049D",
      "", state));
}

TEST(HaplyWire, EveryTruncatedUpdateIsRefused) {
  const std::string whole = kUpdate;
  HaplyState state;
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_FALSE(read_haply_state(whole.substr(0, size), "049D", "61576", state)) << size;
  }
}

TEST(HaplyWire, DamagedUpdatesGiveFiniteReadingsOrNone) {
  Random random(1);
  HaplyState state;
  int refused = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string text = kUpdate;
    for (int n = 0; n < 3; ++n) {
      text[static_cast<std::size_t>(random.uniform() * static_cast<double>(text.size()))] =
          static_cast<char>(random.uniform(0, 256));
    }
    if (!read_haply_state(text, "049D", "61576", state)) {
      ++refused;
      continue;
    }
    EXPECT_TRUE(state.cursor_position_m->allFinite());
  }
  EXPECT_GT(refused, 2000);
}

TEST(HaplyWire, NestingWithoutEndIsRefused) {
  HaplyState state;
  EXPECT_FALSE(read_haply_state(R"({"a":)" + std::string(100'000, '['), "049D", "", state));
}

TEST(HaplyWire, ReadsWithoutAllocation) {
  HaplyState state;
  const test::AllocGuard guard;
  const bool is_read = read_haply_state(kUpdate, "049D", "61576", state);
  EXPECT_EQ(guard.count(), 0u);
  EXPECT_TRUE(is_read);
}

TEST(HaplyWire, WritesAForceInEitherDialect) {
  std::array<char, kHaplyCommandBytes> out{};
  const auto written = [&](HaplyDialect dialect) {
    return std::string(out.data(), write_haply_force("049D", dialect, {0, -0.25, 1.5}, out));
  };
  EXPECT_EQ(written(HaplyDialect::kVector),
            R"({"inverse3":[{"device_id":"049D","commands":{"set_cursor_force":{"vector":)"
            R"({"x":0.000000,"y":-0.250000,"z":1.500000}}}}]})");
  EXPECT_THAT(written(HaplyDialect::kValues), HasSubstr(R"("set_cursor_force":{"values":{"x":)"));
}

TEST(HaplyWire, ASnapshotNamesTheOnlyDeviceAndGripAndTheFilters) {
  const HaplySnapshot snapshot = read_haply_snapshot(
      R"({"session_id":7,"inverse3":[{"device_id":"049D","status":{"calibrated":false,"ready":true},)"
      R"("config":{"filters":{"force_gate":{"gain":0.3},"damping":{"scalar":0.1}}}}],)"
      R"("verse_grip":[{"device_id":"ab"}]})",
      "", "", HaplyDialect::kVector);

  EXPECT_EQ(snapshot.device_id, "049D");
  EXPECT_EQ(snapshot.grip_id, "ab");
  EXPECT_FALSE(snapshot.is_wireless_grip);
  EXPECT_EQ(snapshot.is_calibrated, false);
  EXPECT_EQ(snapshot.is_ready, true);
  EXPECT_EQ(snapshot.is_powered, std::nullopt);
  EXPECT_EQ(snapshot.force_gate_gain, 0.3);
  EXPECT_EQ(snapshot.damping, 0.1);
}

TEST(HaplyWire, OfSeveralDevicesOneHasToBeChosen) {
  const std::string two = R"({"inverse3":[{"device_id":"A"},{"device_id":"B"}]})";
  EXPECT_EQ(read_haply_snapshot(two, "B", "", HaplyDialect::kVector).device_id, "B");
  const auto text_of = [&](const std::string& id) -> std::string {
    try {
      static_cast<void>(read_haply_snapshot(two, id, "", HaplyDialect::kVector));
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(text_of(""), HasSubstr("A, B"));
  EXPECT_THAT(text_of("C"), HasSubstr("there is no Inverse3 \"C\""));
}

HaplyConfig haply_at(std::uint16_t port) {
  HaplyConfig config;
  config.port = port;
  config.workspace_half_extent_m = Vector3(0.08, 0.06, 0.035);
  config.limits = {.peak_force_newton = 3.0, .continuous_force_newton = 2.0};
  config.position_resolution_m = 55e-6;
  config.transfer_limit = std::chrono::seconds(5);
  return config;
}

/// An emulator on a thread of its own.
class EmulatedHaply {
 public:
  explicit EmulatedHaply(const Clock& clock, const Vector3& hand_m = Vector3::Zero(),
                         const std::vector<PlannedFault>& faults = {},
                         const std::vector<ButtonPress>& presses = {})
      : device_({}, {.path = HoldPath{.position_m = hand_m}, .presses = presses}, clock, 1,
                std::chrono::milliseconds(20), faults),
        emulator_(device_, 0),
        thread_([this](const std::stop_token& stop) { emulator_.run(stop); }) {}

  [[nodiscard]] HaplyConfig config() const { return haply_at(emulator_.port()); }
  /// What the motors do, as of the last answer.
  [[nodiscard]] Vector3 motor_force_newton() const { return device_.force_newton(); }

 private:
  EmulatedDevice device_;
  HaplyEmulator emulator_;
  std::jthread thread_;
};

TEST(HaplyDriver, ReportsTheForceThatItApplies) {
  const ManualClock clock;
  EmulatedHaply emulated(clock);
  const auto device = open_haply(emulated.config(), clock, {});
  DeviceSample at_switch;

  ASSERT_TRUE(device->apply({0, 0, 9}, std::chrono::seconds(1), at_switch));

  EXPECT_EQ(at_switch.applied_force_newton, Vector3(0, 0, 3));
}

TEST(HaplyDriver, TurnsTheServicesFrameIntoTheDevices) {
  const ManualClock clock;
  EmulatedHaply emulated(clock);
  HaplyConfig config = emulated.config();
  config.origin_m = Vector3(0.01, 0.02, 0.03);
  // x forward becomes y forward
  config.rotation = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitZ()));
  const auto device = open_haply(config, clock, {});
  DeviceSample sample;
  ASSERT_TRUE(device->read(sample));

  EXPECT_LT((sample.hand_position_m - Vector3(0.02, -0.01, -0.03)).norm(), 1e-3);
}

TEST(HaplyDriver, IsReleasedOnceTheDeviceConfirmsIt) {
  expect_release_confirmed_after<EmulatedHaply>(
      {WireFault::kSilent, WireFault::kUnplugged, WireFault::kGarbage}, open_haply);
}

TEST(HaplyDriver, WithoutSupplyOrCalibrationThereIsNoForceUntilTheServiceHasThem) {
  using namespace std::chrono_literals;
  for (const WireFault kind : {WireFault::kNoSupply, WireFault::kUncalibrated}) {
    const SteadyClock clock;
    test::SharedClock time;
    EmulatedHaply emulated(time, Vector3::Zero(), {{.kind = kind, .from_s = 1.0, .length_s = 1.0}});
    const auto device = open_haply(emulated.config(), clock, {.limit = test::patience(20s)});
    DeviceSample sample;
    ASSERT_TRUE(device->apply(Vector3(0, 0, 1), 1h, sample));
    time.set(1500ms);

    EXPECT_FALSE(device->read(sample));
    EXPECT_EQ(device->last_error(), DeviceError::kNotReady);
    EXPECT_TRUE(device->reopen(kReopenLimit));
    EXPECT_EQ(device->phase(), DevicePhase::kConnected);
    EXPECT_FALSE(device->apply(Vector3(0, 0, 1), 1h, sample));
    EXPECT_EQ(emulated.motor_force_newton(), Vector3(0, 0, 0));
    time.set(3s);
    EXPECT_TRUE(device->calibrate());
    EXPECT_TRUE(device->apply(Vector3(0, 0, 1), 1h, sample));
  }
}

TEST(HaplyDriver, AGripThatVanishesEndsOrRepeatsItselfHoldsNoButton) {
  using namespace std::chrono_literals;
  for (const WireFault kind : {WireFault::kGripGone, WireFault::kGripOff, WireFault::kGripFrozen}) {
    SCOPED_TRACE(static_cast<int>(kind));
    test::SharedClock time;
    EmulatedHaply emulated(time, Vector3::Zero(), {{.kind = kind, .from_s = 1.0, .length_s = 1.0}},
                           {{.button = 1, .from_s = 0.01, .until_s = 4.0},
                            {.button = 1, .from_s = 5.0, .until_s = 6.0}});
    const auto device = open_haply(emulated.config(), time, {});
    const auto held_at = [&](Duration at) {
      for (Duration t = time.now().time_since_epoch(); t < at; t += 10ms) {
        time.set(t);
        DeviceSample passed;
        EXPECT_TRUE(device->read(passed));
      }
      time.set(at);
      DeviceSample sample;
      EXPECT_TRUE(device->read(sample));
      return sample.buttons == 2U;
    };
    EXPECT_TRUE(held_at(900ms));
    EXPECT_EQ(held_at(1100ms), kind == WireFault::kGripFrozen) << "a moment is no loss";
    EXPECT_FALSE(held_at(1400ms));
    EXPECT_FALSE(held_at(3s)) << "it is back, and held: it has to be let go first";
    EXPECT_TRUE(held_at(5500ms));
  }
}

// The position of an answer too many would be taken for that of the next message, and so on.
TEST(HaplyDriver, AnswersThatComeTwiceAreAFault) {
  using namespace std::chrono_literals;
  const SteadyClock clock;
  test::SharedClock time;
  EmulatedHaply emulated(time, Vector3::Zero(),
                         {{.kind = WireFault::kDoubled, .from_s = 1.0, .length_s = 1.0}});
  const auto device = open_haply(emulated.config(), clock, {.limit = test::patience(20s)});
  DeviceSample sample;
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(device->read(sample));
  time.set(1500ms);

  read_until_it_fails(*device, clock);
  EXPECT_EQ(device->last_error(), DeviceError::kCorrupt);
  time.set(3s);
  EXPECT_TRUE(device->reopen(kReopenLimit));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(device->read(sample));
}

// The counted work is that of the hand only if positions are its own, and forces in their frame.
TEST(HaplyDriver, AServiceThatChangesPositionsIsRefused) {
  const auto refused = [](const std::string& config, const std::string& state,
                          HaplyDialect dialect = HaplyDialect::kVector) {
    try {
      static_cast<void>(read_haply_snapshot(
          R"({"inverse3":[{"device_id":"A","config":)" + config + R"(,"state":)" + state + "}]}",
          "", "", dialect));
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refused(R"({"mount":{"scale":1.0}})", R"({"transform":{}})"), "");
  EXPECT_THAT(refused(R"({"mount":{"scale":2}})", "{}"), HasSubstr("scales the positions"));
  // by the vendor's documentation, forces and positions go through basis and mount alike
  const std::string led_front =
      R"({"basis":{"permutation":"XZY"},"mount":{"position":{"x":0,"y":0.1,"z":-0.2},)"
      R"("rotation":{"w":0,"x":0,"y":0,"z":1},"scale":{"x":1,"y":1,"z":1}}})";
  EXPECT_EQ(refused(led_front, "{}"), "");
  EXPECT_THAT(refused(led_front, "{}", HaplyDialect::kValues), HasSubstr("turns the mount"));
  EXPECT_EQ(refused(R"({"mount":{"position":{"x":0,"y":0.1,"z":0},"rotation":{"w":-1,"x":0,"y":0,)"
                    R"("z":0}}})",
                    "{}", HaplyDialect::kValues),
            "");
}

TEST(HaplyDriver, AWorkspaceTransformOfTheServiceIsRefusedAtTheStartAndInTheRun) {
  for (const auto& [transform, what] : std::map<std::string, std::string>{
           {"{}", ""},
           {R"({"position":{"x":0,"y":0,"z":0},"rotation":{"x":0,"y":0,"z":0,"w":1},"scale":1})",
            ""},
           {R"({"scale":1.5})", "scale"},
           {R"({"scale":{"x":1,"y":1,"z":0.5}})", "scale"},
           {R"({"position":{"x":0,"y":0.001,"z":0}})", "position"},
           {R"({"rotation":{"w":0.999,"x":0.04,"y":0,"z":0}})", "rotation"}}) {
    const std::string text =
        R"({"inverse3":[{"device_id":"A","state":{"cursor_position":{"x":0,"y":0,"z":0},)"
        R"("transform":)" +
        transform + "}}]}";
    HaplyState state;
    ASSERT_TRUE(read_haply_state(text, "A", "", state)) << text;
    EXPECT_EQ(state.is_transformed, !what.empty()) << text;
    std::string refusal;
    try {
      static_cast<void>(read_haply_snapshot(text, "", "", HaplyDialect::kVector));
    } catch (const std::runtime_error& error) {
      refusal = error.what();
    }
    EXPECT_THAT(refusal, HasSubstr(what.empty() ? "" : "workspace transform (" + what + ")"));
    EXPECT_EQ(refusal.empty(), what.empty()) << text;
  }
}

TEST(HaplyDriver, SaysHowATransferFailedAndOpensAgain) {
  const auto error_of = [](WireFault kind) {
    test::SharedClock time;
    EmulatedHaply emulated(time, Vector3::Zero(), {{.kind = kind, .from_s = 1.0, .length_s = 1.0}});
    return error_in_fault(emulated.config(), time, open_haply);
  };
  EXPECT_EQ(error_of(WireFault::kUnplugged), DeviceError::kUnplugged);
  EXPECT_EQ(error_of(WireFault::kSilent), DeviceError::kTimeout);
  EXPECT_EQ(error_of(WireFault::kGarbage), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kShort), DeviceError::kCorrupt);
  EXPECT_EQ(error_of(WireFault::kWrongId), DeviceError::kUnplugged);
  EXPECT_EQ(error_of(WireFault::kUnlisted), DeviceError::kUnplugged);
}

TEST(HaplyDriver, IdentifiesTheFrictionOfTheDeviceFromBelow) {
  test::SharedClock clock;
  EmulatedDevice emulated({.viscous_newton_s_per_m = 0.2, .coulomb_newton = 0.15}, nobody(), clock,
                          1, std::chrono::milliseconds(20), {});
  HaplyEmulator emulator(emulated, 0);
  const std::jthread server([&](const std::stop_token& stop) { emulator.run(stop); });
  HaplyConfig config = haply_at(emulator.port());
  const auto device = open_haply(config, clock, {});
  SweepPlan plan = hands_off_plan(device->specification());
  plan.lines.resize(1);
  plan.half_length_m = 0.01;
  EXPECT_THROW(static_cast<void>(identify_friction(*device, clock, plan, {.may_move = true})),
               SetupError);

  const FrictionReport found =
      identify_friction(*device, clock, plan, {.may_move = true, .may_lack_watchdog = true});

  EXPECT_LE(found.viscous_bound_newton_s_per_m, 0.2);
  EXPECT_GE(found.viscous_bound_newton_s_per_m, 0.5 * 0.2);
  EXPECT_LE(found.coulomb_bound_newton, 0.15);
  EXPECT_GE(found.coulomb_bound_newton, 0.9 * 0.15);
}

TEST(HaplyDriver, WithoutAServiceThereIsAnErrorThatSaysSo) {
  const SteadyClock clock;
  HaplyConfig config;
  config.port = 1;
  try {
    static_cast<void>(open_haply(config, clock, {.limit = std::chrono::milliseconds(300)}));
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("127.0.0.1:1: Connection refused"));
    EXPECT_THAT(error.what(), HasSubstr("Inverse Service"));
  }
}

TEST(EmulatedFaults, AreReadFromTheCommandLine) {
  const PlannedFault fault = parse_fault("wrong_id@2.5:500", "haply_inverse");
  EXPECT_EQ(fault.kind, WireFault::kWrongId);
  EXPECT_EQ(fault.from_s, 2.5);
  EXPECT_EQ(fault.length_s, 0.5);
  for (const char* bad :
       {"", "stuck", "stuck@1", "stuck:5@1", "broken@1:5", "stuck@-1:5", "stuck@1:5x"}) {
    EXPECT_THROW(static_cast<void>(parse_fault(bad, "haply_inverse")), SetupError) << bad;
  }
  EXPECT_NO_THROW(static_cast<void>(parse_fault("turning@1:5", "hapi")));
  // each device of docs/devices.md that is tried without a supply
  for (const char* driver : {"haply_inverse", "hapi", "falcon", "wooden"}) {
    EXPECT_NO_THROW(static_cast<void>(parse_fault("no_supply@0:9", driver))) << driver;
  }
  EXPECT_THROW(static_cast<void>(parse_fault("turning@1:5", "haply_inverse")), SetupError);
}

TEST(EmulatedFaults, ThatCanHaveNoEffectAreSaid) {
  const auto refusal = [](const std::string& text) -> std::string {
    try {
      static_cast<void>(parse_fault(text, "wooden"));
    } catch (const SetupError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal("stuck@0:1000000"), HasSubstr("below 1,000,000"));
  EXPECT_THAT(refusal("stuck@1e6:5"), HasSubstr("below 1,000,000"));
  EXPECT_EQ(refusal("stuck@0:999999"), "");
  EXPECT_THAT(refusal("stuck@1:0"), HasSubstr("lasts 0 ms"));
  EXPECT_EQ(refusal("power_cycle@1:0"), "");  // is over as it begins
  const auto hidden = [](const std::vector<std::string>& texts) {
    std::vector<PlannedFault> faults;
    for (const std::string& text : texts) faults.push_back(parse_fault(text, "hapi"));
    return hidden_faults(faults);
  };
  using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;
  EXPECT_EQ(hidden({"stuck@1:500", "silent@1.2:500"}), (Pairs{{1, 0}}));
  EXPECT_EQ(hidden({"stuck@1:500", "silent@1.5:500"}), Pairs());
  EXPECT_EQ(hidden({"stuck@1:500", "late@1:500", "weight@1:500"}), Pairs());
  EXPECT_EQ(hidden({"watchdog_100@1:500", "no_watchdog@1:500"}), (Pairs{{0, 1}}));
  EXPECT_EQ(hidden({"merged@1:500", "doubled@1:500"}), (Pairs{{0, 1}}));
}

std::unique_ptr<DeviceBench> open_emulated_haply() {
  return std::make_unique<DriverUnderTest<EmulatedHaply, open_haply>>();
}

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
PALPATE_DEVICE_CONFORMANCE(HaplyInverse3, device::open_emulated_haply);
}  // namespace palpate::test
