// SPDX-License-Identifier: Apache-2.0
// surface_sender.h — hop 3: which part of the tissue mofc_node gets to know, and when.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/core/messages.h"
#include "common/core/time.h"
#include "physics_node/scene/scene_description.h"

namespace palpate::physics {

/// Sends the descriptions of the listed tissues, and of tiled ones the part that the tool can reach
/// until the next news arrives: within
///
///   ρ = v̂ (A + 2/f) + d + 3 mm, at least 10 mm, at most 40 mm
///
/// of the predicted place, or of where the tool would touch below it, with v̂ the highest speed of
/// the last half second, A the age of the loop that mofc_node reports (ρ is 40 mm until it does), f
/// the rate of the physics and d the distance of the tip's centre from the surface. Of a tool with
/// a shaft within ρ of the whole shaft, with v̂ that of its faster end and d that of the nearest
/// part; then at least 3 mm more than a search along the shaft needs. Nearest first;
/// what is not acknowledged is repeated after A/3, behind tiles up to 6 mm farther away for each
/// time that it was sent; what is known is not sent again. The rest of the surface follows at 64
/// tiles a second while there are free slots. A full store gives up the tiles farthest away.
///
/// At most 2.2 kB of descriptions and tiles per message, and 1 kB about what is still missing. Only
/// the constructor allocates; no lock, no throw.
class SurfaceSender {
 public:
  /// @param tissues  of the scene, which must outlive this; empty: nothing is sent
  SurfaceSender(std::span<const DescribedTissue> tissues, double rate_hz);

  /// Fills interaction.surface, whose contacts are already there.
  /// @param now  physics' clock, time of this step
  void fill(const ToolMotion& motion, TimePoint now, Interaction& interaction) noexcept;

  /// The description of a tissue has changed: it is sent again, with its tiles.
  void forget(std::uint32_t tissue) noexcept;

 private:
  static constexpr std::uint16_t kNoSlot = 0xffff;
  static constexpr std::size_t kCarries = 256;
  static constexpr std::size_t kSpeedBins = 10;
  static constexpr std::size_t kMaxMissing = 64;

  struct Described {
    std::optional<std::uint32_t> tissue;
    std::uint32_t version = 0;
    bool is_acknowledged = false;
    bool is_sent = false;
    TimePoint sent_at{};
    TimePoint wanted_at{};
    std::size_t tiles_known = 0;  // acknowledged
    std::size_t next_tile = 0;    // of the rest
  };
  struct Slot {
    std::uint32_t described = kMaxDescribed;  // kMaxDescribed: free
    std::uint32_t tile = 0;
    std::uint32_t version = 0;
    bool is_acknowledged = false;
    std::uint32_t sendings = 0;
    TimePoint sent_at{};
  };
  struct Carried {
    std::uint32_t slot = 0;
    std::uint32_t version = 0;
  };
  struct Carry {
    std::uint64_t number = 0;
    std::optional<Carried> description{};
    std::array<Carried, kMaxTilesPerMessage> tiles{};
    std::uint32_t tile_count = 0;
  };
  struct Missing {
    double distance_m = 0.0;
    std::uint32_t tile = 0;
  };

  void empty(std::uint64_t store_id) noexcept;
  void acknowledge(const SurfaceReceipts& receipts) noexcept;
  void note_speed(const ToolMotion& motion, TimePoint now) noexcept;
  [[nodiscard]] CapsuleGeometry region_of(const Contact& contact, const ToolMotion& motion,
                                          const Vector3& ahead_m, double reach_m,
                                          double time_s) const noexcept;
  [[nodiscard]] double reach_m() const noexcept;
  [[nodiscard]] std::uint32_t slot_for(std::uint32_t tissue, TimePoint now) noexcept;
  void begin(std::uint32_t slot, std::uint32_t tissue, TimePoint now) noexcept;
  void describe(std::uint32_t slot, TimePoint now, SurfaceNews& news) noexcept;
  void cover(std::uint32_t slot, const CapsuleGeometry& region, TimePoint now,
             SurfaceNews& news) noexcept;
  void send_rest(std::uint32_t slot, const CapsuleGeometry& region, TimePoint now,
                 SurfaceNews& news) noexcept;
  [[nodiscard]] bool has_room(const SurfaceNews& news) const noexcept;
  [[nodiscard]] bool may_carry_tiles(std::uint32_t slot, const SurfaceNews& news) const noexcept;
  [[nodiscard]] std::uint16_t& slot_of(const Described& described, std::uint32_t tile) noexcept;
  bool carry(std::uint32_t described, std::uint32_t tile, const CapsuleGeometry& region,
             double distance_m, TimePoint now, SurfaceNews& news) noexcept;
  [[nodiscard]] std::uint16_t take_slot(const CapsuleGeometry& region, double distance_m,
                                        SurfaceNews& news) noexcept;
  void release(std::uint16_t slot) noexcept;
  [[nodiscard]] Duration repeat_after() const noexcept;

  std::span<const DescribedTissue> tissues_;
  double period_s_;
  double shaft_length_m_ = 0.0;
  std::uint64_t store_id_ = 0;
  std::uint64_t next_number_ = 1;
  std::uint32_t next_version_ = 1;
  Duration loop_age_{};
  std::array<Described, kMaxDescribed> described_{};
  std::vector<Slot> slots_;
  std::vector<std::uint16_t> free_;
  std::vector<std::vector<std::uint16_t>> slot_of_tile_;  // by tissue
  std::array<Carry, kCarries> carries_{};
  std::array<double, kSpeedBins> speeds_{};  // highest of each 50 ms
  std::int64_t speed_bin_ = 0;
  Vector3 shaft_m_ = Vector3::Zero();  // from the tip to the handle, at the last DeviceState
  TimePoint shaft_at_{};
  double rest_ = 0.0;  // tiles of the rest that may be sent
  TimePoint rest_at_{};
};

}  // namespace palpate::physics
