// SPDX-License-Identifier: Apache-2.0
// Rows of palpate_faults for real devices: how long the motors go on pushing when the wire fails
// while the hand presses (docs/devices.md#faults). The driver runs in device_node under `palpate
// launch`; the emulator, which knows what its motors do, in this process.
#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "common/session/session_file.h"
#include "device_node/emulators/falcon_emulator.h"
#include "device_node/emulators/hapi_emulator.h"
#include "device_node/emulators/haply_emulator.h"
#include "device_node/emulators/wooden_emulator.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/wired/acknowledge.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;
using device::WireFault;

constexpr double kPressedNewton = 0.3;
constexpr double kLostJoule = 1e-6;
/// After which the emulated motors end a force if no message comes: so long a force goes on that
/// nothing else ends.
constexpr Duration kMotorWatchdog = 20ms;
/// Within which one more message with a force may follow.
constexpr Duration kOneMore = 20ms;
constexpr int kMostLaunches = 5;

struct WireFaultRow {
  const char* name;
  WireFault kind;
  double length_s;
  bool is_fault;  ///< of the device, which a reset ends
};

constexpr WireFaultRow kWireFaultRows[] = {{"unplugged", WireFault::kUnplugged, 0.3, true},
                                           {"corrupt", WireFault::kGarbage, 0.3, true},
                                           {"silent", WireFault::kSilent, 0.7, true},
                                           {"slow", WireFault::kDelayed, 0.6, false}};

/// Documented: the motors push at most so long after the begin of the fault.
constexpr Duration limit_of(const WireFaultRow& row, Duration watchdog) {
  // slow: five ticks of four transfers, each of them 5 ms late; doubled for a busy machine
  return row.is_fault ? watchdog + kOneMore : 200ms;
}

/// Always in the tissue, to and fro.
HandConfig pressing_to_and_fro() {
  HandConfig hand;
  hand.path = SinusoidPath{.center_m = Vector3(0, 0, -0.012),
                           .amplitude_m = Vector3(0, 0, 0.006),
                           .frequency_hz = Vector3(0, 0, 0.7)};
  return hand;
}

class DeviceFaults : public testing::Test {
 protected:
  void SetUp() override {
    if (std::getenv("PALPATE_DEVICE_FAULTS") == nullptr) {
      GTEST_SKIP() << "takes some seconds a row: PALPATE_DEVICE_FAULTS=1";
    }
  }
  /// All rows of one device.
  /// @param setting  connects the session with the emulator
  void run_rows(const std::string& device, device::EmulatedDevice& emulated,
                const std::string& setting, Duration watchdog = kMotorWatchdog) {
    for (const WireFaultRow& row : kWireFaultRows) {
      SCOPED_TRACE(device + " " + row.name);
      run_row(device, emulated, setting, row, limit_of(row, watchdog));
    }
  }

  /// A launch of its own: what a clamp owes after an earlier fault on a busy machine is not the
  /// next one's. Where the machine holds up so many transfers that no force comes, another launch.
  static void run_row(const std::string& device, device::EmulatedDevice& emulated,
                      const std::string& setting, const WireFaultRow& row, Duration limit) {
    std::optional<Program> started;
    bool is_pressing = false;  // the fault begins while the hand presses
    for (int i = 0; i < kMostLaunches && !is_pressing; ++i) {
      started.emplace(
          "palpate",
          std::vector<std::string>{
              "launch", test::source_dir() + "/deploy/sessions/" + device + ".txtpb", "--set",
              setting, "--set", "device.accept=NO_MOTOR_WATCHDOG", "--no-viewer"});
      ASSERT_TRUE(is_enabled(*started)) << started->err();
      is_pressing = await([&] { return emulated.acting_newton() > kPressedNewton; }, 5s);
    }
    Program& launch = *started;
    ASSERT_TRUE(is_pressing) << launch.err();
    const pid_t node = std::stoi(launch.await_err("event=node_started node=device pid="));
    const auto count = [&](const char* event) { return times_in(launch.err(), event); };
    const int resets = count("event=device_fault_reset");
    const int enablings = count("event=device_phase phase=enabled");
    const double begin_s = emulated.now_s();
    emulated.plan({.kind = row.kind, .from_s = begin_s, .length_s = row.length_s});
    ASSERT_TRUE(await([&] { return emulated.now_s() > begin_s + row.length_s; }));
    const device::FaultOutcome outcome = emulated.outcomes().back();
    std::printf("| %s %s | %.2f N | pushed for %.1f ms (%.0f ms) | least true energy %.1f µJ |\n",
                device.c_str(), row.name, outcome.force_newton,
                1e3 * to_seconds(outcome.pushed_for), 1e3 * to_seconds(limit),
                1e6 * emulated.least_energy_joule());
    EXPECT_LE(outcome.pushed_for, limit);
    EXPECT_GE(emulated.least_energy_joule(), -kLostJoule);
    if (row.is_fault) {
      ASSERT_TRUE(await([&] {
        kill(node, SIGUSR2);
        return count("event=device_fault_reset") > resets;
      })) << launch.err();
      ASSERT_TRUE(is_enabled(launch, enablings + 1)) << launch.err();
    }
    launch.send_signal(SIGINT);
    EXPECT_EQ(launch.wait(), 0) << launch.err();
  }

  /// Of the session that is shipped.
  template <class Config>
  static Config config_of(const std::string& device) {
    return std::get<Config>(
        load_session(test::source_dir() + "/deploy/sessions/" + device + ".txtpb").side().driver);
  }

  RunFolder run_folder_;
  TempFolder folder_;
  SteadyClock clock_;
};

TEST_F(DeviceFaults, TheForceOfAHaplyIsGoneInTime) {
  device::EmulatedDevice emulated({}, pressing_to_and_fro(), clock_, 1, kMotorWatchdog, {});
  device::HaplyEmulator emulator(emulated, 0);
  const std::jthread server([&](const std::stop_token& stop) { emulator.run(stop); });

  run_rows("haply", emulated, "device.haply_inverse.port=" + std::to_string(emulator.port()));
}

TEST_F(DeviceFaults, TheForceOfAHapiBoardIsGoneInTime) {
  device::EmulatedDevice emulated({}, pressing_to_and_fro(), clock_, 1, kMotorWatchdog, {});
  device::HapiEmulator emulator(emulated, config_of<HapiConfig>("hapi"));
  const std::jthread server([&](const std::stop_token& stop) { emulator.run(stop); });

  run_rows("hapi", emulated, "device.hapi.port=" + emulator.port());
}

TEST_F(DeviceFaults, TheForceOfAFalconIsGoneInTime) {
  device::EmulatedDevice emulated({.position_resolution_m = 0.0}, pressing_to_and_fro(), clock_, 1,
                                  kMotorWatchdog, {});
  auto config = config_of<FalconConfig>("falcon");
  config.port = (folder_.path() / "falcon").string();
  device::FalconEmulator emulator(emulated, config, {});
  const std::jthread server([&](const std::stop_token& stop) { emulator.run(stop); });

  run_rows("falcon", emulated, "device.falcon.port=" + config.port);
}

// Its firmware ends a force after half a second, so long does it go on.
TEST_F(DeviceFaults, TheForceOfAWoodenHapticsIsGoneInTime) {
  constexpr Duration kWatchdog = device::WoodenEmulator::kWatchdog;
  device::EmulatedDevice emulated({.position_resolution_m = 0.0}, pressing_to_and_fro(), clock_, 1,
                                  kWatchdog, {});
  auto config = config_of<WoodenConfig>("wooden");
  config.port = (folder_.path() / "wooden").string();
  device::WoodenEmulator emulator(emulated, config);
  const std::jthread server([&](const std::stop_token& stop) { emulator.run(stop); });

  run_rows("wooden", emulated, "device.wooden.port=" + config.port, kWatchdog);
}

}  // namespace
}  // namespace palpate::test
