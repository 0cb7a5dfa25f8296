// SPDX-License-Identifier: Apache-2.0
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

#include "common/contact/bounds.h"
#include "common/contact/surface.h"
#include "common/contact/tiles/held_tile.h"
#include "common/contact/tiles/tile_blocks.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

class TileSurface final : public Surface {
 public:
  /// @param held  the slots of the store, which must outlive the surface
  explicit TileSurface(std::span<const HeldTile> held);

  /// Nothing is known of the surface. The other functions do not allocate.
  void reset(const TiledGeometry& geometry) noexcept;
  /// A slot now holds a tile of this surface, or no longer does. At most as many as held.
  void add(std::uint32_t slot) noexcept;
  void remove(std::uint32_t slot) noexcept;
  /// All facets within this region are held, except those within the spheres that follow.
  void cover(const CapsuleGeometry& region) noexcept {
    covered_ = region;
    gap_count_ = 0;
  }
  /// At most kMaxPendingTiles of them.
  void except(const Vector3& center_m, double radius_m) noexcept;
  [[nodiscard]] double unknown_m(const Vector3& point_m) const noexcept override;
  [[nodiscard]] double known_at_least_m(const Vector3& point_m,
                                        SurfaceHint& hint) const noexcept override;
  /// Collects the tiles near the point; views near it are then fast. Once per tick. Returns its
  /// work.
  /// @param place  < kPlaces, at which the tool touches: of each the last point counts
  std::uint32_t gather(const Vector3& point_m, std::size_t place = 0) noexcept;
  static constexpr std::size_t kPlaces = 2;

  /// Counts hint.uncovered_views, among them those that would have to examine more than
  /// kMostExamined tiles, or would need more than hint.most_work, which is then exhausted. A unit
  /// of work takes about 3 ns. Without tiles the distance is infinite. The trust radius is the
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
  static constexpr int kMostExamined = 128;
  static constexpr std::size_t kMaxNear = 48;
  /// All tiles within a distance of a point, nearest first.
  struct Near {
    Vector3 center_m = Vector3::Zero();
    double radius_m = 0.0;
    std::size_t count = 0;
    std::array<std::uint32_t, kMaxNear> slots{};
    std::array<Bounds, kMaxNear> bounds;
    std::array<double, kMaxNear> distances_m{};

    [[nodiscard]] bool has(std::uint32_t slot) const noexcept;
    /// @see TileBlocks::look_near
    template <class Limit, class Look>
    bool look_near(const Vector3& point_m, SurfaceHint& hint, const Limit& limit,
                   const Look& look) const noexcept;
    void offer(std::uint32_t slot, const Bounds& tile) noexcept;
    void remove(std::uint32_t slot) noexcept;
  };

  [[nodiscard]] double worth_m(const Vector3& point_m, const SurfaceHint& hint) const noexcept;
  /// The nearest facet or point is no farther than this; the largest double without tiles.
  [[nodiscard]] double nearest_at_most_m(const Vector3& point_m, SurfaceHint& hint) const noexcept;
  /// The collected tiles whose middle is nearest.
  [[nodiscard]] const Near& near_to(const Vector3& point_m) const noexcept;
  /// All held tiles within this distance of the point are among the collected ones.
  [[nodiscard]] static bool has_all(const Near& near, const Vector3& point_m,
                                    double distance_m) noexcept;
  /// Calls examine(tile, slot), which returns whether the tile was worth it, for each whose bounds
  /// are within limit() (squared) of the point. False if there are too many of these.
  /// @param tiles  all, or the near ones
  template <class Tiles, class Limit, class Examine>
  bool visit(const Tiles& tiles, const Vector3& point_m, SurfaceHint& hint, const Limit& limit,
             const Examine& examine) const noexcept;

  std::span<const HeldTile> held_;
  TileBlocks all_;
  TiledGeometry geometry_;
  CapsuleGeometry covered_{.radius_m = 0.0};
  std::array<Gap, kMaxPendingTiles> gaps_;
  std::size_t gap_count_ = 0;
  std::array<Near, kPlaces> near_;
};

}  // namespace palpate
