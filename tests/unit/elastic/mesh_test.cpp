// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/mesh.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

namespace palpate::elastic {
namespace {

TEST(ElasticMesh, BenchmarkMeshesHaveTheSizesOfTheProblem) {
  const auto expect = [](const Mesh& mesh, std::size_t nodes, std::size_t elements, double m3) {
    const MeshQuality quality = quality_of(mesh);
    EXPECT_EQ(quality.nodes, nodes);
    EXPECT_EQ(quality.elements, elements);
    EXPECT_NEAR(quality.volume_m3, m3, 1e-12);
    EXPECT_TRUE(quality.is_usable());
  };
  expect(beam_mesh(8, 2), 81, 160, 0.1 * 0.025 * 0.025);
  expect(beam_mesh(16, 4), 425, 1280, 0.1 * 0.025 * 0.025);
  expect(beam_mesh(32, 8), 2673, 10240, 0.1 * 0.025 * 0.025);
  expect(beam_mesh(56, 14), 12825, 54880, 0.1 * 0.025 * 0.025);
  expect(block_mesh(4, 6, 2.5e-3), 567, 1920, 0.1 * 0.1 * 0.05);
  expect(block_mesh(8, 10, 1.25e-3), 3179, 12800, 0.1 * 0.1 * 0.05);
}

TEST(ElasticMesh, ElementsOfARefinedMeshShareTheNodesOfTheirEdges) {
  const Mesh linear = beam_mesh(8, 2);
  const Mesh fine = quadratic(linear);
  // Points of the halved grid, 17 · 5 · 5, but for the middles of the 32 cells: the cut of a cell
  // in five has edges along its own and one diagonal of each face.
  EXPECT_EQ(fine.nodes_m.size(), 17U * 5 * 5 - 32);
  ASSERT_EQ(fine.element_count(), linear.element_count());
  for (std::size_t e = 0; e < fine.element_count(); ++e) {
    const auto nodes = fine.element(e);
    for (std::size_t k = 0; k < 6; ++k) {
      const Vector3d middle = 0.5 * (fine.nodes_m[nodes[static_cast<std::size_t>(kEdges[k][0])]] +
                                     fine.nodes_m[nodes[static_cast<std::size_t>(kEdges[k][1])]]);
      EXPECT_LT((fine.nodes_m[nodes[4 + k]] - middle).norm(), 1e-15);
    }
  }
}

TEST(ElasticMesh, TheSurfaceIsClosedFacesOutwardsAndHasTheAreaOfTheBox) {
  for (const bool is_quadratic : {false, true}) {
    const Mesh linear = beam_mesh(8, 2);
    const Mesh mesh = is_quadratic ? quadratic(linear) : linear;
    Vector3d sum = Vector3d::Zero();
    double area = 0.0;
    double volume = 0.0;
    for (const Face& face : surface_of(mesh)) {
      const Vector3d& a = mesh.nodes_m[face.nodes[0]];
      const Vector3d& b = mesh.nodes_m[face.nodes[1]];
      const Vector3d& c = mesh.nodes_m[face.nodes[2]];
      const Vector3d normal = 0.5 * (b - a).cross(c - a);
      sum += normal;
      area += normal.norm();
      volume += a.dot(normal) / 3.0;
      if (!is_quadratic) continue;
      EXPECT_LT((mesh.nodes_m[face.nodes[3]] - 0.5 * (a + b)).norm(), 1e-15);
      EXPECT_LT((mesh.nodes_m[face.nodes[4]] - 0.5 * (b + c)).norm(), 1e-15);
      EXPECT_LT((mesh.nodes_m[face.nodes[5]] - 0.5 * (c + a)).norm(), 1e-15);
    }
    EXPECT_LT(sum.norm(), 1e-15);
    EXPECT_NEAR(area, 4 * 0.1 * 0.025 + 2 * 0.025 * 0.025, 1e-12);
    EXPECT_NEAR(volume, 0.1 * 0.025 * 0.025, 1e-12);
  }
}

TEST(ElasticMesh, QualityIsOneForTheRegularTetrahedronAndFallsToZero) {
  Mesh mesh;
  mesh.nodes_m = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  mesh.elements = {0, 1, 3, 2};
  const double shape = element_quality(mesh, 0);
  EXPECT_NEAR(std::abs(shape), 1.0, 1e-12);
  if (shape < 0.0) std::swap(mesh.elements[1], mesh.elements[2]);
  EXPECT_TRUE(quality_of(mesh).is_usable());

  // corner 3 into the plane of the others: a sliver, then flat, then inverted
  const Vector3d middle = (mesh.nodes_m[0] + mesh.nodes_m[1] + mesh.nodes_m[3]) / 3.0;
  const Vector3d apex = mesh.nodes_m[2];
  mesh.nodes_m[2] = middle + 0.02 * (apex - middle);
  EXPECT_EQ(quality_of(mesh).slivers, 1U);
  mesh.nodes_m[2] = middle - 0.02 * (apex - middle);
  EXPECT_EQ(quality_of(mesh).inverted, 1U);
  EXPECT_FALSE(quality_of(mesh).is_usable());
}

TEST(ElasticMesh, ReportsUnusedNodesAndADoubtfulScale) {
  Mesh mesh = beam_mesh(8, 2);
  EXPECT_FALSE(quality_of(mesh).is_scale_doubtful());
  for (Vector3d& node : mesh.nodes_m) node *= 1000.0;  // millimetres taken for metres
  EXPECT_TRUE(quality_of(mesh).is_scale_doubtful());
  mesh.nodes_m.emplace_back(0, 0, 0);
  EXPECT_EQ(quality_of(mesh).unused_nodes, 1U);
  EXPECT_FALSE(quality_of(mesh).is_usable());
}

}  // namespace
}  // namespace palpate::elastic
