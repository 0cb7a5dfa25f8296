// physics_input.h — hop 3: the newest Interaction that counts, and how long the physics has been
// silent.
#pragma once

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
  /// The wait for the answer to this very DeviceState ran out.
  bool is_late = false;
};

/// An Interaction counts if it answers the present device session. Physics that keeps answering an
/// old motion counts as silent. No allocation, no throw.
class PhysicsInput {
 public:
  /// @param longest_wait  for the answer to the DeviceState of the tick; 0: never wait
  PhysicsInput(Inbox<Interaction>& in, const Clock& clock, Duration longest_wait)
      : in_(in), clock_(clock), longest_wait_(longest_wait) {}

  /// @param now  the silence is measured up to this time
  [[nodiscard]] PhysicsAnswer take(const DeviceState& state, TimePoint now) noexcept;

  [[nodiscard]] bool waits() const noexcept { return longest_wait_ > Duration::zero(); }
  [[nodiscard]] LinkCounters counters() const noexcept { return in_.counters(); }

 private:
  Inbox<Interaction>& in_;
  const Clock& clock_;
  Duration longest_wait_;
  bool has_interaction_ = false;
  std::uint64_t answered_sequence_ = 0;  // DeviceState that the newest Interaction answers
  TimePoint received_at_{};              // the first Interaction that answered it
};

}  // namespace palpate::mofc
