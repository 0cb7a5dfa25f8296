// SPDX-License-Identifier: Apache-2.0
// tissue_store.h — what physics_node has sent of the tissue: descriptions and tiles, in slots that
// physics_node manages.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/contact/analytic_surfaces.h"
#include "common/contact/tiles/tile_surface.h"
#include "common/core/messages.h"

namespace palpate::mofc {

/// A described tissue.
class DescribedTissue {
 public:
  explicit DescribedTissue(std::span<const HeldTile> tiles) : tiled_(tiles) {
    material_.inclusions.reserve(kMaxDescribedInclusions);
  }

  [[nodiscard]] bool is_known() const noexcept { return is_known_; }
  [[nodiscard]] std::uint32_t tissue() const noexcept { return tissue_; }
  [[nodiscard]] const Surface& surface() const noexcept {
    if (is_tiled_) return tiled_;
    return analytic_;
  }
  [[nodiscard]] const KelvinVoigtMaterial& material() const noexcept { return material_; }
  [[nodiscard]] const TissueMotionConfig& motion() const noexcept { return motion_; }
  [[nodiscard]] const ToolShape& tool() const noexcept { return tool_; }
  [[nodiscard]] std::uint32_t version() const noexcept { return version_; }

  /// The tip, or the shaft, is about to touch near this point of the tissue's rest frame. Returns
  /// the work of looking there (@see SurfaceHint).
  std::uint32_t prepare(const Vector3& point_m, bool is_shaft) noexcept {
    return is_tiled_ ? tiled_.gather(point_m, is_shaft ? 1 : 0) : 0;
  }

 private:
  friend class TissueStore;
  void take(const TissueDescription& description) noexcept;

  bool is_known_ = false;
  bool is_tiled_ = false;
  std::uint32_t tissue_ = 0;
  std::uint32_t version_ = 0;
  AnalyticSurface analytic_;
  TileSurface tiled_;
  KelvinVoigtMaterial material_;
  TissueMotionConfig motion_;
  ToolShape tool_;
};

/// About 20 MB, allocated by the constructor. The other functions neither allocate nor throw.
class TissueStore {
 public:
  /// @param session_id  mofc's; the first id of the store
  explicit TissueStore(std::uint64_t session_id);
  TissueStore(const TissueStore&) = delete;  // its surfaces refer to it
  TissueStore& operator=(const TissueStore&) = delete;

  /// Takes what one Interaction carries, each in order of arrival. A new session of physics_node
  /// empties the store.
  /// @param loop_age  from the DeviceState that it answers to now
  void take(const Interaction& interaction, Duration loop_age) noexcept;

  /// Nothing is known any more, and physics_node is to begin anew.
  void drop() noexcept;

  [[nodiscard]] const SurfaceReceipts& receipts() const noexcept { return receipts_; }
  [[nodiscard]] std::array<DescribedTissue, kMaxDescribed>& tissues() noexcept { return tissues_; }

 private:
  /// What a slot holds; apart from the tiles, which are far apart in memory.
  struct Tag {
    std::uint32_t version = 0;
    std::uint32_t described_slot = 0;
    bool is_held = false;
  };
  void empty() noexcept;
  void take(const TissueDescription& description) noexcept;
  void take(const SurfaceTile& tile) noexcept;
  void cover(const SurfaceNews& news) noexcept;

  std::vector<HeldTile> held_;
  std::vector<Tag> tags_;
  std::array<DescribedTissue, kMaxDescribed> tissues_;
  SurfaceReceipts receipts_;
  std::uint64_t physics_session_id_ = 0;  // 0: none yet
};

}  // namespace palpate::mofc
