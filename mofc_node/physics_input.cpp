// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/physics_input.h"

namespace palpate::mofc {

bool PhysicsInput::answers(const Received<Interaction>* newest, const DeviceState& state) noexcept {
  return newest != nullptr && newest->value.device_session_id == state.header.session_id &&
         newest->value.device_sequence == state.header.sequence;
}

PhysicsAnswer PhysicsInput::answer(const Received<Interaction>* newest, const DeviceState& state,
                                   TimePoint now, bool is_late) noexcept {
  PhysicsAnswer answer{.lost_for = lost_for(newest, now), .is_late = is_late};
  if (newest == nullptr || newest->value.device_session_id != state.header.session_id) {
    has_interaction_ = false;
    return answer;
  }
  if (!has_interaction_ || newest->value.device_sequence != answered_sequence_) {
    received_at_ = newest->received_at;
    answered_sequence_ = newest->value.device_sequence;
  }
  has_interaction_ = true;
  answer.interaction = &newest->value;
  answer.silence = now - received_at_;
  answer.is_stepping = is_stepping(*newest);
  return answer;
}

bool PhysicsInput::is_stepping(const Received<Interaction>& newest) noexcept {
  const Interaction& interaction = newest.value;
  if (interaction.header.session_id != physics_session_ || interaction.steps > steps_) {
    physics_session_ = interaction.header.session_id;
    steps_ = interaction.steps;
    stepped_at_ = newest.received_at;
  }
  return steps_ > 0 && newest.received_at - stepped_at_ <= stale_after_;
}

/// A connection that is back counts once something has come over it.
Duration PhysicsInput::lost_for(const Received<Interaction>* newest, TimePoint now) noexcept {
  const std::uint64_t accepted = in_.counters().accepted;
  if (in_.has_lost_peer()) {
    if (!is_lost_) lost_at_ = now;
    is_lost_ = true;
    accepted_when_lost_ = accepted;
  } else if (accepted != accepted_when_lost_) {
    is_lost_ = false;
  }
  return is_lost_ && newest != nullptr ? std::max(Duration(1), now - lost_at_) : Duration::zero();
}

}  // namespace palpate::mofc
