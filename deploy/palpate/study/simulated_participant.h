// SPDX-License-Identifier: Apache-2.0
// simulated_participant.h — a participant whose senses are known, to test studies.
#pragma once

#include <cstdint>

#include "common/session/session.h"
#include "common/task/score.h"

namespace palpate {

/// The first mark of the trial is where a target is.
[[nodiscard]] bool first_mark_is_right(const TaskScore& score);

struct SimulatedParticipant {
  double weber_ratio = 0.0;    ///< standard deviation of a felt force, as a share of it
  double hand_noise_mm = 0.0;  ///< of each point of a recorded path, each axis

  /// Whether the largest force over the first target feels larger than that elsewhere. The two
  /// differ by a share d of the force: right with probability Φ(d/(√(1 + (1 + d)²) w)).
  [[nodiscard]] bool is_right(const TaskScore& score, std::uint64_t seed) const;
  /// Adds the noise of the hand to a recorded path.
  void move_hand(Session& session, std::uint64_t seed) const;
};

}  // namespace palpate
