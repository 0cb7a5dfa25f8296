// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/tissue_scenes.h"

#include <cmath>
#include <numbers>

#include "common/session/session_file.h"

namespace palpate::bench {
namespace {

constexpr double kSampleS = 0.002;

/// A path through points at given times, in straight lines.
RecordedPath through(std::vector<RecordedPath::Sample> samples) {
  RecordedPath path;
  path.samples = std::move(samples);
  return path;
}

/// Down onto a sphere of 50 mm radius round the origin, 35° to and fro over its top at 80 mm/s, 4
/// mm below its surface, and off again.
RecordedPath over_the_sphere() {
  constexpr double kRadius = 0.046;
  constexpr double kSpeed = 0.08;
  constexpr double kHalfAngle = 35.0 * std::numbers::pi / 180.0;
  const auto at = [](double r, double angle) {
    return Vector3(r * std::sin(angle), 0.0, r * std::cos(angle));
  };
  const double slide_s = 2.0 * kHalfAngle * kRadius / kSpeed;
  std::vector<RecordedPath::Sample> samples{{0.0, at(0.06, -kHalfAngle)},
                                            {0.2, at(0.06, -kHalfAngle)}};
  double t_s = 0.5;
  for (const double direction : {1.0, -1.0}) {
    const int steps = static_cast<int>(slide_s / kSampleS);
    for (int i = 0; i <= steps; ++i) {
      const double angle = direction * kHalfAngle * (2.0 * i / steps - 1.0);
      samples.push_back({t_s + slide_s * i / steps, at(kRadius, angle)});
    }
    t_s += slide_s + 0.1;
  }
  samples.push_back({t_s + 0.3, at(0.06, -kHalfAngle)});
  return through(samples);
}

/// Down to 6 mm, 60 mm along x at 80 mm/s over the edge at x = 0, back, and off.
RecordedPath over_the_edge() {
  const double z = -0.006;
  return through({{0.0, {-0.03, 0, 0.01}},
                  {0.2, {-0.03, 0, 0.01}},
                  {0.5, {-0.03, 0, z}},
                  {1.25, {0.03, 0, z}},
                  {1.35, {0.03, 0, z}},
                  {2.10, {-0.03, 0, z}},
                  {2.4, {-0.03, 0, 0.01}}});
}

/// Pressed to 15 mm within 0.3 s and held for two breaths, then off.
RecordedPath press() {
  return through({{0.0, {0, 0, 0.01}},
                  {0.2, {0, 0, 0.01}},
                  {0.5, {0, 0, -0.015}},
                  {4.5, {0, 0, -0.015}},
                  {4.8, {0, 0, 0.01}}});
}

VPath v_path() {
  VPath v;
  v.tangent = Vector3(1.0, 0.5, 0.0).normalized();
  return v;
}

}  // namespace

std::vector<TissueScene> tissue_scenes() {
  return {
      {"paper soft",
       "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 6 "
       "damping_newton_s_per_m: 15 isotropic_damping: true adhesive: true } }",
       v_path(), 3.0},
      {"paper rigid",
       "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 45 "
       "damping_newton_s_per_m: 150 isotropic_damping: true adhesive: true } }",
       v_path(), 3.0},
      {"500 N/m", "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 500 } }", v_path(),
       3.0},
      {"2000 N/m", "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 2000 } }",
       v_path(), 3.0},
      {"stiffening",
       "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 100 "
       "damping_newton_s_per_m: 2 stiffening_newton_per_m3: 1e7 } }",
       v_path(), 3.0},
      {"sphere 50 mm",
       "tissue { sphere { radius_m: 0.05 } kelvin_voigt { stiffness_newton_per_m: 500 "
       "damping_newton_s_per_m: 2 } }",
       over_the_sphere(), 3.0},
      {"soft/stiff edge",
       "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 "
       "damping_newton_s_per_m: 2 inclusion { center_m { x: 0.04 } radius_m: 0.04 "
       "transition_m: 0.004 stiffness_newton_per_m: 1000 damping_newton_s_per_m: 2 } } }",
       over_the_edge(), 3.0},
      {"moves, relaxes",
       "tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 150 "
       "damping_newton_s_per_m: 2 relaxing_stiffness_newton_per_m: 300 relaxation_time_ms: 200 } "
       "motion { amplitude_m { z: 0.003 } frequency_hz: 0.5 } }",
       press(), 5.5},
  };
}

Session session_of(const TissueScene& scene, const std::vector<std::string>& overrides) {
  const std::string text =
      "name: \"bench\" device { simulated {} } scene { " + std::string(scene.scene) + " }";
  Session session = parse_session(text, scene.name, overrides);
  session.name = scene.name;
  session.side().hand.path = scene.path;
  return session;
}

}  // namespace palpate::bench
