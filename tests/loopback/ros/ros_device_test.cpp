// SPDX-License-Identifier: Apache-2.0
// `palpate ros device`: an arm behind the DDS of another vendor as the device of a session.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "tests/loopback/ros/ros_support.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"
#include "tests/support/wired/acknowledge.h"

namespace palpate {
namespace {

using test::Program;
using testing::HasSubstr;

/// Long periods, leases and limits outlast the pauses of a busy machine.
std::string arm_session_text(const std::string& socket) {
  return R"(
name: "arm"
device {
  rate_hz: 200
  lease_us: 12500
  accept: NO_MOTOR_WATCHDOG
  profile { coulomb_newton: 0.08 viscous_newton_s_per_m: 0.09 position_resolution_m: 1e-4 }
  dead_man_button: 0
  plugin {
    library: ")" PALPATE_ROS_DEVICE R"("
    options: "socket=)" +
         socket +
         R"( peak_newton=3 continuous_newton=3 half_extent_m=0.1 resolution_m=1e-4 buttons=1 patience_ms=300"
  }
}
mofc { controller: mofc mode: guard stale_after_ms: 400 }
physics { rate_hz: 200 }
scene {
  tool { tip_radius_m: 0.003 }
  tissue {
    name: "block"
    half_space { normal { z: 1 } }
    kelvin_voigt { stiffness_newton_per_m: 250 damping_newton_s_per_m: 1 }
  }
}
)";
}

/// The number behind `key=` in what the arm has printed.
double number_in(const std::string& text, const std::string& key) {
  const std::size_t at = text.find(key + "=");
  return at == std::string::npos ? -1e9 : std::stod(text.substr(at + key.size() + 1));
}

class RosDevice : public testing::Test {
 protected:
  std::vector<std::string> bridge_arguments(const std::string& file) {
    return {"device", "--session", file,       "--domain", domain_, "--namespace", "arm",
            "--axes", "-y x z",    "--center", "0",        "0",     "0.1"};
  }
  void start(const std::string& fault) {
    arm_ = std::make_unique<Program>("fast_dds_peer",
                                     std::vector<std::string>{domain_, "arm", "arm", fault});
    bridge_ = std::make_unique<Program>("palpate_ros", bridge_arguments(file_));
    ASSERT_FALSE(bridge_->await_err("event=ros_device socket=").empty()) << bridge_->err();
    watcher_.emplace(load_session(file_), links_);
    launch_ = std::make_unique<Program>(
        "palpate", std::vector<std::string>{"launch", file_, "--no-viewer", "--no-realtime"});
    ASSERT_TRUE(test::is_enabled(*launch_)) << launch_->err() << bridge_->err();
  }
  bool presses() {
    return watcher_->until([&] {
      return !watcher_->rows().empty() &&
             watcher_->rows().back().device.force_on_hand_newton.norm() > 0.4;
    });
  }
  static std::string end(Program& program) {
    program.send_signal(SIGTERM);
    EXPECT_EQ(program.wait(), 0) << program.err();
    return program.out();
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string domain_ = test::ros_domain();
  std::string socket_ = (files_.path() / "arm").string();
  std::string file_ = files_.write("arm.txtpb", arm_session_text(socket_));
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<test::Watcher> watcher_;
  std::unique_ptr<Program> arm_;
  std::unique_ptr<Program> bridge_;
  std::unique_ptr<Program> launch_;
};

TEST_F(RosDevice, AnArmOfAnotherVendorsDdsIsADevice) {
  start("");
  ASSERT_TRUE(presses()) << launch_->err() << bridge_->err();
  // the hand goes down by less than 10 mm, and presses down: the arm's axes are turned
  const TickRow row = watcher_->rows().back();
  EXPECT_GT(row.device.force_on_hand_newton.z(), 0.4);
  EXPECT_LT(row.device.measured_hand_position_m.z(), 0.0);
  EXPECT_GT(row.device.measured_hand_position_m.z(), -0.015);
  EXPECT_THAT(launch_->err(), HasSubstr("event=no_motor_watchdog"));
  end(*launch_);
  bridge_->await_err("event=device_node gone");
  end(*bridge_);
  const std::string told = end(*arm_);
  EXPECT_THAT(told, HasSubstr("frame=base"));
  EXPECT_GT(number_in(told, "largest_newton"), 0.4) << told;
  EXPECT_EQ(number_in(told, "last_newton"), 0.0) << told;
}

TEST_F(RosDevice, AStateThatWasToldBeforeCounts) {
  arm_ = std::make_unique<Program>("fast_dds_peer",
                                   std::vector<std::string>{domain_, "arm", "arm", "kept_state"});
  arm_->await_err("ready");
  bridge_ = std::make_unique<Program>("palpate_ros", bridge_arguments(file_));
  launch_ = std::make_unique<Program>(
      "palpate", std::vector<std::string>{"launch", file_, "--no-viewer", "--no-realtime"});
  EXPECT_TRUE(test::is_enabled(*launch_)) << launch_->err() << bridge_->err();
  end(*launch_);
  end(*bridge_);
  end(*arm_);
}

TEST_F(RosDevice, AnArmThatIsDisabledIsWaitedFor) {
  arm_ = std::make_unique<Program>("fast_dds_peer",
                                   std::vector<std::string>{domain_, "arm", "arm", "disabled"});
  bridge_ = std::make_unique<Program>("palpate_ros", bridge_arguments(file_));
  launch_ = std::make_unique<Program>(
      "palpate", std::vector<std::string>{"launch", file_, "--no-viewer", "--no-realtime"});
  EXPECT_FALSE(launch_->await_err("waiting for the arm's operating_state").empty());
  arm_->send_signal(SIGUSR1);
  EXPECT_FALSE(launch_->await_err("event=device_phase phase=").empty()) << launch_->err();
  end(*launch_);
  end(*bridge_);
  end(*arm_);
}

struct Trouble {
  const char* fault;
  const char* line;  ///< of the bridge; empty: none
};
class RosDeviceTrouble : public RosDevice, public testing::WithParamInterface<Trouble> {};

TEST_P(RosDeviceTrouble, EndsTheForce) {
  start(GetParam().fault);
  ASSERT_TRUE(presses()) << launch_->err() << bridge_->err();
  arm_->send_signal(SIGUSR1);
  EXPECT_TRUE(watcher_->until([&] {
    return !watcher_->rows().empty() &&
           watcher_->rows().back().device.force_on_hand_newton.isZero(0.0) &&
           watcher_->rows().back().device.measured_hand_position_m.z() < -0.002;
  })) << launch_->err()
      << bridge_->err();
  if (*GetParam().line != '\0') {
    EXPECT_FALSE(bridge_->await_err(GetParam().line).empty()) << bridge_->err();
  }
  launch_->send_signal(SIGTERM);
  launch_->wait();  // not 0 where nobody confirms that the motors are limp
  end(*bridge_);
  const std::string told = end(*arm_);
  EXPECT_GE(number_in(told, "zero_after_ms"), 0.0) << told;
  EXPECT_EQ(number_in(told, "last_newton"), 0.0) << told;
}

INSTANTIATE_TEST_SUITE_P(Each, RosDeviceTrouble,
                         testing::Values(Trouble{"stop", ""},
                                         Trouble{"repeat", "its stamp is not later"},
                                         Trouble{"nan", "a component is NaN"},
                                         Trouble{"unhomed", ""}, Trouble{"let_go", ""}),
                         [](const auto& one) { return std::string(one.param.fault); });

TEST_F(RosDevice, WithoutABridgeLaunchSaysWhatToStart) {
  Program launch("palpate", {"launch", file_, "--no-viewer", "--no-realtime"});
  EXPECT_FALSE(launch.await_err("start `palpate ros device` with").empty());
  launch.send_signal(SIGTERM);
  launch.wait();
}

TEST_F(RosDevice, WhatCannotBeServedIsRefusedWithARemedy) {
  Program first("palpate_ros", bridge_arguments(file_));
  ASSERT_FALSE(first.await_err("event=ros_device socket=").empty()) << first.err();
  const test::Outcome second = test::run_program("palpate_ros", bridge_arguments(file_));
  EXPECT_EQ(second.status, 2);
  EXPECT_THAT(second.err, HasSubstr("another program serves it"));
  end(first);

  // the socket of another program stays
  const int stranger = socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  socket_.copy(static_cast<char*>(address.sun_path), sizeof(address.sun_path) - 1);
  ASSERT_EQ(bind(stranger, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_EQ(listen(stranger, 1), 0);
  const test::Outcome taken = test::run_program("palpate_ros", bridge_arguments(file_));
  EXPECT_EQ(taken.status, 2);
  EXPECT_THAT(taken.err, HasSubstr("name another file"));
  EXPECT_TRUE(std::filesystem::is_socket(socket_));
  close(stranger);

  std::vector<std::string> no_center = bridge_arguments(file_);
  no_center.back() = "nan";
  EXPECT_EQ(test::run_program("palpate_ros", no_center).status, 2);
  const test::Outcome no_name =
      test::run_program("palpate_ros", {"device", "--session", file_, "--domain", domain_});
  EXPECT_EQ(no_name.status, 2);
  EXPECT_THAT(no_name.err, HasSubstr("--namespace is missing"));

  for (const char* const wrong : {"patience_ms=abc", "patiense_ms=40", "buttons=1e30"}) {
    std::string text = arm_session_text(socket_);
    text.replace(text.find("buttons=1 patience_ms=300"), 25, wrong);
    const test::Outcome refused = test::run_program(
        "palpate", {"launch", files_.write("wrong.txtpb", text), "--no-viewer", "--no-realtime"});
    EXPECT_EQ(refused.status, 2) << wrong;
    EXPECT_THAT(refused.err, HasSubstr("known are socket=PATH")) << wrong;
  }

  const std::string simulated = files_.write(
      "simulated.txtpb", "name: \"s\" device { simulated {} } physics { rate_hz: 500 }");
  const test::Outcome other = test::run_program("palpate_ros", bridge_arguments(simulated));
  EXPECT_EQ(other.status, 2);
  EXPECT_THAT(other.err, HasSubstr("palpate_ros_device.so"));
}

}  // namespace
}  // namespace palpate
