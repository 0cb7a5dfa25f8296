// SPDX-License-Identifier: Apache-2.0
// journal.h — what decides about a fault, as it happens: each reading, force and raw transfer, and
// now and then the state of everything that remembers. The tick only fills rings; post_mortem.h
// empties them on another thread.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "common/core/spsc_ring.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/telemetry/device_telemetry.h"
#include "device_node/device.h"
#include "device_node/monitor/force_monitor.h"
#include "device_node/monitor/frozen_watch.h"
#include "device_node/monitor/reading_judge.h"

namespace palpate::device {

enum class JournalKind : std::uint8_t {
  kJudge = 0,     ///< ReadingJudge::read()
  kFrozen = 1,    ///< FrozenWatch::read()
  kRead = 2,      ///< of ForceMonitor, from here
  kEnded = 3,     ///<
  kCover = 4,     ///<
  kSwitched = 5,  ///<
  kFailed = 6,    ///<
  kReleased = 7,  ///<
  kSlept = 8,     ///<
  kLost = 9,      ///< to here; a reset, with begin() of the two others
  kBegin = 10,    ///< FrozenWatch::begin()
  kFault = 11,    ///< a fault was latched
  kLedger = 12,   ///< what a clamp counts on came with its answer
  kWithin = 13,   ///< ForceMonitor::begins_within()
};
inline constexpr int kJournalKinds = 14;

/// One call, its arguments and what it decided. Fields that a kind does not use are zero.
struct JournalEntry {
  std::uint64_t index = 0;  ///< counts from 0: a gap shows that entries were lost
  JournalKind kind = JournalKind::kJudge;
  TimePoint at{};
  Vector3 position_m = Vector3::Zero();    ///< D
  Vector3 force_newton = Vector3::Zero();  ///< D
  Duration lease{};                        ///< or late, slept, within
  ReadingDetails details{};
  bool is_good = true;        ///< kJudge, kFrozen, kLedger: plausible; kCover: not reduced
  double ledger_joule = 0.0;  ///< kLedger
  Vector3 covered_newton = Vector3::Zero();  ///< kCover
  Duration covered_lease{};                  ///< kCover
  double monitor_joule = 0.0;                ///< M after the call
  FaultReason fault = FaultReason::kNone;

  template <class Archive>
  void list(Archive& archive) {
    archive(index);
    archive(kind);
    archive(at);
    archive(position_m);
    archive(force_newton);
    archive(lease);
    archive(details.skew);
    archive(details.turning_joule);
    archive(details.turned_newton);
    archive(details.acting_newton);
    archive(is_good);
    archive(ledger_joule);
    archive(covered_newton);
    archive(covered_lease);
    archive(monitor_joule);
    archive(fault);
  }
};

/// Everything that remembers something from one call to the next.
struct JournalState {
  std::uint64_t index = 0;  ///< of the first entry after it
  TimePoint at{};
  ForceMonitor monitor;
  FrozenWatch frozen;
  ReadingJudge judge;

  template <class Archive>
  void list(Archive& archive) {
    archive(index);
    archive(at);
    monitor.list(archive);
    frozen.list(archive);
    judge.list(archive);
  }
};

/// One message of the device's wire; longer ones are cut.
struct WireTransfer {
  TimePoint at{};
  bool is_sent = false;
  std::uint32_t size = 0;  ///< of the whole message
  std::array<std::byte, 480> bytes{};
};

/// Written by the tick, read by one other thread. Nothing blocks or allocates after construction;
/// what finds a full ring is lost and leaves a gap.
class Journal final : public WireTap {
 public:
  static constexpr Duration kStateEvery = std::chrono::milliseconds(500);

  /// @param rate_hz  of the ticks: the rings hold about a second of them
  explicit Journal(double rate_hz = 1000.0)
      : entries_(scaled(kEntries, rate_hz)),
        states_(kStates),
        transfers_(scaled(kTransfers, rate_hz)) {}

  // --- the tick ---
  void keep(JournalEntry entry) noexcept {
    entry.index = next_index_++;
    entries_.push(entry);
  }
  [[nodiscard]] bool is_state_due(TimePoint now) const noexcept { return now >= state_due_at_; }
  void keep(const JournalState& state) noexcept {
    state_due_at_ = state.at + kStateEvery;
    states_.push(state);
  }
  [[nodiscard]] std::uint64_t next_index() const noexcept { return next_index_; }
  void transferred(TimePoint at, bool is_sent, std::span<const std::byte> bytes) noexcept override {
    WireTransfer transfer{
        .at = at, .is_sent = is_sent, .size = static_cast<std::uint32_t>(bytes.size())};
    std::copy_n(bytes.begin(), std::min(bytes.size(), transfer.bytes.size()),
                transfer.bytes.begin());
    transfers_.push(transfer);
  }

  // --- the other thread ---
  [[nodiscard]] bool take(JournalEntry& entry) noexcept { return entries_.pop(entry); }
  [[nodiscard]] bool take(std::optional<JournalState>& state) noexcept {
    return states_.pop(state);
  }
  [[nodiscard]] bool take(WireTransfer& transfer) noexcept { return transfers_.pop(transfer); }

 private:
  static std::size_t scaled(std::size_t at_1_kHz, double rate_hz) {
    return static_cast<std::size_t>(static_cast<double>(at_1_kHz) * std::max(1.0, rate_hz / 1e3));
  }

  // at 1 kHz
  static constexpr std::size_t kEntries = 8192;
  static constexpr std::size_t kTransfers = 2048;
  static constexpr std::size_t kStates = 8;

  SpscRing<JournalEntry> entries_;
  SpscRing<std::optional<JournalState>> states_;
  SpscRing<WireTransfer> transfers_;
  std::uint64_t next_index_ = 0;
  TimePoint state_due_at_{};
};

/// The monitor of the force, whose calls are in a journal if there is one; with a wrist that of its
/// torques, too, whose are not. Force and torque pay for each other: E is the sum of both.
class JournaledMonitor {
 public:
  /// @param wrist  of wrist_as_axes(); none: no wrist
  JournaledMonitor(const ForceMonitor& monitor, Journal* journal,
                   const std::optional<ForceMonitor>& wrist = {}) noexcept
      : monitor_(monitor), wrist_(wrist), journal_(journal) {}

  void read(TimePoint at, const Vector3& position_m, const ReadingDetails& details,
            const std::optional<WristState>& wrist = {}) noexcept {
    monitor_.read(at, position_m, details);
    if (wrist_ && wrist) wrist_->read(at, wrist->pose.angle_rad);
    note({.kind = JournalKind::kRead, .at = at, .position_m = position_m, .details = details});
  }
  void ended(const Vector3& position_m, const std::optional<WristState>& wrist = {}) noexcept {
    monitor_.ended(position_m);
    if (wrist_ && wrist) wrist_->ended(wrist->pose.angle_rad);
    note({.kind = JournalKind::kEnded, .position_m = position_m});
  }
  void switched(TimePoint at, const Vector3& position_m, const Vector3& force_on_hand_newton,
                Duration lease, const ReadingDetails& details,
                const std::optional<WristState>& wrist = {}) noexcept {
    monitor_.switched(at, position_m, force_on_hand_newton, lease, details);
    if (wrist_ && wrist) {
      wrist_->switched(at, wrist->pose.angle_rad, wrist->acting_torque_newton_m, lease);
    }
    note({.kind = JournalKind::kSwitched,
          .at = at,
          .position_m = position_m,
          .force_newton = force_on_hand_newton,
          .lease = lease,
          .details = details});
  }
  void failed(const Vector3& force_on_hand_newton, const Vector3& torque_newton_m) noexcept {
    monitor_.failed(force_on_hand_newton);
    if (wrist_) wrist_->failed(torque_newton_m);
    note({.kind = JournalKind::kFailed, .force_newton = force_on_hand_newton});
  }
  void released(TimePoint at) noexcept {
    monitor_.released(at);
    if (wrist_) wrist_->released(at);
    note({.kind = JournalKind::kReleased, .at = at});
  }
  void slept(Duration duration) noexcept {
    monitor_.slept(duration);
    if (wrist_) wrist_->slept(duration);
    note({.kind = JournalKind::kSlept, .lease = duration});
  }
  void lost() noexcept {
    if (wrist_) {
      // a debt stays, of both together
      monitor_.set_credit(std::min(0.0, monitor_.credit_joule() + wrist_->credit_joule()));
      wrist_->set_credit(0.0);
      wrist_->lost();
    }
    monitor_.lost();
    note({.kind = JournalKind::kLost});
  }
  void begins_within(Duration within) noexcept {
    monitor_.begins_within(within);
    if (wrist_) wrist_->begins_within(within);
    note({.kind = JournalKind::kWithin, .lease = within});
  }
  struct Covered : ForceMonitor::Covered {
    Vector3 torque_newton_m = Vector3::Zero();
  };
  /// Both for the same lease; what is left of the credit is the torque's.
  [[nodiscard]] Covered cover(const Vector3& force_on_hand_newton, Duration lease,
                              const Vector3& torque_newton_m) noexcept {
    if (wrist_) {
      monitor_.set_credit(monitor_.credit_joule() + wrist_->credit_joule());
      wrist_->set_credit(0.0);
    }
    const double credit_joule = monitor_.credit_joule();
    Covered covered{monitor_.cover(force_on_hand_newton, lease), torque_newton_m};
    note({.kind = JournalKind::kCover,
          .force_newton = force_on_hand_newton,
          .lease = lease,
          .is_good = !covered.is_reduced,
          .covered_newton = covered.force_on_hand_newton,
          .covered_lease = covered.lease});
    if (!wrist_) return covered;
    // the drain of 1 ns, in which leases are counted, passes as rounding of the force, too
    const double spent_joule = credit_joule - monitor_.credit_joule();
    const double rounding_joule =
        covered.is_reduced ? 0.0 : spent_joule * std::min(1.0, 1e-9 / to_seconds(lease));
    wrist_->set_credit(monitor_.credit_joule() + rounding_joule);
    monitor_.set_credit(0.0);
    const ForceMonitor::Covered turning = wrist_->cover(torque_newton_m, covered.lease);
    covered.torque_newton_m = turning.force_on_hand_newton;
    covered.lease = turning.lease;
    covered.is_reduced = covered.is_reduced || turning.is_reduced;
    return covered;
  }
  [[nodiscard]] double joule() const noexcept { return monitor_.joule(); }
  [[nodiscard]] bool is_account_plausible() const noexcept {
    return monitor_.is_account_plausible() && (!wrist_ || wrist_->is_account_plausible());
  }
  [[nodiscard]] bool is_ledger_plausible(double ledger_joule) noexcept {
    const bool is_plausible =
        monitor_.is_ledger_plausible(ledger_joule, wrist_ ? wrist_->account_at_most_joule() : 0.0);
    // NaN: this clamp counts on nothing
    if (!std::isnan(ledger_joule)) {
      note({.kind = JournalKind::kLedger, .is_good = is_plausible, .ledger_joule = ledger_joule});
    }
    return is_plausible;
  }
  [[nodiscard]] double coverable_joule() const noexcept {
    return monitor_.coverable_joule() + (wrist_ ? wrist_->coverable_joule() : 0.0);
  }
  [[nodiscard]] const ForceMonitor& monitor() const noexcept { return monitor_; }

 private:
  void note(JournalEntry entry) noexcept {
    if (journal_ == nullptr) return;
    entry.monitor_joule = monitor_.joule();
    journal_->keep(entry);
  }

  ForceMonitor monitor_;
  std::optional<ForceMonitor> wrist_;
  Journal* journal_;
};

}  // namespace palpate::device
