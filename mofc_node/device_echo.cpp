#include "mofc_node/device_echo.h"

namespace palpate::mofc {

void DeviceEcho::reset() noexcept {
  previous_.reset();
  requested_newton_.reset();
  known_until_ = TimePoint::min();
  acting_newton_.setZero();
}

DeviceEcho::Report DeviceEcho::take(const DeviceState& state, bool is_after_gap) noexcept {
  const TimePoint reading = state.header.sampled_at;
  Report report;
  report.has_gap = previous_.has_value() && (is_after_gap || !continues(state));
  if (previous_) report.since_previous = reading - *previous_;

  // Only an echo that ends at its own reading can be continued: an older one was repeated. The
  // first state of a session has none, and neither has a reading with the stamp of the previous
  // one.
  const bool is_current = state.applied_count > 0
                              ? state.applied[state.applied_count - 1].until == reading
                              : !previous_ || known_until_ == reading;
  known_until_ = is_current ? reading : TimePoint::min();

  Vector3 impulse = Vector3::Zero();
  double duration_s = 0.0;
  for (std::uint32_t i = 0; i < state.applied_count; ++i) {
    const AppliedForce& applied = state.applied[i];
    const double stretch_s = to_seconds(applied.until - applied.from);
    segments_[i] = {.duration_s = stretch_s,
                    .force_on_hand_newton = applied.force_on_hand_newton,
                    .hand_position_at_end_m = applied.hand_position_at_end_m,
                    .has_position_at_end = applied.has_position_at_end};
    impulse += stretch_s * applied.force_on_hand_newton;
    duration_s += stretch_s;
  }
  std::size_t count = state.applied_count;
  if (count > 0) {
    acting_newton_ = state.applied[count - 1].force_on_hand_newton;
  } else if (previous_ && is_current && !report.has_gap) {
    // no time has passed; whether the last answer acts already is not reported
    segments_[count++] = {.duration_s = 0.0,
                          .force_on_hand_newton = commanded_newton_.norm() > acting_newton_.norm()
                                                      ? commanded_newton_
                                                      : acting_newton_,
                          .hand_position_at_end_m = state.hand_position_m,
                          .has_position_at_end = true};
  }
  report.applied = {segments_.data(), count};
  if (duration_s > 0.0) report.mean_force_newton = impulse / duration_s;

  // the force that acts at t_k is the answer to the previous state, as the device applied it
  if (requested_newton_ && state.applied_count > 0) {
    transparency_.add(*requested_newton_,
                      state.applied[state.applied_count - 1].force_on_hand_newton);
  }
  previous_ = reading;
  return report;
}

bool DeviceEcho::continues(const DeviceState& state) const noexcept {
  // a segment that is reported twice must not be booked twice
  TimePoint reached = known_until_;
  for (std::uint32_t i = 0; i < state.applied_count; ++i) {
    if (state.applied[i].from != reached) return false;
    reached = state.applied[i].until;
  }
  return reached == state.header.sampled_at;
}

}  // namespace palpate::mofc
