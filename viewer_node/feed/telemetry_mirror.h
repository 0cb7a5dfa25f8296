// SPDX-License-Identifier: Apache-2.0
// telemetry_mirror.h — the state of the running nodes, assembled from their telemetry
// (hop 5). Batches may arrive in any order, be lost or duplicated; the viewer may connect late and
// nodes may restart. Used by the viewer's thread only.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/telemetry/csv_writer.h"
#include "common/telemetry/run_messages.h"
#include "common/telemetry/telemetry.h"

namespace palpate::viewer {

/// A node counts as gone after this silence; 30 … 60 batches a second are normal.
inline constexpr Duration kGoneAfter = std::chrono::seconds(2);
/// Length of the sliding window, on the clock of the node that stamped the ticks.
inline constexpr Duration kWindow = std::chrono::seconds(1);
/// A row waits this long, on the device's clock, for the other half of itself.
inline constexpr Duration kJoinWait = std::chrono::milliseconds(500);
/// Bound on the ticks held whatever the stamps say: three times the window at 10 kHz.
inline constexpr std::size_t kMaxTicksHeld = 1U << 15U;

/// Telemetry link of one node, as received.
struct NodeLink {
  std::uint64_t batches_received = 0;
  std::uint64_t batches_lost = 0;   ///< gaps in the sequence since the first batch
  std::uint64_t records_lost = 0;   ///< inside the node, from its newest batch
  std::uint64_t peers_refused = 0;  ///< by the node, from its newest batch
  std::uint64_t sessions = 0;       ///< different ones; 0: never heard; 2: restarted once; …
  TimePoint heard_at{};             ///< viewer's clock

  [[nodiscard]] bool is_heard() const { return sessions > 0; }
  [[nodiscard]] bool is_gone(TimePoint now) const { return now - heard_at > kGoneAfter; }
  [[nodiscard]] bool is_alive(TimePoint now) const { return is_heard() && !is_gone(now); }
};

/// Figures over the sliding window unless noted otherwise; NaN or nullopt where unknown.
struct TelemetryFigures {
  std::size_t device_ticks = 0;  ///< in the window
  std::size_t mofc_ticks = 0;

  double tick_rate_hz = kNaN;
  std::optional<Duration> lateness_p99;
  std::optional<Duration> lateness_max;
  std::optional<Duration> reply_time_p50;  ///< over answered ticks
  std::optional<Duration> reply_time_p99;
  double answered_ratio = kNaN;              ///< of scheduled ticks: answered / (begun + skipped)
  double answered_ratio_since_start = kNaN;  ///< the same over the device's whole session

  double requested_newton = kNaN;  ///< |requested force| in the newest tick with both halves
  double applied_newton = kNaN;    ///< |rendered force| in that tick; without one, in the newest
  double max_requested_newton = kNaN;
  double max_applied_newton = kNaN;
  double clamped_ratio = kNaN;  ///< of the ticks answered by mofc
  double transparency = kNaN;   ///< projected, capped; rendered against requested
  double force_error_rms_ratio = kNaN;
  std::optional<Duration> force_age_p50;  ///< over ticks with a force of physics
  std::optional<Duration> force_age_max;
  double ledger_energy_joule = kNaN;  ///< newest
  double true_energy_joule = kNaN;    ///< newest; simulated devices only
  GuardState guard = GuardState::kLimp;
  MofcState mofc_state = MofcState::kNoPhysics;
  bool is_in_contact = false;

  double physics_rate_hz = kNaN;
  std::optional<Duration> compute_time_p99;
};

class TelemetryMirror {
 public:
  /// One device tick; either half may be missing, for now or permanently.
  struct JoinedTick {
    std::optional<DeviceTick> device;
    std::optional<MofcTick> mofc;
  };

  /// Called once per device tick in order of sequence, when both halves have arrived or the wait
  /// for the other has ended; set it before the first batch. Ticks without a device half give no
  /// row.
  std::function<void(const TickRow&)> on_row;

  /// @param now  viewer's clock
  void take(const DeviceBatch& batch, TimePoint now);
  void take(const MofcBatch& batch, TimePoint now);
  void take(const PhysicsBatch& batch, TimePoint now);

  /// Hands out the waiting rows; at the end of a recording.
  void flush_rows();

  [[nodiscard]] TelemetryFigures figures() const;

  [[nodiscard]] const NodeLink& device_link() const { return device_.link; }
  [[nodiscard]] const NodeLink& mofc_link() const { return mofc_.link; }
  [[nodiscard]] const NodeLink& physics_link() const { return physics_.link; }
  /// Of the device_node heard last; 0: none yet.
  [[nodiscard]] std::uint64_t device_session_id() const { return device_.session_id; }
  /// Of the newest batch.
  [[nodiscard]] const DeviceCounters& device_counters() const { return device_counters_; }
  [[nodiscard]] const MofcCounters& mofc_counters() const { return mofc_counters_; }
  [[nodiscard]] const PhysicsCounters& physics_counters() const { return physics_counters_; }

  /// The window, by sequence of the DeviceState and of the physics step.
  [[nodiscard]] const std::map<std::uint64_t, JoinedTick>& ticks() const { return ticks_; }
  /// The newest of these that has the device's half; null: none yet.
  [[nodiscard]] const JoinedTick* newest_of_device() const;
  /// The newest one that has mofc's half as well; null: none yet.
  [[nodiscard]] const JoinedTick* newest_joined() const;
  [[nodiscard]] const std::map<std::uint64_t, PhysicsTick>& physics_ticks() const {
    return physics_ticks_;
  }

 private:
  // Classifies the batches of one node: new, late or duplicate.
  struct BatchLog {
    enum class Place { kNewest, kLate, kRefused };

    NodeLink link;
    std::uint64_t session_id = 0;
    std::uint64_t superseded_session_id = 0;
    std::uint64_t first = 0;  // sequence first heard
    std::uint64_t newest = 0;
    std::uint64_t seen = 0;              // bit i: sequence newest − i was received
    std::vector<std::uint64_t> known{};  // session ids: a replay that begins anew repeats them

    Place note(const Header& header, TimePoint now);
  };
  struct Answered {
    TimePoint heard_at;
    std::uint64_t answered = 0;
    std::uint64_t scheduled = 0;
  };

  bool enter_device_session(std::uint64_t session_id);
  void keep_answered(TimePoint now);
  void hand_out_rows(bool is_last);
  void forget_old_ticks();

  BatchLog device_;
  BatchLog mofc_;
  BatchLog physics_;
  DeviceCounters device_counters_;
  MofcCounters mofc_counters_;
  PhysicsCounters physics_counters_;
  std::deque<Answered> answered_;  // over the window, viewer's clock

  std::uint64_t device_session_id_ = 0;  // of ticks_; both nodes' ticks name it
  std::uint64_t superseded_device_session_id_ = 0;
  std::map<std::uint64_t, JoinedTick> ticks_;
  std::map<std::uint64_t, PhysicsTick> physics_ticks_;
  std::optional<std::uint64_t> last_row_;
};

/// Names the newest tick of the device in the marker, where there is one device.
void note_newest_tick(std::span<const TelemetryMirror> mirrors, Marker& marker);

}  // namespace palpate::viewer
