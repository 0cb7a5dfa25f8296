// SPDX-License-Identifier: Apache-2.0
// physics_input.h — hop 3: the newest Interaction that counts, and how long the physics has been
// silent.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/messages.h"

namespace palpate::mofc {

/// What the physics contributes to one answer.
struct PhysicsAnswer {
  /// Null: none has answered the present device session yet. Valid until the next take().
  const Interaction* interaction = nullptr;
  /// Time since the physics last answered a newer motion; 0 without an Interaction.
  Duration silence{};
  /// It reports its steps, and has not sent for longer than stale_after without a new one.
  bool is_stepping = false;
  /// Time since the connection to physics_node was lost, if nothing has come since; else 0.
  Duration lost_for{};
  /// The wait for the answer to this very DeviceState ran out.
  bool is_late = false;
};

/// An Interaction counts if it answers the present device session, and a state that mofc_node has
/// seen. Physics that keeps answering an old motion counts as silent. No allocation, no throw.
class PhysicsInput {
 public:
  /// @param longest_wait  for the answer to the DeviceState of the tick; 0: never wait
  /// @param stale_after   so long may it send without a new step
  PhysicsInput(Inbox<Interaction>& in, const Clock& clock, Duration longest_wait,
               Duration stale_after)
      : in_(in), clock_(clock), longest_wait_(longest_wait), stale_after_(stale_after) {}

  /// @param now   the silence is measured up to this time
  /// @param note  called with every Interaction that has arrived, in order
  template <class Note>
  [[nodiscard]] PhysicsAnswer take(const DeviceState& state, TimePoint now,
                                   const Note& note) noexcept {
    in_.reject_answers_newer_than(
        {state.header.session_id, state.header.sequence, state.header.sampled_at});
    const Received<Interaction>* newest = read(note);
    bool is_late = false;
    if (waits()) {
      // same tick: wait for its answer up to the configured time
      const TimePoint deadline = now + longest_wait_;
      while (!answers(newest, state) && clock_.now() < deadline) {
        in_.wait_until(deadline);
        newest = read(note);
      }
      is_late = !answers(newest, state);
    }
    return answer(newest, state, now, is_late);
  }

  /// What the next take() need not read.   @param note  as there
  template <class Note>
  void read_ahead(const Note& note) noexcept {
    if (!waits()) read(note);
  }

  [[nodiscard]] bool waits() const noexcept { return longest_wait_ > Duration::zero(); }
  [[nodiscard]] LinkCounters counters() const noexcept { return in_.counters(); }

 private:
  template <class Note>
  const Received<Interaction>* read(const Note& note) noexcept {
    while (const Received<Interaction>* next = in_.next()) note(next->value);
    return in_.newest();
  }
  [[nodiscard]] static bool answers(const Received<Interaction>* newest,
                                    const DeviceState& state) noexcept;
  [[nodiscard]] PhysicsAnswer answer(const Received<Interaction>* newest, const DeviceState& state,
                                     TimePoint now, bool is_late) noexcept;
  [[nodiscard]] bool is_stepping(const Received<Interaction>& newest) noexcept;
  [[nodiscard]] Duration lost_for(const Received<Interaction>* newest, TimePoint now) noexcept;

  Inbox<Interaction>& in_;
  const Clock& clock_;
  Duration longest_wait_;
  Duration stale_after_;
  bool has_interaction_ = false;
  std::uint64_t answered_sequence_ = 0;  // DeviceState that the newest Interaction answers
  TimePoint received_at_{};              // the first Interaction that answered it
  std::uint64_t physics_session_ = 0;    // that reported
  std::uint64_t steps_ = 0;              // so many steps
  TimePoint stepped_at_{};               // the first Interaction that reported them
  bool is_lost_ = false;                 // the connection
  TimePoint lost_at_{};
  std::uint64_t accepted_when_lost_ = 0;
};

}  // namespace palpate::mofc
