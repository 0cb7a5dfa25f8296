// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/import_site.h"

#include <algorithm>
#include <cmath>

namespace palpate {

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
    if (z > column.top_m) {
      column.below_m = column.top_m;
      column.top_m = z;
    } else if (z < column.top_m - 1e-6) {
      column.below_m = std::max(column.below_m, z);
    }
  }
  return column;
}

Site site_of(const scan::LabelMap& map, const std::vector<std::uint32_t>& body,
             const std::vector<std::uint32_t>& targets) {
  std::vector<char> kind(map.segments.size() + 1, 0);  // 1: of the body, 3: a target
  for (const std::uint32_t segment : body) kind[segment + 1] = 1;
  for (const std::uint32_t segment : targets)
    kind[segment + 1] = static_cast<char>(kind[segment + 1] | 2);
  const auto for_each = [&](char wanted, auto visit) {
    std::size_t at = 0;
    for (std::uint32_t k = 0; k < map.size[2]; ++k) {
      for (std::uint32_t j = 0; j < map.size[1]; ++j) {
        for (std::uint32_t i = 0; i < map.size[0]; ++i, ++at) {
          if ((kind[map.voxels[at]] & wanted) == wanted)
            visit(map.ras_of_index_m * Vector3(i, j, k));
        }
      }
    }
  };
  Site site;
  double count = 0.0;
  for_each(targets.empty() ? 1 : 3, [&](const Vector3& place_m) {
    site.centre_m += place_m;
    count += 1.0;
  });
  if (count > 0.0) site.centre_m /= count;
  const double near_m = 1.5 * map.spacing_m().maxCoeff();
  double top = -std::numeric_limits<double>::infinity();
  double nearest_m = std::numeric_limits<double>::infinity();
  for_each(1, [&](const Vector3& place_m) {
    // above the centre, or, in a body that is hollow there, as near as there is one
    const double aside_m = std::max(near_m, (place_m - site.centre_m).head<2>().norm());
    if (aside_m > nearest_m || (aside_m == nearest_m && place_m.z() <= top)) return;
    nearest_m = aside_m;
    top = place_m.z();
    site.top_m = aside_m == near_m ? Vector3(site.centre_m.x(), site.centre_m.y(), top) : place_m;
  });
  return site;
}

}  // namespace palpate
