// SPDX-License-Identifier: Apache-2.0
// searched_surface.h — the surface of a tissue at rest: where on it a tip is, by its triangles, and
// which of it a hand has searched, by points that each stand for a small area.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/core/scene_messages.h"
#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "common/task/triangle_grid.h"
#include "common/telemetry/run_messages.h"

namespace palpate {

class SearchedSurface {
 public:
  /// Most points of what is to be searched, whatever its size; about.
  static constexpr std::size_t kMostPoints = 600'000;
  /// A touch farther away is none of this surface.
  static constexpr double kFar_m = 0.1;

  /// One point in each piece of the triangles, at a place of the piece that is random and always
  /// the same: no direction of a path is favoured. Pieces that may have a part of the area are
  /// divided until they are a 24th of `radius_m` across, a 100th of the root of the area if that is
  /// less, more where that would be more points than kMostPoints. So a narrow or small area has as
  /// many points as a large one.
  /// @param mesh      with triangles; without, the surface is empty
  /// @param area      what is to be searched; never a MeshTag; none: all
  /// @param radius_m  of a press, > 0
  SearchedSurface(const SurfaceMesh& mesh, const std::optional<RegionGeometry>& area,
                  double radius_m);

  /// Nothing is to be searched: it tells where a tip is.
  [[nodiscard]] static SearchedSurface of_no_area(const SurfaceMesh& mesh, double radius_m);

  [[nodiscard]] bool empty() const { return triangles_.empty(); }

  /// A place on the surface.
  struct Foot {
    Vector3 point_m = Vector3::Zero();
    Vector3 normal = Vector3::UnitZ();  ///< of its triangle, out of the tissue
    std::uint32_t triangle = 0;
  };
  /// The nearest place on the surface, within `within_m`; on an edge it is of the triangle that the
  /// place is most in front of.
  [[nodiscard]] std::optional<Foot> foot_of(const Vector3& place_m, double within_m) const;
  /// Where the foot of a tip that stays in touch is now: it slides on the surface to where that is
  /// nearest, from triangle to triangle, and passes around an edge only to a side that the tip is
  /// outside of. So it does not jump through thin tissue, nor to a side wall that is nearer.
  /// @param last  of this surface
  [[nodiscard]] Foot followed(const Foot& last, const Vector3& place_m) const;

  /// Normals of one side: they are turned away from each other by at most 120°. Not that of the
  /// other side of thin tissue, nor of a fold.
  [[nodiscard]] static bool is_same_side(const Vector3& normal, const Vector3& other);

  /// Everything within `radius_m` of the place is searched that is on its side.
  /// @param normal  of the surface there
  void search(const Vector3& place_m, const Vector3& normal);

  /// Share of the area that is searched; NaN: nothing is to be searched.
  [[nodiscard]] double searched_ratio() const {
    return area_m2_ > 0.0 ? searched_m2_ / area_m2_ : std::numeric_limits<double>::quiet_NaN();
  }
  [[nodiscard]] double area_m2() const { return area_m2_; }
  /// Up to `most` points of the area, spread over it.
  [[nodiscard]] TaskMap map(std::size_t most) const;
  [[nodiscard]] double spacing_m() const { return spacing_m_; }

 private:
  struct Point {
    Eigen::Vector3f place_m;
    std::uint32_t triangle;
    float area_m2;
    bool is_searched;
  };
  using Cell = std::array<std::int32_t, 3>;
  [[nodiscard]] double spacing_of(const std::optional<RegionGeometry>& area, double whole_m2) const;
  void sample(std::uint32_t triangle, const Corners& piece,
              const std::optional<RegionGeometry>& area);
  void sort_into_cells();
  [[nodiscard]] Cell cell_of(const Vector3& place_m) const;
  /// Calls visit(index of a point) for the points of the cells at this distance from the cell.
  template <class Visit>
  void for_shell(const Cell& middle, std::int32_t distance, const Visit& visit) const;

  double radius_m_;
  double spacing_m_ = 0.0;  // of the points
  double cell_m_;
  double area_m2_ = 0.0;
  double searched_m2_ = 0.0;
  std::vector<Point> points_;  // of the area
  std::uint64_t drawn_ = 0;    // pieces
  std::vector<Corners> triangles_;
  std::vector<Vector3> normals_;  // of the triangles
  TriangleGrid grid_;             // of the triangles
  std::unordered_map<Cell, std::pair<std::uint32_t, std::uint32_t>, CellHash> cells_;
  static constexpr std::int32_t kFarCell = 1'000'000'000;
  Cell first_cell_{kFarCell, kFarCell, kFarCell};  // that has points
  Cell last_cell_{-kFarCell, -kFarCell, -kFarCell};
};

/// Where a tip is on a surface, from tick to tick, whether a force acts or not. Of a tip whose
/// centre is outside that is the nearest place. One that goes in stays on the side on which it went
/// in, although another may be nearer; one that was pressed beyond the other side of thin tissue
/// stays there until it is free: no force, and farther than its radius from the surface at rest.
class TipFoot {
 public:
  explicit TipFoot(double tip_radius_m) : tip_radius_m_(tip_radius_m) {}

  /// @param surface  always the same
  void follow(const SearchedSurface& surface, const Vector3& tip_m, bool is_touch);
  /// None: it is far from the surface.
  [[nodiscard]] const std::optional<SearchedSurface::Foot>& foot() const { return foot_; }

 private:
  [[nodiscard]] bool has_left(const SearchedSurface& surface, const Vector3& tip_m) const;

  double tip_radius_m_;
  Vector3 tip_m_ = Vector3::Constant(std::numeric_limits<double>::quiet_NaN());  // of foot_
  std::optional<SearchedSurface::Foot> foot_;
  bool was_pressed_ = false;  // since it went in
};

}  // namespace palpate
