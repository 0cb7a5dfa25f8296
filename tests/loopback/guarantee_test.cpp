// The guarantee of mode guard over whole runs in lockstep: whatever physics, network and scheduler
// do, the hand is never given net energy. Judged by the simulated device's true energy, which no
// controller sees. PALPATE_SEEDS=10 in the environment makes ten times as many runs.
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>

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

INSTANTIATE_TEST_SUITE_P(Shard, Guarantee, testing::Range(std::uint64_t{0}, kShards));

}  // namespace
}  // namespace palpate::test
