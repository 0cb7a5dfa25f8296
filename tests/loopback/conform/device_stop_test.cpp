// SPDX-License-Identifier: Apache-2.0
// Programs that move a device by itself: a signal leaves its motors limp, no push is stronger than
// was agreed to, and motors that fail a small push get no other.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "deploy/conform/conform_device.h"
#include "device_node/drivers/driver_registry.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using test::Program;
using ::testing::HasSubstr;

const std::string kSession = test::source_dir() + "/deploy/sessions/default.txtpb";
const std::string kLibrary = "device.plugin.library=" PALPATE_BOARD_DEVICE;

/// What board_device.c keeps of its motors.
class Board {
 public:
  struct Motors {
    double force_newton = 0.0;
    double largest_newton = 0.0;
  };
  /// @param kind  of its vices; "right": none
  explicit Board(const std::string& kind) : kind_(kind) {}

  [[nodiscard]] std::string options() const { return kind_ + ":" + file(); }
  [[nodiscard]] Motors motors() const {
    Motors motors;
    std::ifstream(file(), std::ios::binary).read(reinterpret_cast<char*>(&motors), sizeof(motors));
    return motors;
  }
  [[nodiscard]] std::vector<std::string> arguments(std::vector<std::string> command) const {
    command.insert(command.end(),
                   {kSession, "--set", kLibrary, "--set", "device.plugin.options=" + options(),
                    "--trust", "--without-watchdog", "--i-understand-this-moves-the-device"});
    return command;
  }

 private:
  [[nodiscard]] std::string file() const { return (folder_.path() / "motors").string(); }

  std::string kind_;
  test::TempFolder folder_;
};

/// Acknowledged, and pushing.
void await_push(Program& program, const Board& board) {
  ASSERT_TRUE(test::await([&] {
    return (program.out() + program.err()).find("press Enter") != std::string::npos;
  })) << program.out()
      << program.err();
  program.send_signal(SIGUSR2);
  ASSERT_TRUE(test::await([&] { return board.motors().force_newton > 0.05; }))
      << program.out() << program.err();
}

const std::vector<std::vector<std::string>> kCommands{{"identify"}, {"conform", "device"}};

TEST(DeviceStop, ASignalLeavesTheMotorsLimpAndIsTheExitStatus) {
  std::signal(SIGHUP, SIG_DFL);  // of the program, also if the test runs under nohup
  for (const auto& command : kCommands) {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGTSTP}) {
      SCOPED_TRACE(command.back() + " " + std::to_string(signal));
      const Board board("right");
      Program program("palpate", board.arguments(command));
      await_push(program, board);
      program.send_signal(signal);
      EXPECT_EQ(program.wait(), 128 + signal) << program.out() << program.err();
      EXPECT_EQ(board.motors().force_newton, 0.0);
      EXPECT_THAT(program.err(), HasSubstr("motors were released"));
      EXPECT_THAT(program.out() + program.err(), HasSubstr("event=realtime scheduling="));
    }
  }
}

TEST(DeviceStop, ASignalEndsThePromptToo) {
  for (const auto& command : kCommands) {
    const Board board("right");
    Program program("palpate", board.arguments(command));
    EXPECT_TRUE(test::await([&] {
      return (program.out() + program.err()).find("press Enter") != std::string::npos;
    })) << program.err();
    program.send_signal(SIGTERM);
    EXPECT_EQ(program.wait(), 128 + SIGTERM) << program.err();
    EXPECT_THAT(program.err(), HasSubstr("stopped before anybody acknowledged"));
    EXPECT_EQ(board.motors().largest_newton, 0.0);
  }
}

TEST(DeviceStop, MotorsThatDoNotConfirmAndCallsThatDoNotReturnAreSaid) {
  for (const auto& command : kCommands) {
    for (const auto& [kind, said] : {std::pair{"deaf", "did not confirm their release within 1 s"},
                                     std::pair{"hangs", "a call of the driver does not return"}}) {
      SCOPED_TRACE(command.back() + " " + kind);
      const Board board(kind);
      Program program("palpate", board.arguments(command));
      await_push(program, board);
      if (kind == std::string("hangs")) {
        EXPECT_TRUE(test::await([&] { return board.motors().force_newton > 0.1; }));
      }
      program.send_signal(SIGINT);
      EXPECT_EQ(program.wait(), 128 + SIGINT) << program.err();
      EXPECT_THAT(program.err(), HasSubstr(said));
      EXPECT_THAT(program.err(), HasSubstr("cut their supply"));
    }
  }
}

// The checks run in a child: it releases the motors.
TEST(DeviceStop, ChecksWhoseProgramIsKilledReleaseTheMotors) {
  test::adopt_orphans();
  const Board board("right");
  Program program("palpate", board.arguments({"conform", "device"}));
  await_push(program, board);
  program.send_signal(SIGKILL);
  EXPECT_EQ(program.wait(), 128 + SIGKILL);
  EXPECT_TRUE(test::all_children_end());
  EXPECT_EQ(board.motors().force_newton, 0.0);
}

std::vector<ConformFinding> found_on(const Board& board, ConformDeviceOptions options) {
  const PluginConfig plugin{.library = PALPATE_BOARD_DEVICE, .options = board.options()};
  ManualClock clock;
  options.may_move_hardware = true;
  options.profile = DeviceProfile{.coulomb_newton = 0.1};
  options.start_up.is_acknowledged = [asked = 0]() mutable { return ++asked > 1; };
  return conform_device(device::all_drivers({.simulated = {}, .driver = plugin}).at("plugin"),
                        std::chrono::milliseconds(1), clock, options);
}

const ConformFinding& finding(const std::vector<ConformFinding>& all, const std::string& check) {
  return *std::find_if(all.begin(), all.end(),
                       [&](const ConformFinding& one) { return one.check == check; });
}

TEST(ConformDevice, PushesNoHarderThanTheSessionAndThePersonAgreedTo) {
  const Board gentle("right");
  const auto found = found_on(gentle, {.may_lack_watchdog = true, .peak_force_newton = 0.3});
  EXPECT_LE(gentle.motors().largest_newton, 0.3 + 1e-9);
  EXPECT_GE(gentle.motors().largest_newton, 0.29);
  EXPECT_TRUE(finding(found, "motors").is_good) << finding(found, "motors").text;
  EXPECT_TRUE(finding(found, "applied").is_good) << finding(found, "applied").text;
  EXPECT_FALSE(finding(found, "peak").is_checked);

  // nothing ends a force, and no session accepts that
  const Board unguarded("right");
  static_cast<void>(found_on(unguarded, {.may_lack_watchdog = true}));
  EXPECT_LE(unguarded.motors().largest_newton, 1.0 + 1e-9);

  const Board accepted("right");
  static_cast<void>(found_on(accepted, {.may_lack_watchdog = true, .accepts_no_watchdog = true}));
  EXPECT_NEAR(accepted.motors().largest_newton, 3.0, 1e-9);
}

TEST(ConformDevice, AsksForAConsentBeforeItPushesMotorsWithoutAWatchdog) {
  const Board board("right");
  EXPECT_THAT([&] { static_cast<void>(found_on(board, {})); },
              testing::ThrowsMessage<SetupError>(HasSubstr("--without-watchdog")));
  EXPECT_EQ(board.motors().largest_newton, 0.0);
}

TEST(ConformDevice, MotorsThatFailTheSmallPushGetNoOther) {
  const Board board("reversed");
  const auto found = found_on(board, {.may_lack_watchdog = true, .accepts_no_watchdog = true});
  EXPECT_FALSE(finding(found, "motors").is_good);
  EXPECT_LE(board.motors().largest_newton, 0.4 + 1e-9);
  for (const char* check : {"direction", "applied", "lease", "peak"}) {
    EXPECT_FALSE(finding(found, check).is_checked) << check;
    EXPECT_THAT(finding(found, check).text, HasSubstr("not tried"));
  }
}

// A person who has acknowledged expects the device to move.
TEST(HandsOffCheck, OfADeviceWithoutAWatchdogIsRefusedBeforeThePrompt) {
  const Board board("right");
  Program node("device_node", {"--session", kSession, "--set", kLibrary, "--set",
                               "device.plugin.options=" + board.options(), "--set",
                               "device.hands_off_check=true"});
  EXPECT_EQ(node.wait(), 2) << node.err();
  EXPECT_THAT(node.err(), HasSubstr("device.hands_off_check: device \"example plug-in\" has no"));
  EXPECT_THAT(node.err(), testing::Not(HasSubstr("event=device_prompt")));
}

}  // namespace
}  // namespace palpate
