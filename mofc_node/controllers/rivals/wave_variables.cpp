// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/wave_variables.h"

#include <cmath>
#include <limits>

namespace palpate::controllers {

ControlOutput WaveVariables::step(const ControlInput& input) noexcept {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const Interval interval = interval_.read(input);
  if (input.returned_wave == nullptr) {
    is_open_ = false;
    return unbounded_output(input, Vector3::Zero(), kNone);
  }
  if (!is_open_) {
    is_open_ = true;
    sender_.begin(0, p_.b);
    receiver_.begin({});
    spent_.setZero();
  } else if (interval.duration_s > 0.0) {
    sender_.send(std::sqrt(2.0 * p_.b) * interval.moved_m - spent_, interval.duration_s);
    spent_.setZero();
  }

  const Wave& returned = *input.returned_wave;
  if (returned.is_present()) {
    // the other end began anew: so did its sums
    if (returned.stream != receiver_.stream()) receiver_.begin({.stream = returned.stream});
    receiver_.receive(returned);
  }
  const Vector3 part = receiver_.take(p_.T);
  spent_ += part;
  const Vector3 force = std::sqrt(2.0 * p_.b) / p_.T * part - p_.b * input.hand_velocity_m_per_s;
  ControlOutput output =
      unbounded_output(input, returned.is_present() ? force : Vector3(Vector3::Zero()), kNone);
  output.sent_wave = sender_.wave();
  return output;
}

}  // namespace palpate::controllers
