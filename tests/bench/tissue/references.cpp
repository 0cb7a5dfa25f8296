// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/tissue/references.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "common/core/check.h"
#include "physics_node/elastic/equilibrium.h"
#include "tests/bench/tissue/tissue_problems.h"

namespace palpate::bench {

using elastic::Body;
using elastic::BodyDescription;
using elastic::EquilibriumSearch;
using elastic::Law;
using elastic::Mesh;
using elastic::Precision;
using elastic::SearchLimits;
using elastic::Vector3d;
using elastic::VectorXd;
using elastic::WarpedFactor;

namespace {

constexpr Law kLaw = Law::kStableNeoHookean;
// Of bodies of a metre that move by centimetres.
constexpr double kTolerance_m = 1e-7;

SearchLimits limits(double tolerance_m) {
  return {.tolerance_m = tolerance_m, .most_iterations = 200, .slow_iterations = 4};
}

struct Solution {
  double value = 0.0;
  std::size_t nodes = 0;
};

void require(const elastic::SearchReport& report, const char* what) {
  if (!report.is_converged) throw SetupError(std::string("reference of ") + what + ": no balance");
}

Solution sag(const BodyDescription& description, double tolerance_m = kTolerance_m) {
  const Body body(description);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  require(find_rest(search, factor, nullptr, limits(tolerance_m), x), "the hanging bar");
  double least_m = 0.0;
  for (const std::uint32_t node : lower_end(body.mesh())) {
    least_m = std::min(least_m, x[3 * Eigen::Index{node} + 2]);
  }
  return {-least_m, body.node_count()};
}

Solution press(const Mesh& mesh, double depth_m, double along_m) {
  const Body body(held_slab(mesh, kLaw));
  elastic::SphereContact contact(top_of_slab(body.mesh(), 3), 100.0 * kYoung_pa / kSphereRadius_m);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  double force = 0.0;
  bool is_settled = false;
  constexpr int kParts = 2;
  constexpr int kMostRounds = 30;
  for (int part = 1; part <= kParts; ++part) {
    contact.set_sphere(sphere_at(depth_m * part / kParts, along_m), kSphereRadius_m);
    is_settled = false;
    for (int round = 0; round < kMostRounds && !is_settled; ++round) {
      // a round may end early: the last ones must agree
      static_cast<void>(find_rest(search, factor, &contact, limits(1e-6), x));
      const double deepest_m = contact.update_multipliers(x.data(), body.pattern());
      const double before = std::exchange(force, contact.force_on_sphere_newton().z());
      is_settled = deepest_m < 5e-3 * depth_m && std::abs(force - before) < 2e-4 * force;
    }
  }
  if (!is_settled) throw SetupError("reference of the pressed slab: the contact does not settle");
  return {force, body.node_count()};
}

Solution torque(const Mesh& mesh, double angle_rad, double tolerance_m = kTolerance_m) {
  const Body body(twisted_bar(mesh, kLaw));
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  double length_m = 0.0;
  for (const Vector3d& node_m : mesh.nodes_m) length_m = std::max(length_m, node_m.z());
  // evenly, which leaves both ends where they are held
  for (std::size_t i = 0; i < body.node_count(); ++i) {
    const Vector3d& at_m = mesh.nodes_m[i];
    x.segment<3>(static_cast<Eigen::Index>(3 * i)) =
        turned(at_m, angle_rad * (1.0 - at_m.z() / length_m));
  }
  require(find_rest(search, factor, nullptr, limits(tolerance_m), x), "the twisted bar");
  VectorXd gradient = VectorXd::Zero(x.size());
  elastic::add_gradient(search.batches(), x.data(), 0.0, gradient.data());
  double sum = 0.0;
  for (const std::uint32_t node : lower_end(mesh)) {
    const Eigen::Index i = 3 * Eigen::Index{node};
    sum +=
        (x[i] - 0.5 * kBarSide_m) * gradient[i + 1] - (x[i + 1] - 0.5 * kBarSide_m) * gradient[i];
  }
  return {sum, body.node_count()};
}

Reference of(const Solution& coarse, const Solution& fine) {
  return {.value = fine.value,
          .changed_ratio = std::abs(fine.value / coarse.value - 1.0),
          .nodes = fine.nodes};
}

struct Cells {
  int across;
  int along;
};

Reference of_bars(const std::function<Solution(const Mesh&)>& solve, Cells coarse, Cells fine) {
  return of(solve(quadratic(bar_mesh(coarse.across, coarse.along))),
            solve(quadratic(bar_mesh(fine.across, fine.along))));
}

// Under the sphere: the contact has a radius of 0.12 m.
constexpr double kFine_m = 0.3;

Mesh pressed_mesh(int cells, double along_m) {
  return quadratic(graded_slab_mesh(cells, cells / 2, cells * 3 / 4, kFine_m, along_m));
}

}  // namespace

Reference References::sag_m() const {
  const auto solve = [](const Mesh& mesh) { return sag(hanging_bar(mesh, kLaw)); };
  return is_coarse_ ? of_bars(solve, {2, 5}, {3, 8}) : of_bars(solve, {6, 16}, {8, 21});
}

Reference References::press_newton() const {
  const auto solve = [](int cells) { return press(pressed_mesh(cells, 0.0), kPress_m, 0.0); };
  return is_coarse_ ? of(solve(2), solve(3)) : of(solve(4), solve(6));
}

Reference References::torque_newton_m() const {
  const auto solve = [](const Mesh& mesh) { return torque(mesh, kTwist_rad); };
  return is_coarse_ ? of_bars(solve, {2, 5}, {3, 8}) : of_bars(solve, {6, 16}, {8, 21});
}

References::Along::Along(bool is_coarse) {
  const int cells = is_coarse ? 2 : 4;
  const auto solve = [&](double along_m) {
    return press(pressed_mesh(cells, along_m), kPress_m, along_m).value;
  };
  const double middle = solve(0.0);
  const double half = solve(0.5 * kSlide_m) / middle - 1.0;
  const double whole = solve(kSlide_m) / middle - 1.0;
  // with s = along/slide: 1 + a s² + b s⁴ through both
  square_ = (16.0 * half - whole) / 3.0;
  fourth_ = whole - square_;
}

double References::Along::at(double along_m) const {
  const double square = along_m * along_m / (kSlide_m * kSlide_m);
  return 1.0 + square_ * square + fourth_ * square * square;
}

std::vector<Check> References::sag_checks() const {
  // Without Poisson's ratio the held end does not hinder anything: the closed form is exact at
  // small strain.
  BodyDescription thin = hanging_bar(quadratic(bar_mesh(2, 5)), kLaw);
  constexpr double kSmall = 1e-3;
  thin.materials[0].poisson_ratio = 0.0;
  thin.gravity_m_per_s2 *= kSmall;
  return {{"bar, ν = 0, g/1000: sag [mm] against ρ g L²/2E", 1e3 * sag(thin, 1e-11).value,
           1e3 * slender_sag_m(kSmall * kGravity_m_per_s2)}};
}

std::vector<Check> References::press_checks() const {
  // the contact has a tenth of the slab's height
  constexpr double kShallow_m = 0.004;
  const int cells = is_coarse_ ? 3 : 5;
  const Mesh mesh = quadratic(graded_slab_mesh(cells, cells, cells, 0.12));
  return {{"sphere, 4 mm: force [N] against Hertz on a layer (Dimitriadis)",
           press(mesh, kShallow_m, 0.0).value, layer_newton(kShallow_m)}};
}

std::vector<Check> References::torque_checks() const {
  // The ends cannot warp, which stiffens them; the difference of two lengths does not know of it.
  constexpr double kAngle_rad = 0.01;
  const int across = is_coarse_ ? 3 : 4;
  const auto compliance = [&](int along, double length_m) {
    return kAngle_rad /
           torque(quadratic(bar_mesh(across, along, length_m)), kAngle_rad, 1e-9).value;
  };
  const int along = is_coarse_ ? 6 : 10;
  const double found =
      kBarLength_m / (compliance(2 * along, 2.0 * kBarLength_m) - compliance(along, kBarLength_m));
  return {
      {"twist, 0.01 rad: torque over twist per length [N m²], from bars of 1.6 and 3.2 m, "
       "against Saint-Venant",
       found, torsion_stiffness_newton_m2()}};
}

}  // namespace palpate::bench
