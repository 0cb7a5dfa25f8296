// SPDX-License-Identifier: Apache-2.0
// A hand presses an organ onto bone that hardly anything else holds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/unit/elastic/touching/touching_scene.h"

namespace palpate {
namespace {

constexpr double kAboveBone_s = 0.2;
constexpr double kOntoBone_s = 0.35;
constexpr double kPressEnds_s = 0.8;

struct HeldOnBone {
  double largest_error = 0.0;          // relative to the ideal force
  double largest_change_newton = 0.0;  // from tick to tick, while it is held
  double ideal_newton = 0.0;
};

class PressOntoBone : public testing::Test {
 protected:
  /// 3 mm deep into a block of 48 × 48 × 12 mm.
  HeldOnBone held(const std::string& stiffness_pa_per_m,
                  const std::vector<std::string>& overrides) {
    const std::string mesh = physics::box_file(folder_, "block", {-0.024, -0.024, -0.012},
                                               {0.024, 0.024, 0.0}, {8, 8, 2});
    const std::string path = (folder_.path() / "path.csv").string();
    std::ofstream(path) << "t,x,y,z\n0,0,0,0.008\n"
                        << kAboveBone_s << ",0,0,0.006\n"
                        << kOntoBone_s << ",0,0,0.003\n"
                        << kPressEnds_s << ",0,0,0.003\n";
    const std::string file = (folder_.path() / "press.txtpb").string();
    std::ofstream(file) << R"(name: "press"
duration_s: 1
device { rate_hz: 1000 simulated { peak_force_newton: 30 } }
hand { stiffness_newton_per_m: 3000 damping_newton_s_per_m: 20 recorded { file: ")"
                        << path << R"(" } }
mofc { controller: mofc mode: guard }
physics { rate_hz: 1000 }
scene {
  tool { tip_radius_m: 0.006 }
  tissue {
    name: "organ"
    tetrahedral_mesh { file: ")"
                        << mesh << R"(" }
    elastic {
      young_pa: 10e3
      poisson_ratio: 0.45
      viscosity_ms: 2
      linear_elements: true
      attached { where { half_space { point_m { z: 1 } } } stiffness_pa_per_m: )"
                        << stiffness_pa_per_m << R"( }
      touches { tissue: "bone" }
    }
  }
  tissue {
    name: "bone"
    half_space { point_m { z: -0.012 } }
    kelvin_voigt { stiffness_newton_per_m: 5000 damping_newton_s_per_m: 5 }
  }
}
)";
    HeldOnBone held;
    double before = 0.0;
    Lockstep lockstep(load_session(file, overrides), {.has_ideal = true},
                      [&](const TickRow& row, const IdealState& /*ideal*/) {
                        const double newton = row.device.force_on_hand_newton.z();
                        if (row.device.sampled_at >= TimePoint(from_seconds(kOntoBone_s + 0.15))) {
                          const double ideal = row.ideal_force_on_hand_newton.z();
                          held.ideal_newton = ideal;
                          held.largest_error =
                              std::max(held.largest_error, std::abs(newton / ideal - 1.0));
                          held.largest_change_newton =
                              std::max(held.largest_change_newton, std::abs(newton - before));
                        }
                        before = newton;
                      });
    lockstep.run_until(from_seconds(kPressEnds_s));
    return held;
  }

  test::TempFolder folder_;
};

// As soft as springs can be: alone it would give way three hundred times as much.
TEST_F(PressOntoBone, OnTheSoftestSpringsIsAsQuietAndAsStiffAsInFullSolutions) {
  for (const char* stiffness_pa_per_m : {"100", "1000"}) {
    SCOPED_TRACE(stiffness_pa_per_m);
    const HeldOnBone one = held(stiffness_pa_per_m, {});
    std::printf("%s Pa/m: %.3f N, error %.2f %%, at most %.2g N from tick to tick\n",
                stiffness_pa_per_m, one.ideal_newton, 1e2 * one.largest_error,
                one.largest_change_newton);
    EXPECT_GT(one.ideal_newton, 0.4);
    EXPECT_LT(one.largest_error, 0.05);
    EXPECT_LT(one.largest_change_newton, 0.01);
  }
}

TEST_F(PressOntoBone, IsQuietWithDelayAndLossToo) {
  std::vector<std::string> network;
  for (const char* link : {"tool_motion", "interaction"}) {
    network.push_back(std::string("faults.") + link + ".delay_ms=20");
    network.push_back(std::string("faults.") + link + ".loss_ratio=0.2");
  }
  const HeldOnBone one = held("100", network);
  std::printf("20 ms and 20 %% loss: %.3f N, error %.2f %%, at most %.2g N from tick to tick\n",
              one.ideal_newton, 1e2 * one.largest_error, one.largest_change_newton);
  EXPECT_LT(one.largest_error, 0.05);
  EXPECT_LT(one.largest_change_newton, 0.02);
}

}  // namespace
}  // namespace palpate
