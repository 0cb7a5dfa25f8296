// SPDX-License-Identifier: Apache-2.0
// A hand presses relaxing tissue faster than the body is solved.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/support/machine/places.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

constexpr double kContact_s = 0.3;  // the tip touches
constexpr double kPressed_s = 0.4;

/// What is requested of the hand, by tick from the touch on.
std::vector<double> pressed_newton(const std::string& path_file, double solve_rate_hz) {
  const Session session = load_session(
      test::source_dir() + "/deploy/sessions/block_with_tumour.txtpb",
      {"hand={ mass_kg: 0.1 stiffness_newton_per_m: 20000 damping_newton_s_per_m: 60 recorded { "
       "file: '" +
           path_file + "' } }",
       "scene.tissue[0].elastic.viscosity_ms=0",
       "scene.tissue[0].elastic.viscoelastic={ branch { share: 0.3 tau_s: 0.05 } branch { share: "
       "0.2 tau_s: 1 } }",
       "scene.tissue[0].elastic.solve_rate_hz=" + std::to_string(solve_rate_hz)});
  std::vector<double> newton;
  Lockstep lockstep(session, {}, [&](const TickRow& row, const IdealState& /*ideal*/) {
    if (row.mofc && row.device.sampled_at >= TimePoint(from_seconds(kContact_s))) {
      newton.push_back(row.mofc->requested_force_on_hand_newton.z());
    }
  });
  lockstep.run_until(from_seconds(kContact_s + kPressed_s));
  return newton;
}

// Between two solutions the branches hardly give way, on either side of hop 3, nor before the first
// touch.
TEST(RelaxingPress, IsAsStiffAtFiftySolutionsASecondAsAtAThousand) {
  struct Press {
    double depth_m, speed_m_per_s, above_m, most_error_ratio;
  };
  for (const Press& press : {Press{3e-3, 0.16, 0.2e-3, 0.07}, Press{5e-3, 0.1, 0.5e-3, 0.05}}) {
    SCOPED_TRACE(press.speed_m_per_s);
    const std::filesystem::path file =
        std::filesystem::path(testing::TempDir()) / "relaxing_press.csv";
    constexpr double kTip_m = 0.006;
    const double begins_s = kContact_s - press.above_m / press.speed_m_per_s;
    const double ends_s = begins_s + (press.depth_m + press.above_m) / press.speed_m_per_s;
    std::ofstream(file) << "t,x,y,z\n0,0.0311,0.0007," << kTip_m + press.above_m << '\n'
                        << begins_s << ",0.0311,0.0007," << kTip_m + press.above_m << '\n'
                        << ends_s << ",0.0311,0.0007," << kTip_m - press.depth_m << '\n';
    const std::vector<double> seldom = pressed_newton(file.string(), 50);
    const std::vector<double> always = pressed_newton(file.string(), 1000);
    ASSERT_EQ(seldom.size(), always.size());
    double error2 = 0.0;
    double sum2 = 0.0;
    for (std::size_t i = 0; i < always.size(); ++i) {
      error2 += std::pow(seldom[i] - always[i], 2);
      sum2 += std::pow(always[i], 2);
    }
    EXPECT_GT(std::sqrt(sum2 / static_cast<double>(always.size())), 0.1);
    EXPECT_LT(std::sqrt(error2 / sum2), press.most_error_ratio);
  }
}

}  // namespace
}  // namespace palpate
