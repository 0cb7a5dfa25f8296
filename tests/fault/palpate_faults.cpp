// SPDX-License-Identifier: Apache-2.0
// palpate_faults — the fault matrix: the force on a pressing hand when a process of the running
// session is killed, suspended or restarted, or when something around it fails.
//
//   palpate_faults [--json FILE [--overwrite]]             runs every row and prints the table
//   palpate_faults --gtest_filter='*physics*'             runs some rows
//
// Real processes under `palpate launch` with the default real-time settings and the simulated
// device. Each row is also a test.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <zmq.hpp>

#include "common/core/user/output_file.h"
#include "common/link/codec/codec.h"
#include "device_node/simulation/hand.h"
#include "device_node/simulation/plant.h"
#include "tests/fault/pressing_session.h"
#include "tests/support/encoded_frame.h"
#include "tests/support/hostile/raw_zmtp.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/peak_memory.h"
#include "tests/support/port.h"
#include "tests/support/run_folder.h"
#include "tests/support/web_client.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using test::is_fresh;
using test::kLeftNewton;
using test::kRoundingJoule;
using test::newton;
using test::PressingSession;
using test::run_program;
using testing::HasSubstr;

/// So many lost ticks in a row are a fault; fewer may be a busy machine.
constexpr std::ptrdiff_t kGoneTicks = 20;

// --- the table ------------------------------------------------------------------------------

/// One row of the table.
struct Figures {
  std::string fault;
  double noticed_newton = kNaN;  ///< |F| when it was noticed
  double peak_newton = kNaN;     ///< largest |F| from then until the force returns
  double least_energy_joule = kNaN;
  std::optional<Duration>
      safe_after{};       ///< from the fault until |F| ≤ f_co; none: no force was lost
  Duration safe_limit{};  ///< documented bound of it
  std::optional<Duration> back_after{};  ///< from when the node can recover until the force returns
  bool is_ok = false;
};

std::vector<Figures>& table() {
  static std::vector<Figures> rows;
  return rows;
}

/// Resident memory that no program exceeds in any row [MiB]; docs/benchmarks.md has the figures.
const std::map<std::string, double> kMostMib{{"device_node", 64.0},
                                             {"mofc_node", 128.0},
                                             {"device_mofc_node", 128.0},
                                             {"physics_node", 64.0},
                                             {"viewer_node", 128.0}};

/// The largest of all rows, by program [MiB].
std::map<std::string, double>& most_memory_mib() {
  static std::map<std::string, double> most;
  return most;
}

std::string milliseconds(const std::optional<Duration>& time) {
  if (!time) return "–";
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f ms", 1e3 * to_seconds(*time));
  return text;
}

void print_table() {
  std::printf(
      "| fault while the hand presses | N when noticed | largest N after | least true energy | "
      "safe after (documented) | force returns after | ok |\n"
      "|---|---|---|---|---|---|---|\n");
  for (const Figures& row : table()) {
    std::printf("| %s | %.2f | %.2f | %.1f µJ | %s%s | %s | %s |\n", row.fault.c_str(),
                row.noticed_newton, row.peak_newton, 1e6 * row.least_energy_joule,
                milliseconds(row.safe_after).c_str(),
                row.safe_after ? (" (" + milliseconds(row.safe_limit) + ")").c_str() : "",
                milliseconds(row.back_after).c_str(), row.is_ok ? "yes" : "NO");
  }
  std::printf("\n| program | largest resident memory in any row | bound |\n|---|---|---|\n");
  for (const auto& [program, mib] : most_memory_mib()) {
    std::printf("| %s | %.1f MiB | %.0f MiB |\n", program.c_str(), mib, kMostMib.at(program));
  }
}

nlohmann::json json_of_table() {
  const auto ms = [](const std::optional<Duration>& time) -> nlohmann::json {
    if (!time) return nullptr;
    return 1e3 * to_seconds(*time);
  };
  nlohmann::json rows = nlohmann::json::array();
  for (const Figures& row : table()) {
    rows.push_back({{"fault", row.fault},
                    {"noticed_newton", row.noticed_newton},
                    {"peak_newton", row.peak_newton},
                    {"min_true_energy_uj", 1e6 * row.least_energy_joule},
                    {"safe_after_ms", ms(row.safe_after)},
                    {"safe_limit_ms", row.safe_after ? ms(row.safe_limit) : ms({})},
                    {"back_after_ms", ms(row.back_after)},
                    {"is_ok", row.is_ok}});
  }
  return {{"schema_version", 1}, {"rows", rows}};
}

// --- what holds in every row ----------------------------------------------------------------

/// The tick had no current answer of physics. Unknown, so false, if the clamp's record of an
/// answered tick was lost with a killed node.
bool is_lost(const TickRow& row) { return !row.device.is_answered || (row.mofc && !is_fresh(row)); }

bool follows(const TickRow& row, const TickRow& before) {
  return row.device_session_id == before.device_session_id &&
         row.device.sequence == before.device.sequence + 1;
}

/// |F| that the tissue requests, that the clamp commands or that acts: the largest.
double largest_newton(const TickRow& row) {
  if (!row.mofc) return newton(row);
  return std::max({newton(row), row.mofc->commanded_force_on_hand_newton.norm(),
                   row.mofc->requested_force_on_hand_newton.norm()});
}

/// While ticks are lost the force never exceeds that at the begin of the loss; otherwise it never
/// exceeds the law of the tissue, k times the depth, known to half a count of the encoder. The hand
/// never receives energy.
void expect_harmless(const std::vector<TickRow>& rows, const Session& session) {
  const double count_newton =
      test::kPressedTissueNewtonPerM * session.side().device.profile.position_resolution_m;
  double limit_newton = 0.0;
  int failures = 0;
  for (std::size_t i = 0; i < rows.size() && failures < 3; ++i) {
    const TickRow& row = rows[i];
    bool is_ok = true;
    if (is_fresh(row)) {
      const double depth_m = std::max(0.0, -row.device.true_tool_position_world_m.z());
      const double law_newton = test::kPressedTissueNewtonPerM * depth_m + count_newton;
      EXPECT_LE(newton(row), law_newton) << "sequence " << row.device.sequence;
      is_ok = newton(row) <= law_newton;
    } else if (is_lost(row)) {
      if (i == 0 || row.device_session_id != rows[i - 1].device_session_id) {
        limit_newton = largest_newton(row);
      } else if (!is_lost(rows[i - 1])) {
        limit_newton = largest_newton(rows[i - 1]);
      } else if (!follows(row, rows[i - 1])) {  // the loss may have been interrupted
        limit_newton = std::max(limit_newton, largest_newton(row));
      }
      EXPECT_LE(newton(row), limit_newton + 1e-9) << "sequence " << row.device.sequence;
      is_ok = newton(row) <= limit_newton + 1e-9;
    }
    EXPECT_GE(row.device.minimum_true_energy_joule, -kRoundingJoule);
    if (row.device.minimum_true_energy_joule < -kRoundingJoule) is_ok = false;
    if (!is_ok) ++failures;
  }
}

double least_energy_joule(const std::vector<TickRow>& rows) {
  double least = 0.0;
  for (const TickRow& row : rows) least = std::min(least, row.device.minimum_true_energy_joule);
  return least;
}

double peak_newton(std::vector<TickRow>::const_iterator from,
                   std::vector<TickRow>::const_iterator until) {
  double peak = 0.0;
  for (; from != until; ++from) peak = std::max(peak, newton(*from));
  return peak;
}

class Faults : public testing::Test {
 protected:
  void press(const std::vector<std::string>& launch_arguments = {"--no-viewer"}) {
    session_.emplace("pressing", launch_arguments);
    ASSERT_TRUE(session_->until_pressing()) << session_->launch().err();
  }
  [[nodiscard]] const std::vector<TickRow>& rows() const { return session_->rows(); }

  /// Sends the signal and waits for its effect.
  /// @return a time after the effect
  TimePoint stop_with(pid_t node, int signal) {
    EXPECT_GT(node, 1);
    kill(node, signal);
    // it is no child of this process, so look into /proc
    const auto is_done = [&] {
      std::ifstream stat("/proc/" + std::to_string(node) + "/stat");
      std::string text;
      std::getline(stat, text);
      const std::size_t state = text.rfind(") ");
      if (state == std::string::npos) return signal != SIGSTOP;
      const char now = text[state + 2];
      return signal == SIGSTOP ? now == 'T' : now == 'Z' || now == 'X';
    };
    while (!is_done()) std::this_thread::yield();
    return session_->now();
  }

  /// Ends the session and checks what holds in every row: the force returns, and no node but
  /// `restarted` was restarted. Adds the row to the table.
  void finish(Figures figures, const std::string& restarted) {
    EXPECT_TRUE(session_->until_pressing()) << "the force does not return";
    expect_harmless(rows(), session_->session());
    expect_bounded_memory();
    figures.least_energy_joule =
        std::min(std::isnan(figures.least_energy_joule) ? 0.0 : figures.least_energy_joule,
                 least_energy_joule(rows()));
    for (const auto& [node, count] : session_->stop_and_count_restarts()) {
      EXPECT_EQ(count, node == restarted ? 1 : 0) << node;
    }
    figures.is_ok = !HasFailure();
    table().push_back(std::move(figures));
  }

  /// Of all nodes, whatever they suffered.
  void expect_bounded_memory() {
    const auto peaks = test::peak_memory_of_children_mib(session_->launch().pid());
    EXPECT_GE(peaks.size(), 2u) << "two nodes at least";
    for (const auto& [program, mib] : peaks) {
      if (!kMostMib.contains(program)) continue;
      // what others keep from running keeps its messages
      if (mib < kMostMib.at(program) || machine_.may_check("memory of " + program)) {
        EXPECT_LT(mib, kMostMib.at(program)) << program;
      }
      most_memory_mib()[program] = std::max(most_memory_mib()[program], mib);
    }
  }

  /// Whether the device did not go limp in the 0.5 s after that time.
  bool stays_active(TimePoint from) {
    const TimePoint until = from + 500ms;
    EXPECT_TRUE(session_->watcher().until(
        [&] { return !rows().empty() && rows().back().device.sampled_at >= until; }));
    return std::none_of(rows().begin(), rows().end(), [&](const TickRow& row) {
      return row.device.sampled_at >= from && row.device.sampled_at < until &&
             row.device.guard == GuardState::kLimp;
    });
  }

  /// For a fault that must not disturb the hand: the device does not go limp.
  /// @param busy  threads of the fault that take a processor each: checked where there are more
  void finish_undisturbed(const std::string& fault, TimePoint from,
                          const std::string& restarted = "", unsigned busy = 0) {
    const bool is_active = stays_active(from);
    const std::string what = fault + ": the device stays active";
    if (!is_active && busy > 0 && std::thread::hardware_concurrency() <= busy) {
      std::printf("not checked: %s: the fault itself takes the processors\n", what.c_str());
    } else if (machine_.may_check(what)) {
      EXPECT_TRUE(is_active);
    }
    const auto after = std::find_if(rows().begin(), rows().end(), [&](const TickRow& row) {
      return row.device.sampled_at >= from;
    });
    ASSERT_TRUE(after != rows().begin() && after != rows().end());
    finish({.fault = fault,
            .noticed_newton = newton(*(after - 1)),
            .peak_newton = peak_newton(after, rows().end())},
           restarted);
  }

  test::RunFolder run_folder_;
  std::optional<PressingSession> session_;
  test::QuietMachine machine_;
};

// --- a node is killed, suspended or restarted -----------------------------------------------

struct NodeFault {
  const char* node;
  int signal;
};
/// As in the table.
bool is_physics(const NodeFault& fault) { return std::string(fault.node) == "physics"; }
std::string in_words(const NodeFault& fault) {
  const char* how = fault.signal == SIGKILL ? "killed"
                    : fault.signal == SIGSTOP
                        ? is_physics(fault) ? "suspended for 0.8 s" : "suspended for 0.3 s"
                        : "ended, restarted";
  return std::string(fault.node) + "_node " + how;
}
void PrintTo(const NodeFault& fault, std::ostream* out) { *out << in_words(fault); }
/// As in the name of the test.
std::string test_name(const testing::TestParamInfo<NodeFault>& fault) {
  return std::string(fault.param.node) + (fault.param.signal == SIGKILL   ? "_killed"
                                          : fault.param.signal == SIGSTOP ? "_stopped"
                                                                          : "_restarted");
}

class Node : public Faults, public testing::WithParamInterface<NodeFault> {
 protected:
  /// Starts a session and does the fault while the hand presses. Repeats that in a new session if a
  /// busy machine had interrupted the force before.
  /// @param find_row  returns the index of the last row before the effect of the fault
  template <class FindRow>
  void fault_under_force(FindRow find_row) {
    constexpr int kMostAttempts = 5;
    for (int attempt = 1;; ++attempt) {
      do_fault();
      if (HasFatalFailure()) return;
      const std::size_t row = find_row();
      if (HasFailure() || attempt == kMostAttempts || newton(rows()[row]) > kLeftNewton) return;
      static_cast<void>(session_->stop_and_count_restarts());
    }
  }

  [[nodiscard]] static bool is_together() { return std::string(GetParam().node) == "device_mofc"; }
  /// Who was restarted in the end.
  [[nodiscard]] std::string restarted() const {
    return GetParam().signal == SIGSTOP ? "" : GetParam().node;
  }
  /// Waits for the first of `rows()[from …]` with an answer of physics after the node could
  /// recover.
  std::size_t await_back(std::size_t from) {
    const auto is_back = [&](const TickRow& row) {
      return row.device.sampled_at >= healed_at_ && is_fresh(row);
    };
    std::size_t at = from;
    EXPECT_TRUE(session_->watcher().until([&] {
      while (at < rows().size() && !is_back(rows()[at])) ++at;
      return at < rows().size();
    })) << session_->launch().err();
    return std::min(at, rows().size() - 1);
  }

 private:
  void do_fault() {
    std::vector<std::string> arguments{"--no-viewer"};
    if (is_together()) arguments.insert(arguments.end(), {"--together", "device,mofc"});
    answers_.clear();
    press(arguments);
    if (HasFatalFailure()) return;
    victim_ = session_->node(GetParam().node);
    sent_at_ = session_->now();
    faulted_at_ = stop_with(victim_, GetParam().signal);
    healed_at_ = faulted_at_;

    // records of the other nodes about its last ticks; launch restarts it after 100 ms
    session_->watcher().until([&] { return session_->now() >= faulted_at_ + 60ms; });
    const viewer::TelemetryMirror& mirror = session_->watcher().mirror();
    for (const auto& [sequence, tick] : mirror.ticks()) {
      if (tick.mofc) answers_[sequence] = *tick.mofc;
    }
    for (const auto& [sequence, tick] : mirror.physics_ticks()) last_step_at_ = tick.stepped_at;
    heal();
  }
  /// A suspended node continues; a dead one is restarted by launch.
  void heal() {
    if (GetParam().signal != SIGSTOP) return;
    // longer than still_after, which the tissue of this session has
    const Duration suspended = is_physics(GetParam()) ? 800ms : 300ms;
    session_->watcher().until([&] { return session_->now() >= faulted_at_ + suspended; });
    healed_at_ = session_->now();
    kill(victim_, SIGCONT);
  }

  pid_t victim_ = 0;

 protected:
  TimePoint sent_at_;                          ///< of the signal
  TimePoint faulted_at_;                       ///< after its effect
  TimePoint healed_at_;                        ///< from now on the node can recover
  std::map<std::uint64_t, MofcTick> answers_;  ///< by sequence of the DeviceState, up to the fault
  TimePoint last_step_at_;                     ///< last known step of physics
};

using PhysicsOrMofc = Node;

// mofc_node notices by itself that no answers of physics arrive, device_node that it gets no
// answer.
TEST_P(PhysicsOrMofc, TheForceEndsInTimeAndReturns) {
  // the row before the first of many lost ones
  std::size_t noticed = 0;
  const auto is_gone = [&] {
    for (auto first = rows().begin(); rows().end() - first >= kGoneTicks; ++first) {
      if (first->device.sampled_at < sent_at_ - 2ms) continue;
      const auto kept = std::find_if_not(first, first + kGoneTicks, is_lost);
      if (kept == first + kGoneTicks) {
        noticed = static_cast<std::size_t>(first - rows().begin()) - 1;
        return true;
      }
      first = kept;
    }
    return false;
  };
  fault_under_force([&] {
    EXPECT_TRUE(session_->watcher().until(is_gone));
    return noticed;
  });
  ASSERT_FALSE(HasFailure());
  const std::size_t back = await_back(noticed + 1);

  const Session& session = session_->session();
  const TickRow& last = rows()[noticed];
  Figures figures{.fault = in_words(GetParam()), .noticed_newton = newton(last)};
  if (figures.noticed_newton <= kLeftNewton && !machine_.may_check("the fault under force")) {
    GTEST_SKIP() << "the machine was not quiet enough for a press";
  }
  EXPECT_GT(figures.noticed_newton, kLeftNewton);
  const auto begin = rows().begin() + static_cast<std::ptrdiff_t>(noticed) + 1;
  const auto end = rows().begin() + static_cast<std::ptrdiff_t>(back);
  figures.peak_newton = peak_newton(begin, end);

  // safe: no more force than the friction of the device absorbs, whatever the hand does
  const double safe_newton = session.side().device.profile.coulomb_newton + 1e-9;
  const auto safe = std::find_if(std::make_reverse_iterator(end), std::make_reverse_iterator(begin),
                                 [&](const TickRow& row) { return newton(row) > safe_newton; })
                        .base();
  ASSERT_NE(safe, end);
  const bool is_physics_fault = is_physics(GetParam());
  TimePoint safe_at = safe->device.switched_at;
  // a node that ends in order runs for a while after the signal and reports its last tick
  if (GetParam().signal == SIGTERM) {
    faulted_at_ = is_physics_fault ? last_step_at_ : last.device.switched_at;
  }
  if (is_physics_fault) {
    // only a stopped node keeps its connection
    figures.safe_limit =
        session.side().mofc.fade +
        (GetParam().signal == SIGSTOP ? session.side().mofc.still_after : test::kLossNoticed);
  } else {
    figures.safe_limit = session.side().device.lease;  // then the motors switch off by themselves
    safe_at = std::min(safe_at, last.device.switched_at + session.side().device.lease);
  }
  figures.safe_after = std::max(safe_at - faulted_at_, Duration::zero());
  // duration of the tick in which the clamp took the last message, and lateness of the safe tick
  const Duration turn = is_physics_fault
                            ? rows()[noticed].device.switched_at -
                                  rows()[noticed].device.sampled_at + 2ms + safe->device.lateness
                            : Duration::zero();
  if (*figures.safe_after <= figures.safe_limit + turn || machine_.may_check("safe in time")) {
    EXPECT_LE(*figures.safe_after, figures.safe_limit + turn);
  }
  figures.back_after = rows()[back].device.sampled_at - healed_at_;
  finish(std::move(figures), restarted());
}

INSTANTIATE_TEST_SUITE_P(Faults, PhysicsOrMofc,
                         testing::Values(NodeFault{"physics", SIGKILL},
                                         NodeFault{"physics", SIGSTOP},
                                         NodeFault{"physics", SIGTERM}, NodeFault{"mofc", SIGKILL},
                                         NodeFault{"mofc", SIGSTOP}, NodeFault{"mofc", SIGTERM}),
                         test_name);

/// Predicts the motion of the hand after the last row of a dead device. Its last forces are those
/// that mofc_node sent (the device only reduces them); each acts from its switch on, and the
/// watchdog of the motors ends the last one after its lease. The plant and its inner steps are
/// those of the device.
class CarriedOn {
 public:
  CarriedOn(const PressingSession& session, const TickRow& before, const TickRow& last)
      : session_(session.session()),
        plant_(device::plant_of(session_.side().simulated, session_.side().hand),
               last.device.true_tool_position_world_m,
               last.device.true_tool_velocity_world_m_per_s),
        energy_joule_(last.device.true_energy_joule),
        origin_(last.device.sampled_at),
        until_(origin_),
        force_newton_(before.device.force_on_hand_newton) {
    lease_end_ = before.device.switched_at + session_.side().device.lease;
    switch_at(last.device.switched_at, last.device.force_on_hand_newton);
  }
  void switch_at(TimePoint at, const Vector3& force_newton) {
    integrate_until(at);
    force_newton_ = force_newton;
    lease_end_ = at + session_.side().device.lease;
  }
  void integrate_until(TimePoint until) {
    if (lease_end_ <= until) {
      step_until(lease_end_);
      force_newton_.setZero();
    }
    step_until(until);
  }
  [[nodiscard]] TimePoint lease_end() const { return lease_end_; }
  [[nodiscard]] Vector3 position_m() const { return plant_.state().hand_position_m; }
  [[nodiscard]] double energy_joule() const { return energy_joule_ + plant_.state().energy_joule; }
  [[nodiscard]] double least_energy_joule() const {
    return energy_joule_ + plant_.state().minimum_energy_joule;
  }

 private:
  void step_until(TimePoint until) {
    device::in_equal_steps(
        origin_, until_, until, session_.side().simulated.inner_step, [&](double, double h_s) {
          plant_.step(h_s, {.position_m = {0, 0, test::kPressedTargetM}}, force_newton_);
        });
    until_ = std::max(until_, until);
  }

  const Session& session_;
  device::Plant plant_;
  double energy_joule_;
  TimePoint origin_;
  TimePoint until_;
  Vector3 force_newton_;
  TimePoint lease_end_;
};

using Device = Node;

TEST_P(Device, ItsMotorsSwitchOffByThemselvesAndItRestartsLimp) {
  const bool is_stopped = GetParam().signal == SIGSTOP;
  // the first row after the fault
  std::size_t awake = 0;
  fault_under_force([&] {
    awake = 0;
    EXPECT_TRUE(session_->watcher().until([&] {
      while (awake < rows().size() && rows()[awake].device.sampled_at < faulted_at_) ++awake;
      return awake < rows().size();
    })) << session_->launch().err();
    // a suspended tick ends after the process continues; its force belongs to that row
    while (is_stopped && awake > 1 && rows()[awake - 1].device.switched_at > faulted_at_) --awake;
    EXPECT_GE(awake, 2u);
    return std::max<std::size_t>(awake, 1) - 1;
  });
  ASSERT_FALSE(HasFailure());
  const Session& session = session_->session();
  const TickRow& last = rows()[awake - 1];

  Figures figures{.fault = in_words(GetParam()), .noticed_newton = newton(last)};
  if (figures.noticed_newton <= kLeftNewton && !machine_.may_check("the fault under force")) {
    GTEST_SKIP() << "the machine was not quiet enough for a press";
  }
  EXPECT_GT(figures.noticed_newton, kLeftNewton);

  // answers after the last reported row; a clamp that died with the device reported no more, so it
  // is assumed to have commanded the same force until its end
  CarriedOn carried(*session_, rows()[awake - 2], last);
  if (!is_stopped && is_together()) {
    const Duration period = from_seconds(1.0 / session.side().device.rate_hz);
    for (TimePoint at = last.device.switched_at + period; at < faulted_at_; at += period) {
      carried.switch_at(at, last.device.force_on_hand_newton);
    }
  } else if (!is_stopped) {
    const Duration answer = last.device.switched_at - last.device.sampled_at;
    for (const auto& [sequence, tick] : answers_) {
      if (sequence <= last.device.sequence || tick.device_sampled_at > faulted_at_) continue;
      carried.switch_at(tick.device_sampled_at + answer, tick.commanded_force_on_hand_newton);
      figures.noticed_newton =
          std::max(figures.noticed_newton, tick.commanded_force_on_hand_newton.norm());
    }
  }
  const TimePoint lease_end = carried.lease_end();
  if (is_stopped) {
    // the device reads the predicted motion when it continues, so the force ended in time
    const auto found =
        std::find_if(rows().begin() + static_cast<std::ptrdiff_t>(awake), rows().end(),
                     [&](const TickRow& row) { return row.device.sampled_at >= healed_at_; });
    ASSERT_NE(found, rows().end());
    carried.integrate_until(found->device.sampled_at);
    EXPECT_NEAR(carried.position_m().z(), found->device.true_tool_position_world_m.z(), 20e-6);
    EXPECT_NEAR(carried.energy_joule(), found->device.true_energy_joule, 20e-6);
    EXPECT_EQ(newton(rows()[awake]), 0.0);
  } else {
    carried.integrate_until(lease_end + 300ms);
    // limp at first: of what is seen late, no more than the start ramp
    const DeviceTick& first = rows()[awake].device;
    EXPECT_NE(rows()[awake].device_session_id, last.device_session_id);
    const double ramp = static_cast<double>(first.sequence) / session.side().device.rate_hz /
                        to_seconds(session.side().device.start_ramp);
    EXPECT_LE(newton(rows()[awake]), ramp * session.side().device.peak_force_newton + 1e-9);
    if (machine_.may_check("the begin of a restarted device")) {
      EXPECT_EQ(newton(rows()[awake]), 0.0);
    }
  }
  figures.least_energy_joule = carried.least_energy_joule();
  EXPECT_GE(figures.least_energy_joule, -kRoundingJoule);

  figures.safe_limit = session.side().device.lease;
  figures.safe_after = std::max(lease_end - faulted_at_, Duration::zero());
  EXPECT_LE(*figures.safe_after, figures.safe_limit);
  const std::size_t back = await_back(awake);
  figures.peak_newton = peak_newton(rows().begin() + static_cast<std::ptrdiff_t>(awake),
                                    rows().begin() + static_cast<std::ptrdiff_t>(back));
  figures.back_after = rows()[back].device.sampled_at - healed_at_;
  finish(std::move(figures), restarted());
}

INSTANTIATE_TEST_SUITE_P(Faults, Device,
                         testing::Values(NodeFault{"device", SIGKILL}, NodeFault{"device", SIGSTOP},
                                         NodeFault{"device", SIGTERM},
                                         NodeFault{"device_mofc", SIGKILL},
                                         NodeFault{"device_mofc", SIGSTOP}),
                         test_name);

class Viewer : public Faults, public testing::WithParamInterface<NodeFault> {};

TEST_P(Viewer, NoNodeIsDisturbed) {
  press({});
  session_->launch().await_err("event=web url=");
  ASSERT_TRUE(session_->until_pressing());
  const pid_t viewer = session_->node("viewer");
  const TimePoint faulted_at = stop_with(viewer, GetParam().signal);
  const bool is_stopped = GetParam().signal == SIGSTOP;
  if (is_stopped) {
    session_->watcher().until([&] { return session_->now() >= faulted_at + 300ms; });
    kill(viewer, SIGCONT);
  } else {
    session_->launch().await_err("event=web url=", 2);
  }
  finish_undisturbed(in_words(GetParam()), faulted_at, is_stopped ? "" : "viewer");
}

INSTANTIATE_TEST_SUITE_P(Faults, Viewer,
                         testing::Values(NodeFault{"viewer", SIGKILL}, NodeFault{"viewer", SIGSTOP},
                                         NodeFault{"viewer", SIGTERM}),
                         test_name);

// --- faults around the nodes ----------------------------------------------------------------

// Physics runs for 1 ms of every 10.
TEST_F(Faults, PhysicsTenTimesTooSlowReducesTheForceAndNeverRaisesIt) {
  press();
  const pid_t physics = session_->node("physics");
  const TimePoint from = session_->now();
  const auto begin = rows().size();
  std::jthread slow([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const auto continued = std::chrono::steady_clock::now();
      kill(physics, SIGCONT);
      std::this_thread::sleep_for(1ms);
      kill(physics, SIGSTOP);
      // a busy machine lets it run for longer
      std::this_thread::sleep_for(9 * (std::chrono::steady_clock::now() - continued));
    }
  });
  ASSERT_TRUE(session_->watcher().until([&] { return session_->now() >= from + 1500ms; }));
  slow.request_stop();
  slow.join();
  kill(physics, SIGCONT);
  const TimePoint healed_at = session_->now();

  // by the records of physics itself
  std::size_t steps = 0;
  for (const auto& [sequence, tick] : session_->watcher().mirror().physics_ticks()) {
    if (tick.stepped_at > healed_at - 700ms && tick.stepped_at <= healed_at - 200ms) ++steps;
  }
  EXPECT_LT(steps, 0.3 * 0.5 * session_->session().physics.rate_hz);

  // recovered: 50 ticks in a row
  std::size_t back = 0;
  ASSERT_TRUE(session_->watcher().until([&] {
    for (std::size_t i = begin; i + 50 <= rows().size(); ++i) {
      if (rows()[i].device.sampled_at < healed_at) continue;
      if (!std::all_of(rows().begin() + static_cast<std::ptrdiff_t>(i),
                       rows().begin() + static_cast<std::ptrdiff_t>(i) + 50, is_fresh)) {
        continue;
      }
      back = i;
      return true;
    }
    return false;
  }));
  finish({.fault = "physics_node 10 times too slow, 1.5 s",
          .noticed_newton = newton(rows()[begin]),
          .peak_newton = peak_newton(rows().begin() + static_cast<std::ptrdiff_t>(begin),
                                     rows().begin() + static_cast<std::ptrdiff_t>(back)),
          .back_after = rows()[back].device.sampled_at - healed_at},
         "");
}

/// Mounts a small file system on a folder, for this process and its children only.
class SmallDisk {
 public:
  explicit SmallDisk(const std::filesystem::path& folder) : folder_(folder) {
    is_mounted_ = unshare(CLONE_NEWNS) == 0 &&
                  mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
                  mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=16m") == 0;
  }
  ~SmallDisk() {
    if (is_mounted_) umount2(folder_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  [[nodiscard]] bool is_mounted() const { return is_mounted_; }

 private:
  std::filesystem::path folder_;
  bool is_mounted_ = false;
};

TEST_F(Faults, AFullDiskEndsTheRecordingAndNothingElse) {
  const test::TempFolder folder;
  const SmallDisk disk(folder.path());
  if (!disk.is_mounted()) GTEST_SKIP() << "no mount namespace permitted here";
  press({"--no-viewer", "--record", (folder.path() / "run.mcap").string()});

  const TimePoint from = session_->now();
  std::ofstream filler(folder.path() / "filler");
  while (filler) filler << std::string(4096, ' ') << std::flush;
  session_->launch().await_err("run.mcap: No space left on device");

  finish_undisturbed("disk full while launch records", from);
}

// SIGXFSZ, which comes with it, kills a process that does not ignore it.
TEST_F(Faults, AFileSizeLimitEndsTheRecordingAndNothingElse) {
  const test::TempFolder folder;
  const std::string file = (folder.path() / "run.mcap").string();
  press({"--no-viewer", "--record", file});

  const TimePoint from = session_->now();
  const rlimit limit{.rlim_cur = std::filesystem::file_size(file) + 1000,
                     .rlim_max = RLIM_INFINITY};
  ASSERT_EQ(prlimit(session_->launch().pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  session_->launch().await_err("run.mcap: File too large");

  finish_undisturbed("file size limit while launch records", from);
}

TEST_F(Faults, AJumpingWallClockDoesNotDisturb) {
  const test::TempFolder folder;
  const std::string file = (folder.path() / "run.mcap").string();
  setenv("LD_PRELOAD", (test::binary_dir() + "/libwall_clock_steps.so").c_str(), 1);
  session_.emplace("pressing", std::vector<std::string>{"--no-viewer", "--record", file});
  unsetenv("LD_PRELOAD");
  ASSERT_TRUE(session_->until_pressing());

  const std::string maps = "/proc/" + std::to_string(session_->launch().pid()) + "/maps";
  EXPECT_THAT(test::text_of(maps), HasSubstr("libwall_clock_steps.so"));

  finish_undisturbed("wall clock jumps ±1 h five times a second", session_->now());

  // nor does it spoil the times of the recording
  const auto length_s = [](const std::string& of) {
    const auto info = nlohmann::json::parse(run_program("palpate", {"info", of, "--json"}).out);
    return info["length_s"].get<double>();
  };
  const double whole_s = length_s(file);
  EXPECT_GT(whole_s, 0.5);
  EXPECT_LT(whole_s, 3000.0);
  const std::string part = (folder.path() / "part.mcap").string();
  const std::string half = std::to_string(0.5 * whole_s);
  ASSERT_EQ(run_program("palpate", {"cut", file, part, "--from", half}).status, 0);
  EXPECT_NEAR(length_s(part), 0.5 * whole_s, 0.2 * whole_s);
}

TEST_F(Faults, ASecondOfEachNodeIsRefused) {
  press();
  const TimePoint from = session_->now();
  for (const char* node : {"device_node", "mofc_node", "physics_node"}) {
    const test::Outcome second = run_program(node, {"--session", session_->file()});
    EXPECT_EQ(second.status, 2);
    EXPECT_THAT(second.err, HasSubstr(": in use by process "));
  }
  const test::Outcome launch = run_program("palpate", {"launch", session_->file()});
  EXPECT_EQ(launch.status, 2);
  finish_undisturbed("ports taken: a second of each node, and of launch", from);
}

// --- messages of foreign peers --------------------------------------------------------------

/// Sends raw frames to mofc_node and physics_node.
class ForeignPeer {
 public:
  explicit ForeignPeer(const LinksConfig& links)
      : to_mofc_(context_, zmq::socket_type::dealer),
        to_physics_(context_, zmq::socket_type::push) {
    to_mofc_.set(zmq::sockopt::linger, 0);
    to_physics_.set(zmq::sockopt::linger, 0);
    to_mofc_.connect(links.exchange);
    to_physics_.connect(links.tool_motion);
  }
  void send(const std::string& to_mofc, const std::string& to_physics) {
    to_mofc_.send(zmq::buffer(to_mofc), zmq::send_flags::dontwait);
    to_physics_.send(zmq::buffer(to_physics), zmq::send_flags::dontwait);
  }

 private:
  zmq::context_t context_;
  zmq::socket_t to_mofc_;
  zmq::socket_t to_physics_;
};

class ForeignPeers : public Faults {
 protected:
  /// Sends until both nodes have refused and counted more than 10 frames.
  void send_until_refused(const std::string& to_mofc, const std::string& to_physics) {
    ForeignPeer peer(session_->session().side().links);
    const auto& mirror = session_->watcher().mirror();
    EXPECT_TRUE(session_->watcher().until([&] {
      peer.send(to_mofc, to_physics);
      return mirror.mofc_counters().device_state.rejected > 10 &&
             mirror.physics_counters().tool_motion.rejected > 10;
    }));
  }
};

TEST_F(ForeignPeers, HalfWrittenMessagesAreRefused) {
  press();
  const TimePoint from = session_->now();
  const LinksConfig& links = session_->session().side().links;
  test::RawStream to_mofc(links.exchange);
  test::RawStream to_physics(links.tool_motion);
  for (test::RawStream* stream : {&to_mofc, &to_physics}) {  // stops inside a frame
    EXPECT_TRUE(
        stream->write(test::zmtp_greeting() + test::zmtp_head(test::kCommand, 41) + "\5READY"));
  }
  std::string state = test::frame_of(DeviceState{});
  std::string motion = test::frame_of(ToolMotion{});
  state.resize(state.size() / 2);
  motion.resize(motion.size() / 2);

  send_until_refused(state, motion);

  finish_undisturbed("half-written messages", from);
}

TEST_F(ForeignPeers, MessagesOfAnotherVersionAreRefused) {
  press();
  const TimePoint from = session_->now();
  const auto of_version_2 = [](std::string frame) {
    const std::string version("\x0d\1\0\0\0", 5);  // Header.protocol_major, fixed32
    const std::size_t at = frame.find(version);
    EXPECT_LT(at, 8u);
    frame[at + 1] = 2;
    return frame;
  };

  send_until_refused(of_version_2(test::frame_of(DeviceState{})),
                     of_version_2(test::frame_of(ToolMotion{})));

  session_->launch().await_err("peer speaks protocol 2, this program speaks 1");
  finish_undisturbed("messages of another protocol version", from);
}

class MessagesOfTwoParts : public ForeignPeers, public testing::WithParamInterface<bool> {};

TEST_P(MessagesOfTwoParts, AreRefused) {
  const bool is_together = GetParam();
  std::vector<std::string> arguments{"--no-viewer"};
  if (is_together) arguments.insert(arguments.end(), {"--together", "device,mofc"});
  press(arguments);
  const TimePoint from = session_->now();
  const Session& session = session_->session();
  const LinksConfig& links = session.side().links;
  const std::string state = test::frame_of(DeviceState{});
  const std::string motion = test::frame_of(ToolMotion{});
  const std::string subscription("\x0b\5", 2);
  struct Target {
    std::string endpoint;
    zmq::socket_type type;
    std::string valid;
  };
  zmq::context_t context;
  std::vector<zmq::socket_t> peers;
  std::vector<std::string> valid;
  std::vector<Target> targets{
      Target{links.tool_motion, zmq::socket_type::push, motion},
      Target{links.interaction, zmq::socket_type::dealer, subscription},
      Target{links.device_telemetry, zmq::socket_type::dealer, subscription},
      Target{links.mofc_telemetry, zmq::socket_type::dealer, subscription},
      Target{session.physics_telemetry, zmq::socket_type::dealer, subscription}};
  if (!is_together) targets.push_back({links.exchange, zmq::socket_type::dealer, state});
  for (const Target& target : targets) {
    zmq::socket_t& peer = peers.emplace_back(context, target.type);
    peer.set(zmq::sockopt::linger, 0);
    peer.connect(target.endpoint);
    valid.push_back(target.valid);
  }

  const auto& mirror = session_->watcher().mirror();
  int rounds = 0;
  EXPECT_TRUE(session_->watcher().until([&] {
    for (std::size_t i = 0; i < peers.size(); ++i) {
      for (const std::size_t size : {std::size_t{20}, std::size_t{1'900'000}}) {
        peers[i].send(zmq::buffer(valid[i]), zmq::send_flags::sndmore | zmq::send_flags::dontwait);
        peers[i].send(zmq::buffer(std::string(size, 'x')), zmq::send_flags::dontwait);
      }
    }
    return ++rounds >= 10 && (is_together || mirror.mofc_counters().device_state.rejected > 10) &&
           mirror.physics_counters().tool_motion.rejected > 10;
  }));

  finish_undisturbed(is_together ? "messages of two parts to every node, device and mofc together"
                                 : "messages of two parts to every node",
                     from);
}
INSTANTIATE_TEST_SUITE_P(Faults, MessagesOfTwoParts, testing::Bool(), [](const auto& info) {
  return std::string(info.param ? "Together" : "FourProcesses");
});

/// Listens on the path of an ipc endpoint and writes zeros to everyone who connects.
class Zeros {
 public:
  explicit Zeros(const std::string& endpoint)
      : listener_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    endpoint.copy(address.sun_path, sizeof(address.sun_path) - 1, std::string("ipc://").size());
    unlink(address.sun_path);
    EXPECT_EQ(bind(listener_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    EXPECT_EQ(listen(listener_, 16), 0);
  }
  ~Zeros() {
    for (const int peer : peers_) close(peer);
    close(listener_);
  }
  Zeros(const Zeros&) = delete;
  Zeros& operator=(const Zeros&) = delete;
  void serve() {
    const int peer = accept(listener_, nullptr, nullptr);
    if (peer < 0) return;
    const std::string zeros(300, '\0');
    EXPECT_GT(write(peer, zeros.data(), zeros.size()), 0);
    peers_.push_back(peer);
  }
  [[nodiscard]] std::size_t served() const { return peers_.size(); }

 private:
  int listener_;
  std::vector<int> peers_;
};

// libzmq gives up connections whose other end violated the protocol.
TEST_F(ForeignPeers, AnotherProgramInPlaceOfPhysicsIsReplacedByPhysics) {
  press();
  const LinksConfig& links = session_->session().side().links;
  const std::size_t before = rows().size() - 1;
  const pid_t physics = session_->node("physics");
  kill(session_->launch().pid(), SIGSTOP);  // or it restarts physics before the zeros are there
  const TimePoint killed_at = stop_with(physics, SIGKILL);
  {
    Zeros motions(links.tool_motion);
    Zeros interactions(links.interaction);
    EXPECT_TRUE(session_->watcher().until([&] {
      motions.serve();
      interactions.serve();
      return session_->now() >= killed_at + 80ms && motions.served() > 0 &&
             interactions.served() > 0;
    }));
  }
  kill(session_->launch().pid(), SIGCONT);
  EXPECT_GT(session_->node("physics", 2), 1);
  const TimePoint healed_at = session_->now();
  const auto is_back = [&](const TickRow& row) {
    return row.device.sampled_at >= healed_at && is_fresh(row);
  };
  EXPECT_TRUE(session_->watcher().until(
      [&] { return std::any_of(rows().begin(), rows().end(), is_back); }));
  const auto back = std::find_if(rows().begin(), rows().end(), is_back);
  ASSERT_NE(back, rows().end());
  const Duration back_after = back->device.sampled_at - healed_at;
  if (machine_.may_check("the force returns within 2 s")) {
    EXPECT_LT(back_after, 2s);
  }

  finish({.fault = "physics_node killed, zeros at its links until it is restarted",
          .noticed_newton = newton(rows()[before]),
          .peak_newton = peak_newton(rows().begin() + static_cast<std::ptrdiff_t>(before), back),
          .back_after = back_after},
         "physics");
}

/// Writes `total` bytes or as much as 3 s allow, over a new connection whenever one is ended.
void flood(const std::string& endpoint, const char* type, const std::string& frames,
           std::size_t total) {
  const SteadyClock clock;
  const TimePoint end = clock.now() + 3s;
  for (std::size_t sent = 0; sent < total && clock.now() < end;) {
    test::RawStream stream(endpoint);
    const bool is_open = stream.shake_hands(type);
    do {
      sent += frames.size();
    } while (is_open && sent < total && clock.now() < end && stream.write(frames));
  }
}

/// Sixteen viewers that want all and read nothing, and connections that never finish a request, for
/// as long as it exists.
class FloodOfThePage {
 public:
  explicit FloodOfThePage(std::uint16_t port) {
    for (int i = 0; i < 16; ++i) {
      auto& viewer = *clients_.emplace_back(std::make_unique<test::WebClient>(port));
      viewer.read_slowly();
      EXPECT_TRUE(viewer.open_web_socket());
      std::string subscriptions;
      for (int channel = 1; channel <= 8; ++channel) {
        const std::string id = std::to_string(channel);
        if (channel > 1) subscriptions += ',';
        subscriptions.append(R"({"id":)").append(id).append(R"(,"channelId":)").append(id) += '}';
      }
      EXPECT_TRUE(
          viewer.send_text(R"({"op":"subscribe","subscriptions":[)" + subscriptions + "]}"));
    }
    for (int i = 0; i < 300; ++i) {
      clients_.emplace_back(std::make_unique<test::WebClient>(port))
          ->send_raw("GET / HTTP/1.1\r\nHost: loc");
    }
  }

 private:
  std::vector<std::unique_ptr<test::WebClient>> clients_;
};

class Floods : public ForeignPeers {
 protected:
  static constexpr double kMostGrowthMib = 96.0;  // of the 128 that mofc_node is bounded to

  struct Flooded {
    TimePoint from{};
    double most_growth_mib = 0.0;
  };
  /// Presses, then floods every node from all sides.
  Flooded flood_every_node();
};

Floods::Flooded Floods::flood_every_node() {
  std::string tool_motion;
  std::string interaction;
  std::string exchange;
  {
    const test::HeldPort ports[3];
    tool_motion = ports[0].endpoint();
    interaction = ports[1].endpoint();
    exchange = ports[2].endpoint();
  }
  press({"--set", "links.tool_motion=" + tool_motion, "--set", "links.interaction=" + interaction,
         "--set", "links.exchange=" + exchange});
  const int page = std::stoi(session_->launch().await_err("event=web url=http://127.0.0.1:"));
  const Session& session = session_->session();
  const LinksConfig& links = session.side().links;
  std::string subscriptions;
  for (int i = 0; i < 4000; ++i) {
    subscriptions += test::zmtp_frame(test::kLastPart, "\x0b" + std::to_string(i));
    subscriptions += test::zmtp_frame(test::kLastPart, "\1topic " + std::to_string(i));
  }
  std::string parts;
  while (parts.size() < (64 << 10)) parts += test::zmtp_frame(test::kMoreParts, "0123456789");

  std::map<std::string, pid_t> nodes;
  std::map<std::string, double> before;
  for (const char* node : {"device", "mofc", "physics", "viewer"}) {
    nodes[node] = session_->node(node);
    test::restart_peak_memory(nodes[node]);
    before[node] = test::peak_memory_mib(nodes[node]);
  }
  const TimePoint from = session_->now();
  std::atomic<int> running{0};
  std::vector<std::jthread> attackers;
  const auto attack = [&](const std::string& endpoint, const char* type, const std::string& frames,
                          std::size_t mib) {
    ++running;
    attackers.emplace_back([&running, endpoint, type, frames, mib] {
      flood(endpoint, type, frames, mib << 20);
      --running;
    });
  };
  for (const std::string& endpoint :
       {links.device_telemetry, links.mofc_telemetry, session.physics_telemetry, interaction}) {
    attack(endpoint, "DEALER", subscriptions, 11);
  }
  attack(tool_motion, "PUSH", parts, 30);
  attack(interaction, "DEALER", parts, 30);
  attack(exchange, "DEALER", parts, 30);
  const FloodOfThePage flood_of_the_page(static_cast<std::uint16_t>(page));
  EXPECT_TRUE(session_->watcher().until([&] { return running == 0; }));
  attackers.clear();
  Flooded flooded{.from = from};
  for (const auto& [node, process] : nodes) {
    const double most = test::peak_memory_mib(process);
    std::printf("%s_node: %.1f MiB before the floods, at most %.1f MiB\n", node.c_str(),
                before[node], most);
    flooded.most_growth_mib = std::max(flooded.most_growth_mib, most - before[node]);
  }
  return flooded;
}

TEST_F(Floods, NeitherSwellANodeNorDisturbTheHand) {
  constexpr unsigned kAttackers = 7;
  const Flooded flooded = flood_every_node();
  if (machine_.may_check("growth of a flooded node")) {
    EXPECT_LT(flooded.most_growth_mib, kMostGrowthMib);
  }
  finish_undisturbed("floods: subscriptions to every node, endless messages, silent pages",
                     flooded.from, "", kAttackers);
}

// --- two devices ----------------------------------------------------------------------------

TEST_F(Faults, AFailedDeviceDoesNotDisturbAnother) {
  press();
  PressingSession other("other");
  ASSERT_TRUE(other.until_pressing()) << other.launch().err();
  ASSERT_TRUE(session_->until_pressing());

  const TimePoint killed_at = stop_with(other.node("device"), SIGKILL);
  EXPECT_GT(other.node("device", 2), 1);

  finish_undisturbed("the device of a session beside it killed", killed_at);
  EXPECT_TRUE(other.until_pressing());
  expect_harmless(other.rows(), other.session());
  EXPECT_EQ(other.stop_and_count_restarts().at("device"), 1);
}

class TwoHands : public Faults, public testing::WithParamInterface<const char*> {};

// The checked rows are those of the first side, the right one. Four tick threads share a processor.
TEST_P(TwoHands, AFailureOnTheLeftDoesNotDisturbTheRight) {
  const std::string victim = std::string("left.") + GetParam();
  session_.emplace("pressing", std::vector<std::string>{"--no-viewer"},
                   std::vector<std::string>{"right", "left"});
  ASSERT_TRUE(session_->until_pressing_while_others_touch()) << session_->launch().err();

  const TimePoint killed_at = stop_with(session_->node(victim), SIGKILL);
  EXPECT_GT(session_->node(victim, 2), 1);
  EXPECT_TRUE(session_->until_pressing(1)) << "the force on the left hand does not return";
  expect_harmless(session_->rows(1), session_->session());
  finish_undisturbed(std::string("two hands: ") + GetParam() + "_node of the other killed",
                     killed_at, victim);
}

INSTANTIATE_TEST_SUITE_P(Faults, TwoHands, testing::Values("device", "mofc"),
                         [](const auto& node) { return std::string(node.param); });

// --- the program ----------------------------------------------------------------------------

/// Prints failures only.
class Quiet : public testing::EmptyTestEventListener {
  void OnTestPartResult(const testing::TestPartResult& result) override {
    if (result.passed()) return;
    std::fprintf(stderr, "%s:%d: %s\n", result.file_name(), result.line_number(), result.message());
  }
};

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  std::string json_file;
  bool may_overwrite = false;
  if (argc >= 3 && std::string(argv[1]) == "--json") {
    json_file = argv[2];
    may_overwrite = argc == 4 && std::string(argv[3]) == "--overwrite";
    argc = 1;
  }
  const bool prints_table = argc == 1;
  testing::InitGoogleMock(&argc, argv);
  if (prints_table) {
    setenv("PALPATE_DEVICE_FAULTS", "1", 0);  // every row
    testing::TestEventListeners& listeners = testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
    listeners.Append(new palpate::Quiet);
  }
  const int status = RUN_ALL_TESTS();
  if (!palpate::table().empty()) palpate::print_table();
  if (json_file.empty()) return status;
  try {
    palpate::write_file("json file", json_file, palpate::json_of_table().dump(2) + "\n",
                        may_overwrite);
    return status;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "palpate_faults: %s\n", error.what());
    return 2;
  }
}
