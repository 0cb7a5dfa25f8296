// SPDX-License-Identifier: Apache-2.0
// mofc_side.h — mofc_node's end of hops 2 and 3, for a test of a physics: sends motions along a
// path and judges what answers.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "common/session/session.h"

namespace palpate {

/// Where the tool was, and what the physics answered for that place.
struct AnsweredPlace {
  TimePoint received_at;
  TimePoint sampled_at;  ///< when the tool was there
  Vector3 position_m = Vector3::Zero();
  Vector3 velocity_m_per_s = Vector3::Zero();
  Vector3 force_newton = Vector3::Zero();
  std::shared_ptr<const Interaction> answer;
};

class MofcSide {
 public:
  MofcSide(ZmqContext& context, const Side& side, Clock& clock, std::uint64_t session_id);

  /// Position of the tool after so many seconds.
  using Path = std::function<Vector3(double t_s)>;
  /// Sends motions along the path at kMotionHz and takes the answers.
  void follow(const Path& path, double seconds);
  /// Takes answers without sending; returns their number.
  std::size_t listen(double seconds);
  /// Every motion has its first answer.
  [[nodiscard]] bool has_all_answers() const { return last_answered_ + 1 == next_sequence_; }
  /// Sends this position until an answer to a motion sent from now on arrives; false at the end.
  [[nodiscard]] bool await_answer(const Vector3& position_m, double seconds);

  /// The first answer to each motion, in order; cleared by take_trace().
  [[nodiscard]] std::vector<AnsweredPlace> take_trace();
  /// Seconds from the sending of a motion to its first answer, of all so far.
  [[nodiscard]] const std::vector<double>& delays_s() const { return delays_s_; }
  /// Answers per second while motions were sent, the median of spans of 0.1 s; 0: none.
  [[nodiscard]] double rate_hz() const;
  /// Longest time without an answer while motions were sent; the test's own pauses excluded.
  [[nodiscard]] double longest_silence_s() const { return longest_silence_s_; }
  /// The first answer whose stamps or pose are wrong; empty: none.
  [[nodiscard]] const std::string& wrong_stamp() const { return wrong_stamp_; }
  /// Session of the newest answer; 0: none yet.
  [[nodiscard]] std::uint64_t physics_session() const { return physics_session_; }
  [[nodiscard]] const Rejections& rejections() const { return answers_.rejections(); }

  static constexpr double kMotionHz = 500.0;

 private:
  struct Sent {
    std::uint64_t sequence = 0;
    TimePoint sampled_at;
    Vector3 position_m;
    Vector3 velocity_m_per_s;
    bool is_answered = false;
  };
  void send(const Vector3& position_m, const Vector3& velocity_m_per_s);
  std::size_t take();
  void judge(const Interaction& answer, TimePoint received_at);
  void complain(const std::string& what);

  Clock& clock_;
  ZmqSender<ToolMotion> motions_;
  ZmqSource<Interaction> answers_;
  ToolMotion motion_;
  std::deque<Sent> sent_;
  std::uint64_t next_sequence_ = 1;
  std::uint64_t physics_session_ = 0;
  std::uint64_t last_sequence_ = 0;
  std::uint64_t last_answered_ = 0;
  std::optional<TimePoint> heard_at_;
  std::vector<AnsweredPlace> trace_;
  std::vector<double> delays_s_;
  std::vector<double> rates_hz_;
  double longest_silence_s_ = 0.0;
  std::string wrong_stamp_;
};

}  // namespace palpate
