// SPDX-License-Identifier: Apache-2.0
// The guarantee in real processes, in mode guard: nodes are killed or suspended while the hand
// presses, a device fails, and flight recordings are written.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <optional>

#include "common/session/session_file.h"
#include "tests/support/machine/machine.h"
#include "tests/support/pressing_hand.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using test::kLeftNewton;
using test::kRoundingJoule;
using test::newton;
using test::presses;
using test::Program;
using test::TempFolder;
using test::Watcher;

const std::string kPressing = std::string(test::kPressingHand) + R"(
name: "guarantee"
mofc { mode: guard velocity_estimator { difference { time_constant_ms: 5 } } }
)";

class PressingHand : public testing::Test {
 protected:
  PressingHand() {
    files_.write("hand.csv", test::kPressingPath);
    file_ = files_.write("guarantee.txtpb", kPressing);
    session_ = load_session(file_);
  }

  void SetUp() override { start(); }

  void start() {
    device_.reset();
    mofc_.reset();
    physics_.reset();
    watcher_.emplace(session_, links_);
    physics_.emplace("physics_node", std::vector<std::string>{"--session", file_});
    mofc_.emplace("mofc_node", std::vector<std::string>{"--session", file_});
    // the path of the hand begins with the device, so the other nodes start first
    ASSERT_TRUE(watcher_->until([&] {
      return watcher_->mirror().mofc_link().is_heard() &&
             watcher_->mirror().physics_link().is_heard();
    }));
    device_.emplace("device_node", std::vector<std::string>{"--session", file_});
    if (watcher_->until([&] { return is_far_enough(); })) return;
    // without real-time priority other programs may interrupt every press
    if (!machine_.may_check("a press")) GTEST_SKIP() << "the hand never pressed";
    FAIL() << device_->err();
  }
  /// State at which a test begins.
  virtual bool is_far_enough() const { return presses(watcher_->rows()); }

  /// Sends the signal and waits for its effect.
  /// @return a time after the effect
  TimePoint stop_with(Program& program, int signal) {
    program.send_signal(signal);
    siginfo_t info{};
    waitid(P_PID, static_cast<id_t>(program.pid()), &info, WEXITED | WSTOPPED | WNOWAIT);
    EXPECT_EQ(info.si_code, signal == SIGKILL ? CLD_KILLED : CLD_STOPPED);
    return clock_.now();
  }

  /// Does the fault. Repeats that in new processes if a busy machine had interrupted the force
  /// before.
  /// @param do_fault  returns the force at its effect
  template <class DoFault>
  void fault_under_force(DoFault do_fault) {
    constexpr int kMostAttempts = 5;
    double force_newton = do_fault();
    for (int attempt = 1; attempt < kMostAttempts && !HasFailure(); ++attempt) {
      if (force_newton > kLeftNewton) return;
      ASSERT_NO_FATAL_FAILURE(start());
      if (IsSkipped()) return;
      force_newton = do_fault();
    }
    if (machine_.may_check("the fault under force")) {
      EXPECT_GT(force_newton, kLeftNewton);
    }
  }

  /// Waits until the force has been 0 for 100 ticks in a row.
  bool until_limp() {
    return watcher_->until([&] {
      const auto& rows = watcher_->rows();
      return rows.size() > 100 && std::all_of(rows.end() - 100, rows.end(),
                                              [](const auto& r) { return newton(r) == 0; });
    });
  }
  void expect_passive() const {
    ASSERT_FALSE(watcher_->rows().empty());
    EXPECT_GE(watcher_->rows().back().device.minimum_true_energy_joule, -kRoundingJoule);
  }

  test::RunFolder run_folder_;
  TempFolder files_;
  std::string file_;
  Session session_;
  SteadyClock clock_;  // one host: the same as the nodes'
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<Watcher> watcher_;
  std::optional<Program> physics_;
  std::optional<Program> mofc_;
  std::optional<Program> device_;
  test::QuietMachine machine_;
};

// --- physics --------------------------------------------------------------------------------

TEST_F(PressingHand, WhenPhysicsIsKilledTheForceNeverRisesAndIsGoneAfterTheFade) {
  TimePoint killed_at;
  double limit_newton = 0.0;
  std::vector<TickRow>::const_iterator declared;
  fault_under_force([&] {
    killed_at = stop_with(*physics_, SIGKILL);
    EXPECT_TRUE(until_limp());
    // silence is declared in the row after the last one with an answer of physics
    const auto& rows = watcher_->rows();
    declared = std::find_if(rows.rbegin(), rows.rend(), test::hears_physics).base();
    if (declared == rows.begin()) return 0.0;
    const TickRow& last_fresh = *(declared - 1);
    limit_newton =
        std::max(newton(last_fresh), last_fresh.mofc->commanded_force_on_hand_newton.norm());
    return limit_newton;
  });
  const auto& rows = watcher_->rows();
  ASSERT_TRUE(!HasFailure() && declared != rows.end());

  // mofc may take the last Interaction in its first turn after the kill
  const auto turn = std::find_if(rows.begin(), rows.end(), [&](const TickRow& row) {
    return row.device.is_answered && row.device.sampled_at >= killed_at;
  });
  ASSERT_NE(turn, rows.end());
  const TimePoint gone_at =
      turn->device.switched_at + test::kLossNoticed + session_.side().mofc.fade;
  int faded = 0;
  for (auto row = declared; row != rows.end(); ++row) {
    EXPECT_LE(newton(*row), limit_newton + 1e-9) << "sequence " << row->device.sequence;
    if (row->mofc && row->mofc->state == MofcState::kFading) ++faded;
    if (row->device.is_answered && row->device.sampled_at > gone_at) {
      if (newton(*row) == 0.0 || !machine_.may_check("the loss is noticed in time")) continue;
      ADD_FAILURE() << "sequence " << row->device.sequence << ": " << newton(*row) << " N";
    }
  }
  // more than a fifth of the ticks of the fade, of which a busy machine may skip some
  const auto fade_end = std::find_if(declared, rows.end(), [&](const TickRow& row) {
    return row.device.sampled_at >= declared->device.sampled_at + session_.side().mofc.fade;
  });
  if (machine_.may_check("most ticks of the fade")) {
    EXPECT_GT(5 * faded, fade_end - declared);
  }
  expect_passive();
}

// --- mofc -----------------------------------------------------------------------------------

class WithoutMofc : public PressingHand, public testing::WithParamInterface<int> {};

TEST_P(WithoutMofc, TheDeviceIsHarmlessWhenTheLeaseEndsAndThenLimp) {
  TimePoint stopped_at;
  std::vector<TickRow>::const_iterator after;
  fault_under_force([&] {
    stopped_at = stop_with(*mofc_, GetParam());
    EXPECT_TRUE(until_limp());
    const auto& rows = watcher_->rows();
    after = std::find_if(rows.rbegin(), rows.rend(), [](const TickRow& row) {
              return row.device.is_answered;
            }).base();
    return after == rows.begin() ? 0.0 : newton(*(after - 1));
  });
  const auto& rows = watcher_->rows();
  ASSERT_TRUE(!HasFailure() && after != rows.end());
  const DeviceTick& last = (after - 1)->device;
  EXPECT_LE(last.sampled_at, stopped_at);

  const DeviceConfig& config = session_.side().device;
  EXPECT_LE(config.longest_lease, 10ms);
  int leased = 0;
  int fallback = 0;
  for (auto row = after; row != rows.end(); ++row) {
    const Duration silence = row->device.switched_at - last.switched_at;
    if (silence < config.longest_lease) {
      ++leased;
      continue;
    }
    EXPECT_LE(newton(*row), config.profile.coulomb_newton + 1e-9)
        << to_seconds(silence) << " s after the last answer";
    if (newton(*row) > 0.0) ++fallback;
    if (silence >= config.limp_after + config.fade) {
      EXPECT_EQ(newton(*row), 0.0);
      EXPECT_EQ(row->device.guard, GuardState::kLimp);
    }
  }
  EXPECT_LE(leased, 11);
  if (machine_.may_check("ticks of the fallback")) {
    EXPECT_GT(fallback, 10);
  }
  expect_passive();

  if (GetParam() == SIGSTOP) {
    mofc_->send_signal(SIGCONT);
    EXPECT_TRUE(watcher_->until([&] { return presses(watcher_->rows()); }));
    expect_passive();
  }
}

INSTANTIATE_TEST_SUITE_P(Signals, WithoutMofc, testing::Values(SIGKILL, SIGSTOP),
                         [](const auto& signal) {
                           return std::string(signal.param == SIGKILL ? "Killed" : "Stopped");
                         });

// rogue_mofc_node pushes with 20 N along every motion of a hand on a spring of 400 N/m, in
// mofc_node's place: without the monitor 3.3 N at up to 0.5 m/s.
class LyingClamp : public testing::TestWithParam<bool> {};

TEST_P(LyingClamp, GivesEnergyOnlyWithoutTheMonitor) {
  const bool is_monitored = GetParam();
  const test::QuietMachine machine;
  const test::RunFolder run_folder;
  TempFolder files;
  files.write("hand.csv", "t,x,y,z\n0,0,0,0\n0.1,0.01,0,0\n0.2,0,0,0\n");
  const std::string file = files.write("rogue.txtpb", R"(
name: "rogue"
realtime { priority: 0 cpu: -1 }
device { simulated {} }
hand { mass_kg: 0.255 stiffness_newton_per_m: 400 damping_newton_s_per_m: 6 recorded { file: "hand.csv" loop: true } }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } } }
)");
  const Session session = load_session(file);
  ProcessLinks links{{.priority = 0, .cpu = -1}};
  Watcher watcher(session, links);
  const Program rogue("rogue_mofc_node", {"--session", file});
  const Program device("device_node", {"--session", file, "--set",
                                       is_monitored ? "device.monitor=on" : "device.monitor=off"});

  constexpr double kDrawn = -1e-3;
  const auto& rows = watcher.rows();
  const auto least = [&] {
    return rows.empty() ? 0.0 : rows.back().device.minimum_true_energy_joule;
  };
  if (!is_monitored) {
    EXPECT_TRUE(watcher.until([&] { return least() < kDrawn; })) << device.err();
    return;
  }
  const DeviceCounters& counters = watcher.mirror().device_counters();
  ASSERT_TRUE(watcher.until([&] {
    return rows.size() > 2000 && counters.monitor_reductions > 1000;
  })) << device.err();
  EXPECT_GE(least(), -kRoundingJoule);
  if (machine.may_check("most ticks answered")) {
    EXPECT_GT(2 * counters.answered_ticks, counters.loop.ticks);
  }
}

INSTANTIATE_TEST_SUITE_P(Monitor, LyingClamp, testing::Bool(),
                         [](const auto& on) { return std::string(on.param ? "On" : "Off"); });

// --- device ---------------------------------------------------------------------------------

// The watchdog of the motors ends the force while the process is suspended. In 300 ms the spring of
// the hand, with 0.3 kg and 6.1 N·s/m, pulls it to 7.5 mm, up to 0.25 mm for 0.1 N of stiction and
// exp(−10.2 · 0.3) = 0.05 of some 4 mm of remaining oscillation. With the force still on, the hand
// would be at least 0.35 N / 400 N/m = 0.9 mm higher.
//
// On its way it meets friction only. Each half oscillation is shorter by exp(−π · 0.28 / √(1 −
// 0.28²)) = 0.40 at least, so the path is at most 4 mm (1 + 2 · 0.4 / (1 − 0.4)) = 9.3 mm: 0.93 mJ
// of Coulomb friction and, at 0.15 m/s at most, a seventh of that of viscous friction. With the
// first 2 ms, 1.5 mJ is an upper bound; 0.8 N over the first 3 mm alone would be 2.4 mJ.
TEST_F(PressingHand, WhenTheDeviceIsSuspendedItsMotorsSwitchOffByThemselves) {
  TimePoint continued_at;
  std::vector<TickRow>::const_iterator awake;
  fault_under_force([&] {
    const TimePoint stopped_at = stop_with(*device_, SIGSTOP);
    watcher_->until([&] { return clock_.now() >= stopped_at + 300ms; });
    continued_at = clock_.now();
    device_->send_signal(SIGCONT);
    const auto& rows = watcher_->rows();
    EXPECT_TRUE(watcher_->until([&] { return rows.back().device.sampled_at > continued_at; }));
    awake = std::find_if(rows.begin(), rows.end(), [&](const TickRow& row) {
      return row.device.switched_at >= continued_at;
    });
    return awake == rows.begin() ? 0.0 : newton(*(awake - 1));
  });
  const auto& rows = watcher_->rows();
  ASSERT_TRUE(!HasFailure() && awake != rows.end());
  const auto read_awake = std::find_if(
      awake, rows.end(), [&](const TickRow& row) { return row.device.sampled_at >= continued_at; });
  ASSERT_NE(read_awake, rows.end());
  const DeviceTick& asleep = (awake - 1)->device;
  EXPECT_EQ(newton(*awake), 0.0);
  // continued late, the hand has left the tissue again
  if (machine_.may_check("300 ms of suspension")) {
    EXPECT_NEAR(read_awake->device.true_tool_position_world_m.z(), -7.5e-3, 0.5e-3);
  }
  EXPECT_LT(read_awake->device.true_energy_joule - asleep.true_energy_joule, 1.5e-3);

  EXPECT_TRUE(watcher_->until([&] { return presses(watcher_->rows()); }));
  expect_passive();
}

// --- a fault --------------------------------------------------------------------------------

// Its spring, 400 N/m on 0.3 kg, throws the hand 1 m aside at some 20 m/s. No hand is that fast, so
// the device takes it for an encoder fault. The hand continues to press there.
class ThrownHand : public PressingHand {
 protected:
  ThrownHand() {
    files_.write("hand.csv",
                 "t,x,y,z\n0,0,0,0.004\n0.5,0,0,0.004\n0.8,0,0,-0.0075\n2,0,0,-0.0075\n"
                 "2.001,1,0,-0.0075\n1000,1,0,-0.0075\n");
  }
  bool is_far_enough() const override {
    return std::any_of(watcher_->rows().begin(), watcher_->rows().end(), [](const TickRow& row) {
      return newton(row) > 0.0 || row.device.guard == GuardState::kFault;
    });
  }
};

TEST_F(ThrownHand, AFaultEndsTheForceIsRecordedAndLastsUntilItsReset) {
  const auto& rows = watcher_->rows();
  const auto is_fault = [](const TickRow& row) { return row.device.guard == GuardState::kFault; };
  ASSERT_TRUE(watcher_->until([&] { return is_fault(rows.back()); }));
  const std::string text = device_->await_err("event=flight_recording reason=fault ticks=");
  device_->await_err("event=device_fault reason=\"position jumped\"");

  // the force stays 0; only a reset changes that
  ASSERT_TRUE(watcher_->until_rows(1500));
  const auto fault = std::find_if(rows.begin(), rows.end(), is_fault);
  const auto fault_index = fault - rows.begin();
  EXPECT_TRUE(std::all_of(fault, rows.end(), is_fault));
  EXPECT_TRUE(std::all_of(fault, rows.end(), [](const TickRow& row) { return newton(row) == 0; }));
  EXPECT_EQ(watcher_->mirror().device_counters().device_faults, 1u);

  // the file ends with the fault, or a few ticks later
  std::ifstream in(text.substr(text.find("file=") + 5));
  std::string last;
  std::size_t faults = 0;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#")) continue;  // what led to it
    last = line;
    if (line.find(",fault,") != std::string::npos) ++faults;
  }
  EXPECT_GT(faults, 0u);
  EXPECT_THAT(last, testing::HasSubstr(",fault,"));

  // after the reset the force ramps up from 0
  const auto is_answered = [](const TickRow& row) {
    return row.device.guard == GuardState::kAnswered;
  };
  device_->send_signal(SIGUSR2);
  ASSERT_TRUE(watcher_->until([&] { return is_answered(rows.back()); }));
  ASSERT_TRUE(watcher_->until_rows(300));
  const auto again = std::find_if(rows.begin() + fault_index, rows.end(), is_answered);
  ASSERT_NE(again, rows.end());
  const double peak_newton = session_.side().device.peak_force_newton;
  for (auto row = again; row != rows.end(); ++row) {
    const double share = to_seconds(row->device.switched_at - again->device.switched_at) /
                         to_seconds(session_.side().device.start_ramp);
    EXPECT_LE(newton(*row), std::min(share, 1.0) * peak_newton + 1e-9);
    EXPECT_NE(row->device.guard, GuardState::kFault);
  }
  EXPECT_EQ(watcher_->mirror().device_counters().fault_resets, 1u);
  expect_passive();
}

// --- flight recorder ------------------------------------------------------------------------

TEST_F(PressingHand, ASignalWritesTheLastTicksOfEachNodeBesideTheRunFolder) {
  constexpr std::size_t kLeastTicks = 50;
  const std::size_t third = std::min<std::size_t>(watcher_->rows().size() / 3, 1000);
  for (Program* node : {&*physics_, &*mofc_, &*device_}) {
    node->send_signal(SIGUSR1);
    const std::string text = node->await_err("event=flight_recording reason=signal ticks=");
    const std::string path = text.substr(text.find("file=") + 5);

    EXPECT_EQ(fs::path(path).parent_path(), run_folder_.path());
    std::ifstream in(path);
    std::size_t lines = 0;
    for (std::string line; std::getline(in, line);) lines += line.starts_with("#") ? 0U : 1U;
    EXPECT_EQ(lines, std::stoul(text) + 1);
    EXPECT_GT(lines, kLeastTicks);
    // mofc_node and physics_node may miss ticks of the device on a busy machine
    if (machine_.may_check("a third of the ticks recorded")) {
      EXPECT_GT(lines, third);
    }
  }

  // the nodes continue
  EXPECT_TRUE(watcher_->until_rows(100));
  EXPECT_TRUE(watcher_->until([&] { return presses(watcher_->rows()); }));
  for (Program* node : {&*device_, &*mofc_, &*physics_}) {
    node->send_signal(SIGTERM);
    EXPECT_EQ(node->wait(), 0) << node->err();
  }
}

TEST_F(PressingHand, AResetWithoutAFaultChangesNothing) {
  device_->send_signal(SIGUSR2);

  EXPECT_TRUE(watcher_->until_rows(300));
  EXPECT_TRUE(watcher_->until([&] { return presses(watcher_->rows()); }));
  EXPECT_EQ(watcher_->mirror().device_counters().fault_resets, 0u);
}

}  // namespace
}  // namespace palpate
