// SPDX-License-Identifier: Apache-2.0
// held_tile.h — some neighbouring facets of a surface, or points of a cloud, as a search reads
// them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/contact/bounds.h"
#include "common/contact/cloud/cloud_blend.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// A SurfaceTile as it is evaluated. Only the entries in use have values: a store has a thousand.
struct HeldTile {
  std::uint32_t facet_count;
  std::array<Vector3, kMaxTileVertices> vertices_m;
  std::array<std::uint64_t, kMaxTileVertices> keys;  ///< equal for vertices that coincide
  std::array<std::array<std::uint8_t, 3>, kMaxTileFacets> facets;
  std::array<Vector3, kMaxTileFacets> normals;  ///< unit
  std::array<Vector3, kMaxTileFacets> centers_m;
  std::array<double, kMaxTileFacets> radii_m;  ///< of the spheres around the facets
  struct Point {
    double reach_m;
    double stiffness_ratio;
    CloudQuadric quadric;
  };
  std::uint32_t point_count;
  using OfPoints = Eigen::Array<double, kMaxTilePoints, 1>;
  /// Their places [m], apart from the rest and coordinate by coordinate: what a search reads. Those
  /// of no point are infinitely far away.
  std::array<OfPoints, 3> places_m;
  std::array<Point, kMaxTilePoints> points;
  Bounds bounds;  ///< of the facets, or of what the points reach
  Bounds core;    ///< of the facets, or of the points

  HeldTile() noexcept : facet_count(0), point_count(0) {}
  /// Takes a tile that the codec has checked. No allocation, no throw.
  void take(const SurfaceTile& tile) noexcept;

  [[nodiscard]] Vector3 place_m(std::size_t point) const noexcept {
    const auto i = static_cast<Eigen::Index>(point);
    return {places_m[0][i], places_m[1][i], places_m[2][i]};
  }
  [[nodiscard]] OfPoints squared_distances(const Vector3& from_m) const noexcept {
    return (from_m.x() - places_m[0]).square() +
           ((from_m.y() - places_m[1]).square() + (from_m.z() - places_m[2]).square());
  }
};

}  // namespace palpate
