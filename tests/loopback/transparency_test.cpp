// The rendered force of tissue whose physics runs at 50 Hz, 50 ms away each way, with 20 % of the
// messages lost, behind the clamp: bounds for the figures that transparency_bench prints.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "deploy/lockstep/loopback.h"
#include "tests/bench/tissue_scenes.h"
#include "tests/support/parameter_words.h"

namespace palpate {
namespace {

RunStatistics run(const std::string& tissue, const std::vector<std::string>& overrides) {
  for (const bench::TissueScene& scene : bench::tissue_scenes()) {
    if (scene.name != tissue) continue;
    return run_loopback(bench::session_of(scene, overrides), {.seconds = scene.seconds}).statistics;
  }
  ADD_FAILURE() << tissue;
  return {};
}

std::vector<std::string> far_away(double delay_ms, const std::string& use) {
  const std::string delay = ".delay_ms=" + std::to_string(delay_ms);
  return {"physics.rate_hz=50",
          "faults.tool_motion" + delay,
          "faults.interaction" + delay,
          "faults.tool_motion.loss_ratio=0.2",
          "faults.interaction.loss_ratio=0.2",
          "mofc.interaction=" + use};
}

struct Bound {
  const char* tissue;
  double delay_ms;
  double transparency;
  double force_error;
  double ideal_run_force_error;
  double path_rms_m;
  std::uint64_t excess_reversals;
};
void PrintTo(const Bound& bound, std::ostream* out) {
  *out << bound.tissue << ", " << bound.delay_ms << " ms";
}
const Bound kBounds[] = {
    // nearly a pure damper, seen through a quantised encoder
    {"paper soft", 50, 0.95, 0.15, 0.125, 1e-4, 0},
    {"500 N/m", 50, 0.95, 0.05, 0.05, 1e-4, 0},
    {"2000 N/m", 50, 0.95, 0.05, 0.05, 1e-4, 0},
    {"paper rigid", 50, 0.80, 0.45, 0.45, 2e-4, 1},
    {"stiffening", 100, 0.95, 0.05, 0.05, 1e-4, 0},
    {"sphere 50 mm", 100, 0.95, 0.05, 0.05, 1e-4, 0},
};

class TruthUnderLatency : public testing::TestWithParam<Bound> {};

TEST_P(TruthUnderLatency, TheRenderedForceFollowsTheTissueNotTheNetwork) {
  const Bound& bound = GetParam();
  const RunStatistics local = run(bound.tissue, far_away(bound.delay_ms, "local"));
  EXPECT_GE(local.ideal_transparency(), bound.transparency);
  EXPECT_LE(local.force_error_rms_ratio(), bound.force_error);
  EXPECT_LE(local.ideal_run_force_error_rms_ratio(), bound.ideal_run_force_error);
  EXPECT_LE(local.path_deviation_rms_m(), bound.path_rms_m);
  EXPECT_LE(local.excess_reversals(), bound.excess_reversals);
  EXPECT_GE(local.minimum_true_energy_joule(), -1e-6);
  EXPECT_GT(local.contact_ticks(), 200u);

  // with the force held, transparency is low: the bounds above can fail
  const RunStatistics held = run(bound.tissue, far_away(bound.delay_ms, "held"));
  EXPECT_LT(held.ideal_transparency(), 0.5);
  EXPECT_GE(held.minimum_true_energy_joule(), -1e-6);
}
INSTANTIATE_TEST_SUITE_P(Tissues, TruthUnderLatency, testing::ValuesIn(kBounds),
                         test::parameter_words<Bound>);

// Frozen physics makes it worse: the model becomes too old.
TEST(TruthUnderLatency, FrozenPhysicsLowersTransparency) {
  const RunStatistics live = run("moves, relaxes", far_away(0, "local"));
  std::vector<std::string> overrides = far_away(0, "local");
  overrides.emplace_back("faults.interaction.freeze={from_s: 0.7 until_s: 1000}");
  const RunStatistics frozen = run("moves, relaxes", overrides);

  EXPECT_LT(live.force_error_rms_ratio(), 0.05);
  EXPECT_GT(frozen.force_error_rms_ratio(), 0.5);
}

}  // namespace
}  // namespace palpate
