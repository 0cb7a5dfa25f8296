// SPDX-License-Identifier: Apache-2.0
// The whole loop through the wire of a real device: hand → emulator → driver → clamp → tissue.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "common/process/process_links.h"
#include "common/session/session_file.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"
#include "tests/support/wired/acknowledge.h"

namespace palpate {
namespace {

using nlohmann::json;
using test::Outcome;
using test::Program;
using test::TempFolder;
using testing::HasSubstr;

const std::string kDefaultSession = test::source_dir() + "/deploy/sessions/default.txtpb";
const std::string kHaplySession = test::source_dir() + "/deploy/sessions/haply.txtpb";
const std::string kHapiSession = test::source_dir() + "/deploy/sessions/hapi.txtpb";
const std::string kFalconSession = test::source_dir() + "/deploy/sessions/falcon.txtpb";
const std::string kWoodenSession = test::source_dir() + "/deploy/sessions/wooden.txtpb";

/// Forces that a hand feels: the emulated motors end none by themselves.
const std::string kAccepted = "device.accept=NO_MOTOR_WATCHDOG";

constexpr double kRate_hz = 200.0;

class EmulatedDevices : public testing::Test {
 protected:
  /// Of the line that the emulator ends with.
  static double least_energy_microjoule(const std::string& err) {
    static const std::string kBefore = "least true energy ";
    const std::size_t at = err.find(kBefore);
    return at == std::string::npos ? -1e9 : std::stod(err.substr(at + kBefore.size()));
  }
  /// Ticks that device_node has left out, by its own words.
  static int skipped_ticks(const std::string& err) {
    static const std::string kBefore = " device event=ticks_skipped count=";
    int skipped = 0;
    for (std::size_t at = err.find(kBefore); at != std::string::npos; at = err.find(kBefore, at)) {
      at += kBefore.size();
      skipped += std::stoi(err.substr(at));
    }
    return skipped;
  }
  static std::string haply_setting() {
    const std::string endpoint = test::HeldPort().endpoint();
    return "device.haply_inverse.port=" + endpoint.substr(endpoint.rfind(':') + 1);
  }

  TempFolder folder_;
  test::RunFolder run_folder_;
};

TEST_F(EmulatedDevices, AreFeltThroughTheirWiresAndStayPassive) {
  struct Wire {
    std::string session;
    std::string port;   // a setting
    std::string limit;  // a setting
  };
  const std::vector<Wire> wires{
      {kHaplySession, haply_setting(), "device.haply_inverse.transfer_limit_ms=1000"},
      {kHapiSession, "device.hapi.port=" + (folder_.path() / "board").string(),
       "device.hapi.transfer_limit_ms=1000"},
      {kFalconSession, "device.falcon.port=" + (folder_.path() / "usb").string(),
       "device.falcon.transfer_limit_ms=1000"},
      {kWoodenSession, "device.wooden.port=" + (folder_.path() / "hidraw").string(),
       "device.wooden.transfer_limit_ms=1000"}};
  for (const auto& [session, port, limit] : wires) {
    SCOPED_TRACE(session);
    ProcessLinks links({.priority = 0, .cpu = -1});
    test::Watcher watcher(load_session(session), links);
    // long periods, leases and limits outlast the pauses of a busy machine
    Program launch("palpate", {"launch", session, "--emulate", "--set", port, "--set", limit,
                               "--set", kAccepted, "--set", "device.rate_hz=200", "--set",
                               "device.lease_us=12500", "--set", "mofc.stale_after_ms=200",
                               "--no-viewer", "--no-realtime", "--json", "-"});
    launch.await_err("event=device_phase phase=");
    EXPECT_TRUE(watcher.until_rows(100));
    for (const TickRow& row : watcher.rows()) {
      EXPECT_EQ(row.device.force_on_hand_newton, Vector3(0, 0, 0)) << "nobody has acknowledged";
    }
    const auto begin = std::chrono::steady_clock::now();
    // A push of the motors that lasts several ticks longer than meant moves the handle too far, and
    // an emulator that does not run for a second is silent.
    const auto is_starved = [&] {
      const double ticks =
          kRate_hz *
          std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      return skipped_ticks(launch.err()) > 0.2 * ticks;
    };
    const bool is_felt = test::is_enabled(launch) && watcher.until([&] {
      return !watcher.rows().empty() &&
             watcher.rows().back().device.force_on_hand_newton.norm() > 0.3;
    });
    if (!is_felt && is_starved()) {
      std::cout << "not checked: the force through the wire of " << session
                << ": device_node skipped " << skipped_ticks(launch.err()) << " of its ticks\n";
      launch.send_signal(SIGINT);
      launch.wait();
      EXPECT_GE(least_energy_microjoule(launch.err()), -1.0) << launch.err();
      continue;
    }
    EXPECT_TRUE(is_felt) << launch.err();
    EXPECT_TRUE(watcher.until_rows(100));  // so that launch has seen it too
    const test::QuietMachine machine;
    launch.send_signal(SIGINT);

    const int status = launch.wait();
    const std::string err = launch.err();
    // a node that a busy machine does not let end in time is killed
    const bool may_be_load = err.find("event=node_killed") != std::string::npos &&
                             !machine.may_check("each node stops within its grace: " + session);
    EXPECT_TRUE(status == 0 || may_be_load) << status << err;
    EXPECT_GE(least_energy_microjoule(err), -1.0) << err;
    EXPECT_THAT(err, HasSubstr("event=no_motor_watchdog"));
    EXPECT_THAT(err, HasSubstr("none, accepted: the guarantee is not available while"));
    EXPECT_THAT(err, HasSubstr("palpate: event=realtime scheduling=ordinary cpu=any"));
    const json summary = json::parse(launch.out(), nullptr, false);
    ASSERT_FALSE(summary.is_discarded()) << launch.out();
    EXPECT_GT(summary.at("max_force_n").get<double>(), 0.3) << summary;
  }
}

TEST_F(EmulatedDevices, WithoutAcceptanceTheirForceStaysAtTheFriction) {
  Program launch("palpate", {"launch", kHaplySession, "--emulate", "--set", haply_setting(),
                             "--set", "device.haply_inverse.transfer_limit_ms=1000", "--no-viewer",
                             "--no-realtime", "--json", "-", "--seconds", "5"});
  EXPECT_TRUE(test::is_enabled(launch)) << launch.err();
  EXPECT_EQ(launch.wait(), 0) << launch.err();
  const json summary = json::parse(launch.out(), nullptr, false);
  ASSERT_FALSE(summary.is_discarded()) << launch.out();
  EXPECT_FALSE(summary.at("accepts_no_motor_watchdog").get<bool>());
  EXPECT_LE(summary.at("max_force_n").get<double>(), 0.1 + 1e-9) << "f_co";
  EXPECT_THAT(launch.err(), HasSubstr("none: forces stay within the dry friction"));
}

TEST_F(EmulatedDevices, AnUnpluggedDeviceIsAFaultThatAResetEnds) {
  const std::string port = haply_setting();
  Program emulator(
      "palpate", {"emulate", kHaplySession, "--set", port, "--fault", "unplugged@4:300", "--fault",
                  "unplugged@16:300", "--fault", "unplugged@64:300"});
  emulator.await_err("emulates the device at");
  // a busy machine makes transfers late, too, but not by so much
  Program launch("palpate",
                 {"launch", kHaplySession, "--set", port, "--set", kAccepted, "--set",
                  "device.haply_inverse.transfer_limit_ms=1000", "--no-viewer", "--no-realtime"});
  const std::string started = launch.await_err("event=node_started node=device pid=");
  const pid_t device = std::stoi(started);

  EXPECT_TRUE(test::is_enabled(launch)) << launch.err();
  launch.await_err("event=device_fault reason=\"device gone\"");
  // until the emulator accepts connections again
  const bool is_reset = test::await([&] {
    kill(device, SIGUSR2);
    usleep(50'000);
    return launch.err().find("event=device_fault_reset") != std::string::npos;
  });

  EXPECT_TRUE(is_reset) << launch.err();
  launch.send_signal(SIGINT);
  EXPECT_EQ(launch.wait(), 0);
  emulator.send_signal(SIGINT);
  EXPECT_EQ(emulator.wait(), 0);
  EXPECT_GE(least_energy_microjoule(emulator.err()), -1.0);
}

TEST_F(EmulatedDevices, ADeviceThatLostItsSupplySaysWhatItNeedsAndEachVainSignalIsAnswered) {
  const std::string port = haply_setting();
  Program powered("palpate", {"emulate", kHaplySession, "--set", port});
  powered.await_err("emulates the device at");
  Program launch("palpate",
                 {"launch", kHaplySession, "--set", port, "--set",
                  "device.haply_inverse.transfer_limit_ms=1000", "--no-viewer", "--no-realtime"});
  const pid_t device = std::stoi(launch.await_err("event=node_started node=device pid="));
  launch.await_err("event=acknowledge_with command=\"kill -USR2 " + std::to_string(device) + "\"");
  launch.await_err("event=device_phase phase=calibrated");
  powered.send_signal(SIGINT);
  EXPECT_EQ(powered.wait(), 0);
  launch.await_err("event=device_fault ");
  Program unpowered("palpate",
                    {"emulate", kHaplySession, "--set", port, "--fault", "no_supply@0:999999"});
  unpowered.await_err("emulates the device at");

  const auto signals_until = [&](const std::string& line, int times) {
    return test::await([&] {
      if (test::times_in(launch.err(), line) >= times) return true;
      kill(device, SIGUSR2);
      usleep(50'000);
      return false;
    });
  };
  const std::string prompt = "event=device_prompt: connect the power supply of the Inverse3";
  EXPECT_TRUE(signals_until(prompt, 1)) << launch.err();
  EXPECT_TRUE(signals_until("event=acknowledgement_in_vain: the device did not take its", 1))
      << launch.err();
  EXPECT_TRUE(signals_until(prompt, 2)) << launch.err();
  launch.send_signal(SIGINT);
  launch.wait();
}

TEST_F(EmulatedDevices, AClientInAnotherLanguageIsServedAsDocumented) {
  const std::string setting = haply_setting();
  Program emulator("palpate", {"emulate", kHaplySession, "--set", setting, "--hands-off"});
  emulator.await_err("emulates the device at");

  const Outcome client = test::run_program(
      "/usr/bin/python3", {test::source_dir() + "/tests/loopback/devices/haply_client.py",
                           setting.substr(setting.find('=') + 1)});

  EXPECT_EQ(client.status, 0) << client.err;
  EXPECT_THAT(client.out, HasSubstr("as documented"));
  emulator.send_signal(SIGINT);
  EXPECT_EQ(emulator.wait(), 0);
}

TEST_F(EmulatedDevices, TheDoctorOpensTheDeviceAndSaysWhatItLacks) {
  const std::string setting = haply_setting();
  const Outcome absent = test::run_program("palpate", {"doctor", kHaplySession, "--set", setting});
  EXPECT_EQ(absent.status, 1);
  EXPECT_THAT(absent.out, HasSubstr("is the Inverse Service running"));

  Program emulator("palpate", {"emulate", kHaplySession, "--set", setting, "--hands-off"});
  emulator.await_err("emulates the device at");
  const Outcome doctor = test::run_program(
      "palpate", {"doctor", kHaplySession, "--set", setting, "--set", "device.dead_man_button=3"});

  EXPECT_THAT(doctor.out, HasSubstr("Haply Inverse3 049D opens"));
  EXPECT_THAT(doctor.out, HasSubstr("has 3 buttons, counted from 0"));
  EXPECT_THAT(doctor.out, HasSubstr("SIGUSR2 to device_node, or a press of button 3"));
  EXPECT_THAT(
      doctor.out,
      HasSubstr("note   motor watchdog           none: forces stay within the dry friction"));
  const Outcome without = test::run_program("palpate", {"doctor", kHaplySession, "--set", setting,
                                                        "--set", "device.hands_off_check=true"});
  EXPECT_THAT(without.out, HasSubstr("each fault: SIGUSR2 to device_node"));
  EXPECT_THAT(without.out, testing::Not(HasSubstr("or a press of")));
  EXPECT_THAT(without.out, HasSubstr("device.hands_off_check: device"));
}

TEST_F(EmulatedDevices, DoctorAndLogSayWhatLimitsTheForce) {
  const std::string port = "device.hapi.port=" + (folder_.path() / "board").string();
  const std::string stretched = "device.hapi.mount.workspace_half_extent_m.x=0.12";
  Program emulator("palpate", {"emulate", kHapiSession, "--set", port, "--hands-off"});
  emulator.await_err("emulates the device at");

  const Outcome doctor = test::run_program("palpate", {"doctor", kHapiSession, "--set", port});
  EXPECT_THAT(doctor.out, HasSubstr("note   force limit"));
  EXPECT_THAT(doctor.out, HasSubstr("coulomb_newton, divided by 1."));
  const Outcome none =
      test::run_program("palpate", {"doctor", kHapiSession, "--set", port, "--set", stretched});
  EXPECT_THAT(none.out, HasSubstr("TO DO  force limit              0 N: nothing bounds"));
  EXPECT_THAT(none.out, HasSubstr("a smaller device.hapi.mount.workspace_half_extent_m"));

  Program launch("palpate", {"launch", kHapiSession, "--set", port, "--set", stretched,
                             "--no-viewer", "--no-realtime"});
  EXPECT_THAT(launch.await_err("event=force_limit newton=0: "),
              HasSubstr("remedy=\"give a smaller"));
}

// Where it is permitted: otherwise other programs delay the emulator's answers, and identify's
// ticks by more than a lease.
TEST_F(EmulatedDevices, EmulatorAndIdentifyUseTheSessionsRealTimeScheduling) {
  const std::string setting = haply_setting();
  Program emulator("palpate", {"emulate", kHaplySession, "--set", setting, "--hands-off"});
  const std::string emulated = emulator.await_err("event=realtime ");
  Program identify("palpate", {"identify", kHaplySession, "--set", setting, "--without-watchdog",
                               "--i-understand-this-moves-the-device"});
  ASSERT_TRUE(test::await([&] {
    return identify.out().find("take the hand off") != std::string::npos;
  })) << identify.out()
      << identify.err();

  const int policy = sched_getscheduler(identify.pid()) & ~SCHED_RESET_ON_FORK;
  const bool is_permitted = emulated.starts_with("scheduling=fifo priority=80 cpu=any");
  EXPECT_TRUE(is_permitted || emulated.find("fifo_refused=") != std::string::npos) << emulated;
  EXPECT_EQ(policy, is_permitted ? SCHED_FIFO : SCHED_OTHER) << identify.out();
}

TEST_F(EmulatedDevices, ARestartGivesNoForceBeforeAPersonHasAcknowledgedItAgain) {
  ProcessLinks links({.priority = 0, .cpu = -1});
  test::Watcher watcher(load_session(kHaplySession), links);
  Program launch(
      "palpate",
      {"launch", kHaplySession, "--emulate", "--set", haply_setting(), "--set", kAccepted, "--set",
       "device.haply_inverse.transfer_limit_ms=1000", "--no-viewer", "--no-realtime"});
  // a person at the device acknowledges whatever it waits for, on a busy machine several times
  const auto pushes = [&](pid_t node) {
    return watcher.until([&] {
      if (!watcher.rows().empty() &&
          watcher.rows().back().device.force_on_hand_newton.norm() > 0.3) {
        return true;
      }
      if (waits_for_acknowledgement(watcher.mirror().device_counters().phase)) kill(node, SIGUSR2);
      return false;
    });
  };
  const pid_t first = std::stoi(launch.await_err("event=node_started node=device pid="));
  EXPECT_TRUE(pushes(first)) << launch.err();
  const std::uint64_t first_session = watcher.rows().back().device_session_id;

  kill(first, SIGKILL);
  const pid_t second = std::stoi(launch.await_err("event=node_started node=device pid=", 2));
  launch.await_err("event=device_phase phase=calibrated", 2);
  // rows of ticks that nobody answered, as those of the check of the motors, come half a second
  // late
  const auto rows_of_second = [&] {
    return std::count_if(watcher.rows().begin(), watcher.rows().end(), [&](const TickRow& row) {
      return row.device_session_id != first_session;
    });
  };
  EXPECT_TRUE(watcher.until([&] { return rows_of_second() > 100; })) << launch.err();
  for (const TickRow& row : watcher.rows()) {
    if (row.device_session_id == first_session) continue;
    EXPECT_EQ(row.device.force_on_hand_newton, Vector3(0, 0, 0));
  }

  EXPECT_TRUE(pushes(second)) << launch.err();
  launch.send_signal(SIGINT);
  EXPECT_EQ(launch.wait(), 0) << launch.err();
  EXPECT_GE(least_energy_microjoule(launch.err()), -1.0) << launch.err();
}

// A supervisor starts device_node again with the same arguments, with the user's hand on the
// device.
TEST_F(EmulatedDevices, TheHandsOffCheckMovesARealDeviceOnlyAfterAPromptOfThatStart) {
  const std::string prompt = "event=device_prompt: the hands-off check moves the device by itself";
  const std::string moves = "event=hands_off_check_acknowledged";
  Program launch("palpate",
                 {"launch", kDefaultSession, "--set",
                  std::string("device.plugin={ library: \"") + PALPATE_EXAMPLE_DEVICE + "\" }",
                  "--set", "device.hands_off_check=true", "--no-viewer", "--no-realtime"});
  const pid_t first = std::stoi(launch.await_err("event=node_started node=device pid="));
  launch.await_err(prompt);
  EXPECT_EQ(test::times_in(launch.err(), moves), 0);
  kill(first, SIGUSR2);
  launch.await_err(moves);
  kill(first, SIGKILL);

  const pid_t second = std::stoi(launch.await_err("event=node_started node=device pid=", 2));
  launch.await_err(prompt, 2);
  EXPECT_EQ(test::times_in(launch.err(), moves), 1) << "the restart waits for a person again";
  kill(second, SIGUSR2);
  launch.await_err(moves, 2);
  launch.send_signal(SIGINT);
  launch.wait();
}

TEST_F(EmulatedDevices, ASimulatedDeviceNeedsNoEmulator) {
  const Outcome run = test::run_program("palpate", {"emulate", kDefaultSession});
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.err, HasSubstr("emulators are of haply_inverse, hapi, falcon and wooden"));
}

TEST_F(EmulatedDevices, AFileInTheWayOfThePortIsNotReplaced) {
  const std::filesystem::path file = folder_.path() / "mine";
  std::ofstream(file) << "precious";
  const Outcome run = test::run_program(
      "palpate", {"emulate", kHapiSession, "--set", "device.hapi.port=" + file.string()});
  EXPECT_EQ(run.status, 2);
  EXPECT_THAT(run.err, HasSubstr("no emulator made it"));
  EXPECT_TRUE(std::filesystem::is_regular_file(file));
}

}  // namespace
}  // namespace palpate
