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

/// Sends the descriptions of the listed tissues, or of all if the store has room for them, and of
/// tiled ones the part that the tool can reach until the next news arrives: within
///
///   ρ = v̂ (A + 2/f) + d + 3 mm, at least 10 mm, at most 40 mm
///
/// of the predicted place, or of where the tool would touch below it, with v̂ the highest speed of
/// the last half second, A the age of the loop that mofc_node reports (ρ is 40 mm until it does), f
/// the rate of the physics and d the distance of the tip's centre from the surface. Of a tool with
/// a shaft within ρ of the whole shaft, with v̂ that of its faster end and d that of the nearest
/// part; then at least 3 mm more than a search along the shaft needs. First what is nearest to the
/// way from the tool to the predicted place. What is known is not sent again. What is not
/// acknowledged is repeated once a receipt can have come, after A and some ms, or after A/3 if more
/// than a twentieth of the messages is lost; it is put behind tiles up to 3 mm farther away for
/// each time that it was sent. The rest of the surface follows in the background while there are
/// free slots. A full store gives up the tiles farthest away.
///
/// A message carries as many tiles as the receiver accepts and the frame has room for, up to 5 kB
/// with the description, and 1 kB about what is still missing. Tiles take up to 600 kB/s, those of
/// the background 200 kB/s. Only the constructor allocates; no lock, no throw.
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
  static constexpr std::size_t kCarries = 2048;  // of 1 kHz for two seconds
  static constexpr std::size_t kSpeedBins = 10;

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
    double key_m = 0.0;  // by which it is sorted
    double distance_m = 0.0;
    std::uint32_t tile = 0;
  };
  /// The first few of what is offered, in ascending order.
  template <std::size_t kMost>
  struct First {
    std::array<Missing, kMost> entries;
    std::size_t count = 0;
    void offer(const Missing& one, std::size_t most = kMost) noexcept;
  };
  /// A slot, and how far its tile is from the tool.
  struct Ranked {
    double away_m = 0.0;
    std::uint16_t slot = 0;
  };

  void empty(const SurfaceReceipts& receipts) noexcept;
  void acknowledge(const SurfaceReceipts& receipts) noexcept;
  void note_speed(const ToolMotion& motion, TimePoint now) noexcept;
  [[nodiscard]] CapsuleGeometry region_of(const Contact& contact, const ToolMotion& motion,
                                          const Vector3& ahead_m, double reach_m,
                                          double time_s) const noexcept;
  [[nodiscard]] double reach_m() const noexcept;
  [[nodiscard]] std::uint32_t slot_for(std::uint32_t tissue, TimePoint now) noexcept;
  void begin(std::uint32_t slot, std::uint32_t tissue, TimePoint now) noexcept;
  void describe(std::uint32_t slot, TimePoint now, SurfaceNews& news) noexcept;
  void cover(std::uint32_t slot, const CapsuleGeometry& region, const Vector3& ahead_m,
             TimePoint now, SurfaceNews& news) noexcept;
  void send_rest(std::uint32_t slot, const CapsuleGeometry& region, TimePoint now,
                 SurfaceNews& news) noexcept;
  [[nodiscard]] bool has_room(std::uint32_t slot, std::uint32_t tile,
                              const SurfaceNews& news) const noexcept;
  [[nodiscard]] bool is_due(std::uint16_t index, TimePoint now) const noexcept;
  [[nodiscard]] bool may_carry_tiles(std::uint32_t slot, const SurfaceNews& news) const noexcept;
  [[nodiscard]] std::uint16_t& slot_of(const Described& described, std::uint32_t tile) noexcept;
  bool carry(std::uint32_t described, std::uint32_t tile, const CapsuleGeometry& region,
             double distance_m, TimePoint now, SurfaceNews& news) noexcept;
  [[nodiscard]] std::uint16_t take_slot(const CapsuleGeometry& region, double distance_m,
                                        SurfaceNews& news) noexcept;
  void rank(const CapsuleGeometry& region) noexcept;
  void release(std::uint16_t slot) noexcept;
  /// While the loop's age is unknown, twice as long after each sending: what is on its way keeps
  /// nothing else waiting.
  [[nodiscard]] Duration repeat_after(std::uint32_t sendings) const noexcept;

  std::span<const DescribedTissue> tissues_;
  double period_s_;
  double shaft_length_m_ = 0.0;
  bool all_fit_ = true;  // as many tissues are described as the store has room for
  std::uint64_t store_id_ = 0;
  std::uint32_t tiles_per_message_ = kLeastTilesPerMessage;
  bool is_lossy_ = false;
  std::uint64_t next_number_ = 1;
  std::uint32_t next_version_ = 1;
  Duration loop_age_{};
  std::array<Described, kMaxDescribed> described_{};
  std::vector<Slot> slots_;
  std::vector<std::uint16_t> free_;
  std::vector<Ranked> ranked_;  // of this message, the farthest last; empty: not ranked yet
  std::vector<std::vector<std::uint16_t>> slot_of_tile_;  // by tissue
  std::array<Carry, kCarries> carries_{};
  std::array<double, kSpeedBins> speeds_{};  // highest of each 50 ms
  std::int64_t speed_bin_ = 0;
  Vector3 shaft_m_ = Vector3::Zero();  // from the tip to the handle, at the last DeviceState
  TimePoint shaft_at_{};
  // bytes that may be sent: in this message, of tiles, of the rest
  double room_bytes_ = 0.0;
  double tile_bytes_ = 0.0;
  double rest_bytes_ = 0.0;
  TimePoint filled_at_{};
};

}  // namespace palpate::physics
