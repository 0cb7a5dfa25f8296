// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/mofc_side.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstddef>
#include <utility>

namespace palpate {
namespace {

constexpr std::size_t kMostSent = 5000;  // 10 s
constexpr double kSamePlace_m = 1e-9;
constexpr double kRateSpan_s = 0.1;
constexpr double kOwnPause_s = 0.02;  // of this process, after which silence is not judged

Vector3 velocity_at(const MofcSide::Path& path, double t_s) {
  constexpr double kStep_s = 1e-4;
  return (path(t_s + kStep_s) - path(std::max(0.0, t_s - kStep_s))) /
         (kStep_s + std::min(t_s, kStep_s));
}

}  // namespace

MofcSide::MofcSide(ZmqContext& context, const Side& side, Clock& clock, std::uint64_t session_id)
    : clock_(clock),
      motions_(context, connect_to(side.links.tool_motion, "links.tool_motion")),
      answers_(context, clock, connect_to(side.links.interaction, "links.interaction")) {
  motion_.header.session_id = session_id;
  motion_.device_session_id = session_id ^ 0x5555;
}

void MofcSide::send(const Vector3& position_m, const Vector3& velocity_m_per_s) {
  motion_.header.sequence = next_sequence_;
  motion_.header.sampled_at = clock_.now();
  motion_.device_sequence = next_sequence_;
  motion_.device_sampled_at = motion_.header.sampled_at;
  motion_.tool_position_world_m = position_m;
  motion_.tool_velocity_world_m_per_s = velocity_m_per_s;
  motions_.send(motion_);
  sent_.push_back({.sequence = next_sequence_++,
                   .sampled_at = motion_.header.sampled_at,
                   .position_m = position_m,
                   .velocity_m_per_s = velocity_m_per_s});
  if (sent_.size() > kMostSent) sent_.pop_front();
}

void MofcSide::complain(const std::string& what) {
  if (wrong_stamp_.empty()) wrong_stamp_ = what;
}

void MofcSide::judge(const Interaction& answer, TimePoint received_at) {
  if (answer.header.session_id != std::exchange(physics_session_, answer.header.session_id)) {
    last_answered_ = 0;  // it has started again
  } else if (answer.header.sequence <= last_sequence_) {
    complain(fmt::format("header.sequence {} after {}: count up with every message",
                         answer.header.sequence, last_sequence_));
  }
  last_sequence_ = answer.header.sequence;
  const auto sent = std::find_if(sent_.begin(), sent_.end(), [&](const Sent& one) {
    return one.sequence == answer.device_sequence;
  });
  if (answer.device_session_id != motion_.device_session_id || sent == sent_.end() ||
      sent->sampled_at != answer.device_sampled_at) {
    complain("answers is not the device of any motion sent: echo it unchanged");
    return;
  }
  if ((answer.tool_position_world_m - sent->position_m).norm() > kSamePlace_m) {
    complain("tool_position_world_m is not that of the motion answered: echo the pose of the step");
  }
  if (answer.device_sequence < last_answered_) {
    complain("an older motion answered after a newer one: answer the newest");
    return;
  }
  last_answered_ = answer.device_sequence;
  if (std::exchange(sent->is_answered, true)) return;
  delays_s_.push_back(to_seconds(received_at - sent->sampled_at));
  trace_.push_back({.received_at = received_at,
                    .sampled_at = sent->sampled_at,
                    .position_m = sent->position_m,
                    .velocity_m_per_s = sent->velocity_m_per_s,
                    .force_newton = answer.force_on_tool_newton,
                    .answer = std::make_shared<const Interaction>(answer)});
}

std::size_t MofcSide::take() {
  Interaction answer;
  TimePoint received_at;
  std::size_t count = 0;
  while (answers_.receive(answer, received_at)) {
    judge(answer, received_at);
    ++count;
  }
  return count;
}

void MofcSide::follow(const Path& path, double seconds) {
  const TimePoint begin = clock_.now();
  const Duration period = from_seconds(1.0 / kMotionHz);
  heard_at_ = begin;
  TimePoint last_turn = begin;
  TimePoint span_begin = begin;
  std::size_t span_count = 0;
  for (TimePoint next = begin; next < begin + from_seconds(seconds); next += period) {
    clock_.sleep_until(next);
    const TimePoint now = clock_.now();
    if (to_seconds(now - last_turn) > kOwnPause_s) heard_at_ = now;
    last_turn = now;
    const double t_s = to_seconds(now - begin);
    send(path(t_s), velocity_at(path, t_s));
    const std::size_t count = take();
    if (count > 0) heard_at_ = now;
    span_count += count;
    if (const double span_s = to_seconds(now - span_begin); span_s >= kRateSpan_s) {
      rates_hz_.push_back(static_cast<double>(std::exchange(span_count, 0)) / span_s);
      span_begin = now;
    }
    longest_silence_s_ = std::max(longest_silence_s_, to_seconds(now - *heard_at_));
  }
}

double MofcSide::rate_hz() const {
  std::vector<double> rates_hz = rates_hz_;
  if (rates_hz.empty()) return 0.0;
  const auto middle = rates_hz.begin() + static_cast<std::ptrdiff_t>(rates_hz.size() / 2);
  std::nth_element(rates_hz.begin(), middle, rates_hz.end());
  return *middle;
}

std::size_t MofcSide::listen(double seconds) {
  std::size_t count = 0;
  const TimePoint end = clock_.now() + from_seconds(seconds);
  while (clock_.now() < end) {
    clock_.sleep_until(clock_.now() + from_seconds(1.0 / kMotionHz));
    count += take();
  }
  return count;
}

bool MofcSide::await_answer(const Vector3& position_m, double seconds) {
  const TimePoint end = clock_.now() + from_seconds(seconds);
  const std::uint64_t first = next_sequence_;
  while (clock_.now() < end) {
    send(position_m, Vector3::Zero());
    clock_.sleep_until(clock_.now() + from_seconds(1.0 / kMotionHz));
    take();
    if (last_answered_ >= first) return true;
  }
  return false;
}

std::vector<AnsweredPlace> MofcSide::take_trace() { return std::exchange(trace_, {}); }

}  // namespace palpate
