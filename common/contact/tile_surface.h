// tile_surface.h — a surface of triangles, or a cloud, of which only some tiles are known.
//
// Of triangles distance, normal and curvature are those of TriangleSurface with the same facets
// (sign by the normals at the foot, which are summed over the facets that meet there), so with all
// tiles near a point both see the same. Of a cloud they are those of the blend of the known points.
// A view is covered if no unknown facet can be nearer than its foot, or no unknown point nearer
// than the nearest one, nor reach a place that was blended.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/contact/bounds.h"
#include "common/contact/cloud/cloud_blend.h"
#include "common/contact/surface.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// A SurfaceTile as it is evaluated.
struct HeldTile {
  std::uint32_t version = 0;
  std::uint32_t described_slot = 0;
  bool is_held = false;
  std::uint32_t facet_count = 0;
  std::array<Vector3, kMaxTileVertices> vertices_m;
  std::array<std::uint64_t, kMaxTileVertices> keys{};  ///< equal for vertices that coincide
  std::array<std::array<std::uint8_t, 3>, kMaxTileFacets> facets{};
  std::array<Vector3, kMaxTileFacets> normals;  ///< unit
  std::array<Vector3, kMaxTileFacets> centers_m;
  std::array<double, kMaxTileFacets> radii_m{};  ///< of the spheres around the facets
  struct Point {
    Vector3 place_m;
    double reach_m = 0.0;
    CloudQuadric quadric;
    double stiffness_ratio = 1.0;
  };
  std::uint32_t point_count = 0;
  std::array<Point, kMaxTilePoints> points;
  Bounds bounds;  ///< of the facets, or of what the points reach
  Bounds core;    ///< of the facets, or of the points

  /// Takes a tile that the codec has checked. No allocation, no throw.
  void take(const SurfaceTile& tile) noexcept;
};

class TileSurface final : public Surface {
 public:
  /// @param held  the slots of the store, which must outlive the surface
  explicit TileSurface(std::span<const HeldTile> held) : held_(held) {
    slots_.reserve(held.size());
  }

  /// Nothing is known of the surface. The other functions do not allocate.
  void reset(const TiledGeometry& geometry) noexcept;
  /// A slot now holds a tile of this surface, or no longer does.
  void add(std::uint32_t slot) noexcept;
  void remove(std::uint32_t slot) noexcept;
  /// All facets within this ball are held, except those within the spheres that follow.
  void cover(const Vector3& center_m, double radius_m) noexcept {
    covered_center_m_ = center_m;
    covered_radius_m_ = radius_m;
    gap_count_ = 0;
  }
  /// At most kMaxPendingTiles of them.
  void except(const Vector3& center_m, double radius_m) noexcept;
  /// No unknown facet is nearer to the point than this; may be below 0.
  [[nodiscard]] double unknown_m(const Vector3& point_m) const noexcept;
  /// Collects the tiles near the point; views near it are then fast. Once per tick.
  void gather(const Vector3& point_m) noexcept;

  /// Counts hint.uncovered_views, among them those that would have to examine more than
  /// kMostExamined tiles. Without tiles the distance is infinite. The trust radius is the
  /// least.
  [[nodiscard]] SurfaceView view(const Vector3& point_m, SurfaceHint& hint) const noexcept override;
  using Surface::view;
  [[nodiscard]] bool is_sheet() const noexcept override { return geometry_.is_sheet; }

 private:
  struct Search;
  struct PointSearch;
  struct Gap {
    Vector3 center_m = Vector3::Zero();
    double radius_m = 0.0;
  };
  [[nodiscard]] SurfaceView view_of_facets(const Vector3& point_m,
                                           SurfaceHint& hint) const noexcept;
  [[nodiscard]] SurfaceView view_of_points(const Vector3& point_m,
                                           SurfaceHint& hint) const noexcept;
  /// The nearest facet or point is no farther than this; the largest double without tiles.
  [[nodiscard]] double nearest_at_most_m(const Vector3& point_m) const noexcept;
  /// Slots with all held tiles within this distance of the point: the near ones, or all.
  [[nodiscard]] std::span<const std::uint32_t> within(const Vector3& point_m,
                                                      double distance_m) const noexcept;
  /// Calls examine(tile, slot), which returns whether the tile is worth it. False if there are too
  /// many of these.
  template <class Examine>
  bool visit(std::span<const std::uint32_t> slots, const Examine& examine) const noexcept;

  static constexpr int kMostExamined = 128;
  static constexpr std::size_t kMaxNear = 48;

  std::span<const HeldTile> held_;
  std::vector<std::uint32_t> slots_;
  TiledGeometry geometry_;
  Vector3 covered_center_m_ = Vector3::Zero();
  double covered_radius_m_ = 0.0;
  std::array<Gap, kMaxPendingTiles> gaps_;
  std::size_t gap_count_ = 0;
  // all tiles within near_radius_m_ of near_center_m_, nearest first
  std::array<std::uint32_t, kMaxNear> near_{};
  std::size_t near_count_ = 0;
  Vector3 near_center_m_ = Vector3::Zero();
  double near_radius_m_ = 0.0;
};

}  // namespace palpate
