// SPDX-License-Identifier: Apache-2.0
// The programs as a user starts them: a touch over four processes, killed nodes, viewers that come
// and go, wrong sessions and flags.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>
#include <sstream>

#include "common/session/session_file.h"
#include "tests/support/machine/places.h"
#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/resting_press.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using test::HeldPort;
using test::Outcome;
using test::Program;
using test::rests_in_tissue;
using test::run_program;
using test::TempFolder;
using test::text_of;
using test::Watcher;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

using Arguments = std::vector<std::string>;

/// The hand at rest in tissue, with a viewer that prints its status often.
const std::string kPress = std::string(test::kRestingPress) + R"(
name: "press"
realtime { priority: 0 cpu: -1 }
viewer { status_interval_ms: 50 }
)";

const std::string kDefault = test::source_dir() + "/deploy/sessions/default.txtpb";

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// Numbers of one column of a table written by --csv, without an incomplete last row.
std::vector<double> column(const std::string& csv, const std::string& name) {
  const auto cells = [](const std::string& line) {
    std::vector<std::string> texts;
    std::istringstream in(line);
    for (std::string text; std::getline(in, text, ',');) texts.push_back(text);
    return texts;
  };
  const std::vector<std::string> lines = lines_of(csv.substr(0, csv.rfind('\n') + 1));
  if (lines.empty()) return {};
  const std::vector<std::string> names = cells(lines.front());
  const auto at =
      static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  std::vector<double> values;
  for (std::size_t i = 1; i < lines.size(); ++i)
    values.push_back(std::stod(cells(lines[i]).at(at)));
  return values;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values.at(values.size() / 2);
}

class Processes : public testing::Test {
 protected:
  Processes() {
    test::adopt_orphans();
    press_ = files_.write("press.txtpb", kPress);
  }

  std::string file(const std::string& name) const { return (files_.path() / name).string(); }

  /// Call it when the programs of the test have ended.
  void expect_nothing_left() const {
    EXPECT_TRUE(test::all_children_end(5s)) << "a process is left";
    std::vector<fs::path> left;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(run_folder_.path())) {
      if (!entry.is_directory()) left.push_back(entry.path());  // nodes started by hand leave it
    }
    EXPECT_THAT(left, testing::IsEmpty());
  }
  void expect_nothing_left_of_a_launch() const {
    expect_nothing_left();
    EXPECT_TRUE(fs::is_empty(run_folder_.path())) << "the session's folder is left";
  }

  /// The process of a node that palpate launch started, the `count`-th time.
  static pid_t node_of(Program& launch, const std::string& node, int count = 1) {
    const std::string pid = launch.await_err("event=node_started node=" + node + " pid=", count);
    return pid.empty() ? 0 : std::stoi(pid);
  }
  /// Waits until the program has printed the text to stdout.
  static bool shows(const Program& program, const std::string& text) {
    return test::await([&] { return program.out().find(text) != std::string::npos; });
  }
  static void kill_node(Program& launch, const std::string& node) {
    const pid_t pid = node_of(launch, node);
    ASSERT_GT(pid, 1);
    kill(pid, SIGKILL);
  }

  /// Waits until the median force in the newest `rows` rows of a viewer's table is the expected one
  /// and as many came before them: a busy machine may interrupt a press. @return the last median
  static double rendered_newton(const std::string& csv, std::size_t rows, double expected_newton,
                                double tolerance_newton) {
    double newton = kNaN;
    std::uintmax_t bytes = 0;
    test::await([&] {
      std::error_code error;
      const std::uintmax_t now_bytes = fs::file_size(csv, error);
      if (error || now_bytes == bytes) return false;
      bytes = now_bytes;
      const std::vector<double> fs_z = column(text_of(csv), "fs_z");
      if (fs_z.size() <= 2 * rows) return false;
      newton = median({fs_z.end() - static_cast<std::ptrdiff_t>(rows), fs_z.end()});
      return std::abs(newton - expected_newton) <= tolerance_newton;
    });
    return newton;
  }

  test::RunFolder run_folder_;
  TempFolder files_;
  std::string press_;
};

// --- one touch ------------------------------------------------------------------------------

// The default session with an inclusion so viscous that the clamp has to act.
TEST_F(Processes, TheDefaultSessionIsRenderedClampedAndSummarised) {
  const test::QuietMachine machine;
  Program launch("palpate", {"launch", kDefault, "--json", file("run.json"), "--no-viewer", "--set",
                             "scene.tissue[1].kelvin_voigt.damping_newton_s_per_m=300"});
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(kDefault), links);
  EXPECT_TRUE(watcher.until([&] {
    return watcher.mirror().mofc_counters().contact_ticks > 0 &&
           watcher.mirror().mofc_counters().clamped_ticks > 0 &&
           watcher.mirror().device_counters().max_force_newton > 0.1 &&
           watcher.mirror().physics_counters().meshes_skipped > 30;
  })) << launch.err();
  launch.send_signal(SIGTERM);

  EXPECT_EQ(launch.wait(), 0) << launch.err();
  const json run = json::parse(text_of(file("run.json")));
  EXPECT_GT(run["in_contact_ticks"], 0);
  EXPECT_GT(run["clamped_ticks"], 0);
  EXPECT_GT(run["answered_ratio"], 0.0);
  if (machine.may_check("most ticks answered")) {
    EXPECT_GT(run["answered_ratio"], 0.5);
  }
  EXPECT_GE(run["min_true_energy_j"], -1e-6);
  EXPECT_GT(run["max_force_n"], 0.1);
  EXPECT_GT(run["meshes_skipped"], 30);  // no viewer is connected: 30 per second
  EXPECT_EQ(run["mesh_frames"], 0);
  for (const char* node : {"physics", "mofc", "device"}) EXPECT_EQ(run["restarts"][node], 0);
  EXPECT_THAT(launch.out(), AllOf(HasSubstr("answered in time"), HasSubstr("clamped")));
  EXPECT_THAT(launch.err(), Not(HasSubstr("rejected")));
  expect_nothing_left_of_a_launch();
}

TEST_F(Processes, LaunchWritesOneRowPerDeviceTick) {
  // at 1 kHz: launch writes a thousand rows at a time
  Program launch("palpate",
                 {"launch", press_, "--json", file("run.json"), "--csv", file("run.csv"),
                  "--no-viewer", "--set", "device.rate_hz=1000", "--set", "device.lease_us=2000"});
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(press_), links);
  std::size_t rows = 0;
  EXPECT_TRUE(watcher.until([&] {
    const std::string csv = text_of(file("run.csv"));
    rows = static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n'));
    // a subscriber misses the beginning
    return rows > 0 && 2 * rows >= watcher.mirror().device_counters().loop.ticks + 100;
  })) << rows
      << " rows of " << watcher.mirror().device_counters().loop.ticks << " ticks";
  launch.send_signal(SIGTERM);
  ASSERT_EQ(launch.wait(), 0) << launch.err();

  const std::vector<double> t_s = column(text_of(file("run.csv")), "t_s");

  EXPECT_TRUE(std::is_sorted(t_s.begin(), t_s.end()));
  const json run = json::parse(text_of(file("run.json")));
  EXPECT_LE(t_s.size(), run["ticks"].get<std::size_t>());
  EXPECT_GE(t_s.size() + 1, rows);  // with the header
}

// Two springs in series, hand 400 N/m and tissue k: 5 mm · 400·k / (400 + k). 800 N/m gives
// 1.333 N, and the stiction's 0.1 N moves that by 0.1 N · 800 / 1200 at most.
TEST_F(Processes, TheStiffnessInTheSessionOfPhysicsAloneChangesTheRenderedForce) {
  const auto expect_rendered = [&](const std::string& name, double newton, double tolerance_newton,
                                   const Arguments& physics_settings) {
    const std::string csv = file(name);
    Arguments physics_arguments{"--session", press_};
    physics_arguments.insert(physics_arguments.end(), physics_settings.begin(),
                             physics_settings.end());
    Program physics("physics_node", physics_arguments);
    Program mofc("mofc_node", {"--session", press_});
    Program device("device_node", {"--session", press_});
    Program viewer("viewer_node", {"--session", press_, "--csv", csv, "--quiet"});

    // at rest: oscillations have decayed after 1 s, 200 rows (2 m / b = 0.06 s)
    EXPECT_NEAR(rendered_newton(csv, 200, newton, tolerance_newton), newton, tolerance_newton);

    for (Program* node : {&viewer, &device, &mofc, &physics}) {
      node->send_signal(SIGTERM);
      EXPECT_EQ(node->wait(), 0) << node->err();
    }
  };

  expect_rendered("soft.csv", test::kRestingNewton, test::kStictionNewton + 0.01, {});
  expect_rendered("stiff.csv", 4.0 / 3.0, 0.1 * 800.0 / 1200.0 + 0.01,
                  {"--set", "scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=800"});
  expect_nothing_left();
}

// --- nodes that die -------------------------------------------------------------------------

class NodeUnderLaunch : public Processes {
 protected:
  NodeUnderLaunch()
      : links_({.priority = 0, .cpu = -1}),
        watcher_(load_session(press_), links_),
        launch_("palpate", {"launch", press_, "--no-viewer", "--json", file("run.json")}) {}

  void SetUp() override {
    ASSERT_TRUE(watcher_.until([&] { return rests_in_tissue(watcher_); }));
  }

  /// Ends the launch.
  json summary() {
    launch_.send_signal(SIGTERM);
    EXPECT_EQ(launch_.wait(), 0) << launch_.err();
    expect_nothing_left_of_a_launch();
    return json::parse(text_of(file("run.json")));
  }

  ProcessLinks links_;
  Watcher watcher_;
  Program launch_;
};

TEST_F(NodeUnderLaunch, KilledPhysicsIsReportedAndRestartedAndTheForceReturns) {
  kill_node(launch_, "physics");

  launch_.await_err("event=node_died node=physics how=\"killed by signal 9 (Killed)\"");
  EXPECT_GT(node_of(launch_, "physics", 2), 1);
  EXPECT_TRUE(watcher_.until([&] { return watcher_.mirror().physics_link().sessions == 2; }));
  const std::uint64_t steps = watcher_.mirror().physics_counters().contact_steps;
  EXPECT_TRUE(watcher_.until([&] {
    return watcher_.mirror().physics_counters().contact_steps > steps + 200 &&
           rests_in_tissue(watcher_);
  }));
  const json run = summary();
  EXPECT_EQ(run["restarts"], json({{"physics", 1}, {"mofc", 0}, {"device", 0}}));
}

TEST_F(NodeUnderLaunch, AKilledDeviceComesBackLimp) {
  const test::QuietMachine machine;
  const DeviceConfig device = load_session(press_).side().device;
  const double ramp_s = to_seconds(device.start_ramp);
  ASSERT_GT(ramp_s, 0.0);
  const double peak_newton = 3.3;

  // again if its beginning, when it is limp, was not seen
  int kills = 0;
  int in_ramp = 0;
  while (in_ramp == 0 && kills < 10) {
    const std::uint64_t killed_session = watcher_.rows().back().device_session_id;
    const auto is_new = [&](const TickRow& row) { return row.device_session_id != killed_session; };
    const auto before = static_cast<std::ptrdiff_t>(watcher_.rows().size());
    const pid_t pid = node_of(launch_, "device", ++kills);
    ASSERT_GT(pid, 1);
    kill(pid, SIGKILL);
    launch_.await_err("event=node_died node=device", kills);
    ASSERT_TRUE(watcher_.until(
        [&] { return is_new(watcher_.rows().back()) && rests_in_tissue(watcher_); }));

    const auto end = watcher_.rows().end();
    auto row = std::find_if(watcher_.rows().begin() + before, end, is_new);
    // an answer withdrawn for a late switch is limp, too, but continues its ramp
    const DeviceCounters& counters = watcher_.mirror().device_counters();
    if (row->device.sequence >= 60 || counters.late_switches > 0 ||
        counters.loop.skipped_ticks > 0) {
      continue;
    }
    // the start ramp of the session: 0 at first, at most the elapsed share of the ramp later; a
    // viewer may miss the first ticks
    const Duration missed =
        from_seconds(static_cast<double>(row->device.sequence) / device.rate_hz);
    TimePoint ramp_from = row->device.sampled_at - missed;
    TimePoint answered_at = row->device.sampled_at;
    for (; row != end; ++row) {
      const DeviceTick& tick = row->device;
      if (tick.guard == GuardState::kLimp && in_ramp == 0) {
        EXPECT_EQ(tick.force_on_hand_newton, Vector3::Zero().eval());
        ramp_from = answered_at = tick.sampled_at;
        continue;
      }
      // an answer after the lease has ended begins a shorter ramp
      if (tick.switched_at - answered_at > device.lease) break;
      const double share = to_seconds(tick.switched_at - ramp_from) / ramp_s;
      if (share >= 1.0) break;
      EXPECT_LE(tick.force_on_hand_newton.norm(), peak_newton * share + 1e-9);
      ++in_ramp;
      if (tick.is_answered) answered_at = tick.switched_at;
    }
  }
  EXPECT_TRUE(in_ramp > 0 || !machine.may_check("a restarted device begins limp"));
  EXPECT_EQ(summary()["restarts"], json({{"physics", 0}, {"mofc", 0}, {"device", kills}}));
}

TEST_F(NodeUnderLaunch, WhenMofcIsKilledTheDeviceFallsBackAndThenRecovers) {
  const test::QuietMachine machine;
  const DeviceCounters before = watcher_.mirror().device_counters();
  kill_node(launch_, "mofc");

  launch_.await_err("event=node_died node=mofc");
  EXPECT_TRUE(watcher_.until(
      [&] { return watcher_.mirror().mofc_link().sessions == 2 && rests_in_tissue(watcher_); }));
  const DeviceCounters& after = watcher_.mirror().device_counters();
  EXPECT_GT(after.fallback_ticks + after.limp_ticks, before.fallback_ticks + before.limp_ticks);
  if (machine.may_check("a tick between the lease and limp")) {
    EXPECT_GT(after.fallback_ticks, before.fallback_ticks);
  }
  const double coulomb_newton = load_session(press_).side().device.profile.coulomb_newton;
  for (const TickRow& row : watcher_.rows()) {
    const double force_newton = row.device.force_on_hand_newton.norm();
    if (row.device.guard == GuardState::kLimp) {
      EXPECT_EQ(force_newton, 0.0);
    } else if (row.device.guard == GuardState::kFallback) {
      EXPECT_LE(force_newton, coulomb_newton + 1e-9);
    }
  }
  launch_.await_err("event=fallback_began");
  EXPECT_EQ(summary()["restarts"], json({{"physics", 0}, {"mofc", 1}, {"device", 0}}));
}

TEST_F(NodeUnderLaunch, ANodeThatWasSuspendedContinuesWithoutARestart) {
  const pid_t mofc = node_of(launch_, "mofc");
  ASSERT_GT(mofc, 1);
  const std::uint64_t limp_ticks = watcher_.mirror().device_counters().limp_ticks;

  kill(mofc, SIGSTOP);
  EXPECT_TRUE(watcher_.until(
      [&] { return watcher_.mirror().device_counters().limp_ticks > limp_ticks + 60; }));
  kill(mofc, SIGCONT);

  EXPECT_TRUE(watcher_.until([&] { return rests_in_tissue(watcher_); }));
  EXPECT_EQ(summary()["restarts"], json({{"physics", 0}, {"mofc", 0}, {"device", 0}}));
}

// --- the end --------------------------------------------------------------------------------

TEST_F(Processes, CtrlCStopsAllInOrderAndTheSummaryIsPrinted) {
  const test::QuietMachine machine;
  Program launch("palpate", {"launch", kDefault, "--csv", file("run.csv")});
  for (const char* peer : {"force_command", "device_state", "interaction", "tool_motion"}) {
    launch.await_err(std::string("event=peer_up link=") + peer);
  }
  launch.await_err("event=web url=");
  // launch itself has received telemetry
  ASSERT_TRUE(test::await([&] { return lines_of(text_of(file("run.csv"))).size() > 1; }));

  launch.send_signal(SIGINT);

  EXPECT_EQ(launch.wait(), 0) << launch.err();
  const std::string log = launch.err();
  std::vector<std::size_t> ends;
  for (const std::string node : {"device", "mofc", "physics", "viewer"}) {
    // launch gives each 2 s
    const std::size_t killed_at = log.find("event=node_killed node=" + node);
    const bool may_be_killed =
        killed_at != std::string::npos && !machine.may_check(node + " ends in time");
    ends.push_back(may_be_killed
                       ? killed_at
                       : log.find("event=node_stopped node=" + node + " how=\"exit status 0\""));
    EXPECT_NE(ends.back(), std::string::npos) << log;
  }
  EXPECT_TRUE(std::is_sorted(ends.begin(), ends.end())) << log;
  EXPECT_THAT(launch.out(), HasSubstr("answered in time"));
  expect_nothing_left_of_a_launch();
}

TEST_F(Processes, AKilledLaunchLeavesNoOrphan) {
  Program launch("palpate", {"launch", kDefault});
  launch.await_err("event=peer_up link=interaction");

  launch.send_signal(SIGKILL);

  EXPECT_EQ(launch.wait(), 128 + SIGKILL);
  EXPECT_TRUE(test::all_children_end(5s)) << "a node is left";
}

TEST_F(Processes, ALaunchAfterAKilledOneStartsAsUsual) {
  {
    Program launch("palpate", {"launch", kDefault, "--no-viewer"});
    launch.await_err("event=peer_up link=interaction");
    launch.send_signal(SIGKILL);
    launch.wait();
    ASSERT_TRUE(test::all_children_end(5s));
  }

  Program again("palpate", {"launch", kDefault, "--no-viewer"});
  again.await_err("event=peer_up link=interaction");
  again.send_signal(SIGTERM);

  EXPECT_EQ(again.wait(), 0) << again.err();
  expect_nothing_left_of_a_launch();
}

TEST_F(Processes, ANormalRunLogsNoWarning) {
  const test::QuietMachine machine;
  const Outcome launch =
      run_program("palpate", {"launch", kDefault, "--seconds", "1", "--no-viewer", "--set",
                              "realtime={ priority: 0 cpu: -1 }"});

  ASSERT_EQ(launch.status, 0) << launch.err;
  for (const std::string& line : lines_of(launch.err)) {
    // a busy machine really skips ticks, and a virtual one may be stopped within a switch however
    // quiet it is: warnings about that, and its consequences, are correct
    const bool is_load = line.find("event=switch_late") != std::string::npos ||
                         line.find("event=ticks_skipped") != std::string::npos ||
                         line.find("event=fallback_") != std::string::npos ||
                         line.find("event=interaction_stale_") != std::string::npos ||
                         line.find("event=motions_dropped") != std::string::npos;
    if (is_load || line.find(" info ") != std::string::npos) continue;
    const bool may_be_load = line.find("event=node_killed") != std::string::npos;
    EXPECT_TRUE(may_be_load && !machine.may_check(line)) << line;
  }
}

// --- viewers --------------------------------------------------------------------------------

TEST_F(Processes, ViewersMayComeLateAndLeaveEarly) {
  Program launch("palpate", {"launch", press_, "--no-viewer", "--json", file("run.json")});
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(press_), links);
  ASSERT_TRUE(watcher.until([&] { return rests_in_tissue(watcher); }));

  // two at once: one is ended, one is killed; then a third one comes
  Program leaves("viewer_node", {"--session", press_, "--csv", file("leaves.csv")});
  Program dies("viewer_node", {"--session", press_, "--csv", file("dies.csv"), "--quiet"});
  const auto sees = [&](const std::string& csv) {
    return watcher.until([&] { return lines_of(text_of(file(csv))).size() > 50; });
  };
  EXPECT_TRUE(sees("leaves.csv"));
  EXPECT_TRUE(sees("dies.csv"));
  EXPECT_TRUE(shows(leaves, " Hz  "));
  leaves.send_signal(SIGINT);
  EXPECT_EQ(leaves.wait(), 0) << leaves.err();
  dies.send_signal(SIGKILL);
  dies.wait();
  Program last("viewer_node", {"--session", press_, "--csv", file("last.csv")});
  const double tolerance_newton = test::kStictionNewton + 0.01;
  EXPECT_NEAR(rendered_newton(file("last.csv"), 100, test::kRestingNewton, tolerance_newton),
              test::kRestingNewton, tolerance_newton);
  EXPECT_TRUE(shows(last, "contact"));
  last.send_signal(SIGINT);
  EXPECT_EQ(last.wait(), 0) << last.err();

  ASSERT_TRUE(watcher.until_rows(100));
  EXPECT_TRUE(watcher.until([&] { return rests_in_tissue(watcher); }));
  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 0);
  EXPECT_EQ(json::parse(text_of(file("run.json")))["restarts"],
            json({{"physics", 0}, {"mofc", 0}, {"device", 0}}));
}

TEST_F(Processes, AViewerWithoutNodesReportsThatAndEndsInTime) {
  Program viewer("viewer_node", {"--session", press_});
  EXPECT_TRUE(shows(viewer, "device: not heard yet"));
  viewer.send_signal(SIGTERM);
  EXPECT_EQ(viewer.wait(), 0) << viewer.err();
  // its time may be over before its first status
  const Outcome timed = run_program("viewer_node", {"--session", press_, "--seconds", "0.3"});
  EXPECT_EQ(timed.status, 0) << timed.err;
  expect_nothing_left();
}

// --- wrong set-ups ------------------------------------------------------------------------

/// Every command that reads a session.
std::vector<Arguments> commands(const std::string& session) {
  return {{"palpate", "launch", session},         {"palpate", "loopback", session},
          {"palpate", "scene", "check", session}, {"device_node", "--session", session},
          {"mofc_node", "--session", session},    {"physics_node", "--session", session},
          {"viewer_node", "--session", session}};
}

Outcome run(const Arguments& command) {
  return run_program(command.front(), Arguments(command.begin() + 1, command.end()));
}

class WrongSetUp : public Processes {
 protected:
  /// The command ends with status 2 and the message, before it has started anything.
  void expect_refused(const Arguments& command, const std::string& message) const {
    const Outcome refused = run(command);
    SCOPED_TRACE(testing::PrintToString(command));
    EXPECT_EQ(refused.status, 2);
    EXPECT_THAT(refused.err, HasSubstr(message));
    EXPECT_THAT(refused.err, Not(HasSubstr("event=node_started")));
    EXPECT_EQ(refused.out, "");
  }
  void expect_refused_by_all(const std::string& session, const std::string& message) const {
    for (const Arguments& command : commands(session)) expect_refused(command, message);
    expect_nothing_left();
  }
};

TEST_F(WrongSetUp, ATypoInAFieldNameIsReportedWithItsPlaceAndARemedy) {
  const std::string session =
      files_.write("typo.txtpb", "name: \"typo\"\nhand { stifness_newton_per_m: 400 }\n");

  expect_refused_by_all(session, session +
                                     ":2:8: hand.stifness_newton_per_m: no such field; did "
                                     "you mean 'stiffness_newton_per_m'?");
}

TEST_F(WrongSetUp, NanIsRefused) {
  const std::string session =
      files_.write("nan.txtpb", "name: \"nan\"\ndevice { simulated { mass_kg: nan } }\n");

  expect_refused_by_all(session,
                        session + ":2:22: device.simulated.mass_kg = nan: must be a finite number");
}

TEST_F(WrongSetUp, ANegativeMassIsRefused) {
  const std::string session =
      files_.write("mass.txtpb", "name: \"mass\"\ndevice { simulated { mass_kg: -1 } }\n");

  expect_refused_by_all(session, session +
                                     ":2:22: device.simulated.mass_kg = -1: must be > 0; give the "
                                     "mass of the moving parts in kg");
}

TEST_F(WrongSetUp, AMissingFileIsRefused) {
  expect_refused_by_all(file("none.txtpb"), file("none.txtpb") + ": no such file; check the path");
}

TEST_F(WrongSetUp, AllProblemsOfASessionAreReportedAtOnce) {
  const std::string session = files_.write(
      "two.txtpb", "name: \"two\"\ndevice { simulated { mass_kg: -1 } }\nphysics { rate_hz: 0 }\n");

  const Outcome refused = run({"palpate", "scene", "check", session});

  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("2 problems"), HasSubstr(":2:22: "), HasSubstr(":3:")));
}

TEST_F(WrongSetUp, ARunningSessionIsNotLaunchedAgain) {
  Program first("palpate", {"launch", press_, "--no-viewer", "--json", file("run.json")});
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(press_), links);
  ASSERT_TRUE(watcher.until([&] { return rests_in_tissue(watcher); }));

  expect_refused({"palpate", "launch", press_}, "session \"press\" is already launched; stop that");
  for (const char* node : {"device", "mofc", "physics"}) {
    expect_refused({std::string(node) + "_node", "--session", press_}, ": in use by process ");
  }

  const std::uint64_t answered = watcher.mirror().device_counters().answered_ticks;
  EXPECT_TRUE(watcher.until(
      [&] { return watcher.mirror().device_counters().answered_ticks > answered + 40; }));
  first.send_signal(SIGTERM);
  EXPECT_EQ(first.wait(), 0);
  EXPECT_EQ(json::parse(text_of(file("run.json")))["restarts"],
            json({{"physics", 0}, {"mofc", 0}, {"device", 0}}));
  expect_nothing_left();
}

TEST_F(WrongSetUp, APortInUseEndsTheLaunchAndIsNamed) {
  const HeldPort taken;
  const std::string setting = "links.mofc_telemetry=" + taken.endpoint();
  const std::string message = "links.mofc_telemetry = " + taken.endpoint() +
                              ": in use by another process; stop it or give "
                              "links.mofc_telemetry another endpoint";

  expect_refused({"mofc_node", "--session", press_, "--set", setting}, message);
  const Outcome launch = run({"palpate", "launch", press_, "--no-viewer", "--set", setting});

  EXPECT_EQ(launch.status, 2);
  EXPECT_THAT(launch.err, AllOf(HasSubstr(message), HasSubstr("event=node_refused node=mofc")));
  expect_nothing_left();
}

TEST_F(WrongSetUp, AWrongOverrideIsRefused) {
  for (Arguments command : commands(press_)) {
    command.insert(command.end(), {"--set", "mofc.controler=none"});
    expect_refused(command,
                   "--set mofc.controler=none: mofc.controler: no such field; did you "
                   "mean 'mofc.controller'?");
  }
  expect_nothing_left();
}

TEST_F(WrongSetUp, AnUnknownFlagIsRefused) {
  for (Arguments command : commands(press_)) {
    command.emplace_back("--no-such-flag");
    expect_refused(command, "--no-such-flag");
  }
}

TEST_F(WrongSetUp, UnknownNodesAndConflictingOptionsAreRefused) {
  const auto launch = [&](const Arguments& more) {
    Arguments command{"palpate", "launch", press_};
    command.insert(command.end(), more.begin(), more.end());
    return command;
  };
  expect_refused(launch({"--nodes", "device,moffc"}),
                 "--nodes: moffc not in {device,mofc,physics,standby,viewer}");
  expect_refused(launch({"--nodes"}), "--nodes");
  expect_refused(launch({"--nodes", ""}), "--nodes");
  expect_refused(launch({"--nodes", "device", "--together", "device,mofc"}),
                 "--together device,mofc: both must be among --nodes");
  expect_refused(launch({"--nodes", "physics", "--no-viewer"}), "--nodes excludes --no-viewer");
  expect_nothing_left();
}

TEST_F(WrongSetUp, ATimeThatIsNotPositiveIsRefused) {
  for (const char* seconds : {"-1", "0", "nan", "soon"}) {
    for (const Arguments& command : {Arguments{"palpate", "launch", press_, "--no-viewer"},
                                     Arguments{"palpate", "loopback", press_},
                                     Arguments{"viewer_node", "--session", press_}}) {
      Arguments timed = command;
      timed.insert(timed.end(), {"--seconds", seconds});
      expect_refused(timed, std::string("--seconds: \"") + seconds + "\": give a time in s");
    }
  }
}

TEST_F(WrongSetUp, NoCommandIsRefused) {
  expect_refused({"palpate"}, "--help");
  expect_refused({"palpate", "lunch", press_}, "--help");
  expect_refused({"palpate", "launch"}, "SESSION is required");
  expect_refused({"device_node"}, "--session is required");
}

// Otherwise the figures of the run would be lost.
TEST_F(WrongSetUp, ATableOrSummaryThatCannotBeWrittenIsReportedBeforeTheRun) {
  for (const char* option : {"--csv", "--json"}) {
    for (const char* command : {"launch", "loopback"}) {
      expect_refused({"palpate", command, press_, "--seconds", "3600", option, "/nonexistent/x"},
                     "/nonexistent/x: No such file or directory: give a path in a folder that "
                     "exists and is writable");
    }
  }
  expect_refused({"viewer_node", "--session", press_, "--csv", "/nonexistent/x"},
                 "/nonexistent/x: No such file or directory");
  expect_nothing_left();
}

// --- lockstep from the command line ---------------------------------------------------------

TEST_F(Processes, LoopbackWritesTheDocumentedTable) {
  const Outcome loopback =
      run_program("palpate", {"loopback", kDefault, "--seconds", "0.5", "--csv", file("run.csv")});

  ASSERT_EQ(loopback.status, 0) << loopback.err;
  EXPECT_EQ(loopback.err, "palpate: " + file("run.csv") + ": written\n");
  const std::vector<std::string> lines = lines_of(text_of(file("run.csv")));
  ASSERT_EQ(lines.size(), 501u);
  EXPECT_EQ(lines.front(),
            "t_s,x_m,y_m,z_m,xm_m,ym_m,zm_m,fe_x,fe_y,fe_z,fs_x,fs_y,fs_z,fi_x,fi_y,fi_z,"
            "f_max_x,f_max_y,f_max_z,energy_j,true_energy_j,force_age_s,"
            "in_contact,clamped,fallback,peak_limited,"
            "judged_s,transparency_s,along_n2s,ideal_n2s,error_n2s,error_ns,beyond_jnd_s,grip");
  for (const std::string& line : lines) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 33);
  }
}

TEST_F(Processes, LoopbackWritesTheDocumentedFigures) {
  const Outcome loopback =
      run_program("palpate", {"loopback", kDefault, "--seconds", "1", "--json", file("run.json")});

  ASSERT_EQ(loopback.status, 0) << loopback.err;
  const json run = json::parse(text_of(file("run.json")));
  for (const char* key :
       {"schema_version", "ticks", "in_contact_ticks", "transparency", "gain",
        "force_error_rms_ratio", "min_true_energy_j", "max_force_n", "velocity_reversals",
        "clamp_ratio", "fallbacks", "wall_s", "ticks_per_wall_s"}) {
    EXPECT_TRUE(run.contains(key)) << key;
  }
  for (const char* key : {"x", "y", "z", "vector"}) {
    EXPECT_TRUE(run["transparency"].contains(key)) << key;
  }
  for (const char* key : {"x", "y", "z", "ideal", "excess"}) {
    EXPECT_TRUE(run["velocity_reversals"].contains(key)) << key;
  }
  EXPECT_EQ(run["ticks"], 1000);
  EXPECT_GT(run["in_contact_ticks"], 0);
  EXPECT_GE(run["min_true_energy_j"], -1e-6);
}

TEST_F(Processes, ASummaryOnStandardOutputIsTheOnlyOutput) {
  const Outcome loopback =
      run_program("palpate", {"loopback", kDefault, "--seconds", "0.1", "--json", "-"});
  EXPECT_EQ(json::parse(loopback.out)["ticks"], 100);

  Program launch("palpate", {"launch", press_, "--json", "-"});
  ProcessLinks links({.priority = 0, .cpu = -1});
  Watcher watcher(load_session(press_), links);
  EXPECT_TRUE(watcher.until_rows(200)) << launch.err();
  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 0) << launch.err();
  EXPECT_GT(json::parse(launch.out())["ticks"], 20);
}

TEST_F(Processes, LoopbackGivesTheSameBytesForTheSameSeed) {
  const auto csv_of = [&](const Arguments& more) {
    Arguments arguments{"loopback",    kDefault, "--seconds",
                        "2",           "--csv",  file("run.csv"),
                        "--overwrite", "--set",  "faults.interaction.loss_ratio=0.2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome loopback = run_program("palpate", arguments);
    EXPECT_EQ(loopback.status, 0) << loopback.err;
    return text_of(file("run.csv"));
  };
  const std::string first = csv_of({});

  EXPECT_GT(first.size(), 100'000u);
  EXPECT_TRUE(csv_of({}) == first) << "a second run differs";
  EXPECT_TRUE(csv_of({"--inproc"}) == first) << "over inproc it differs";
  EXPECT_FALSE(csv_of({"--set", "seed=2"}) == first) << "another seed gave the same run";
}

TEST_F(Processes, SceneCheckTellsWhatAGripperTakes) {
  const std::string retract = test::source_dir() + "/deploy/sessions/retract.txtpb";
  const Outcome good = run_program("palpate", {"scene", "check", "-q", retract});
  EXPECT_EQ(good.status, 0) << good.err;
  EXPECT_THAT(good.out, HasSubstr("  gripper: takes "));
  EXPECT_THAT(good.err, Not(HasSubstr("gripper")));
  const Outcome narrow = run_program(
      "palpate", {"scene", "check", "-q", retract, "--set", "scene.tool.gripper.reach_m=0.00601"});
  EXPECT_EQ(narrow.status, 0) << narrow.err;
  EXPECT_THAT(narrow.err, HasSubstr("the gripper takes nothing at "));
}

TEST_F(Processes, SceneCheckTellsWhatOrgansTouchAndHowTheyTear) {
  const std::string tools = test::source_dir() + "/deploy/sessions/tools/";
  const Outcome ribs =
      run_program("palpate", {"scene", "check", "-q", tools + "against_rib.txtpb"});
  EXPECT_EQ(ribs.status, 0) << ribs.err;
  EXPECT_THAT(ribs.out, HasSubstr(", which does not give way, friction coefficient "));
  const std::string bed = tools + "gallbladder.txtpb";
  const Outcome good = run_program("palpate", {"scene", "check", "-q", bed});
  EXPECT_THAT(good.err, Not(HasSubstr("elastic.attached")));
  const Outcome stiff =
      run_program("palpate", {"scene", "check", "-q", bed, "--set",
                              "scene.tissue[0].elastic.attached[0].stiffness_pa_per_m=1e7"});
  EXPECT_EQ(stiff.status, 0) << stiff.err;
  EXPECT_THAT(stiff.err, HasSubstr("elastic.attached[0] does not keep its toughness"));
}

TEST_F(Processes, SceneCheckPrintsWhatASessionContains) {
  const Outcome check = run_program("palpate", {"scene", "check", kDefault});

  EXPECT_EQ(check.status, 0) << check.err;
  EXPECT_THAT(check.out, AllOf(HasSubstr("ok"), HasSubstr("2 tissues"), HasSubstr("1000 Hz")));
}

}  // namespace
}  // namespace palpate
