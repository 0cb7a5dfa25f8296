// SPDX-License-Identifier: Apache-2.0
// The guarantee of mode guard over whole runs in lockstep: no physics, network or scheduler gives
// the hand net energy. Measured by the simulated device's true energy, which no controller sees.
// PALPATE_SEEDS=10 in the environment makes ten times as many runs; PALPATE_SEED_OFFSET=N skips N
// of each shard, to divide many runs between machines. Each shard prints the least energy and what
// the monitor reduced.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "tests/property/seeds.h"
#include "tests/support/adversity.h"

namespace palpate::test {
namespace {

// Rounding of the inner steps.
constexpr double kRoundingJoule = 1e-6;

constexpr std::uint64_t kShards = 10;
constexpr std::uint64_t kRunsPerShard = 100;

std::uint64_t runs_per_shard() { return seed_count(kRunsPerShard); }

/// Lying clamps take the same code; a tenth of the runs is enough by default.
std::uint64_t lying_runs_per_shard() { return std::max<std::uint64_t>(10, runs_per_shard() / 10); }

std::uint64_t seed_of(std::uint64_t shard, std::uint64_t i) {
  const char* offset = std::getenv("PALPATE_SEED_OFFSET");
  return 1 + shard + kShards * (i + (offset != nullptr ? std::strtoull(offset, nullptr, 10) : 0));
}

/// Of one shard.
struct Tally {
  std::uint64_t runs = 0;
  std::uint64_t too_fast = 0;  // hand faster than v_max: beyond what is promised
  std::uint64_t reductions = 0;
  double least_joule = 0.0;

  /// False: not to be judged.
  bool add(const AdverseResult& result) {
    ++runs;
    if (result.top_speed_m_per_s > result.v_max_m_per_s) {
      ++too_fast;
      return false;
    }
    reductions += result.device.monitor_reductions;
    least_joule = std::min(least_joule, result.statistics.minimum_true_energy_joule());
    return true;
  }
  void print(const char* what, std::uint64_t shard) const {
    std::printf(
        "%s, shard %llu: %llu runs, %llu with too fast a hand left out, least true energy %.3g µJ, "
        "%llu commands reduced by the monitor\n",
        what, static_cast<unsigned long long>(shard), static_cast<unsigned long long>(runs),
        static_cast<unsigned long long>(too_fast), 1e6 * least_joule,
        static_cast<unsigned long long>(reductions));
  }
};

class Guarantee : public testing::TestWithParam<std::uint64_t> {};

TEST_P(Guarantee, NoHandWithinVMaxIsGivenEnergyByAnyPhysicsNetworkOrScheduler) {
  Tally tally;
  for (std::uint64_t i = 0; i < runs_per_shard(); ++i) {
    const std::uint64_t seed = seed_of(GetParam(), i);
    const AdverseResult result = run_adverse(random_adverse_run(seed), seed);
    if (!tally.add(result)) continue;
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
    EXPECT_EQ(result.device.monitor_reductions, 0U) << "seed=" << seed;
  }
  EXPECT_LE(tally.too_fast, 1 + runs_per_shard() / 20);
  tally.print("honest clamp", GetParam());
}

// In these the monitor's account and the clamp's came apart when each went by its own: they close
// their windows at other readings once one of them ends exactly at its limit, or after a gap. In
// the last one a deadline was rounded up by part of a nanosecond, in which 4 W act.
TEST(GuaranteeOfTheMonitor, NothingOfAnHonestClampIsReducedThoughTheirAccountsDiffer) {
  for (const std::uint64_t seed :
       {494785U, 96861U, 99882U, 753777U, 516551U, 59836U, 629797U, 104161U, 557623U}) {
    const AdverseResult result = run_adverse(random_adverse_run(seed), seed);
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
    EXPECT_EQ(result.device.monitor_reductions, 0U) << "seed=" << seed;
  }
}

TEST_P(Guarantee, NoHandWithinVMaxIsGivenEnergyByAClampThatLies) {
  Tally tally;
  for (std::uint64_t i = 0; i < lying_runs_per_shard(); ++i) {
    const std::uint64_t seed = seed_of(GetParam(), i);
    const AdverseResult result = run_adverse(random_lying_run(seed), seed);
    if (!tally.add(result)) continue;
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
  }
  EXPECT_GT(tally.reductions, 0U);
  tally.print("lying clamp", GetParam());
}

/// A run whose controller is one published by others, another one with each seed; the monitor off.
AdverseRun run_of_others(std::uint64_t seed, bool has_net) {
  constexpr const char* kControllers[] = {"none",           "virtual_coupling",  "energy_bounding",
                                          "force_bounding", "passivity_control", "memory_based",
                                          "input_to_state", "two_port",          "energy_tank",
                                          "lyapunov",       "wave_variables"};
  AdverseRun run = random_adverse_run(seed);
  run.overrides.insert(
      run.overrides.end(),
      {std::string("mofc.controller=") + kControllers[(seed / kShards) % std::size(kControllers)],
       "mofc.interaction=local", "device.monitor=off",
       std::string("mofc.safety_net=") + (has_net ? "true" : "false")});
  return run;
}

TEST_P(Guarantee, NoControllerBehindTheSafetyNetGivesTheHandEnergy) {
  Tally tally;
  const std::uint64_t runs = std::max<std::uint64_t>(12, runs_per_shard() / 10);
  for (std::uint64_t i = 0; i < runs; ++i) {
    const std::uint64_t seed = seed_of(GetParam(), i);
    const AdverseResult result = run_adverse(run_of_others(seed, true), seed);
    if (!tally.add(result)) continue;
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
  }
  tally.print("safety net", GetParam());
}

TEST(GuaranteeTwin, WithoutTheSafetyNetControllersGiveTheHandEnergy) {
  double least_joule = 0.0;
  for (std::uint64_t seed = kShards; seed < kShards * 13; seed += kShards) {
    least_joule = std::min(
        least_joule,
        run_adverse(run_of_others(seed, false), seed).statistics.minimum_true_energy_joule());
  }
  EXPECT_LT(least_joule, -0.01);
}

TEST_P(Guarantee, NoHandWithinVMaxIsGivenEnergyByAModelEstimatedFromAnEngineThatLies) {
  Tally tally;
  for (std::uint64_t i = 0; i < lying_runs_per_shard(); ++i) {
    const std::uint64_t seed = seed_of(GetParam(), i);
    const AdverseResult result = run_adverse(random_black_box_run(seed), seed);
    if (!tally.add(result)) continue;
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
    EXPECT_EQ(result.device.monitor_reductions, 0U) << "seed=" << seed;
  }
  tally.print("lying engine", GetParam());
}

bool has_friction_per_axis(const AdverseRun& run) {
  return std::any_of(run.overrides.begin(), run.overrides.end(), [](const std::string& override) {
    return override.find("per_axis") != std::string::npos;
  });
}

/// Least true energy over the first `seeds` runs as above, of those with this kind of friction,
/// with one more override that removes a protection.
double least_energy_joule(std::uint64_t seeds, bool is_per_axis, const std::string& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    AdverseRun run = random_adverse_run(seed);
    if (has_friction_per_axis(run) != is_per_axis) continue;
    run.overrides.push_back(change);
    least = std::min(least, run_adverse(run, seed).statistics.minimum_true_energy_joule());
  }
  return least;
}

// The law above can fail, and does in the same runs.
TEST(GuaranteeTwin, WithoutTheControllerEnergyIsDrawnInMostRuns) {
  int drawn = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    AdverseRun run = random_adverse_run(seed);
    run.overrides.emplace_back("mofc.controller=none");
    run.overrides.emplace_back("device.monitor=off");
    if (run_adverse(run, seed).statistics.minimum_true_energy_joule() < -1e-3) ++drawn;
  }
  EXPECT_GT(drawn, 50);
}

TEST(GuaranteeTwin, WithoutTheMonitorALyingClampGivesEnergyInMostRuns) {
  int drawn = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    AdverseRun run = random_lying_run(seed);
    run.overrides.emplace_back("device.monitor=off");
    if (run_adverse(run, seed).statistics.minimum_true_energy_joule() < -1e-3) ++drawn;
  }
  EXPECT_GT(drawn, 30);
}

TEST(GuaranteeTwin, WithTheEncoderTreatedAsExactEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(100, false, "device.profile.position_resolution_m=0"), -1e-3);
  EXPECT_LT(least_energy_joule(200, true, "device.profile.position_resolution_m=0"), -1e-4);
}

TEST(GuaranteeTwin, WithFrictionOverestimatedEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(100, false, "device.profile.viscous_newton_s_per_m=0.6"), -1e-3);
  EXPECT_LT(least_energy_joule(100, false, "device.profile.coulomb_newton=0.6"), -1e-3);
  EXPECT_LT(least_energy_joule(200, true,
                               "device.profile.viscous_per_axis_newton_s_per_m="
                               "{ x: 1 y: 1 z: 1 }"),
            -1e-3);
  EXPECT_LT(
      least_energy_joule(200, true, "device.profile.coulomb_per_axis_newton={ x: 1 y: 1 z: 1 }"),
      -1e-3);
}

// The profile claims five times the friction of the device. The same runs without the check lose
// energy.
TEST(HandsOffCheck, LowersAProfileThatClaimsTooMuchFrictionAndNoEnergyIsDrawn) {
  double least_without = 0.0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    AdverseRun run{.overrides = {"device.profile.viscous_newton_s_per_m=0.5",
                                 "device.profile.coulomb_newton=0.5",
                                 "adversary.physics=everything"}};
    least_without =
        std::min(least_without, run_adverse(run, seed).statistics.minimum_true_energy_joule());
    run.overrides.emplace_back("device.hands_off_check=true");
    const AdverseResult checked = run_adverse(run, seed);
    EXPECT_GE(checked.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
    EXPECT_LT(checked.device.checked_friction_ratio, 0.25);
    EXPECT_GT(checked.device.checked_friction_ratio, 0.1);
  }
  EXPECT_LT(least_without, -1e-3);
}

// A third of 2000 answers is NaN: through the codec none of them gets to the clamp.
TEST(GuaranteeOnTheWire, AForceThatIsNotANumberIsRefusedByTheCodecAndNoEnergyIsDrawn) {
  const AdverseRun run{.overrides = {"adversary.physics=not_a_number"},
                       .links = LockstepLinks::kInproc};
  const AdverseResult result = run_adverse(run, 1);
  EXPECT_NEAR(static_cast<double>(result.mofc.interaction.rejected), 2000.0 / 3.0, 5.0);
  EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule);
}

// A hand that goes where the force goes at 2.2 mm/s, which draws most from a nanojoule a command,
// and an exact encoder. Were the rounding granted to every command, a minute would give it 29 µJ.
TEST(GuaranteeOfTheMonitor, ItsRoundingIsSpentOnce) {
  const std::filesystem::path folder = testing::TempDir();
  std::ofstream(folder / "slow.csv") << "t,x,y,z\n0,0,0,0.05\n60,0.132,0,0.05\n";
  const Session session = parse_session(R"(
name: "rounding"
device { profile { position_resolution_m: 0 } simulated { position_resolution_m: 0 } }
hand { stiffness_newton_per_m: 2000 damping_newton_s_per_m: 40 recorded { file: "slow.csv" } }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 500 } } }
adversary { clamp: rounding }
)",
                                        "rounding", {}, folder);
  const RunReport report = run_loopback(session, {.seconds = 60.0, .lockstep = {}});
  EXPECT_GE(report.statistics.minimum_true_energy_joule(), -1e-8);
  EXPECT_GT(report.device.monitor_reductions, 10000U);
}

// A hand goes 8 mm below the surface of a 500 N/m wall in 2 s and stays there: 6 mm deep its spring
// of 1500 N/m balances the wall's 3 N. Friction of 0.1 N and 0.1 N·s/m, an ordinary encoder, 1 kHz.
TEST(LegitimateForce, AStaticPressOf3NewtonKeepsItsForce) {
  const std::filesystem::path folder = testing::TempDir();
  std::ofstream(folder / "static_press.csv") << "t,x,y,z\n0,0,0,0.01\n2,0,0,-0.008\n";
  const Session session = parse_session(R"(
name: "static_press"
device { simulated {} }
hand {
  stiffness_newton_per_m: 1500
  damping_newton_s_per_m: 20
  recorded { file: "static_press.csv" }
}
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 500 } } }
)",
                                        "static_press", {}, folder);
  double least_ratio = 1.0;
  double least_requested_newton = 10.0;
  int ticks = 0;
  Lockstep lockstep(session, {}, [&](const TickRow& row, const IdealState&) {
    if (row.device.sampled_at < TimePoint(std::chrono::seconds(3))) return;
    ASSERT_TRUE(row.mofc.has_value());
    const double requested = row.mofc->requested_force_on_hand_newton.norm();
    least_requested_newton = std::min(least_requested_newton, requested);
    least_ratio = std::min(least_ratio, row.device.force_on_hand_newton.norm() / requested);
    ++ticks;
  });
  lockstep.run_until(std::chrono::seconds(13));

  EXPECT_EQ(ticks, 10000);
  EXPECT_NEAR(least_requested_newton, 3.0, 0.1);  // the 0.1 N of stiction
  EXPECT_GE(least_ratio, 0.99);
}

INSTANTIATE_TEST_SUITE_P(Shard, Guarantee, testing::Range(std::uint64_t{0}, kShards));

}  // namespace
}  // namespace palpate::test
