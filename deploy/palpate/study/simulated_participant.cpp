// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/study/simulated_participant.h"

#include <cmath>
#include <variant>

#include "common/core/random.h"

namespace palpate {

bool first_mark_is_right(const TaskScore& score) {
  if (score.marks.empty()) return false;
  const MarkScore::Outcome outcome = score.marks.front().outcome;
  return outcome == MarkScore::Outcome::kFind || outcome == MarkScore::Outcome::kGuess;
}

bool SimulatedParticipant::is_right(const TaskScore& score, std::uint64_t seed) const {
  Random random(seed ^ fnv1a("senses"));
  const double there = score.targets.empty() ? kNotKnown : score.targets[0].force.most_newton;
  const double elsewhere = score.elsewhere.most_newton;
  if (!std::isfinite(there) || !std::isfinite(elsewhere)) return random.chance(0.5);
  return there * (1.0 + weber_ratio * random.normal()) >
         elsewhere * (1.0 + weber_ratio * random.normal());
}

void SimulatedParticipant::move_hand(Session& session, std::uint64_t seed) const {
  auto* path = std::get_if<RecordedPath>(&session.sides.front().hand.path);
  if (path == nullptr || !(hand_noise_mm > 0.0)) return;
  Random random(seed ^ fnv1a("hand"));
  for (RecordedPath::Sample& sample : path->samples) {
    for (int axis = 0; axis < 3; ++axis) {
      sample.position_m[axis] += 1e-3 * hand_noise_mm * random.normal();
    }
  }
}

}  // namespace palpate
