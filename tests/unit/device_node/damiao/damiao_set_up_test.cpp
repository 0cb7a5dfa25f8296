// SPDX-License-Identifier: Apache-2.0
// What a leader arm of Damiao motors refuses before it may have torque, with the remedy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <bit>
#include <chrono>
#include <cmath>
#include <string>
#include <vector>

#include "device_node/drivers/damiao/damiao_arm.h"
#include "device_node/drivers/damiao/damiao_frame.h"
#include "device_node/emulators/damiao_emulator.h"
#include "tests/unit/device_node/damiao/bench.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using test::DamiaoBench;
using ::testing::AnyOf;
using ::testing::HasSubstr;

TEST(DamiaoSetUp, AnotherModelOrRangeIsRefused) {
  DamiaoBench bench;
  bench.joints[1].model = "DM4310";
  EXPECT_THAT(bench.refusal(), HasSubstr("joint 2 (id 2): its values are within 12.5 rad and 54 "
                                         "N·m, those of a DM4310 within 12.5 and 10"));
  bench.joints[1].model = "DM8009";
  bench.emulator().with_motor(
      5, [](EmulatedDamiaoMotor& m) { m.set_reg(21, std::bit_cast<std::uint32_t>(3.14F)); });
  EXPECT_THAT(bench.refusal(), HasSubstr("joint 6 (id 6): its values are within 3.14 rad"));
}

TEST(DamiaoSetUp, AnotherModeIsSetToMit) {
  DamiaoBench bench;
  bench.emulator().with_motor(0, [](EmulatedDamiaoMotor& m) { m.set_reg(10, 2); });
  bench.open();
  EXPECT_EQ(bench.reg(0, damiao::kControlMode), damiao::kMitMode);
  bench.close();
  bench.emulator().with_motor(0, [](EmulatedDamiaoMotor& m) {
    m.set_reg(10, 2);
    m.keeps_registers = false;
  });
  EXPECT_THAT(bench.refusal(), HasSubstr("joint 1 (id 1): stays in control mode 2"));
}

TEST(DamiaoSetUp, AHardwareErrorIsRefusedWithItsCause) {
  DamiaoBench bench;
  bench.emulator().with_motor(5, [](EmulatedDamiaoMotor& m) { m.protect(0xC); });
  EXPECT_THAT(bench.refusal(),
              HasSubstr("joint 6 (id 6): reports a hardware error: winding overheated"));
}

TEST(DamiaoSetUp, AMotorThatIsNotThereIsNamed) {
  DamiaoBench bench;
  bench.joints[2].id = 9;
  EXPECT_THAT(bench.refusal(), HasSubstr("joint 3 (id 9): does not answer on "));
  bench.joints[2].id = 3;
  bench.joints[2].feedback_id = 0x33;
  EXPECT_THAT(bench.refusal(), HasSubstr("joint 3 (id 3): does not answer on "));
  bench.joints[2].feedback_id = 0;
  bench.plan(WireFault::kBusOff);
  EXPECT_THAT(bench.refusal(), HasSubstr("joint 1 (id 1): the interface is down or off the bus"));
}

TEST(DamiaoSetUp, WrongSettingsAreRefusedBeforeTheBusIsOpened) {
  const auto refusal_of = [](const auto& change) {
    DamiaoBench bench;
    bench.settings.port = "/nowhere/bus";
    change(bench);
    return bench.refusal();
  };
  using B = DamiaoBench;
  EXPECT_THAT(refusal_of([](B& b) { b.joints.clear(); }), HasSubstr("1 … 8 joints"));
  EXPECT_THAT(refusal_of([](B& b) { b.joints[1].id = 0; }), HasSubstr("an id is 1 … 15"));
  EXPECT_THAT(refusal_of([](B& b) { b.joints[1].id = 16; }), HasSubstr("an id is 1 … 15"));
  EXPECT_THAT(refusal_of([](B& b) { b.joints[1].feedback_id = 0x7FF; }), HasSubstr("1 … 2046"));
  EXPECT_THAT(refusal_of([](B& b) { b.joints[1].feedback_id = 0x11; }),
              HasSubstr("feedback_id 17 is that of another"));
  EXPECT_THAT(refusal_of([](B& b) { b.joints[1].model = "XL330"; }),
              HasSubstr("model \"XL330\" is not known here; there are DM3507, DM4310"));
  EXPECT_THAT(refusal_of([](B& b) { b.joints[1].torque_limit_newton_m = 0.0; }),
              HasSubstr("torque_limit_newton_m"));
  EXPECT_THAT(refusal_of([](B& b) { b.joints[1].torque_ratio = std::nan(""); }),
              HasSubstr("torque_ratio"));
  for (const double ratio : {0.001, 0.3, 3.1}) {  // as if per mA, or of another unit
    EXPECT_THAT(refusal_of([=](B& b) { b.joints[1].torque_ratio = ratio; }), HasSubstr("1/3 … 3"));
  }
  EXPECT_THAT(refusal_of([](B& b) { b.settings.timeout_s = 0.0; }), HasSubstr("0.002 … 1"));
  EXPECT_THAT(refusal_of([](B& b) { b.settings.longest_delay_s = 0.001; }),
              HasSubstr("longest_delay_s must be above 0.001"));
  EXPECT_THAT(refusal_of([](B&) {}), HasSubstr("/nowhere/bus: No such file"));
  // without the kernel's modules, without the interface
  EXPECT_THAT(
      refusal_of([](B& b) { b.settings.port = "can77"; }),
      AnyOf(HasSubstr("can77: this kernel has no SocketCAN"), HasSubstr("can77: No such device")));
}

TEST(DamiaoSetUp, ALimitBelowTheLeastTorqueIsRefused) {
  DamiaoBench bench;
  bench.joints[0].torque_limit_newton_m = 0.01;
  EXPECT_THAT(bench.refusal(), HasSubstr("below half a unit of the wire, 0.0131868 N·m"));
}

// A bus on which nobody takes a frame: a socket that nobody reads.
TEST(CanPort, WhatDoesNotLeaveIsTold) {
  int ends[2] = {-1, -1};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  CanPort port(ends[0]);
  Transfer transfer = Transfer::kDone;
  for (int k = 0; k < 100'000 && transfer == Transfer::kDone; ++k) {
    transfer = port.send(damiao_refresh(1), 1ms);
  }
  EXPECT_EQ(transfer, Transfer::kFull);
  ::close(ends[1]);
  EXPECT_EQ(port.send(damiao_refresh(1), 1ms), Transfer::kClosed);
}

TEST(DamiaoSetUp, MotorsBesideTheArmAreLeftAlone) {
  DamiaoBench bench;
  bench.joints.resize(3);
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  EXPECT_EQ(bench.state(4), damiao::kOff);
  EXPECT_EQ(bench.reg(4, damiao::kTimeout), 0u);
}

}  // namespace
}  // namespace palpate::device
