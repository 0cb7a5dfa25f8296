// SPDX-License-Identifier: Apache-2.0
// The rendered force of tissue whose physics runs at 50 Hz, 50 ms away each way, with 20 % of the
// messages lost, behind the clamp: bounds for the figures that transparency_bench prints.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <optional>
#include <string>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/tissue_scenes.h"
#include "tests/support/machine/places.h"
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

/// The figures that count every tick once, for comparison: with what acted from its switch on
/// against the ideal force at its reading.
class TickMeans {
 public:
  void add(const TickRow& row) {
    const Vector3& fi = row.ideal_force_on_hand_newton;
    const Vector3& fs = row.device.force_on_hand_newton;
    if (std::max(fi.norm(), fs.norm()) <= kForceFloorNewton) return;
    if (!fi.isZero(0.0)) sum_ += std::clamp(fs.dot(fi) / fi.squaredNorm(), 0.0, 1.0);
    ++ticks_;
  }
  [[nodiscard]] double transparency() const { return sum_ / ticks_; }

 private:
  double sum_ = 0.0;
  double ticks_ = 0.0;
};

// Ticks from 0 to 10 ms of every 20 ms, then a hole; leases of 2 ms at most. So a force acts for
// at most 12 of 20 ms, however good the ticks are.
TEST(IntegratedFigures, AHoleIsChargedForAsLongAsItLasts) {
  const std::filesystem::path folder = testing::TempDir();
  std::ofstream(folder / "held.csv") << "t,x,y,z\n0,0,0,0.002\n0.2,0,0,-0.006\n";
  const Session session = parse_session(R"(
name: "press"
device { simulated {} lease_us: 2000 longest_lease_us: 2000 monitor: off }
hand { stiffness_newton_per_m: 1500 damping_newton_s_per_m: 20 recorded { file: "held.csv" } }
mofc { controller: none }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } } }
faults { device { skip { from_s: 0.0101 until_s: 0.0199 every_s: 0.02 } } }
)",
                                        "press", {}, folder);
  RunStatistics statistics;
  TickMeans ticks;
  double acted_s = 0.0;
  double whole_s = 0.0;
  Lockstep lockstep(session, {.has_ideal = true}, [&](const TickRow& row, const IdealState& ideal) {
    if (row.device.sampled_at < TimePoint(from_seconds(0.5))) return;
    statistics.add(row, ideal);
    ticks.add(row);
    for (std::uint32_t i = 0; i < row.device.acted_count; ++i) {
      const AppliedForce& acted = row.device.acted[i];
      const double s = to_seconds(acted.until - acted.from);
      whole_s += s;
      if (!acted.force_on_hand_newton.isZero(0.0)) acted_s += s;
    }
  });
  lockstep.run_until(from_seconds(1.5));

  EXPECT_NEAR(whole_s, 1.0, 0.02) << "what acted is known throughout";
  EXPECT_LE(acted_s / whole_s, 12.0 / 20.0 + 0.01);
  EXPECT_LE(statistics.ideal_transparency(), acted_s / whole_s + 1e-6);
  EXPECT_LE(statistics.vector_transparency(), acted_s / whole_s + 1e-6);
  EXPECT_GE(statistics.beyond_jnd_ratio(), 1.0 - acted_s / whole_s - 1e-6);
  EXPECT_GE(ticks.transparency(), statistics.ideal_transparency() + 0.1);
}

// A damper of 20 N·s/m, the hand led at 2 Hz and 5 mm by a stiff hand, the device at 100 Hz without
// clamp: the force of a reading acts for 10 ms while the tissue's goes on. Judged by the path that
// the hand was led along, and by the forces in the rows, at every 10 µs.
TEST(IntegratedFigures, AHeldForceIsComparedWithTheTissueAsItGoesOn) {
  const double omega = 2.0 * std::numbers::pi * 2.0;
  const double amplitude_m = 0.005;
  const double damping = 20.0;
  const Session session = parse_session(R"(
name: "damper"
device { rate_hz: 100 simulated { mass_kg: 0.05 position_resolution_m: 0 } monitor: off }
hand { mass_kg: 0.01 stiffness_newton_per_m: 100000 damping_newton_s_per_m: 200
       sinusoid { center_m { z: -0.02 } amplitude_m { z: 0.005 } frequency_hz { z: 2 } } }
mofc { controller: none }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 0 damping_newton_s_per_m: 20 } } }
)",
                                        "damper", {}, testing::TempDir());
  RunStatistics statistics;
  TickMeans ticks;
  double along = 0.0;
  double reference = 0.0;
  double capped_s = 0.0;
  double judged_s = 0.0;
  std::optional<TickRow> before;
  Lockstep lockstep(session, {.has_ideal = true}, [&](const TickRow& row, const IdealState& ideal) {
    statistics.add(row, ideal);
    ticks.add(row);
    const double fs = before ? before->device.force_on_hand_newton.z() : 0.0;
    for (int i = 0; before && i < 1000; ++i) {
      const double t_s = to_seconds(before->device.sampled_at - TimePoint{}) + (i + 0.5) * 1e-5;
      const double speed = amplitude_m * omega * std::cos(omega * t_s);
      const double fi = std::max(0.0, -damping * speed);
      if (std::max(fi, fs) <= kForceFloorNewton) continue;
      along += fs * fi;
      reference += fi * fi;
      capped_s += fi > 0.0 ? std::clamp(fs / fi, 0.0, 1.0) : 0.0;
      judged_s += 1.0;
    }
    before = row;
  });
  lockstep.run_until(from_seconds(2.0));

  EXPECT_NEAR(statistics.ideal_transparency(), capped_s / judged_s, 0.003);
  EXPECT_NEAR(statistics.gain(), along / reference, 0.003);
  EXPECT_GE(ticks.transparency(), statistics.ideal_transparency() + 0.01);
}

// --- devices that are slow or coarse
// --------------------------------------------------------------

struct Poor {
  const char* name;
  const char* session;
  std::vector<std::string> overrides;
  double transparency;
  std::uint64_t excess_reversals;
};
void PrintTo(const Poor& poor, std::ostream* out) { *out << poor.name; }

const std::vector<std::string> kCoarse{"device.simulated.position_resolution_m=3e-4",
                                       "device.profile.position_resolution_m=3e-4"};

class PoorDevices : public testing::TestWithParam<Poor> {};

TEST_P(PoorDevices, RenderWhatTheirCreditCovers) {
  const Poor& poor = GetParam();
  const Session session = load_session(
      std::filesystem::path(test::source_dir()) / "deploy/sessions" / poor.session, poor.overrides);
  const RunStatistics run = run_loopback(session, {.seconds = 10.0}).statistics;
  EXPECT_GE(run.ideal_transparency(), poor.transparency);
  EXPECT_LE(run.excess_reversals(), poor.excess_reversals);
  EXPECT_GE(run.minimum_true_energy_joule(), -1e-6);
}

INSTANTIATE_TEST_SUITE_P(
    Device, PoorDevices,
    testing::Values(Poor{"coarse", "default.txtpb", kCoarse, 0.98, 0},
                    Poor{"at_50_hz", "default.txtpb", {"device.rate_hz=50"}, 0.6, 2},
                    Poor{"at_50_hz_liver", "liver.txtpb", {"device.rate_hz=50"}, 0.6, 2},
                    Poor{"at_50_hz_cloud", "cloud.txtpb", {"device.rate_hz=50"}, 0.6, 2}),
    [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace palpate
