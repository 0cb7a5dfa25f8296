// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/device_echo.h"

namespace palpate::mofc {

void DeviceEcho::reset() noexcept {
  previous_.reset();
  requested_newton_.reset();
  requested_before_newton_.reset();
  known_until_ = TimePoint::min();
}

DeviceEcho::Report DeviceEcho::take(const DeviceState& state) noexcept {
  const TimePoint reading = state.header.sampled_at;
  Report report;
  if (previous_) report.since_previous = reading - *previous_;
  if (state.applied_count > 0) report.since_answered = reading - state.applied[0].from;

  // what ended by then is booked
  TimePoint reached = known_until_;
  bool is_continued = true;
  std::size_t count = 0;
  Vector3 impulse = Vector3::Zero();
  double duration_s = 0.0;
  bool is_before_answer = true;  // what acted at the previous reading still acts
  for (std::uint32_t i = 0; i < state.applied_count; ++i) {
    const AppliedForce& applied = state.applied[i];
    if (applied.until <= known_until_) continue;
    is_continued = is_continued && applied.from == reached;
    reached = applied.until;
    const double stretch_s = to_seconds(applied.until - applied.from);
    segments_[count++] = {.duration_s = stretch_s,
                          .force_on_hand_newton = applied.force_on_hand_newton,
                          .hand_position_at_end_m = applied.hand_position_at_end_m,
                          .has_position_at_end = applied.has_position_at_end};
    impulse += stretch_s * applied.force_on_hand_newton;
    duration_s += stretch_s;
    is_before_answer = is_before_answer && applied.force_on_hand_newton == acting_newton_ &&
                       applied.until < reading;
    const auto& requested = is_before_answer ? requested_before_newton_ : requested_newton_;
    if (requested) rendered_.add(stretch_s, *requested, applied.force_on_hand_newton);
  }
  report.applied = {segments_.data(), count};
  // those that were skipped came first
  report.reported = std::span(state.applied).subspan(state.applied_count - count, count);
  if (duration_s > 0.0) report.mean_force_newton = impulse / duration_s;

  // Only an echo that ends at its own reading can be continued: an older one was repeated. The
  // first state of a session may report nothing.
  const bool is_current = reached == reading || (!previous_ && count == 0);
  report.has_gap = previous_.has_value() && !(is_continued && is_current);
  known_until_ = is_current ? reading : TimePoint::min();
  acting_newton_ = state.acting_force_on_hand_newton;
  previous_ = reading;
  return report;
}

}  // namespace palpate::mofc
