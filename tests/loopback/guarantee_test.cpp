// The guarantee of mode guard over whole runs in lockstep: no physics, network or scheduler gives
// the hand net energy. Measured by the simulated device's true energy, which no controller sees.
// PALPATE_SEEDS=10 in the environment makes ten times as many runs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "common/session/session_file.h"
#include "tests/support/adversity.h"

namespace palpate::test {
namespace {

// Rounding of the inner steps.
constexpr double kRoundingJoule = 1e-6;

constexpr std::uint64_t kShards = 10;
constexpr std::uint64_t kRunsPerShard = 100;

std::uint64_t runs_per_shard() {
  const char* factor = std::getenv("PALPATE_SEEDS");
  return kRunsPerShard * (factor != nullptr ? std::strtoull(factor, nullptr, 10) : 1);
}

class Guarantee : public testing::TestWithParam<std::uint64_t> {};

TEST_P(Guarantee, NoHandWithinVMaxIsGivenEnergyByAnyPhysicsNetworkOrScheduler) {
  std::uint64_t too_fast = 0;
  for (std::uint64_t i = 0; i < runs_per_shard(); ++i) {
    const std::uint64_t seed = 1 + GetParam() + kShards * i;
    const AdverseResult result = run_adverse(random_adverse_run(seed), seed);
    if (result.top_speed_m_per_s > result.v_max_m_per_s) {
      ++too_fast;  // beyond what is promised
      continue;
    }
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
  }
  EXPECT_LE(too_fast, runs_per_shard() / 20);
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
    if (run_adverse(run, seed).statistics.minimum_true_energy_joule() < -1e-3) ++drawn;
  }
  EXPECT_GT(drawn, 50);
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

// A third of 2000 answers is NaN: through the codec none of them gets to the clamp.
TEST(GuaranteeOnTheWire, AForceThatIsNotANumberIsRefusedByTheCodecAndNoEnergyIsDrawn) {
  const AdverseRun run{
      .overrides = {}, .physics = Physics::kNotANumber, .links = LockstepLinks::kInproc};
  const AdverseResult result = run_adverse(run, 1);
  EXPECT_NEAR(static_cast<double>(result.mofc.interaction.rejected), 2000.0 / 3.0, 5.0);
  EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule);
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
    const double requested = row.mofc->asked_force_on_hand_newton.norm();
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
