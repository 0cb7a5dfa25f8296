// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <numeric>
#include <random>

#include "deploy/scan/organ_mesh.h"
#include "deploy/scan/stuffing.h"
#include "physics_node/surfaces/triangle_surface.h"
#include "tests/property/seeds.h"

namespace palpate::scan {
namespace {

OrganMesh meshed(LabelMap& map, const std::vector<std::uint32_t>& segments,
                 const OrganMeshing& meshing) {
  std::vector<Region> regions = keep_largest_part(map, segments);
  return organ_mesh_of(map, std::move(regions), meshing);
}

constexpr double kDegrees = 180.0 / std::numbers::pi;

double volume_m3(const physics::TetrahedralMesh& mesh) {
  double sixfold = 0.0;
  for (const auto& corners : mesh.tetrahedra) {
    const double part = physics::six_volumes_m3(mesh.nodes_m, corners);
    EXPECT_GT(part, 0.0);
    sixfold += part;
  }
  return sixfold / 6.0;
}

/// The volume that the faces enclose is the sum of the elements only if these neither overlap nor
/// leave gaps.
void expect_solid(const physics::TetrahedralMesh& mesh) {
  const physics::TriangleMesh surface = physics::surface_of(mesh);
  ASSERT_EQ(physics::complaint_about(surface), "");
  EXPECT_TRUE(physics::TriangleSurface(surface).is_closed());
  EXPECT_NEAR(physics::enclosed_volume_m3(surface) / volume_m3(mesh), 1.0, 1e-9);
}

/// A lump of about 60 mm, rough where `roughness` > 0.
std::function<double(const Vector3&)> lump(unsigned seed, double roughness) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0.75, 1.25);
  const Vector3 stretch(share(random), share(random), share(random));
  const double waves = 200.0 * share(random);
  return [=](const Vector3& p) {
    return 0.03 - p.cwiseProduct(stretch).norm() *
                      (1.0 + roughness * std::sin(waves * p.x()) * std::sin(waves * p.y() + 1.0) *
                                 std::sin(waves * p.z()));
  };
}

Stuffing stuffing_of(std::function<double(const Vector3&)> inside, int coarsest) {
  return {.bounds = {Vector3::Constant(-0.06), Vector3::Constant(0.06)},
          .cell_m = 0.004,
          .coarsest = coarsest,
          .inside = std::move(inside)};
}

TEST(Stuffing, KeepsTheAnglesOfItsProofOnRoughAndSmoothBodies) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    for (const int coarsest : {0, 3}) {
      const physics::TetrahedralMesh mesh =
          stuffed(stuffing_of(lump(seed, 0.15 * (seed % 3)), coarsest));
      const FaceAngles angles = face_angles_of(mesh);
      EXPECT_GT(kDegrees * angles.least_rad, 10.0) << seed;
      EXPECT_LT(kDegrees * angles.largest_rad, 165.0) << seed;
      EXPECT_GT(mesh.tetrahedra.size(), 5000u);
      std::vector<std::uint32_t> kept;
      expect_solid(one_solid(mesh, kept));
    }
  }
}

TEST(Stuffing, MayBeCoarseInPartsOfTheSurface) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    Stuffing stuffing = stuffing_of(lump(seed, 0.1), 2);
    stuffing.cell_m = 0.002;
    const std::size_t all_fine = stuffed(stuffing).tetrahedra.size();
    stuffing.coarsest_at_surface = [](const Vector3& p) { return p.z() > 0.015 ? 0 : 2; };

    const physics::TetrahedralMesh mesh = stuffed(stuffing);

    EXPECT_LT(mesh.tetrahedra.size(), all_fine / 2);
    const FaceAngles angles = face_angles_of(mesh);
    EXPECT_GT(kDegrees * angles.least_rad, 5.0) << seed;
    std::vector<std::uint32_t> kept;
    expect_solid(one_solid(mesh, kept));
  }
}

// Cubes of up to eight cells at the surface, where angles are the sharpest.
TEST(OpenSlivers, MakesThemBluntAndKeepsTheBody) {
  int opened = 0;
  for (unsigned seed = 1; seed <= (test::kIsSanitized ? 2 : 12); ++seed) {
    Stuffing stuffing = stuffing_of(lump(seed, 0.3), 3);
    stuffing.cell_m = 0.002;
    stuffing.coarsest_at_surface = [](const Vector3& p) { return p.z() > 0.015 ? 0 : 3; };
    std::vector<std::uint32_t> kept;
    physics::TetrahedralMesh mesh = one_solid(stuffed(stuffing), kept);
    const FaceAngles before = face_angles_of(mesh);
    const double before_m3 = volume_m3(mesh);

    open_slivers(mesh);

    const FaceAngles after = face_angles_of(mesh);
    RecordProperty("degrees_" + std::to_string(seed),
                   std::to_string(kDegrees * before.least_rad) + " " +
                       std::to_string(kDegrees * after.least_rad));
    opened += after.least_rad > before.least_rad ? 1 : 0;
    EXPECT_GE(after.least_rad, before.least_rad);
    EXPECT_GT(kDegrees * after.least_rad, 7.3) << seed;
    EXPECT_NEAR(volume_m3(mesh), before_m3, 1e-3 * before_m3);
    expect_solid(mesh);
  }
  EXPECT_GE(opened, test::kIsSanitized ? 0 : 3);
}

TEST(OneSolid, KeepsTheLargestPartAndSeparatesPartsThatMeetInANode) {
  // two tetrahedra with a common face; one at an edge of the first; one at a node; one apart
  physics::TetrahedralMesh mesh;
  mesh.nodes_m = {{0, 0, 0},   {1, 0, 0},    {0, 1, 0},  {0, 0, 1},  {1, 1, 1},
                  {0, -1, -1}, {0, -1, 0.1}, {-3, 0, 0}, {-3, 1, 0}, {-3, 0, 1}};
  mesh.tetrahedra = {{0, 1, 2, 3}, {1, 4, 2, 3}, {0, 1, 6, 5}, {0, 7, 8, 9}};
  for (auto& corners : mesh.tetrahedra) {
    if (physics::six_volumes_m3(mesh.nodes_m, corners) < 0.0) std::swap(corners[0], corners[1]);
  }
  std::vector<std::uint32_t> kept;
  const physics::TetrahedralMesh solid = one_solid(mesh, kept);
  EXPECT_EQ(kept, (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(solid.nodes_m.size(), 5u);
  expect_solid(solid);
}

/// A ball of voxels, off the middle of the grid, with a ball of label 2 inside.
LabelMap ball(double radius_mm, const Vector3& voxel_mm, double lesion_mm,
              const Matrix3& turned = Matrix3::Identity()) {
  LabelMap map;
  const Vector3 centre_mm = Vector3(radius_mm, radius_mm, radius_mm) + Vector3(6.3, 5.8, 6.1);
  for (int i = 0; i < 3; ++i) {
    map.size[static_cast<std::size_t>(i)] =
        static_cast<std::uint32_t>((2.0 * radius_mm + 13.0) / voxel_mm[i]);
  }
  map.ras_of_index_m.linear() = turned * Matrix3((1e-3 * voxel_mm).asDiagonal());
  map.ras_of_index_m.translation() = turned * (-1e-3 * centre_mm);
  map.segments = {{.value = 1, .name = "organ"}, {.value = 2, .name = "lesion"}};
  for (std::uint32_t k = 0; k < map.size[2]; ++k) {
    for (std::uint32_t j = 0; j < map.size[1]; ++j) {
      for (std::uint32_t i = 0; i < map.size[0]; ++i) {
        const Vector3 p = Vector3(i, j, k).cwiseProduct(voxel_mm) - centre_mm;
        const bool is_lesion = (p - Vector3(0, 0, 0.4 * radius_mm)).norm() < lesion_mm;
        map.voxels.push_back(p.norm() >= radius_mm ? 0 : is_lesion ? 2 : 1);
      }
    }
  }
  return map;
}

TEST(SmoothField, OfABallOfVoxelsHasNoStairs) {
  for (const double slice_mm : {2.0, 4.0}) {
    const LabelMap map = ball(40.0, {2, 2, slice_mm}, 0.0);
    const SmoothField field(map, {false, true, true}, {});
    const Eigen::Affine3d index_of_m = map.ras_of_index_m.inverse();
    double sum = 0.0;
    double squares = 0.0;
    constexpr int kPlaces = 4000;
    for (int i = 0; i < kPlaces; ++i) {
      const double z = 1.0 - (2.0 * i + 1.0) / kPlaces;
      const double turn = 2.399963 * i;
      const Vector3 n(std::sqrt(1.0 - z * z) * std::cos(turn),
                      std::sqrt(1.0 - z * z) * std::sin(turn), z);
      double in = 0.030;
      double out = 0.050;
      for (int step = 0; step < 30; ++step) {
        (field.at(index_of_m * Vector3(0.5 * (in + out) * n)) > 0.0 ? in : out) = 0.5 * (in + out);
      }
      sum += in;
      squares += in * in;
    }
    const double mean_m = sum / kPlaces;
    const double deviation_m = std::sqrt(squares / kPlaces - mean_m * mean_m);
    // the voxels themselves deviate by 0.29 of their edge
    EXPECT_LT(deviation_m, 0.06 * 1e-3 * slice_mm);
    RecordProperty("deviation_mm", std::to_string(1e3 * deviation_m));
  }
}

TEST(OrganMesh, HasTheVolumesOfItsVoxels) {
  const Matrix3 turned = Eigen::AngleAxisd(0.5, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  const Matrix3 mirrored = Vector3(-1, 1, 1).asDiagonal();
  for (const Matrix3& frame : {Matrix3(Matrix3::Identity()), turned, mirrored}) {
    for (const double slice_mm : {1.0, 3.0}) {
      if (test::kIsSanitized && slice_mm < 2.0) continue;
      LabelMap map = ball(30.0, {1, 1, slice_mm}, 11.0, frame);

      const OrganMesh organ = meshed(map, {0, 1}, {.tetrahedra = 20'000, .fine = {1}});

      expect_solid(organ.mesh);
      EXPECT_LE(organ.mesh.tetrahedra.size(), 20'000u);
      EXPECT_GT(organ.mesh.tetrahedra.size(), 10'000u);
      EXPECT_GT(kDegrees * organ.angles.least_rad, 5.0);
      for (const Region& region : organ.regions) {
        EXPECT_NEAR(region.mesh_m3 / region.voxels_m3, 1.0, 0.01) << region.segment;
        EXPECT_EQ(region.dropped_voxels, 0u);
      }
      // elements of the lesion lie within a cell of it
      const Vector3 lesion_m = frame * Vector3(0, 0, 0.012);
      for (std::size_t e = 0; e < organ.mesh.tetrahedra.size(); ++e) {
        Vector3 centre_m = Vector3::Zero();
        for (const std::uint32_t corner : organ.mesh.tetrahedra[e])
          centre_m += 0.25 * organ.mesh.nodes_m[corner];
        const double beyond_m = (centre_m - lesion_m).norm() - 0.011;
        EXPECT_LT(organ.mesh.regions[e] == 1 ? beyond_m : -beyond_m, organ.cell_m);
      }
    }
  }
}

// Many elements have their centres at the same distance from a flat boundary along the lattice;
// they cannot only change sides together.
TEST(OrganMesh, HasTheVolumesOfLabelsWithAFlatBoundaryOnACoarseLattice) {
  LabelMap map;
  map.size = {64, 48, 48};
  map.ras_of_index_m.linear() = 1e-3 * Matrix3::Identity();
  map.segments = {{.value = 1, .name = "front"}, {.value = 2, .name = "back"}};
  for (int k = 0; k < 48; ++k) {
    for (int j = 0; j < 48; ++j) {
      for (int i = 0; i < 64; ++i) {
        const Vector3 p((i - 31.4) / 28.0, (j - 23.7) / 20.0, (k - 23.6) / 20.0);
        map.voxels.push_back(p.norm() >= 1.0 ? 0 : k < 19 ? 2 : 1);
      }
    }
  }
  const OrganMesh organ =
      meshed(map, {0, 1}, {.tetrahedra = 3000, .site_m = Vector3(0.0314, 0.0237, 0.0436)});
  EXPECT_GT(organ.cell_m, 0.002);
  for (const Region& region : organ.regions)
    EXPECT_NEAR(region.mesh_m3 / region.voxels_m3, 1.0, 0.005) << region.segment;
}

TEST(OrganMesh, IsTheSameEachTimeAndDropsIslands) {
  LabelMap map = ball(20.0, {1, 1, 1}, 6.0);
  map.voxels[0] = 1;  // a corner of the picture
  LabelMap again = map;

  const OrganMesh first = meshed(map, {0, 1}, {.tetrahedra = 4000});
  const OrganMesh second = meshed(again, {0, 1}, {.tetrahedra = 4000});

  EXPECT_EQ(first.mesh.tetrahedra, second.mesh.tetrahedra);
  EXPECT_EQ(first.mesh.regions, second.mesh.regions);
  EXPECT_TRUE(first.mesh.nodes_m == second.mesh.nodes_m);
  EXPECT_EQ(first.regions[0].dropped_voxels, 1u);
}

TEST(OrganMesh, OfALabelHasASurfaceOfItsOwn) {
  LabelMap map = ball(20.0, {1, 1, 1}, 8.0);
  const OrganMesh organ = meshed(map, {0, 1}, {.tetrahedra = 8000, .fine = {1}});
  const double enclosed_m3 = physics::enclosed_volume_m3(surface_of_region(organ.mesh, 1));
  EXPECT_NEAR(enclosed_m3 / organ.regions[1].mesh_m3, 1.0, 1e-9);
}

TEST(OrganMesh, OfAThinLobeIsSolid) {
  // a plate of 60 × 40 × 4 mm, thicker in its middle, voxels of 1 mm
  LabelMap map;
  map.size = {70, 50, 24};
  map.ras_of_index_m.linear() = 1e-3 * Matrix3::Identity();
  map.segments = {{.value = 1, .name = "lobe"}};
  for (int k = 0; k < 24; ++k) {
    for (int j = 0; j < 50; ++j) {
      for (int i = 0; i < 70; ++i) {
        const double half = 2.0 + 6.0 * std::exp(-(i - 35) * (i - 35) / 200.0);
        map.voxels.push_back(i >= 5 && i < 65 && j >= 5 && j < 45 && std::abs(k - 11.6) < half ? 1
                                                                                               : 0);
      }
    }
  }
  const OrganMesh organ = meshed(map, {0}, {.tetrahedra = 12'000});
  expect_solid(organ.mesh);
  EXPECT_NEAR(organ.regions[0].mesh_m3 / organ.regions[0].voxels_m3, 1.0, 0.01);
  EXPECT_GT(kDegrees * organ.angles.least_rad, 10.0);
}

// Debian's package mricron-data has this atlas of 48 tracts in voxels of 2 mm, all below 2000
// voxels.
TEST(OrganMesh, OfAPublicAtlasIsOneSolid) {
  const char* file = "/usr/share/mricron/templates/JHU-WhiteMatter-labels-2mm.nii.gz";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "needs the package mricron-data";
  LabelMap map = load_label_map(file);
  ASSERT_EQ(map.segments.size(), 48u);
  std::vector<std::uint32_t> all(map.segments.size());
  std::iota(all.begin(), all.end(), 0U);

  const OrganMesh organ = meshed(map, all, {.tetrahedra = 30'000});

  expect_solid(organ.mesh);
  EXPECT_GT(kDegrees * organ.angles.least_rad, 5.0);
  double voxels_m3 = 0.0;
  double mesh_m3 = 0.0;
  for (const Region& region : organ.regions) {
    voxels_m3 += region.voxels_m3;
    mesh_m3 += region.mesh_m3;
  }
  EXPECT_NEAR(mesh_m3 / voxels_m3, 1.0, 0.01);
}

}  // namespace
}  // namespace palpate::scan
