// SPDX-License-Identifier: Apache-2.0
// Bodies that nobody drew: random shapes with holes and thin places, supports at random, elements
// left out or given twice. A body is refused with a reason, or its force is finite, does not pull,
// gives no energy, and nearly always comes to that of a slow full solution, which in a shallow
// press is that of linear elasticity, assembled and solved here with Eigen alone.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Sparse>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/property/seeds.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/elastic/random_bodies.h"

namespace palpate::physics {
namespace {

/// Stiffness of linear elasticity, with rows only for free nodes.
class LinearBody {
 public:
  explicit LinearBody(const elastic::Body& body) : body_(body) {
    const elastic::Mesh& mesh = body.mesh();
    const elastic::Material& material = body.description().materials.front();
    const double E = material.young_modulus_pa;
    const double nu = material.poisson_ratio;
    const double lambda = E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
    const double mu = E / (2.0 * (1.0 + nu));
    Eigen::Matrix<double, 6, 6> D = Eigen::Matrix<double, 6, 6>::Zero();
    D.topLeftCorner<3, 3>().setConstant(lambda);
    for (int i = 0; i < 3; ++i) D(i, i) += 2.0 * mu;
    for (int i = 3; i < 6; ++i) D(i, i) = mu;
    std::vector<Eigen::Triplet<double>> entries;
    for (std::size_t e = 0; e < mesh.element_count(); ++e) {
      const auto nodes = mesh.element(e);
      Eigen::Matrix4d at;  // the shape functions are the rows of its inverse
      for (Eigen::Index k = 0; k < 4; ++k) {
        at.col(k) << 1.0, mesh.nodes_m[nodes[static_cast<std::size_t>(k)]];
      }
      const double volume_m3 = at.determinant() / 6.0;
      const Eigen::Matrix4d shape = at.inverse();
      Eigen::Matrix<double, 6, 12> B = Eigen::Matrix<double, 6, 12>::Zero();
      for (Eigen::Index k = 0; k < 4; ++k) {
        const double x = shape(k, 1);
        const double y = shape(k, 2);
        const double z = shape(k, 3);
        B.block<6, 3>(0, 3 * k) << x, 0, 0, 0, y, 0, 0, 0, z, y, x, 0, 0, z, y, z, 0, x;
      }
      const Eigen::Matrix<double, 12, 12> K = std::abs(volume_m3) * B.transpose() * D * B;
      for (Eigen::Index i = 0; i < 12; ++i) {
        for (Eigen::Index j = 0; j < 12; ++j) {
          const Eigen::Index row = body.pattern().row_of[nodes[static_cast<std::size_t>(i / 3)]];
          const Eigen::Index column = body.pattern().row_of[nodes[static_cast<std::size_t>(j / 3)]];
          if (row < 0 || column < 0) continue;
          entries.emplace_back(3 * row + i % 3, 3 * column + j % 3, K(i, j));
        }
      }
    }
    const auto size = static_cast<Eigen::Index>(3 * body.pattern().size());
    Eigen::SparseMatrix<double> K(size, size);
    K.setFromTriplets(entries.begin(), entries.end());
    factor_.compute(K);
    load_ = Eigen::VectorXd::Zero(size);
  }

  void press(const elastic::SurfacePoint& point, const Vector3& force_newton) {
    for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
      const Eigen::Index row = body_.pattern().row_of[point.nodes[a]];
      if (row >= 0) load_.segment<3>(3 * row) += point.weights[a] * force_newton;
    }
  }
  void solve() { moved_m_ = factor_.solve(load_); }
  [[nodiscard]] Vector3 moved_m(const elastic::SurfacePoint& point) const {
    Vector3 sum = Vector3::Zero();
    for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
      const Eigen::Index row = body_.pattern().row_of[point.nodes[a]];
      if (row >= 0) sum += point.weights[a] * moved_m_.segment<3>(3 * row);
    }
    return sum;
  }

 private:
  const elastic::Body& body_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
  Eigen::VectorXd load_;
  Eigen::VectorXd moved_m_;
};

/// How far the pressed points of linear elasticity under the forces of a full solution are from the
/// sphere that presses them, as a share of how deep it is; nothing: a fixed place is pressed, which
/// gives way to the penalty.
std::optional<double> error_of_a_shallow_press(const ElasticBody& body, const Place& place) {
  constexpr double kDepth_m = 0.2e-3;
  const FullPress press(body, place, kDepth_m);
  const ElasticSimulation::Touch& touch = press.touch();
  if (touch.forces_on_body_newton.empty()) return std::nullopt;
  LinearBody linear(*body.body);
  for (std::size_t p = 0; p < body.points.size(); ++p) {
    linear.press(body.points[p], touch.forces_on_body_newton[p]);
  }
  linear.solve();
  std::optional<double> largest;
  for (std::size_t p = 0; p < body.points.size(); ++p) {
    const elastic::SurfacePoint& point = body.points[p];
    if (touch.forces_on_body_newton[p].isZero(0.0)) continue;
    if (point.is_held(body.body->pattern())) return std::nullopt;
    const Vector3 at_m = point.position_m(body.start_m.data()) + linear.moved_m(point);
    const double gap_m = (at_m - touch.centre_m).norm() - kTip_m;
    largest = std::max(largest.value_or(0.0), std::abs(gap_m) / kDepth_m);
  }
  return largest;
}

/// Besides the first ones some of those where a fast tip once had, for one solution, only points
/// behind the thin body: 0 N for 5 ms, and up to a third of the work back twice.
std::vector<std::uint64_t> seeds_of_bodies() {
  std::vector<std::uint64_t> all = test::seeds(100);
  for (const std::uint64_t seed : {342U, 400U, 819U, 1263U, 1343U}) {
    if (seed > all.size()) all.push_back(seed);
  }
  return all;
}

TEST(RandomBodies, AreRefusedOrRight) {
  const test::TempFolder folder;
  int refused = 0;
  int pressed = 0;
  int compared = 0;
  int held = 0;
  int beyond = 0;
  const std::vector<std::uint64_t> seeds = seeds_of_bodies();
  for (const std::uint64_t seed : seeds) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    RandomBody random(seed, folder);
    std::vector<std::shared_ptr<const ElasticBody>> bodies;
    try {
      bodies = elastic_bodies_of(random.scene);
    } catch (const SetupError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("body_" + std::to_string(seed) + ".msh"));
      ++refused;
      continue;
    }
    const ElasticBody& body = *bodies.front();
    const Place place = place_on(body, random);
    if (const auto error = error_of_a_shallow_press(body, place)) {
      EXPECT_LT(*error, 0.1);
      ++compared;
    }

    // in a session, deep and fast, and back
    const double speed_m_per_s = random.between(0.03, 0.3);
    const double depth_m = random.between(0.2, 0.6) * kTip_m;
    const Cycle cycle = press_and_leave(bodies.front(), place, depth_m, speed_m_per_s);
    ASSERT_TRUE(cycle.is_finite);
    const FullPress full(body, place, depth_m);
    if (!full.has_failed()) {
      const Vector3& wanted = full.touch().force_on_tool_newton;
      ++held;
      beyond += (cycle.rest_newton - wanted).norm() > 0.1 * wanted.norm() + 1e-3 ? 1 : 0;
    }
    EXPECT_LT(cycle.last_newton.norm(), 0.01 * cycle.most_newton + 1e-6);
    EXPECT_GE(cycle.against_newton, -0.1 * cycle.most_newton);
    EXPECT_GE(cycle.work_joule, -0.02 * cycle.most_newton * depth_m);
    pressed += cycle.most_newton > 0.0 ? 1 : 0;
  }
  const int all = static_cast<int>(seeds.size());
  std::printf(
      "%d bodies: %d refused, %d pressed; %d of %d beyond 10 %% of a slow press, %d compared "
      "with linear elasticity\n",
      all, refused, pressed, beyond, held, compared);
  EXPECT_GT(refused, all / 10);
  EXPECT_GT(compared, all / 5);
  EXPECT_GE(pressed, compared);
  EXPECT_GT(held, pressed / 2);
  // a few have several states of rest, or turn about a thin place
  EXPECT_LE(beyond, held / 40);
}

}  // namespace
}  // namespace palpate::physics
