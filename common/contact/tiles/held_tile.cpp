// SPDX-License-Identifier: Apache-2.0
#include "common/contact/tiles/held_tile.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

void HeldTile::take(const SurfaceTile& tile) noexcept {
  for (std::size_t i = 0; i < tile.vertex_count; ++i) {
    const auto& [x, y, z] = tile.vertices[i];
    vertices_m[i] = tile.origin_m + tile.step_m * Vector3(x, y, z);
    keys[i] = (std::uint64_t{x} << 32U) | (std::uint64_t{y} << 16U) | z;
  }
  facets = tile.facets;
  facet_count = tile.facet_count;
  for (std::size_t i = 0; i < facet_count; ++i) {
    const Vector3& a = vertices_m[facets[i][0]];
    const Vector3& b = vertices_m[facets[i][1]];
    const Vector3& c = vertices_m[facets[i][2]];
    normals[i] = (b - a).cross(c - a).normalized();
    centers_m[i] = (a + b + c) / 3.0;
    radii_m[i] =
        std::sqrt(std::max({(a - centers_m[i]).squaredNorm(), (b - centers_m[i]).squaredNorm(),
                            (c - centers_m[i]).squaredNorm()}));
    const Bounds facet = bounds_of(std::array<Vector3, 3>{a, b, c});
    if (i == 0) bounds = facet;
    bounds.include(facet);
  }
  core = bounds;
  point_count = tile.point_count;
  places_m.fill(OfPoints::Constant(std::numeric_limits<double>::infinity()));
  for (std::size_t i = 0; i < point_count; ++i) {
    const TilePoint& from = tile.points[i];
    Point& to = points[i];
    const auto& [x, y, z] = from.place;
    const Vector3 place = tile.origin_m + tile.step_m * Vector3(x, y, z);
    for (std::size_t k = 0; k < 3; ++k) {
      places_m[k][static_cast<Eigen::Index>(i)] = place[static_cast<Eigen::Index>(k)];
    }
    to.reach_m = tile.step_m * from.reach;
    const auto reach = static_cast<float>(to.reach_m);
    for (std::size_t k = 0; k < 3; ++k) {
      to.quadric.normal[k] = static_cast<float>(from.normal[k]) / kTilePointScale;
    }
    to.quadric.offset = static_cast<float>(from.offset) / kTilePointScale * reach;
    for (std::size_t k = 0; k < 6; ++k) {
      to.quadric.curvature[k] = static_cast<float>(from.curvature[k]) / kTilePointScale / reach;
    }
    to.stiffness_ratio = static_cast<double>(from.stiffness_ratio);
    Bounds reached{place, place};
    reached.grow(Vector3::Constant(to.reach_m));
    if (i == 0) {
      bounds = reached;
      core = {place, place};
    }
    bounds.include(reached);
    core.include(place);
  }
}

}  // namespace palpate
