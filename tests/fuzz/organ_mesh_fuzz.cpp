// SPDX-License-Identifier: Apache-2.0
// organ_mesh_fuzz.cpp — any small label map, with cells of any size, as a mesh: one solid whose
// elements are not inverted and have a region each, or a SetupError. Bytes: labels, sizes, shape of
// the voxels, what is fine, then a voxel each.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "deploy/scan/organ_mesh.h"

namespace {

using namespace palpate;

constexpr std::size_t kHead = 12;

/// The edges of the voxels are at most 30 times as long as wide, as check_grid() has it.
scan::LabelMap map_of(const std::uint8_t* data, std::size_t size) {
  scan::LabelMap map;
  for (std::size_t a = 0; a < 3; ++a) {
    map.size[a] = 1U + data[a] % 9U;
    const auto axis = static_cast<Eigen::Index>(a);
    map.ras_of_index_m.linear()(axis, axis) = 1e-3 * (1.0 + 0.1 * data[3 + a]);
  }
  // oblique, sheared and mirrored
  map.ras_of_index_m.linear()(0, 1) = 2e-6 * data[6];
  if (data[7] % 2 != 0) map.ras_of_index_m.linear().col(2) *= -1.0;
  const std::uint32_t labels = 1U + data[8] % 5U;
  for (std::uint32_t s = 0; s < labels; ++s)
    map.segments.push_back({.value = s + 1, .name = "label " + std::to_string(s + 1)});
  map.voxels.resize(std::size_t{map.size[0]} * map.size[1] * map.size[2]);
  for (std::size_t v = 0; v < map.voxels.size(); ++v) {
    // what the input does not reach repeats it
    const std::uint8_t byte = size > kHead ? data[kHead + v % (size - kHead)] : 1;
    map.voxels[v] = static_cast<std::uint16_t>(byte % (labels + 1U));
    if (map.voxels[v] != 0) ++map.segments[map.voxels[v] - 1U].voxels;
  }
  return map;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < kHead) return 0;
  scan::LabelMap map = map_of(data, size);
  std::vector<std::uint32_t> all(map.segments.size());
  std::iota(all.begin(), all.end(), 0U);
  scan::OrganMeshing meshing{.tetrahedra = 200U + 2U * data[9]};
  if (data[10] % 3 == 1) meshing.cell_m = (1.0 + 0.02 * data[11]) * map.spacing_m().maxCoeff();
  if (data[10] % 3 == 2) meshing.site_m = 1e-3 * Vector3(data[11], 1.0, 1.0);
  if (data[10] % 2 != 0) meshing.fine = {static_cast<std::uint32_t>(data[11] % all.size())};
  try {
    std::vector<scan::Region> regions = scan::keep_largest_part(map, all);
    const scan::OrganMesh organ = scan::organ_mesh_of(map, std::move(regions), meshing);
    const auto& mesh = organ.mesh;
    PALPATE_REQUIRE(!mesh.tetrahedra.empty() && mesh.regions.size() == mesh.tetrahedra.size());
    double sum_m3 = 0.0;
    for (const scan::Region& region : organ.regions) sum_m3 += region.mesh_m3;
    for (std::size_t e = 0; e < mesh.tetrahedra.size(); ++e) {
      const double volume_m3 = physics::six_volumes_m3(mesh.nodes_m, mesh.tetrahedra[e]) / 6.0;
      PALPATE_REQUIRE(volume_m3 > 0.0 && std::isfinite(volume_m3));
      PALPATE_REQUIRE(mesh.regions[e] < organ.regions.size());
      sum_m3 -= volume_m3;
    }
    PALPATE_REQUIRE(std::abs(sum_m3) < 1e-9);
    PALPATE_REQUIRE(organ.angles.least_rad > 0.0);
    PALPATE_REQUIRE(!physics::surface_of(mesh).triangles.empty());
  } catch (const SetupError&) {
    // nothing is left, or the cells are too large
  }
  return 0;
}
