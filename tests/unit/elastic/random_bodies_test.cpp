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
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/temp_folder.h"

namespace palpate::physics {
namespace {

constexpr double kTip_m = 0.005;
constexpr double kReach_m = 0.05;
constexpr double kTick_s = 1e-3;
constexpr double kStart_s = 0.06;
constexpr double kHold_s = 0.3;

struct RandomBody {
  std::mt19937_64 random;
  std::string file;
  SceneConfig scene;

  RandomBody(std::uint64_t seed, const test::TempFolder& folder) : random(seed) {
    file = (folder.path() / ("body_" + std::to_string(seed) + ".msh")).string();
    std::ofstream(file) << msh_text(mesh());
    ElasticMaterial material{.young_pa = std::pow(10.0, between(3.0, 5.0)),
                             .poisson_ratio = between(0.2, 0.49),
                             .viscosity_s = one_of({0.0, 0.005, 0.02})};
    material.is_linear = true;
    const int supports = static_cast<int>(between(1.0, 3.999));
    for (int i = 0; i < supports; ++i) material.fixed.push_back(support());
    scene = {.tip_radius_m = kTip_m,
             .tissues = {{.name = "body",
                          .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                                   .file = file},
                          .material = material}}};
  }

  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  double one_of(std::initializer_list<double> values) {
    return *(values.begin() +
             static_cast<std::ptrdiff_t>(between(0.0, static_cast<double>(values.size()) - 1e-9)));
  }

 private:
  std::array<double, 3> size_m_{};

  TetrahedralMesh mesh() {
    const double cell_m = between(0.006, 0.012);
    std::array<std::vector<double>, 3> planes;
    for (std::size_t k = 0; k < 3; ++k) {
      const int cells = static_cast<int>(between(1.0, 5.999));
      size_m_[k] = cells * cell_m;
      planes[k] = elastic::equal_planes(-0.5 * size_m_[k], 0.5 * size_m_[k], cells);
    }
    const elastic::Mesh box = elastic::box_mesh(planes[0], planes[1], planes[2]);
    const double shake_m = one_of({0.0, 0.1, 0.15}) * cell_m;
    const double left_out = one_of({0.0, 0.0, 0.1, 0.4});
    const bool is_doubled = one_of({0, 0, 0, 0, 0, 0, 0, 1}) > 0.5;
    std::vector<std::array<std::uint32_t, 4>> elements;
    for (std::size_t e = 0; e < box.element_count(); ++e) {
      if (between(0.0, 1.0) < left_out && e > 0) continue;
      const auto corners = box.element(e);
      elements.push_back({corners[0], corners[1], corners[2], corners[3]});
    }
    if (is_doubled) elements.push_back(elements.front());
    // nodes that no element has any more are left out
    TetrahedralMesh mesh;
    std::map<std::uint32_t, std::uint32_t> kept;
    for (auto& element : elements) {
      for (std::uint32_t& node : element) {
        const auto [at, is_new] =
            kept.try_emplace(node, static_cast<std::uint32_t>(mesh.nodes_m.size()));
        if (is_new) {
          mesh.nodes_m.emplace_back(box.nodes_m[node] + Vector3(between(-shake_m, shake_m),
                                                                between(-shake_m, shake_m),
                                                                between(-shake_m, shake_m)));
        }
        node = at->second;
      }
      mesh.tetrahedra.push_back(element);
    }
    return mesh;
  }

  RegionGeometry support() {
    Vector3 at;
    Vector3 normal;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const double half_m = 0.5 * size_m_[static_cast<std::size_t>(k)];
      at[k] = between(-half_m, half_m);
      normal[k] = between(-1.0, 1.0);
    }
    const double kind = between(0.0, 1.0);
    if (kind < 0.2) return SphereGeometry{.center_m = at, .radius_m = between(0.002, 0.015)};
    if (kind < 0.3) {
      return BoxGeometry{.center_m = at, .size_m = Vector3::Constant(between(0.004, 0.03))};
    }
    // below a side
    const auto axis = static_cast<Eigen::Index>(between(0.0, 2.999));
    normal.setZero();
    normal[axis] = between(0.0, 1.0) < 0.5 ? 1.0 : -1.0;
    return HalfSpaceGeometry{
        .point_m = (between(0.3, 0.499) * size_m_[static_cast<std::size_t>(axis)]) * -normal,
        .normal = normal};
  }
};

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

/// A place of the surface, and the outward normal there.
struct Place {
  Vector3 at_m;
  Vector3 outward;
};

/// Every other time one where nothing is fixed, if there is one.
Place place_on(const ElasticBody& body, RandomBody& random) {
  std::vector<std::array<std::uint32_t, 3>> faces = triangles_of(body);
  const auto is_fixed = [&](const auto& face) {
    return std::any_of(face.begin(), face.end(),
                       [&](std::uint32_t node) { return body.body->pattern().row_of[node] < 0; });
  };
  if (random.between(0.0, 1.0) < 0.5 && !std::all_of(faces.begin(), faces.end(), is_fixed)) {
    std::erase_if(faces, is_fixed);
  }
  const auto& face = faces[static_cast<std::size_t>(
      random.between(0.0, static_cast<double>(faces.size()) - 1e-9))];
  const auto node = [&](std::size_t k) -> Vector3 {
    return body.start_m.segment<3>(3 * Eigen::Index{face[k]});
  };
  return {.at_m = (node(0) + node(1) + node(2)) / 3.0,
          .outward = (node(1) - node(0)).cross(node(2) - node(0)).normalized()};
}

/// The full solution under a tip that comes down there and stays.
class FullPress {
 public:
  FullPress(const ElasticBody& body, const Place& place, double depth_m)
      : simulation_(body, 1, kTip_m, kStep_s) {
    TipSide side;
    const double speed_m = depth_m / 20.0;  // a step
    for (int step = -20; step < 60; ++step) {
      const Vector3 tip_m =
          place.at_m + (kTip_m - std::min(depth_m, speed_m * step)) * place.outward;
      std::array<std::optional<TipState>, 1> tips;
      if (side.follow(body.shape, body.bounds, kTip_m, kReach_m, tip_m, kStep_s * (step + 20))) {
        tips[0] = {.tip_m = tip_m, .place_m = side.place_m()};
      }
      simulation_.step(tips);
    }
  }
  [[nodiscard]] const ElasticSimulation::Touch& touch() const { return simulation_.touch(0); }
  [[nodiscard]] bool has_failed() const { return simulation_.failed_steps() > 0; }

 private:
  static constexpr double kStep_s = 0.02;
  ElasticSimulation simulation_;
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
    ElasticTissues tissues(bodies, 1, kTip_m, ElasticPace::kVirtual);
    const double down_s = kStart_s + (depth_m + 0.004) / speed_m_per_s;
    double most_newton = 0.0;
    double against_newton = 0.0;
    Vector3 rest_newton = Vector3::Zero();  // at the end of the hold
    double work_joule = 0.0;                // by the tip, on the body
    Vector3 last_m = place.at_m;
    Vector3 last_newton = Vector3::Zero();
    for (double time_s = 0.0; time_s < 2.0 * down_s + kHold_s + 0.1; time_s += kTick_s) {
      const double way_s =
          std::max(0.0, time_s < down_s + kHold_s ? std::min(time_s, down_s) - kStart_s
                                                  : 2.0 * down_s + kHold_s - kStart_s - time_s);
      const Vector3 tip_m = place.at_m + (kTip_m + 0.004 - speed_m_per_s * way_s) * place.outward;
      SceneForce sum;
      tissues.step(0, tip_m, time_s, kReach_m, sum);
      const Vector3& newton = sum.force_on_tool_newton;
      ASSERT_TRUE(newton.allFinite()) << time_s;
      if (time_s > 0.0) work_joule -= 0.5 * (newton + last_newton).dot(tip_m - last_m);
      last_m = tip_m;
      last_newton = newton;
      if (time_s < down_s + kHold_s) rest_newton = newton;
      most_newton = std::max(most_newton, newton.norm());
      against_newton = std::min(against_newton, newton.dot(place.outward));
    }
    const FullPress full(body, place, depth_m);
    if (!full.has_failed()) {
      const Vector3& wanted = full.touch().force_on_tool_newton;
      ++held;
      beyond += (rest_newton - wanted).norm() > 0.1 * wanted.norm() + 1e-3 ? 1 : 0;
    }
    EXPECT_LT(last_newton.norm(), 0.01 * most_newton + 1e-6);
    EXPECT_GE(against_newton, -0.1 * most_newton);
    EXPECT_GE(work_joule, -0.02 * most_newton * depth_m);
    pressed += most_newton > 0.0 ? 1 : 0;
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
