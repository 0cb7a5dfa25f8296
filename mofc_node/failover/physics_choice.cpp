// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/failover/physics_choice.h"

#include <algorithm>

namespace palpate::mofc {
namespace {

// The nodes of a session do not start at the same instant.
constexpr Duration kFirstAnswer = std::chrono::seconds(2);

}  // namespace

PhysicsRole PhysicsChoice::step(const std::array<HeardPhysics, kPhysicsRoles>& heard,
                                TimePoint now) noexcept {
  if (!began_at_) began_at_ = now;
  for (const HeardPhysics& physics : heard) term_ = std::max(term_, physics.term);
  const PhysicsRole named = speaker_of(term_);
  if (is_heard(heard[index_of(named)])) {
    use(named);
    return in_use_;
  }
  const PhysicsRole rest = other(in_use_);
  if (is_silent(heard[index_of(in_use_)], now) && is_heard(heard[index_of(rest)])) {
    if (named != rest && term_ < kMaxPhysicsTerm) ++term_;
    use(rest);
  }
  return in_use_;
}

bool PhysicsChoice::is_heard(const HeardPhysics& physics) const noexcept {
  return physics.has_answered && !physics.is_lost && physics.silence <= silence_ / 2;
}

bool PhysicsChoice::is_silent(const HeardPhysics& physics, TimePoint now) const noexcept {
  if (!physics.has_answered) return now - *began_at_ >= kFirstAnswer;
  return physics.is_lost || physics.silence >= silence_;
}

void PhysicsChoice::use(PhysicsRole role) noexcept {
  if (role == in_use_) return;
  in_use_ = role;
  ++switches_;
}

}  // namespace palpate::mofc
