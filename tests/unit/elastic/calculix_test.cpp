// SPDX-License-Identifier: Apache-2.0
// The same meshes in another program, CalculiX: its laws, elements and search are not ours. Skipped
// where `ccx` is not installed.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/equilibrium.h"
#include "physics_node/elastic/sphere_contact.h"
#include "physics_node/elastic_tissue/unloaded.h"
#include "tests/bench/elastic/elastic_problems.h"
#include "tests/property/seeds.h"
#include "tests/support/temp_folder.h"

namespace palpate::elastic {
namespace {

/// Input of a static analysis with large displacements, for which CalculiX takes *ELASTIC as the
/// St. Venant–Kirchhoff law. SI.
std::string calculix_input(const Body& body, const VectorXd& node_forces_newton) {
  const BodyDescription& given = body.description();
  const Mesh& mesh = given.mesh;
  std::ostringstream text;
  text.precision(12);  // CalculiX reads 20 characters of a number
  text << "*NODE, NSET=ALL\n";
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    const Vector3d& x = mesh.nodes_m[i];
    text << i + 1 << ", " << x.x() << ", " << x.y() << ", " << x.z() << "\n";
  }
  text << "*ELEMENT, ELSET=BODY, TYPE=" << (mesh.nodes_per_element == 4 ? "C3D4" : "C3D10") << "\n";
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    text << e + 1;
    for (const std::uint32_t node : mesh.element(e)) text << ", " << node + 1;
    text << "\n";
  }
  text << "*BOUNDARY\n";
  for (const std::uint32_t node : given.fixed_nodes) text << node + 1 << ", 1, 3\n";
  const Material& material = given.materials[0];
  text << "*MATERIAL, NAME=TISSUE\n*ELASTIC\n"
       << material.young_modulus_pa << ", " << material.poisson_ratio << "\n*DENSITY\n"
       << material.density_kg_per_m3 << "\n*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE\n"
       << "*STEP, NLGEOM, INC=200\n*STATIC\n0.25, 1.0\n"
       // largest residual and correction, relative
       << "*CONTROLS, PARAMETERS=FIELD\n1e-7, 1e-6\n";
  const double gravity = given.gravity_m_per_s2.norm();
  if (gravity > 0.0) {
    const Vector3d down = given.gravity_m_per_s2 / gravity;
    text << "*DLOAD\nBODY, GRAV, " << gravity << ", " << down.x() << ", " << down.y() << ", "
         << down.z() << "\n";
  }
  if (node_forces_newton.size() > 0) {
    text << "*CLOAD\n";
    for (Eigen::Index k = 0; k < node_forces_newton.size(); ++k) {
      if (node_forces_newton[k] == 0.0) continue;
      text << k / 3 + 1 << ", " << k % 3 + 1 << ", " << node_forces_newton[k] << "\n";
    }
  }
  text << "*NODE PRINT, NSET=ALL, FREQUENCY=1000\nU\n*END STEP\n";
  return text.str();
}

class CalculiX : public testing::Test {
 protected:
  void SetUp() override {
    if (test::kIsSanitized) GTEST_SKIP() << "what it compares is compared in the other builds";
    if (std::system("command -v ccx >/dev/null") != 0) {  // NOLINT: a fixed text
      GTEST_SKIP() << "CalculiX is not installed: apt-get install calculix-ccx";
    }
  }

  /// Where the nodes are in CalculiX, as Body::rest_m().
  VectorXd positions_m(const Body& body, const VectorXd& node_forces_newton = {}) {
    folder_.write("body.inp", calculix_input(body, node_forces_newton));
    const std::string command =
        "cd '" + folder_.path().string() + "' && OMP_NUM_THREADS=1 ccx body >log 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << test::text_of(folder_.path() / "log");  // NOLINT
    VectorXd x = body.rest_m();
    std::istringstream lines(test::text_of(folder_.path() / "body.dat"));
    std::size_t found = 0;
    for (std::string line; std::getline(lines, line);) {
      std::istringstream numbers(line);
      Eigen::Index node = 0;
      Vector3d way;
      if (!(numbers >> node >> way.x() >> way.y() >> way.z())) continue;
      if (node < 1 || 3 * node > x.size()) {
        ADD_FAILURE() << "no such node: " << line;
        continue;
      }
      x.segment<3>(3 * node - 3) = body.rest_m().segment<3>(3 * node - 3) + way;
      ++found;
    }
    EXPECT_EQ(found, body.node_count()) << test::text_of(folder_.path() / "log");
    return x;
  }

  TempFolder folder_;
};

double largest_way_m(const Body& body, const VectorXd& x) {
  return (x - body.rest_m()).cwiseAbs().maxCoeff();
}

VectorXd rest_of(const Body& body) {
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  EXPECT_TRUE(find_rest(search, factor, nullptr, {.tolerance_m = 1e-8}, x).is_converged);
  return x;
}

// Linear elements have one strain, and without λ the quadratic ones are those of CalculiX too.
TEST_F(CalculiX, TheHangingBeamIsTheSame) {
  for (const auto& [is_quadratic, nu] : {std::pair{false, 0.45}, {true, 0.0}}) {
    const Mesh linear = beam_mesh(8, 2);
    const Body body(bench::hanging_beam(is_quadratic ? quadratic(linear) : linear,
                                        Law::kStVenantKirchhoff, 100e3, nu));
    const VectorXd x = rest_of(body);
    EXPECT_GT(largest_way_m(body, x), 0.01);
    EXPECT_LT((positions_m(body) - x).cwiseAbs().maxCoeff(), 1e-4 * largest_way_m(body, x))
        << (is_quadratic ? "quadratic" : "linear");
  }
}

// What is found to sag into the shape of a scan does so in CalculiX.
TEST_F(CalculiX, TheUnloadedShapeSagsIntoTheScan) {
  for (const auto& [is_quadratic, nu] : {std::pair{false, 0.45}, {true, 0.0}}) {
    const Mesh linear = beam_mesh(8, 2);
    const BodyDescription scan = bench::hanging_beam(is_quadratic ? quadratic(linear) : linear,
                                                     Law::kStVenantKirchhoff, 100e3, nu);
    const UnloadedShape found = find_unloaded_shape(scan);
    ASSERT_TRUE(found.is_converged);
    BodyDescription unloaded = scan;
    unloaded.mesh = found.mesh;
    const VectorXd given = Body(scan).rest_m();
    const Body body(unloaded);
    EXPECT_GT((body.rest_m() - given).cwiseAbs().maxCoeff(), 0.01);
    // at the corners, where the scan has nodes
    const auto corners = 3 * static_cast<Eigen::Index>(linear.nodes_m.size());
    EXPECT_LT((positions_m(body) - given).head(corners).cwiseAbs().maxCoeff(), 2e-4)
        << (is_quadratic ? "quadratic" : "linear");
  }
}

// Nearly incompressible: the four dilatations of a C3D10 lock a little, one common dilatation does
// not. Reference: 27-node hexahedra, converged, 23.24 mm.
TEST_F(CalculiX, OneDilatationPerElementIsNearerToTheReference) {
  const Body body(
      bench::hanging_beam(quadratic(beam_mesh(8, 2)), Law::kStVenantKirchhoff, 100e3, 0.45));
  const Eigen::Index tip = bench::tip_of(body.mesh());
  const double ours_m = body.rest_m()[tip] - rest_of(body)[tip];
  const double calculix_m = body.rest_m()[tip] - positions_m(body)[tip];
  EXPECT_NEAR(ours_m, 23.24e-3, 0.015 * 23.24e-3);
  EXPECT_NEAR(calculix_m, 23.24e-3, 0.05 * 23.24e-3);
  EXPECT_LT(std::abs(ours_m - 23.24e-3), std::abs(calculix_m - 23.24e-3));
}

// CalculiX under the forces of our contact. There the contact is what it must be: the points that
// press lie on the sphere, the others outside, and each force is normal to the sphere.
TEST_F(CalculiX, TheForcesOfAnIndentationPutTheSurfaceOnTheSphere) {
  constexpr double kSphere_m = 0.04;  // over several elements: this law lets single ones be crushed
  constexpr double kDepth_m = 3e-3;
  const Mesh block =
      box_mesh(equal_planes(0, 0.1, 10), equal_planes(0, 0.1, 10), equal_planes(0, 0.05, 5));
  const Body body(bench::standing_block(block, Law::kStVenantKirchhoff));
  const std::vector<SurfacePoint> points = bench::top_points(body.mesh(), 0.02, 2);
  const Vector3d centre_m(0.05, 0.05, 0.05 + kSphere_m - kDepth_m);
  SphereContact contact(points, 3e7);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  for (const double part : {0.5, 1.0}) {
    contact.set_sphere(centre_m + Vector3d(0, 0, (1 - part) * kDepth_m), kSphere_m);
    for (int round = 0; round < 5; ++round) {
      ASSERT_TRUE(find_rest(search, factor, &contact, {.tolerance_m = 1e-8}, x).is_converged);
      contact.update_multipliers(x.data(), body.pattern());
    }
  }
  const std::vector<Vector3d> forces = contact.forces_on_body_newton();
  VectorXd node_forces = VectorXd::Zero(x.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(points[i].count); ++k) {
      node_forces.segment<3>(3 * Eigen::Index{points[i].nodes[k]}) +=
          points[i].weights[k] * forces[i];
    }
  }

  const VectorXd there = positions_m(body, node_forces);
  EXPECT_LT((there - x).cwiseAbs().maxCoeff(), 2e-3 * kDepth_m);
  int pressing = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3d away = points[i].position_m(there.data()) - centre_m;
    const double gap_m = away.norm() - kSphere_m;
    EXPECT_GT(gap_m, -5e-3 * kDepth_m);
    if (forces[i].isZero(0.0)) continue;
    ++pressing;
    EXPECT_LT(gap_m, 1e-2 * kDepth_m);
    EXPECT_GT(forces[i].dot(away.normalized()), 0.0);
    EXPECT_LT(forces[i].cross(away.normalized()).norm(), 1e-2 * forces[i].norm());
  }
  EXPECT_GT(pressing, 5);
}

}  // namespace
}  // namespace palpate::elastic
