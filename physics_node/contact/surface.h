// surface.h — a surface loaded from a file: in its own frame, never changed, shared by all tissues
// and tools that need it.
#pragma once

#include <cstdint>

#include "common/core/scene_messages.h"
#include "common/core/vector.h"
#include "physics_node/surfaces/geometry.h"

namespace palpate::physics {

/// Where the last view of one caller ended; zero at first. It saves time where the tool moves
/// little from one step to the next and never changes a result.
struct SurfaceHint {
  std::uint32_t cell = 0;
  std::uint32_t octree_cells_visited = 0;  ///< by its views so far
  std::uint32_t last_cell_hits = 0;        ///< views whose nearest point was in the last one's cell
};

/// Thread-safe; view() is real-time safe: no allocation, no lock, no throw, bounded time.
class Surface {
 public:
  virtual ~Surface() = default;
  Surface() = default;
  Surface(const Surface&) = delete;
  Surface& operator=(const Surface&) = delete;

  /// @param point_m  in the surface's frame; for one that is not finite, or farther than numbers
  ///     go, the distance is infinite
  [[nodiscard]] virtual SurfaceView view(const Vector3& point_m,
                                         SurfaceHint& hint) const noexcept = 0;
  [[nodiscard]] SurfaceView view(const Vector3& point_m) const noexcept {
    SurfaceHint none;
    return view(point_m, none);
  }

  /// Holds every point at which view() gives a distance ≤ 0.
  [[nodiscard]] virtual Bounds bounds() const noexcept = 0;

  /// As viewers draw it, in the surface's frame. Not for the step: it allocates and takes its time.
  [[nodiscard]] virtual SurfaceMesh display_mesh() const = 0;

  /// Has no inside: behind it is as free as in front.
  [[nodiscard]] virtual bool is_sheet() const noexcept { return false; }

  /// Heap memory held.
  [[nodiscard]] virtual std::size_t bytes() const noexcept = 0;
};

}  // namespace palpate::physics
