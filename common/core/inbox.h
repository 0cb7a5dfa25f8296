// SPDX-License-Identifier: Apache-2.0
// inbox.h — the receiving side of a link in a node: messages pass the fault line and are delivered
// in order, once each; losses, duplicates and restarts are counted.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>

#include "common/core/clock.h"
#include "common/core/fault_line.h"
#include "common/core/messages.h"
#include "common/core/ports.h"

namespace palpate {

/// Which DeviceState a message answers.
struct DeviceStamp {
  std::uint64_t session_id = 0;
  std::uint64_t sequence = 0;
  TimePoint sampled_at{};  ///< device's clock
};
[[nodiscard]] inline DeviceStamp answered_state(const ForceCommand& command) {
  return {command.answers_session_id, command.answers_sequence, command.answers_sampled_at};
}
[[nodiscard]] inline DeviceStamp answered_state(const Interaction& interaction) {
  return {interaction.device_session_id, interaction.device_sequence,
          interaction.device_sampled_at};
}

template <class T>
struct Received {
  T value{};
  TimePoint received_at{};           ///< this node's clock
  std::uint64_t skipped_before = 0;  ///< sequence numbers missing directly before this message
};

/// A message older than one already accepted is dropped and counted. A restarted sender (new
/// session id) is accepted at once; messages of the previous session are dropped as out of order
/// until the current one has been silent for kSessionSilence.
///
///   before the first   newest() and next() return nullptr
///   fresh or stale     the caller decides, from received_at
///   invalid            refused by the codec before it gets here; counted in counters().rejected
///   ahead              see reject_answers_newer_than()
///
/// Single-threaded. No lock, no throw; allocates only if a fault line is configured.
template <class T>
class Inbox {
  static constexpr Duration kSessionSilence = std::chrono::seconds(1);

 public:
  Inbox(Source<T>& source, const Clock& clock) : source_(source), clock_(clock) {}
  Inbox(Source<T>& source, const Clock& clock, const LinkFaults& faults, std::uint64_t seed)
      : source_(source), clock_(clock) {
    if (faults.any()) faults_.emplace(faults, seed, clock.now());
  }

  /// The next accepted message, or nullptr. The pointer is valid until the next call.
  const Received<T>* next() noexcept {
    for (;;) {
      Received<T>& arriving = slots_[1 - held_];
      if (!arrived(arriving.value, arriving.received_at)) break;
      if (!accept(arriving)) continue;
      held_ = 1 - held_;
      return &slots_[held_];
    }
    counters_.rejected = source_.rejected();
    return nullptr;
  }

  /// Reads everything that has arrived and returns the newest message accepted so far; nullptr
  /// before the first. `skipped_before` refers to the last message read; a restart of the sender is
  /// visible in the session id.
  const Received<T>* newest() noexcept {
    while (next() != nullptr) {
    }
    return counters_.accepted > 0 ? &slots_[held_] : nullptr;
  }

  /// From now on an answer to a later state of this session, or to this one with another stamp, is
  /// dropped and counted in counters().ahead.
  void reject_answers_newer_than(const DeviceStamp& newest) noexcept { newest_state_ = newest; }

  /// Returns when a message may have arrived, or at `deadline`. May return early.
  void wait_until(TimePoint deadline) noexcept {
    if (faults_) deadline = std::min(deadline, faults_->next_due());
    if (deadline > clock_.now()) source_.wait_until(deadline);
  }

  /// See Source::prepare_wait().
  void prepare_wait(TimePoint deadline) noexcept { source_.prepare_wait(deadline); }

  /// When a message held by the fault line is due; TimePoint::max() if none.
  [[nodiscard]] TimePoint next_due() const {
    return faults_ ? faults_->next_due() : TimePoint::max();
  }

  /// See Source::has_lost_peer().
  [[nodiscard]] bool has_lost_peer() const noexcept { return source_.has_lost_peer(); }

  [[nodiscard]] const LinkCounters& counters() const { return counters_; }

 private:
  bool arrived(T& message, TimePoint& received_at) noexcept {
    if (!faults_) return source_.receive(message, received_at);
    while (source_.receive(message, received_at)) faults_->push(message, received_at);
    return faults_->pop(clock_.now(), message, received_at);
  }

  [[nodiscard]] bool is_ahead(const T& message) const noexcept {
    if constexpr (requires { answered_state(message); }) {
      const DeviceStamp answered = answered_state(message);
      if (!newest_state_ || answered.session_id != newest_state_->session_id) return false;
      return answered.sequence > newest_state_->sequence ||
             answered.sampled_at > newest_state_->sampled_at ||
             (answered.sequence == newest_state_->sequence &&
              answered.sampled_at != newest_state_->sampled_at);
    }
    return false;
  }

  bool accept(Received<T>& arriving) noexcept {
    const Header& header = arriving.value.header;
    if (is_ahead(arriving.value)) {
      ++counters_.ahead;
      return false;
    }
    const bool is_first = counters_.accepted == 0;
    const bool is_new_session = is_first || header.session_id != session_id_;
    if (is_new_session && !is_first && header.session_id == superseded_session_id_ &&
        arriving.received_at - slots_[held_].received_at < kSessionSilence) {
      ++counters_.out_of_order;
      return false;
    }
    arriving.skipped_before = 0;
    if (!is_new_session) {
      if (header.sequence == sequence_) {
        ++counters_.duplicates;
        return false;
      }
      if (header.sequence < sequence_) {
        ++counters_.out_of_order;
        return false;
      }
      arriving.skipped_before = header.sequence - sequence_ - 1;
      counters_.skipped += arriving.skipped_before;
    } else {
      ++counters_.sessions;
      superseded_session_id_ = session_id_;
      session_id_ = header.session_id;
    }
    sequence_ = header.sequence;
    ++counters_.accepted;
    return true;
  }

  Source<T>& source_;
  const Clock& clock_;
  std::optional<FaultLine<T>> faults_;
  // messages have kilobytes: one slot holds the newest accepted one, the other takes the next
  std::array<Received<T>, 2> slots_{};
  std::size_t held_ = 0;
  LinkCounters counters_;
  std::uint64_t session_id_ = 0;
  std::uint64_t superseded_session_id_ = 0;
  std::uint64_t sequence_ = 0;
  std::optional<DeviceStamp> newest_state_;
};

}  // namespace palpate
