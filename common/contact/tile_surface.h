// tile_surface.h — a surface of triangles of which only some tiles are known.
//
// Distance, normal and curvature are those of TriangleSurface with the same facets (sign by the
// normals at the foot, which are summed over the facets that meet there), so with all tiles near a
// point both see the same. A view is covered if no unknown facet can be nearer than its foot.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/contact/bounds.h"
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
  Bounds bounds;

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
  void reset(bool is_sheet) noexcept;
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

  /// Counts hint.uncovered_views. Without tiles the distance is infinite. The trust radius is the
  /// least.
  [[nodiscard]] SurfaceView view(const Vector3& point_m, SurfaceHint& hint) const noexcept override;
  using Surface::view;
  [[nodiscard]] bool is_sheet() const noexcept override { return is_sheet_; }

 private:
  struct Search;
  struct Gap {
    Vector3 center_m = Vector3::Zero();
    double radius_m = 0.0;
  };
  static constexpr std::size_t kMaxNear = 48;

  std::span<const HeldTile> held_;
  std::vector<std::uint32_t> slots_;
  bool is_sheet_ = false;
  Vector3 covered_center_m_ = Vector3::Zero();
  double covered_radius_m_ = 0.0;
  std::array<Gap, kMaxPendingTiles> gaps_;
  std::size_t gap_count_ = 0;
  // all tiles within near_radius_m_ of near_center_m_
  std::array<std::uint32_t, kMaxNear> near_{};
  std::size_t near_count_ = 0;
  Vector3 near_center_m_ = Vector3::Zero();
  double near_radius_m_ = 0.0;
};

}  // namespace palpate
