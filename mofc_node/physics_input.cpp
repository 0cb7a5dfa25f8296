#include "mofc_node/physics_input.h"

namespace palpate::mofc {

PhysicsAnswer PhysicsInput::take(const DeviceState& state, TimePoint now) noexcept {
  PhysicsAnswer answer;
  const Received<Interaction>* newest = in_.newest();
  const auto answers_this_tick = [&](const Received<Interaction>* r) {
    return r != nullptr && r->value.device_session_id == state.header.session_id &&
           r->value.device_sequence == state.header.sequence;
  };

  // same tick: wait for its answer up to the configured time
  if (waits()) {
    const TimePoint deadline = now + longest_wait_;
    while (!answers_this_tick(newest) && clock_.now() < deadline) {
      in_.wait_until(deadline);
      newest = in_.newest();
    }
    answer.is_late = !answers_this_tick(newest);
  }

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
  return answer;
}

}  // namespace palpate::mofc
