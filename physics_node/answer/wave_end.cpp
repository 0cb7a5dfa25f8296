// SPDX-License-Identifier: Apache-2.0
#include "physics_node/answer/wave_end.h"

#include <cmath>

#include "common/contact/contact_model.h"
#include "common/coupling/implicit_step.h"

namespace palpate::physics {

const ToolMotion& WaveEnd::advance(const ToolMotion& motion, const Interaction& last,
                                   TimePoint now) noexcept {
  T_ = 0.0;
  if (!motion.wave.is_present()) {
    receiver_.begin({});
    return motion;
  }
  motion_ = motion;
  const bool is_same = receiver_.has_begun() && motion.wave.stream == receiver_.stream() &&
                       motion.device_session_id == device_session_id_ &&
                       motion.header.session_id == mofc_session_id_;
  if (!is_same) {
    device_session_id_ = motion.device_session_id;
    mofc_session_id_ = motion.header.session_id;
    receiver_.begin(motion.wave);
    sender_.begin(motion.wave.stream, motion.wave.impedance_newton_s_per_m);
    position_m_ = motion.tool_position_world_m;
    stepped_at_ = now;
    return motion_;
  }

  receiver_.receive(motion.wave);
  const double T = to_seconds(now - stepped_at_);
  Vector3 v = Vector3::Zero();
  Vector3 p = position_m_;
  if (T > 0.0) {
    T_ = T;
    stepped_at_ = now;
    arrived_ = receiver_.take(T);
    const double b = sender_.wave().impedance_newton_s_per_m;
    const Vector3 free_m = std::sqrt(2.0 / b) * arrived_;  // of the tool without tissue
    const double age_s = std::max(0.0, to_seconds(now - last.header.sampled_at));
    p = implicit_step(
        [&](const Vector3& at_m) {
          const Vector3 moved_m = at_m - position_m_;
          return Vector3(evaluate(last, at_m, moved_m / T, age_s).force_on_tool_newton +
                         b / T * (free_m - moved_m));
        },
        position_m_ + free_m, b / T);
    v = (p - position_m_) / T;
  }
  motion_.tool_position_world_m = p;
  motion_.tool_velocity_world_m_per_s = v;
  return motion_;
}

void WaveEnd::answer(Interaction& interaction) noexcept {
  if (T_ > 0.0) {
    const double b = sender_.wave().impedance_newton_s_per_m;
    const Vector3 impulse = -T_ * interaction.force_on_tool_newton;  // f T
    position_m_ += (std::sqrt(2.0 * b) * arrived_ - impulse) / b;
    sender_.send(arrived_ - std::sqrt(2.0 / b) * impulse, T_);
  }
  interaction.wave = receiver_.has_begun() ? sender_.wave() : Wave{};
}

}  // namespace palpate::physics
