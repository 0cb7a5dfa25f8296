// SPDX-License-Identifier: Apache-2.0
// Rows of palpate_faults with a second physics: what the hand feels when the one that speaks is
// killed, suspended, slow or cut from the network (docs/theory.md §5.1). Real processes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "common/telemetry/summary.h"
#include "tests/fault/pressing_session.h"
#include "tests/support/machine/machine.h"
#include "tests/support/run_folder.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

constexpr double kUnfeltTransparency = 0.9;
/// From the fault on: longer than silence and fade together.
constexpr Duration kOverTheFault = 600ms;

struct FaultOfPhysics {
  const char* name;
  std::vector<std::string> settings;
  /// Returns the time of the fault.
  std::function<TimePoint(PressingSession&)> happen;
};
std::ostream& operator<<(std::ostream& out, const FaultOfPhysics& fault) {
  return out << fault.name;
}

struct Felt {
  double transparency = 0.0;  ///< rendered over ideal force, projected and capped
  double least_energy_joule = 0.0;
  std::uint64_t term = 0;
};

/// T over the rows from a time on, against the law of the tissue at the true position.
double transparency_over(const std::vector<TickRow>& rows, TimePoint from) {
  RunStatistics statistics;
  for (TickRow row : rows) {
    if (row.device.sampled_at < from || row.device.sampled_at >= from + kOverTheFault) continue;
    row.ideal_force_on_hand_newton =
        kPressedTissueNewtonPerM *
        Vector3(0.0, 0.0, std::max(0.0, -row.device.true_tool_position_world_m.z()));
    statistics.add(row, {});
  }
  const double transparency = statistics.ideal_transparency();
  return std::isfinite(transparency) ? transparency : 0.0;
}

class Takeover : public testing::TestWithParam<FaultOfPhysics> {
 protected:
  /// Presses, lets the fault happen and judges.
  static Felt run(const std::vector<std::string>& more_settings) {
    std::vector<std::string> arguments{"--no-viewer"};
    for (const auto* settings : {&GetParam().settings, &more_settings}) {
      for (const std::string& setting : *settings) {
        arguments.insert(arguments.end(), {"--set", setting});
      }
    }
    PressingSession session("takeover", arguments);
    EXPECT_TRUE(session.until_pressing()) << session.launch().err();
    const TimePoint at = GetParam().happen(session);
    const auto is_over = [&] {
      return !session.rows().empty() &&
             session.rows().back().device.sampled_at >= at + kOverTheFault;
    };
    EXPECT_TRUE(session.watcher().until(is_over)) << session.launch().err();
    Felt felt{.transparency = transparency_over(session.rows(), at),
              .term = session.watcher().mirror().mofc_counters().physics_term};
    for (const TickRow& one : session.rows()) {
      felt.least_energy_joule =
          std::min(felt.least_energy_joule, one.device.minimum_true_energy_joule);
    }
    EXPECT_GE(felt.least_energy_joule, -kRoundingJoule);
    static_cast<void>(session.stop_and_count_restarts());
    return felt;
  }

 private:
  RunFolder run_folder_;
};

TEST_P(Takeover, IsNotFeltWithAStandbyAndIsWithout) {
  const QuietMachine machine;
  const Felt with = run({"physics.standby={}"});
  // the tissue is described and rests: it would outlast most of these faults by itself
  const Felt without = run({"mofc.still_after_ms=0"});

  std::printf("| %s | %.3f | %.3f | %.1f µJ |\n", GetParam().name, with.transparency,
              without.transparency,
              1e6 * std::min(with.least_energy_joule, without.least_energy_joule));
  if (!machine.may_check("what is felt of a takeover")) return;
  EXPECT_GE(with.transparency, kUnfeltTransparency);
  EXPECT_EQ(with.term, 1u);
  EXPECT_LT(without.transparency, kUnfeltTransparency) << "the bound above could not fail";
}

TimePoint stop_physics(PressingSession& session, int signal) {
  const TimePoint at = session.now();
  kill(session.node("physics"), signal);
  return at;
}

/// Runs 3 ms in 200 ms.
TimePoint slow_physics_down(PressingSession& session) {
  const TimePoint at = session.now();
  const pid_t physics = session.node("physics");
  for (int i = 0; i < 3; ++i) {
    kill(physics, SIGSTOP);
    session.watcher().until([&] { return session.now() >= at + (i + 1) * 200ms; });
    kill(physics, SIGCONT);
    session.watcher().until([&] { return session.now() >= at + (i + 1) * 200ms + 3ms; });
  }
  return at;
}

/// The links of the first physics lose everything from 3 s after their start, when the hand presses
/// for the second time.
const std::string kOutage = "{outage { from_s: 3 until_s: 600 }}";

/// The outage began at least 70 ms before the standby spoke or the force began to fade.
TimePoint until_cut(PressingSession& session) {
  const auto is_noticed = [](const TickRow& row) {
    return row.mofc && (row.mofc->is_from_standby || row.mofc->state == MofcState::kFading);
  };
  const auto find = [&] {
    return std::find_if(session.rows().begin(), session.rows().end(), is_noticed);
  };
  EXPECT_TRUE(session.watcher().until([&] { return find() != session.rows().end(); }));
  return find() != session.rows().end() ? find()->device.sampled_at - 80ms : TimePoint{};
}

INSTANTIATE_TEST_SUITE_P(
    Faults, Takeover,
    testing::Values(
        FaultOfPhysics{"killed", {}, [](auto& session) { return stop_physics(session, SIGKILL); }},
        FaultOfPhysics{
            "suspended", {}, [](auto& session) { return stop_physics(session, SIGSTOP); }},
        FaultOfPhysics{"slow: runs 3 ms in 200 ms", {}, slow_physics_down},
        FaultOfPhysics{"cut from the network",
                       {"faults.tool_motion=" + kOutage, "faults.interaction=" + kOutage},
                       until_cut}));

}  // namespace
}  // namespace palpate::test
