// SPDX-License-Identifier: Apache-2.0
// palpate conform: what keeps the rules passes, each fault of wrong_physics is named, and so are
// those of a driver (device_checks_test.cpp has each).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sched.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <filesystem>
#include <future>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "deploy/conform/apart.h"
#include "deploy/conform/conform_device.h"
#include "device_node/conformance/device_checks.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/scripted_device.h"
#include "tests/support/temp_folder.h"
#include "tests/support/text.h"

namespace palpate {
namespace {

using nlohmann::json;
using test::Program;
using test::TempFolder;
using ::testing::HasSubstr;

struct Report {
  int status = -1;
  std::map<std::string, bool> is_good;
  std::string text;
};

/// A run of the suite, whose findings go to a file.
class Conform {
 public:
  /// @param more  behind `palpate conform`
  explicit Conform(const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"conform"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const std::vector<std::string> output{"--json", (folder_.path() / "found.json").string()};
    arguments.insert(arguments.begin() + 2, output.begin(), output.end());
    program_ = std::make_unique<Program>("palpate", arguments);
  }
  Report report() {
    Report report{
        .status = program_->wait(std::chrono::seconds(60)), .is_good = {}, .text = program_->out()};
    const std::filesystem::path file = folder_.path() / "found.json";
    if (!std::filesystem::exists(file)) return report;
    const json found = json::parse(test::text_of(file));
    for (const json& one : found.at("findings")) {
      report.is_good[one.at("check").get<std::string>()] = one.at("is_good").get<bool>();
    }
    return report;
  }
  [[nodiscard]] std::string err() const { return program_->err(); }
  /// Once that is said.
  void acknowledge(const std::string& prompt) {
    program_->await_err(prompt);
    program_->send_signal(SIGUSR2);
  }

 private:
  TempFolder folder_;
  std::unique_ptr<Program> program_;
};

const std::string kDefaultSession = test::source_dir() + "/deploy/sessions/default.txtpb";

std::string bin(const char* name) { return test::binary_dir() + "/" + name; }

TEST(ConformPhysics, AProgramThatCannotBeStartedIsNamedAfterOptionsWithSeveralValues) {
  Program conform("palpate", {"conform", "physics", "--press", "0", "0", "-0.004", "--", "./none",
                              "--session", "{session}"});
  EXPECT_EQ(conform.wait(), 2);
  EXPECT_EQ(conform.err(),
            "palpate conform: physics.command: " + std::filesystem::absolute("./none").string() +
                ": is not a program that you may run; install it, or give the path "
                "of its file\n");
}

TEST(ConformPhysics, OurOwnPhysicsPassesEveryCheck) {
  const test::QuietMachine machine;
  Conform run({"physics", "--", bin("physics_node"), "--session", "{session}"});
  const Report report = run.report();
  if (report.status == 1 && !machine.may_check("checks of real time")) return;
  EXPECT_GE(report.is_good.size(), 14U);
  EXPECT_EQ(report.status, 0) << report.text << run.err();
}

// One fault each; all at once, as they mostly wait.
TEST(ConformPhysics, NamesEachFault) {
  const std::map<std::string, std::string> check_of{
      {"start", "start"},      {"silence", "silence"},
      {"answers", "answers"},  {"rest", "rest"},
      {"air", "rest"},         {"pull", "rest"},
      {"against", "contacts"}, {"model", "model"},
      {"jumps", "jumps"},      {"energy", "energy"},
      {"stamps", "stamps"},    {"pose", "stamps"},
      {"frames", "frames"},    {"delay", "delay"},
      {"restart", "restart"},  {"suspension", "suspension"},
      {"stop", "stop"},        {"whirl", "energy"},
      {"loop", "energy"},      {"slow", "rest"},
      {"rate", "rate"}};
  const auto begin = [](const std::string& fault) {
    return std::make_unique<Conform>(std::vector<std::string>{"physics", "--", bin("wrong_physics"),
                                                              fault, "--session", "{session}"});
  };
  const auto is_named = [&](const std::string& fault, const Report& report) {
    const auto found = report.is_good.find(check_of.at(fault));
    return report.status == 1 && found != report.is_good.end() && !found->second;
  };
  std::map<std::string, std::unique_ptr<Conform>> runs;
  for (const auto& [fault, check] : check_of) runs[fault] = begin(fault);
  std::vector<std::string> again;
  for (auto& [fault, run] : runs) {
    if (!is_named(fault, run->report())) again.push_back(fault);
  }
  // so many suites at once leave little to each: one that cannot start checks no more, and a
  // motion that was seldom computed shows no fault; these have the machine to themselves
  for (const std::string& fault : again) {
    const test::QuietMachine machine;
    const std::unique_ptr<Conform> run = begin(fault);
    const Report report = run->report();
    if (is_named(fault, report) || !machine.may_check(fault)) continue;
    ADD_FAILURE() << fault << "\n" << report.text << run->err();
  }
}

// A program that always computes shares one processor with three others.
TEST(ConformPhysics, OnABusyMachineJudgesNothingThatTakesAProcessor) {
  if (!std::filesystem::exists("/proc/self/schedstat")) GTEST_SKIP() << "the kernel does not tell";
  cpu_set_t all;
  cpu_set_t one;
  ASSERT_EQ(sched_getaffinity(0, sizeof(all), &all), 0);
  CPU_ZERO(&one);
  std::size_t processor = 0;
  while (!CPU_ISSET(processor, &all)) ++processor;
  CPU_SET(processor, &one);
  ASSERT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);  // what begins now inherits it
  std::array<std::jthread, 3> others;
  for (std::jthread& other : others) {
    other = std::jthread([](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
      }
    });
  }
  Conform run({"physics", "--", bin("wrong_physics"), "busy", "--session", "{session}"});
  ASSERT_EQ(sched_setaffinity(0, sizeof(all), &all), 0);
  const Report report = run.report();
  others = {};
  EXPECT_EQ(report.status, 1) << report.text << run.err();
  EXPECT_THAT(report.text, HasSubstr("-     rate: not judged: the program waited for a processor"));
}

// Each sense of a path is judged.
TEST(ConformPhysics, NamesEnergyTheOtherWayRoundAndASideThatIsNotAnswered) {
  const test::QuietMachine machine;
  std::map<std::string, std::unique_ptr<Conform>> runs;
  for (const std::string fault : {"whirl back", "loop back"}) {
    runs[fault] = std::make_unique<Conform>(std::vector<std::string>{
        "physics", "--", bin("wrong_physics"), fault, "--session", "{session}"});
  }
  const std::string two_hands = test::source_dir() + "/deploy/sessions/two_hands.txtpb";
  runs["sides"] = std::make_unique<Conform>(
      std::vector<std::string>{"physics", "--session", two_hands, "--", bin("wrong_physics"),
                               "sides", "--session", "{session}"});
  for (auto& [fault, run] : runs) {
    const Report report = run->report();
    EXPECT_EQ(report.status, 1) << fault << "\n" << report.text << run->err();
    const auto found = report.is_good.find(fault == "sides" ? "sides" : "energy");
    if (found == report.is_good.end() && !machine.may_check(fault)) continue;
    ASSERT_NE(found, report.is_good.end()) << fault << "\n" << report.text << run->err();
    EXPECT_FALSE(found->second) << fault << "\n" << report.text;
  }
}

TEST(ConformPhysics, RefusesAProgramThatIsNotThere) {
  Conform run({"physics", "--", "./no_such_physics"});
  EXPECT_EQ(run.report().status, 2);
  EXPECT_NE(run.err().find("no_such_physics"), std::string::npos) << run.err();
}

TEST(ConformPhysics, RefusesToCheckNothing) {
  Conform run({"physics", "--session", kDefaultSession});
  EXPECT_EQ(run.report().status, 2);
  EXPECT_NE(run.err().find("physics.command"), std::string::npos) << run.err();
}

TEST(ConformDevice, TheSimulatedDevicePassesEveryCheck) {
  const test::QuietMachine machine;
  Conform run({"device", kDefaultSession, "--set", "device.simulated.position_latch=true"});
  const Report report = run.report();
  if (report.status == 1 && !machine.may_check("checks of real time")) return;
  EXPECT_EQ(report.is_good.size(), device::device_checks().size());
  EXPECT_EQ(report.status, 0) << report.text << run.err();
  for (const auto& [check, is_good] : report.is_good) {
    // a program does not count its allocations
    EXPECT_EQ(is_good, check != "allocation") << check << "\n" << report.text;
  }
}

TEST(ConformDevice, RefusesASessionThatIsNotThere) {
  Conform run({"device", "no_such_session.txtpb"});
  EXPECT_EQ(run.report().status, 2);
  EXPECT_NE(run.err().find("no_such_session.txtpb"), std::string::npos) << run.err();
}

// The libraries of others run in the process of the checks.
TEST(ConformDevice, ADriverThatEndsTheProgramFails) {
  const std::string library = "device.plugin.library=" PALPATE_WRONG_DEVICE;
  for (const auto& [fault, end] :
       {std::pair{"exits", "with status 0"}, std::pair{"crashes", "by signal 6"}}) {
    Conform run({"device", kDefaultSession, "--set", library, "--set",
                 std::string("device.plugin.options=") + fault, "--trust",
                 "--i-understand-this-moves-the-device"});
    run.acknowledge("press Enter");
    const Report report = run.report();
    EXPECT_EQ(report.status, 1) << report.text << run.err();
    EXPECT_THAT(report.text, HasSubstr(end)) << run.err();
    ASSERT_TRUE(report.is_good.contains("program")) << report.text;
    EXPECT_FALSE(report.is_good.at("program"));
  }
}

// A device that stands, with an orientation that is none.
device::Driver driver_of(bool is_simulated) {
  return {.open =
              [is_simulated](const Clock& clock, const device::StartUp&) {
                auto opened = std::make_unique<test::ScriptedDevice>(clock, is_simulated);
                opened->position_m = Vector3::Zero();
                opened->orientation.coeffs() *= 2.0;
                return opened;
              },
          .is_simulated = is_simulated};
}

TEST(ConformDevice, NamesWhatFallsShortWithARemedy) {
  ManualClock clock;
  std::vector<std::string> told;
  const std::vector<ConformFinding> found =
      conform_device(driver_of(true), std::chrono::milliseconds(1), clock,
                     {.on_finding = [&](const ConformFinding& one) { told.push_back(one.check); }});
  ASSERT_EQ(found.size(), told.size());
  const auto reading = std::find_if(
      found.begin(), found.end(), [](const ConformFinding& one) { return one.check == "reading"; });
  ASSERT_NE(reading, found.end());
  EXPECT_TRUE(reading->is_checked);
  EXPECT_FALSE(reading->is_good);
  EXPECT_THAT(reading->text, HasSubstr("norm 2"));
  EXPECT_THAT(reading->remedy, HasSubstr("unit quaternions"));
}

// A transfer that fails tells nothing of signs, axes and gains.
TEST(ConformDevice, BlamesNoMotorsWhereATransferFails) {
  ManualClock clock;
  device::Driver driver = driver_of(false);
  driver.open = [](const Clock& time, const device::StartUp&) {
    auto opened = std::make_unique<test::ScriptedDevice>(time, false);
    opened->position_m = Vector3::Zero();
    opened->before_switch = [device = opened.get(), switches = 0]() mutable {
      device->fails_to_apply = ++switches > 220;  // those of the checks before
    };
    return opened;
  };
  const std::vector<ConformFinding> found = conform_device(
      driver, std::chrono::milliseconds(1), clock,
      {.may_move_hardware = true, .start_up = {.is_acknowledged = [] { return true; }}});
  bool was_seen = false;
  for (const ConformFinding& one : found) {
    if (one.check == "pace") {
      EXPECT_THAT(one.text, testing::Not(HasSubstr("e+")));
    }
    if (one.check != "motors") continue;
    was_seen = true;
    EXPECT_FALSE(one.is_good);
    EXPECT_THAT(one.text, HasSubstr("failed"));
    EXPECT_THAT(one.remedy, AllOf(HasSubstr("cable"), testing::Not(HasSubstr("signs"))));
  }
  EXPECT_TRUE(was_seen);
}

TEST(ConformDevice, NamesACallThatDoesNotReturn) {
  ManualClock clock;
  std::promise<void> hung;
  std::shared_future<void> end = hung.get_future().share();
  device::Driver driver = driver_of(true);
  driver.open = [end](const Clock& time, const device::StartUp&) {
    auto opened = std::make_unique<test::ScriptedDevice>(time, true);
    opened->before_switch = [end] { end.wait(); };
    return opened;
  };
  std::vector<ConformFinding> named;
  const auto found = conform_device(driver, std::chrono::milliseconds(1), clock,
                                    {.on_hang =
                                         [&](const ConformFinding& one) {
                                           named.push_back(one);
                                           hung.set_value();
                                         },
                                     .hang_after = std::chrono::milliseconds(100)});
  ASSERT_EQ(named.size(), 1u) << "once";
  EXPECT_FALSE(named.front().is_good);
  EXPECT_THAT(named.front().text, HasSubstr("has not returned for 0.1 s"));
  EXPECT_THAT(named.front().remedy, HasSubstr("after one transfer"));
  EXPECT_EQ(found.size(), device::device_checks().size()) << "it returned at last";
}

// No push goes so far: what does has little friction, or runs away.
TEST(ConformDevice, EndsWithTheMotorsReleasedWhereTheArmGoesAway) {
  ManualClock clock;
  device::Driver driver = driver_of(false);
  driver.open = [](const Clock& time, const device::StartUp&) {
    auto opened = std::make_unique<test::ScriptedDevice>(time, false);
    opened->position_m = Vector3::Zero();
    opened->before_switch = [device = opened.get()] {
      *device->position_m += Vector3(2e-4, 0.0, 0.0);
    };
    return opened;
  };
  const auto checks = [&] {
    static_cast<void>(conform_device(
        driver, std::chrono::milliseconds(1), clock,
        {.may_move_hardware = true, .start_up = {.is_acknowledged = [] { return true; }}}));
  };
  EXPECT_THAT(checks, testing::ThrowsMessage<std::runtime_error>(
                          AllOf(HasSubstr("the arm is 50 mm from where they began"),
                                HasSubstr("the motors were released"))));
}

TEST(FindApart, PassesAnyTextOn) {
  const ConformFinding odd{
      .check = "a\x1f\x1e", .text = "b\n\"c\" \xff", .remedy = "d\x1f", .is_checked = false};
  std::vector<ConformFinding> found;
  EXPECT_TRUE(find_apart([&](const OnFinding& on_finding, const auto&) { on_finding(odd); },
                         [&](const ConformFinding& one) { found.push_back(one); }));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].check, odd.check);
  EXPECT_EQ(found[0].text, "b\n\"c\" \xEF\xBF\xBD") << "JSON is UTF-8";
  EXPECT_EQ(found[0].remedy, odd.remedy);
  EXPECT_FALSE(found[0].is_checked);
}

TEST(FindApart, ThrowsWhatTheChecksThrow) {
  const auto refuse = [](const OnFinding&, const auto&) { throw SetupError("no\nsuch device"); };
  EXPECT_THAT([&] { static_cast<void>(find_apart(refuse, [](const ConformFinding&) {})); },
              testing::ThrowsMessage<SetupError>("no\nsuch device"));
}

TEST(ConformDevice, MovesHardwareOnlyIfToldTo) {
  ManualClock clock;
  const device::Driver driver = driver_of(false);
  try {
    static_cast<void>(conform_device(driver, std::chrono::milliseconds(1), clock, {}));
    FAIL() << "it moved";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("--i-understand-this-moves-the-device"));
  }
  try {
    static_cast<void>(
        conform_device(driver, std::chrono::milliseconds(1), clock, {.may_move_hardware = true}));
    FAIL() << "it moved";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nobody can acknowledge: Take the hand off the device"));
  }
  int asked = 0;
  const auto found = conform_device(
      driver, std::chrono::milliseconds(1), clock,
      {.may_move_hardware = true, .start_up = {.is_acknowledged = [&] { return ++asked > 10; }}});
  EXPECT_EQ(asked, 11);
  EXPECT_EQ(found.size(), device::device_checks().size());
  const auto motors = std::find_if(found.begin(), found.end(),
                                   [](const ConformFinding& one) { return one.check == "motors"; });
  ASSERT_NE(motors, found.end());
  EXPECT_TRUE(motors->is_checked && !motors->is_good) << "it stands: " << motors->text;
}

}  // namespace
}  // namespace palpate
