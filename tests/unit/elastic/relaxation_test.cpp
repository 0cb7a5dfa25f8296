// SPDX-License-Identifier: Apache-2.0
// Branches of a body against the closed forms of a bar.
#include "physics_node/elastic/relaxation.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "common/session/power_law.h"
#include "physics_node/elastic/dynamics.h"

namespace palpate::elastic {
namespace {

constexpr double kLength_m = 0.1;
constexpr double kArea_m2 = 4e-4;
constexpr double kYoung_pa = 10e3;

/// Draws the end of the bar to a place along x, by springs so stiff that they hold it there.
class Clamp final : public Obstacle {
 public:
  Clamp(const Mesh& mesh) {
    for (std::uint32_t i = 0; i < mesh.nodes_m.size(); ++i) {
      if (mesh.nodes_m[i].x() > kLength_m - 1e-9) nodes_.push_back(i);
    }
  }
  double way_m = 0.0;

  double add_gradient(const double* x_m, double* gradient) const override {
    double sum = 0.0;
    for (const std::uint32_t node : nodes_) {
      const double away = x_m[3 * node] - kLength_m - way_m;
      sum += 0.5 * kStiff * away * away;
      gradient[3 * node] += kStiff * away;
    }
    return sum;
  }
  void add_stiffness(const double* /*x_m*/, const BlockPattern& pattern,
                     BlockValues& values) const override {
    for (const std::uint32_t node : nodes_) {
      const auto row = static_cast<std::uint32_t>(pattern.row_of[node]);
      values[9 * std::size_t{pattern.slot(row, row)}] += kStiff;
    }
  }
  /// With which the bar draws.
  [[nodiscard]] double newton(const VectorXd& x_m) const {
    double sum = 0.0;
    for (const std::uint32_t node : nodes_) {
      sum += kStiff * (kLength_m + way_m - x_m[3 * Eigen::Index{node}]);
    }
    return sum;
  }

 private:
  static constexpr double kStiff = 1e4;  // N/m of each; the bar has 40 N/m
  std::vector<std::uint32_t> nodes_;
};

/// A bar along x, held at 0, of next to no mass; ν = 0, so that its stress is the same everywhere.
BodyDescription bar(bool is_quadratic, Law law, std::vector<Branch> branches) {
  const std::array<double, 3> along{0.0, 0.05, kLength_m};
  const std::array<double, 2> across{0.0, 0.02};
  const Mesh linear = box_mesh(along, across, across);
  BodyDescription body{.mesh = is_quadratic ? quadratic(linear) : linear,
                       .materials = {{.young_modulus_pa = kYoung_pa,
                                      .poisson_ratio = 0.0,
                                      .density_kg_per_m3 = 1.0}},
                       .law = law,
                       .fixed_nodes = {},
                       .branches = std::move(branches)};
  body.fixed_nodes = nodes_where(body.mesh, [](const Vector3d& at) { return at.x() < 1e-9; });
  return body;
}

double share_at_rest(const std::vector<Branch>& branches) {
  double rest = 1.0;
  for (const Branch& branch : branches) rest -= branch.share;
  return rest;
}

// Drawn out within h and held: F = F∞ (1 + Σ γ (τ/h) (exp(h/τ) − 1) exp(−t/τ)), γ = share/rest.
TEST(Relaxation, TheForceOfABarThatIsHeldFollowsTheClosedForm) {
  const std::vector<Branch> branches{{0.3, 0.05}, {0.2, 1.0}};
  const double rest = share_at_rest(branches);
  for (const bool is_quadratic : {false, true}) {
    for (const Law law : {Law::kCorotational, Law::kStableNeoHookean}) {
      const Body body(bar(is_quadratic, law, branches));
      Clamp clamp(body.mesh());
      Dynamics dynamics(body, {.theta = 1.0, .tolerance_m = 1e-12});
      clamp.way_m = 1e-4;  // strain 1e-3
      const double at_rest = kYoung_pa * kArea_m2 * clamp.way_m / kLength_m;
      const double h = 0.005;
      double t = h;
      dynamics.step(h, &clamp);
      double worst = 0.0;
      for (int i = 0; i < 200; ++i) {
        double wanted = 1.0;
        for (const Branch& b : branches) {
          wanted += b.share / rest * b.tau_s / h * std::expm1(h / b.tau_s) * std::exp(-t / b.tau_s);
        }
        wanted *= at_rest;
        worst = std::max(worst, std::abs(clamp.newton(dynamics.x_m()) / wanted - 1.0));
        dynamics.step(0.02, &clamp);
        t += 0.02;
      }
      EXPECT_LT(worst, 0.01) << is_quadratic << " " << static_cast<int>(law);
      EXPECT_NEAR(clamp.newton(dynamics.x_m()), at_rest * (1.0 + 0.2 / rest * std::exp(-t)),
                  0.005 * at_rest);
    }
  }
}

/// Complex modulus over E from the force under a sinusoidal way, of the last two of some periods.
std::complex<double> measured_modulus(const std::vector<Branch>& branches, double f, double run_s) {
  constexpr int kSteps = 60;  // of a period
  const Body body(bar(false, Law::kCorotational, branches));
  Clamp clamp(body.mesh());
  Dynamics dynamics(body, {.theta = 1.0, .tolerance_m = 1e-12});
  const int periods = 2 + static_cast<int>(std::ceil(run_s * f));
  const double amplitude_m = 1e-5;
  std::complex<double> sum = 0.0;
  for (int i = 1; i <= periods * kSteps; ++i) {
    const double phase = 2.0 * std::numbers::pi * i / kSteps;
    clamp.way_m = amplitude_m * std::sin(phase);
    dynamics.step(1.0 / (f * kSteps), &clamp);
    if (i <= (periods - 2) * kSteps) continue;
    sum += clamp.newton(dynamics.x_m()) * std::complex<double>(std::sin(phase), std::cos(phase));
  }
  return sum / static_cast<double>(kSteps) / (kYoung_pa * kArea_m2 / kLength_m * amplitude_m);
}

// E' = 1 + Σ γ (ωτ)²/(1 + (ωτ)²), E'' = Σ γ ωτ/(1 + (ωτ)²), over the modulus at rest.
TEST(Relaxation, StorageAndLossModulusAreThoseOfTheClosedForm) {
  const std::vector<Branch> branches{{0.3, 0.05}, {0.2, 0.4}};
  const double rest = share_at_rest(branches);
  for (const double f : {0.3, 1.0, 3.0, 10.0}) {
    std::complex<double> wanted = 1.0;
    for (const Branch& b : branches) {
      const double wt = 2.0 * std::numbers::pi * f * b.tau_s;
      wanted += b.share / rest * std::complex<double>(wt * wt, wt) / (1.0 + wt * wt);
    }
    const std::complex<double> found = measured_modulus(branches, f, 2.5);
    EXPECT_NEAR(found.real() / wanted.real(), 1.0, 0.01) << f;
    EXPECT_NEAR(found.imag() / wanted.imag(), 1.0, 0.01) << f;
  }
}

// A body with the branches of a power law has the complex modulus of the power law.
TEST(Relaxation, ABodyWithAPowerLawHasItsModulus) {
  constexpr double kExponent = 0.15;
  const PowerLawFit fit = fit_power_law(kExponent, 1.0);
  std::vector<Branch> branches;
  for (const auto& branch : fit.branches) branches.push_back({branch.share, branch.tau_s});
  for (const double f : {0.2, 1.0, 7.0}) {
    const std::complex<double> wanted =
        std::polar(std::pow(f, kExponent), 0.5 * std::numbers::pi * kExponent);
    const std::complex<double> found = fit.rest_ratio * measured_modulus(branches, f, 12.0);
    EXPECT_LT(std::abs(found - wanted) / std::abs(wanted), 0.01) << f;
  }
}

// What has crept comes to rest where the springs alone would be, and sleeps.
TEST(Relaxation, ABodyUnderGravityCreepsToTheRestOfItsSprings) {
  BodyDescription description = bar(false, Law::kStableNeoHookean, {{0.5, 0.2}});
  description.gravity_m_per_s2 = {2.0, 0.0, 0.0};
  description.materials[0].density_kg_per_m3 = 1000.0;
  description.materials[0].mass_damping_per_s = 20.0;
  const Body body(description);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd rest = body.rest_m();
  ASSERT_TRUE(find_rest(search, factor, nullptr, {}, rest).is_converged);
  Dynamics dynamics(body, {.theta = 1.0});
  for (int i = 0; i < 600 && !dynamics.is_asleep(); ++i) dynamics.step(0.02);
  EXPECT_TRUE(dynamics.is_asleep());
  EXPECT_LT((dynamics.x_m() - rest).cwiseAbs().maxCoeff(), 1e-5);
}

TEST(Relaxation, RefusesBranchesThatCannotBe) {
  for (const std::vector<Branch>& bad : {std::vector<Branch>{{0.6, 1.0}, {0.4, 1.0}},
                                         {{0.0, 1.0}},
                                         {{-0.1, 1.0}},
                                         {{0.1, 0.0}},
                                         {{std::nan(""), 1.0}},
                                         std::vector<Branch>(9, {0.01, 1.0})}) {
    EXPECT_THROW(Body(bar(false, Law::kCorotational, bad)), std::invalid_argument);
  }
}

}  // namespace
}  // namespace palpate::elastic
