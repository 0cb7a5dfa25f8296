// SPDX-License-Identifier: Apache-2.0
// The example organ of the shipped sessions.
#include "deploy/palpate/organ.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "physics_node/files/ply.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/support/machine/places.h"

namespace palpate {
namespace {

std::string bytes_of(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

const std::string kFolder = test::source_dir() + "/deploy/sessions/";

// To a few ulp of float only: sin and exp may round differently elsewhere.
TEST(Organ, ShippedCloudIsTheGeneratedOne) {
  const physics::PointCloud shipped =
      physics::parse_ply(bytes_of(kFolder + "organ.ply"), "organ.ply", "stiffness_ratio");
  const physics::PointCloud made = organ_cloud(3000);

  ASSERT_EQ(shipped.points_m.size(), made.points_m.size());
  for (std::size_t i = 0; i < made.points_m.size(); ++i) {
    EXPECT_LT((shipped.points_m[i] - made.points_m[i]).norm(), 1e-7);
    EXPECT_LT((shipped.normals[i] - made.normals[i]).norm(), 1e-5);
    EXPECT_NEAR(shipped.stiffness_ratios[i], made.stiffness_ratios[i], 1e-5);
  }
}

TEST(Organ, ShippedMeshIsTheGeneratedOne) {
  const physics::TetrahedralMesh shipped =
      physics::parse_msh(bytes_of(kFolder + "organ.msh"), "organ.msh");
  const physics::TetrahedralMesh made = organ_mesh(2);

  ASSERT_EQ(shipped.nodes_m.size(), made.nodes_m.size());
  ASSERT_EQ(shipped.tetrahedra.size(), 2240U);
  EXPECT_EQ(shipped.tetrahedra, made.tetrahedra);
}

TEST(Organ, ShippedBlockIsTheGeneratedOne) {
  EXPECT_EQ(bytes_of(kFolder + "block.msh"), physics::msh_text(block_mesh(4)));
}

TEST(Organ, ABlockFillsItsPlaceAndIsFinestAroundTheMiddleOfItsTop) {
  for (const std::uint32_t cells : {2U, 4U, 7U}) {
    const physics::TetrahedralMesh block = block_mesh(cells);
    ASSERT_EQ(block.tetrahedra.size(), 20U * cells * cells * cells);
    double volume_m3 = 0.0;
    for (const auto& corners : block.tetrahedra) {
      const double six_m3 = physics::six_volumes_m3(block.nodes_m, corners);
      ASSERT_GT(six_m3, 0.0);
      volume_m3 += six_m3 / 6.0;
    }
    EXPECT_NEAR(volume_m3, 0.1 * 0.1 * 0.05, 1e-12);
    const auto edge_m = [&](const Vector3& there) {
      double least_m = 1.0;
      double edge = 0.0;
      for (const auto& corners : block.tetrahedra) {
        const Vector3 middle = 0.25 * (block.nodes_m[corners[0]] + block.nodes_m[corners[1]] +
                                       block.nodes_m[corners[2]] + block.nodes_m[corners[3]]);
        if ((middle - there).norm() > least_m) continue;
        least_m = (middle - there).norm();
        edge = std::cbrt(physics::six_volumes_m3(block.nodes_m, corners));
      }
      return edge;
    };
    EXPECT_LT(edge_m({0, 0, 0}), edge_m({0.05, 0.05, -0.05}));
  }
}

TEST(Organ, CloudAndMeshAreTheSameBody) {
  const physics::CloudSurface cloud(organ_cloud(3000));
  const physics::TriangleSurface mesh(physics::surface_of(organ_mesh(5)));

  EXPECT_TRUE(mesh.is_closed());
  double largest_m = 0.0;
  for (const Vector3& vertex : mesh.mesh().vertices_m) {
    largest_m = std::max(largest_m, std::abs(cloud.view(vertex).distance_m));
  }
  // points 2.7 mm apart follow a body that is curved by 1/10 mm at its tightest
  EXPECT_LT(largest_m, 0.5e-3);
}

TEST(Organ, HasALumpAlmostThreeTimesAsStiff) {
  const physics::PointCloud cloud = organ_cloud(30000);
  const auto [softest, stiffest] =
      std::minmax_element(cloud.stiffness_ratios.begin(), cloud.stiffness_ratios.end());

  EXPECT_NEAR(*softest, 1.0, 1e-6);
  // at its middle it would be 4, which is 8·√ln(3/1.9) = 5.4 mm below the surface
  EXPECT_NEAR(*stiffest, 2.9, 0.1);
}

}  // namespace
}  // namespace palpate
