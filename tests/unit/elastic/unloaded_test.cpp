// SPDX-License-Identifier: Apache-2.0
// The shape of a body without load, from that in a scan.
#include "physics_node/elastic_tissue/unloaded.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic/dynamics.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/temp_folder.h"

namespace palpate::elastic {
namespace {

BodyDescription standing(const Mesh& linear, Law law, double young_pa, double poisson_ratio) {
  BodyDescription body{.mesh = quadratic(linear),
                       .materials = {{.young_modulus_pa = young_pa,
                                      .poisson_ratio = poisson_ratio,
                                      .mass_damping_per_s = 15.0}},
                       .law = law,
                       .fixed_nodes = {},
                       .gravity_m_per_s2 = {0.0, 0.0, -9.81}};
  body.fixed_nodes = nodes_where(body.mesh, [](const Vector3d& at) { return at.z() < 1e-6; });
  return body;
}

// P = E (F − 1), dP/dX = ρ g: a column of length L stands h = L − ρ g L²/(2E) high, and its point X
// at X − ρ g (L X − X²/2)/E. With h = 0.1 m and E = 5 kPa L = 112.4 mm.
TEST(UnloadedShape, AColumnIsAsLongAsTheClosedForm) {
  const double h = 0.1;
  const double c = 1000.0 * 9.81 / 5e3;
  const double length_m = (1.0 - std::sqrt(1.0 - 2.0 * c * h)) / c;
  const Mesh column =
      box_mesh(equal_planes(0, 0.03, 1), equal_planes(0, 0.03, 1), equal_planes(0, h, 8));

  const UnloadedShape shape = find_unloaded_shape(standing(column, Law::kCorotational, 5e3, 0.0));

  ASSERT_TRUE(shape.is_converged);
  const Mesh given = quadratic(column);
  for (std::size_t i = 0; i < column.nodes_m.size(); ++i) {
    const double X = shape.mesh.nodes_m[i].z();
    EXPECT_NEAR(X - c * (length_m * X - 0.5 * X * X), given.nodes_m[i].z(), 5e-5);
    EXPECT_NEAR(shape.mesh.nodes_m[i].x(), given.nodes_m[i].x(), 1e-5);
  }
}

// A block of soft tissue, let go without load, sags in time into the shape of the scan.
TEST(UnloadedShape, ABlockOfSoftTissueSagsIntoTheShapeOfTheScan) {
  const Mesh block =
      box_mesh(equal_planes(0, 0.15, 8), equal_planes(0, 0.12, 6), equal_planes(0, 0.1, 6));
  for (const double young_pa : {3e3, 5e3}) {
    if (test::kIsSanitized && young_pa < 4e3) continue;
    const BodyDescription loaded = standing(block, Law::kStableNeoHookean, young_pa, 0.45);
    const UnloadedShape shape = find_unloaded_shape(loaded);
    ASSERT_TRUE(shape.is_converged) << young_pa;
    BodyDescription free = loaded;
    free.mesh = shape.mesh;
    free.more_load_newton = shape.more_load_newton;
    const Body body(free);
    Dynamics dynamics(body, {.theta = 1.0});
    for (int i = 0; i < 400 && !dynamics.is_asleep(); ++i) dynamics.step(0.02);
    double away_m = 0.0;
    double moved_m = 0.0;
    for (std::size_t i = 0; i < loaded.mesh.nodes_m.size(); ++i) {
      const Vector3d now = dynamics.x_m().segment<3>(3 * static_cast<Eigen::Index>(i));
      away_m = std::max(away_m, (now - loaded.mesh.nodes_m[i]).norm());
      moved_m = std::max(moved_m, (now - shape.mesh.nodes_m[i]).norm());
    }
    EXPECT_LT(away_m, 2e-4) << young_pa;
    EXPECT_GT(moved_m, 5e-3) << young_pa;
    std::printf(
        "E %g Pa: sags %.1f mm, into the scan within %.3f mm (at rest %.4f mm), %d solutions\n",
        young_pa, 1e3 * moved_m, 1e3 * away_m, 1e3 * shape.away_m, shape.solutions);
  }
}

TEST(UnloadedShape, ABodyThatCannotBearItsWeightHasNone) {
  const Mesh column =
      box_mesh(equal_planes(0, 0.03, 1), equal_planes(0, 0.03, 1), equal_planes(0, 0.1, 8));
  EXPECT_FALSE(find_unloaded_shape(standing(column, Law::kCorotational, 1.5e3, 0.0)).is_converged);
}

/// A session with a block of so many cells a side, 0.12 × 0.12 × 0.1 m, its top at z = 0.
class ScannedBlock {
 public:
  ScannedBlock(const TempFolder& folder, int cells, ElasticMaterial material) {
    const Mesh linear = box_mesh(equal_planes(-0.06, 0.06, cells), equal_planes(-0.06, 0.06, cells),
                                 equal_planes(-0.1, 0.0, cells));
    const std::string file = (folder.path() / ("b" + std::to_string(cells) + ".msh")).string();
    std::ofstream(file) << physics::msh_text(test::tetrahedra_of(linear));
    material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0999}}};
    scene.tip_radius_m = 0.015;
    scene.tissues = {
        {.name = "block",
         .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh, .file = file},
         .material = material}};
  }
  [[nodiscard]] double pressed_newton(const physics::ElasticBody& body) const {
    physics::ElasticSimulation simulation(body, 1, scene.tip_radius_m, 0.02);
    for (int i = 0; i < 120; ++i) {
      const double depth_m = std::min(0.006, 0.0005 * i - 0.002);
      const std::vector<std::optional<physics::TipState>> tips{physics::TipState{
          .tip_m = {0.002, 0.001, 0.015 - depth_m}, .place_m = {0.002, 0.001, 0.015}}};
      simulation.step(tips);
    }
    return simulation.touch(0).force_on_tool_newton.z();
  }
  SceneConfig scene{};
};

TEST(UnloadedShape, InASessionTheBodyStartsWithTheShapeOfTheScanAndAFinerMeshHasItsForce) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "takes minutes with sanitizers";
#endif
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const TempFolder folder;
  const ElasticMaterial material{
      .young_pa = 4e3, .gravity_m_per_s2 = {0, 0, -9.81}, .scan_gravity_m_per_s2 = {0, 0, -9.81}};
  std::vector<double> newton;
  for (const int cells : {8, 12}) {
    const ScannedBlock session(folder, cells, material);
    const auto body = physics::elastic_bodies_of(session.scene).at(0);
    for (const std::uint32_t node : body->surface_nodes) {
      const Vector3d at = body->start_m.segment<3>(3 * Eigen::Index{node});
      // on the box of the scan
      const double outside = std::max({std::abs(at.x()) - 0.06, std::abs(at.y()) - 0.06, at.z()});
      EXPECT_LT(std::abs(outside), at.z() < -0.0999 ? 0.1 : 2e-4);
    }
    EXPECT_LT(body->scan_error_m, 2e-4);
    newton.push_back(session.pressed_newton(*body));
  }
  std::printf("pressed 6 mm: %.4f N, finer %.4f N\n", newton[0], newton[1]);
  EXPECT_NEAR(newton[0], newton[1], 0.1 * newton[1]);
}

// It would be the shape of the scan, on a ridge from which the body buckles.
TEST(UnloadedShape, OneThatIsNotStableIsRefused) {
  const TempFolder folder;
  const ScannedBlock session(folder, 3,
                             {.young_pa = 2000.0,
                              .gravity_m_per_s2 = {0, 0, -9.81},
                              .scan_gravity_m_per_s2 = {0, 0, -9.81}});
  try {
    (void)physics::elastic_bodies_of(session.scene);
    FAIL();
  } catch (const SetupError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find(physics::kNoUnloadedShape), std::string::npos);
    EXPECT_NE(text.find("not stable"), std::string::npos) << text;
  }
}

TEST(UnloadedShape, ASessionWhoseBodyIsTooSoftIsRefusedWithWhatToDo) {
  const TempFolder folder;
  const ScannedBlock session(folder, 3,
                             {.young_pa = 100.0,
                              .gravity_m_per_s2 = {0, 0, -9.81},
                              .scan_gravity_m_per_s2 = {0, 0, -9.81}});
  try {
    static_cast<void>(physics::elastic_bodies_of(session.scene));
    FAIL() << "was accepted";
  } catch (const SetupError& error) {
    EXPECT_NE(std::string(error.what()).find(physics::kNoUnloadedShape), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace palpate::elastic
