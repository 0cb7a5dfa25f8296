// Rows of palpate_faults with a second physics: what the hand feels when the one that speaks is
// killed, suspended, slow or cut from the network (docs/theory.md §5.1). Real processes.
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tests/fault/pressing_session.h"
#include "tests/support/run_folder.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

constexpr double kUnfeltTransparency = 0.9;
/// From the fault on: longer than silence and fade together.
constexpr Duration kOverTheFault = 600ms;

struct TakeoverRow {
  std::string fault;
  double transparency = 0.0;  ///< rendered over ideal force, projected and capped
  double least_energy_joule = 0.0;
  std::uint64_t term = 0;
};

/// T over the rows from a time on, against the law of the tissue at the true position.
double transparency_over(const std::vector<TickRow>& rows, TimePoint from) {
  double sum = 0.0;
  int count = 0;
  for (const TickRow& row : rows) {
    if (row.device.sampled_at < from || row.device.sampled_at >= from + kOverTheFault) continue;
    const double ideal_newton =
        kPressedTissueNewtonPerM * std::max(0.0, -row.device.true_tool_position_world_m.z());
    if (ideal_newton <= 0.05) continue;
    sum += std::clamp(row.device.force_on_hand_newton.z() / ideal_newton, 0.0, 1.0);
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

class Takeover : public testing::Test {
 protected:
  /// Presses, does the fault and judges. A busy machine may itself interrupt the force: then again.
  /// @param do_fault  gets the session; returns the time of the fault
  TakeoverRow run(const std::string& fault, const std::vector<std::string>& settings,
                  const std::function<TimePoint(PressingSession&)>& do_fault) {
    constexpr int kMostAttempts = 4;
    TakeoverRow row;
    for (int attempt = 1; attempt <= kMostAttempts; ++attempt) {
      std::vector<std::string> arguments{"--no-viewer"};
      for (const std::string& setting : settings) {
        arguments.insert(arguments.end(), {"--set", setting});
      }
      PressingSession session("takeover", arguments);
      if (!session.until_pressing()) continue;
      const TimePoint at = do_fault(session);
      const auto is_over = [&] {
        return !session.rows().empty() &&
               session.rows().back().device.sampled_at >= at + kOverTheFault;
      };
      if (!session.watcher().until(is_over)) continue;
      row = {.fault = fault,
             .transparency = transparency_over(session.rows(), at),
             .term = session.watcher().mirror().mofc_counters().physics_term};
      for (const TickRow& one : session.rows()) {
        row.least_energy_joule =
            std::min(row.least_energy_joule, one.device.minimum_true_energy_joule);
      }
      EXPECT_GE(row.least_energy_joule, -kRoundingJoule) << fault;
      static_cast<void>(session.stop_and_count_restarts());
      if (row.transparency >= kUnfeltTransparency) break;
    }
    std::printf("| %s | T %.3f | least true energy %.1f µJ | term %llu |\n", row.fault.c_str(),
                row.transparency, 1e6 * row.least_energy_joule,
                static_cast<unsigned long long>(row.term));
    return row;
  }

  static constexpr const char* kStandby = "physics.standby={}";
  RunFolder run_folder_;
};

TEST_F(Takeover, AKilledPhysicsIsNotFelt) {
  const TakeoverRow row = run("physics_node killed, with a standby", {kStandby}, [](auto& session) {
    const TimePoint at = session.now();
    kill(session.node("physics"), SIGKILL);
    return at;
  });
  EXPECT_GE(row.transparency, kUnfeltTransparency);
  EXPECT_EQ(row.term, 1u);
}

TEST_F(Takeover, ASuspendedPhysicsIsNotFelt) {
  const TakeoverRow row =
      run("physics_node suspended, with a standby", {kStandby}, [](auto& session) {
        const TimePoint at = session.now();
        kill(session.node("physics"), SIGSTOP);
        return at;
      });
  EXPECT_GE(row.transparency, kUnfeltTransparency);
  EXPECT_EQ(row.term, 1u);
}

TEST_F(Takeover, ASlowPhysicsIsNotFelt) {
  const TakeoverRow row =
      run("physics_node runs 3 ms in 200 ms, with a standby", {kStandby}, [](auto& session) {
        const TimePoint at = session.now();
        const pid_t physics = session.node("physics");
        for (int i = 0; i < 3; ++i) {
          kill(physics, SIGSTOP);
          session.watcher().until([&] { return session.now() >= at + (i + 1) * 200ms; });
          kill(physics, SIGCONT);
          session.watcher().until([&] { return session.now() >= at + (i + 1) * 200ms + 3ms; });
        }
        return at;
      });
  EXPECT_GE(row.transparency, kUnfeltTransparency);
  EXPECT_EQ(row.term, 1u);
}

// The links of the first physics lose everything from 3 s after their start, when the hand presses
// for the second time. The fault began at least 70 ms before the standby spoke.
TEST_F(Takeover, APhysicsThatIsCutFromTheNetworkIsNotFelt) {
  const std::string cut = "{outage { from_s: 3 until_s: 600 }}";
  const TakeoverRow row =
      run("physics_node cut from the network, with a standby",
          {kStandby, "faults.tool_motion=" + cut, "faults.interaction=" + cut}, [](auto& session) {
            const auto is_taken_over = [](const TickRow& one) {
              return one.mofc && one.mofc->is_from_standby;
            };
            const auto find = [&] {
              return std::find_if(session.rows().begin(), session.rows().end(), is_taken_over);
            };
            EXPECT_TRUE(session.watcher().until([&] { return find() != session.rows().end(); }));
            return find() != session.rows().end() ? find()->device.sampled_at - 80ms : TimePoint{};
          });
  EXPECT_GE(row.transparency, kUnfeltTransparency);
  EXPECT_EQ(row.term, 1u);
}

// The same fault without a standby is felt: the bound above can fail.
TEST_F(Takeover, WithoutAStandbyAKilledPhysicsIsFelt) {
  std::optional<TakeoverRow> felt;
  {
    PressingSession session("takeover");
    ASSERT_TRUE(session.until_pressing()) << session.launch().err();
    const TimePoint at = session.now();
    kill(session.node("physics"), SIGKILL);
    ASSERT_TRUE(session.watcher().until([&] {
      return !session.rows().empty() &&
             session.rows().back().device.sampled_at >= at + kOverTheFault;
    }));
    felt = {.fault = "physics_node killed, without",
            .transparency = transparency_over(session.rows(), at)};
    static_cast<void>(session.stop_and_count_restarts());
  }
  std::printf("| %s | T %.3f |\n", felt->fault.c_str(), felt->transparency);
  EXPECT_LT(felt->transparency, kUnfeltTransparency);
}

}  // namespace
}  // namespace palpate::test
