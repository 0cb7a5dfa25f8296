// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/mofc_side.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <limits>
#include <utility>

namespace palpate {
namespace {

constexpr std::size_t kMostSent = 5000;  // 10 s
constexpr double kSamePlace_m = 1e-9;
constexpr double kOwnPause_s = 0.02;  // of this process, after which silence is not judged

Vector3 velocity_at(const MofcSide::Path& path, double t_s) {
  constexpr double kStep_s = 1e-4;
  return (path(t_s + kStep_s) - path(std::max(0.0, t_s - kStep_s))) /
         (kStep_s + std::min(t_s, kStep_s));
}

AnsweredPlace place_of(const Interaction& answer, TimePoint received_at) {
  AnsweredPlace place{.received_at = received_at,
                      .device_sequence = answer.device_sequence,
                      .position_m = answer.tool_position_world_m,
                      .force_newton = answer.force_on_tool_newton};
  Matrix3 slope = Matrix3::Zero();
  double most_outward_newton = -std::numeric_limits<double>::infinity();
  bool touches = false;
  bool is_linear = true;
  bool is_adhesive = false;
  for (std::uint32_t i = 0; i < answer.listed_count; ++i) {
    const Contact& contact = answer.contacts[i];
    if (contact.penetration_m <= 0.0) continue;
    touches = true;
    slope += contact.d_force_d_position;
    is_linear = is_linear && contact.hunt_crossley_exponent == 0.0;
    is_adhesive = is_adhesive || contact.is_adhesive;
    most_outward_newton =
        std::max(most_outward_newton, place.force_newton.dot(contact.normal_world));
  }
  if (touches && is_linear) place.slope_newton_per_m = slope;
  if (touches && !is_adhesive) place.against_newton = std::max(0.0, -most_outward_newton);
  return place;
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
                   .position_m = position_m});
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
  trace_.push_back(place_of(answer, received_at));
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
  for (TimePoint next = begin; next < begin + from_seconds(seconds); next += period) {
    clock_.sleep_until(next);
    const TimePoint now = clock_.now();
    if (to_seconds(now - last_turn) > kOwnPause_s) heard_at_ = now;
    last_turn = now;
    const double t_s = to_seconds(now - begin);
    send(path(t_s), velocity_at(path, t_s));
    if (take() > 0) heard_at_ = now;
    longest_silence_s_ = std::max(longest_silence_s_, to_seconds(now - *heard_at_));
  }
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
