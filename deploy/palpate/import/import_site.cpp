// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/import_site.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "deploy/scan/organ_mesh.h"

namespace palpate {
namespace {

constexpr double kSame_m = 1e-6;

}  // namespace

std::string stl_text(const physics::TriangleMesh& surface) {
  std::string text = "palpate import: metres, frame W of the session";
  text.resize(80, ' ');
  const auto append = [&](auto value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  append(static_cast<std::uint32_t>(surface.triangles.size()));
  for (const auto& corners : surface.triangles) {
    const auto& [a, b, c] = corners;
    const Vector3 normal = (surface.vertices_m[b] - surface.vertices_m[a])
                               .cross(surface.vertices_m[c] - surface.vertices_m[a])
                               .normalized();
    for (int i = 0; i < 3; ++i) append(static_cast<float>(normal[i]));
    for (const std::uint32_t corner : corners) {
      for (int i = 0; i < 3; ++i) append(static_cast<float>(surface.vertices_m[corner][i]));
    }
    append(std::uint16_t{0});
  }
  return text;
}

Column column_at(const physics::TriangleMesh& surface, double x, double y) {
  Column column;
  for (const auto& [ia, ib, ic] : surface.triangles) {
    const Vector3& a = surface.vertices_m[ia];
    const Vector3& b = surface.vertices_m[ib];
    const Vector3& c = surface.vertices_m[ic];
    const auto side = [&](const Vector3& p, const Vector3& q) {
      return (q.x() - p.x()) * (y - p.y()) - (q.y() - p.y()) * (x - p.x());
    };
    const Vector3 weights(side(b, c), side(c, a), side(a, b));
    if (!(weights.minCoeff() >= 0.0 || weights.maxCoeff() <= 0.0) || weights.sum() == 0.0) continue;
    const double z =
        (weights.x() * a.z() + weights.y() * b.z() + weights.z() * c.z()) / weights.sum();
    // a line through an edge or a node meets several triangles there
    if (z > column.top_m + kSame_m) {
      column.below_m = column.top_m;
      column.top_m = z;
    } else if (z < column.top_m - kSame_m) {
      column.below_m = std::max(column.below_m, z);
    }
  }
  return column;
}

Site site_of(const scan::LabelMap& map, const std::optional<std::uint32_t>& target) {
  const auto place_of = [&](std::size_t at) {
    const std::size_t row = at / map.size[0];
    return Vector3(map.ras_of_index_m * Vector3(static_cast<double>(at % map.size[0]),
                                                static_cast<double>(row % map.size[1]),
                                                static_cast<double>(row / map.size[1])));
  };
  const std::vector<std::size_t> part = scan::largest_part_of(
      map, [&](std::uint16_t voxel) { return target ? voxel == *target + 1 : voxel != 0; });
  Site site;
  for (const std::size_t at : part) site.centre_m += place_of(at);
  site.centre_m /= static_cast<double>(std::max<std::size_t>(part.size(), 1));
  const double near_m = 1.5 * map.spacing_m().maxCoeff();
  double top = -std::numeric_limits<double>::infinity();
  double nearest_m = std::numeric_limits<double>::infinity();
  for (std::size_t at = 0; at < map.voxels.size(); ++at) {
    if (map.voxels[at] == 0) continue;
    const Vector3 place_m = place_of(at);
    // above the centre, or, in a body that is hollow there, as near as there is one
    const double aside_m = std::max(near_m, (place_m - site.centre_m).head<2>().norm());
    if (aside_m > nearest_m || (aside_m == nearest_m && place_m.z() <= top)) continue;
    nearest_m = aside_m;
    top = place_m.z();
    site.top_m = aside_m == near_m ? Vector3(site.centre_m.x(), site.centre_m.y(), top) : place_m;
  }
  return site;
}

}  // namespace palpate
