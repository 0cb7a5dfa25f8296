// SPDX-License-Identifier: Apache-2.0
// leader_loop.h — a leader, its watchdog, a network that loses and delays, and a physics that lies,
// round a clamp.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "mofc_node/controllers/ports/port_guard.h"
#include "tests/property/ports/handle.h"
#include "tests/property/ports/leaders.h"

namespace palpate::test {

using controllers::PortGuard;
using controllers::PortGuardParameters;
using controllers::PortInput;
using controllers::PortOutput;
using controllers::PortStretch;

/// What can go wrong between leader and clamp.
struct LeaderTiming {
  double period_s = 1e-3;
  double longest_interval_s = 1e-3;  // a tick that comes late
  double longest_delay_s = 0.0;      // of an answer
  double overrun = 1.0;              // a command acts this many times its lease
  double lost_answers = 0.0;         // shares
  double lost_states = 0.0;          // the next one reports what they did
  double lost_echoes = 0.0;          // it is not known what acted
  double silent_watchdog = 0.0;      // of the leases that end: where the hand was is not known
};

/// Efforts of a follower or a physics that says anything: nothing, a push, noise, a push along the
/// motion, a hundred times too much, no number.
class LyingPhysics {
 public:
  LyingPhysics(Random& random, std::size_t count, const std::array<Port, kMostPorts>& ports)
      : random_(random), count_(count) {
    for (std::size_t i = 0; i < count_; ++i) {
      largest_[i] = 0.3 + 10.0 * ports[i].f_co + 2.0 * ports[i].f_d * ports[i].v_max;
    }
    change();
  }
  void change() {
    kind_ = random_.below(6);
    for (std::size_t i = 0; i < count_; ++i) push_[i] = random_.uniform(-1.0, 1.0) * largest_[i];
  }
  [[nodiscard]] PortValues request(const PortValues& moved) {
    PortValues effort{};
    for (std::size_t i = 0; i < count_; ++i) {
      switch (kind_) {
        case 0:
          break;
        case 1:
          effort[i] = push_[i];
          break;
        case 2:
          effort[i] = random_.uniform(-1.0, 1.0) * largest_[i];
          break;
        case 3:
          effort[i] = 100.0 * push_[i];
          break;
        default:  // active: along the motion seen last
          effort[i] = moved[i] == 0.0 ? push_[i] : std::copysign(push_[i], moved[i]);
      }
    }
    if (random_.chance(0.01)) {
      const std::size_t at = random_.below(count_);
      effort[at] = random_.chance(0.5) ? std::numeric_limits<double>::quiet_NaN()
                                       : std::numeric_limits<double>::infinity();
    }
    return effort;
  }

 private:
  Random& random_;
  std::size_t count_;
  std::uint64_t kind_ = 0;
  PortValues largest_{};
  PortValues push_{};
};

/// One leader with everything drawn at random, and what its clamp assumes.
struct LeaderCase {
  /// @param joints  4 … 8; 0: the handle
  LeaderCase(std::uint64_t seed, std::size_t joints) : random(seed) {
    if (joints > 0) {
      auto made = std::make_unique<JointLeader>(random, joints);
      joint_leader = made.get();
      leader = std::move(made);
    } else {
      auto made = std::make_unique<Handle>(random);
      handle = made.get();
      leader = std::move(made);
    }
    parameters.count = leader->count();
    take_profile();
    if (joints > 0) {
      for (Port& port : parameters.ports) port.priority = static_cast<int>(random.below(2));
    }
    timing.period_s = random.chance(0.5) ? 1e-3 : random.uniform(1e-3, 10e-3);  // 1 kHz … 100 Hz
    timing.longest_interval_s =
        timing.period_s * (random.chance(0.5) ? 1.0 : random.uniform(1.0, 5.0));
    timing.longest_delay_s = random.uniform(0.1, 0.8) * timing.period_s;
    timing.lost_answers = random.chance(0.5) ? random.uniform(0.0, 0.3) : 0.0;
    timing.lost_states = random.chance(0.5) ? random.uniform(0.0, 0.05) : 0.0;
    timing.lost_echoes = random.chance(0.3) ? random.uniform(0.0, 0.02) : 0.0;
    timing.silent_watchdog = random.chance(0.5) ? random.uniform() : 0.0;
    parameters.times = {.hold_s = timing.period_s * random.uniform(1.0, 2.0),
                        .delta_max_s = timing.longest_delay_s,
                        .prompt_s = random.chance(0.5) ? 0.0 : 0.5 * timing.longest_delay_s,
                        .longest_lease_s = timing.period_s * random.uniform(1.0, 20.0)};
    // half of them may keep all that the hand has put in
    const bool is_capped = random.chance(0.5);
    parameters.credit_cap_joule = is_capped ? 1e-4 * std::pow(1e4, random.uniform()) : 1e6;
    parameters.gate_joule = is_capped ? 1e-4 * std::pow(1e5, random.uniform()) : 1e6;
    parameters.contact_credit_joule =
        random.chance(0.5) ? 0.0 : 1e-3 * std::pow(1e4, random.uniform());
  }

  /// After a change of the leader.
  void take_profile() {
    ports = leader->profile();
    parameters.ports = ports;
  }

  Random random;
  std::unique_ptr<Leader> leader;
  JointLeader* joint_leader = nullptr;
  Handle* handle = nullptr;
  std::array<Port, kMostPorts> ports{};
  PortGuardParameters parameters;
  LeaderTiming timing;
  bool is_clamped = true;          // false: the requested efforts, as they are
  bool sees_gaps = true;           // false: a lost echo is taken for one that says all,
  bool loses_stretches = false;    // false: and that nothing acted
  bool ignores_deadlines = false;  // answers that come too late are used
  int rendered = 0;                // ticks with more than friction absorbs, on some port
};

class LeaderLoop {
 public:
  explicit LeaderLoop(LeaderCase& a_case)
      : case_(a_case),
        random_(a_case.random),
        leader_(*a_case.leader),
        guard_(a_case.parameters),
        physics_(a_case.random, a_case.leader->count(), a_case.ports) {
    echo_.reserve(256);
    reading_ = leader_.read();
  }

  /// @param check  called with every input and output
  template <class Check>
  void run(int ticks, Check&& check) {
    const LeaderTiming& t = case_.timing;
    PortValues before = reading_;
    bool has_gap = false;
    for (int k = 0; k < ticks; ++k) {
      if (random_.chance(0.05)) leader_.change();
      if (random_.chance(0.05)) physics_.change();
      is_attack_ = random_.chance(is_attack_ ? 0.8 : 0.02);
      if (is_attack_) leader_.attack();
      const double interval_s = is_attack_ || random_.chance(0.3)
                                    ? t.longest_interval_s
                                    : random_.uniform(t.period_s, t.longest_interval_s);
      double delay_s = random_.uniform() * t.longest_delay_s;
      if (is_attack_) delay_s = random_.chance(0.5) ? 0.0 : t.longest_delay_s;

      // the reading; the answer to it, unless state or answer get lost
      if (!is_read_) reading_ = leader_.read();
      is_read_ = true;
      PortOutput answer;
      bool is_answered = false;
      if (!random_.chance(t.lost_states)) {
        if (random_.chance(t.lost_echoes)) {
          has_gap = case_.sees_gaps;
          if (case_.sees_gaps || case_.loses_stretches) {
            echo_.clear();
          } else {
            for (PortStretch& stretch : echo_) stretch.effort_on_hand = {};
          }
        }
        PortValues moved{};
        for (std::size_t i = 0; i < moved.size(); ++i) moved[i] = reading_[i] - before[i];
        const PortInput input{
            .position = reading_,
            .applied = echo_,
            .has_gap = has_gap,
            .acting_effort_on_hand = effort_,
            .acting_lease_s =
                lease_left_s_ > 0.0 ? lease_left_s_ : std::numeric_limits<double>::infinity(),
            .requested_effort_on_hand = physics_.request(moved),
            .is_request_fresh = random_.chance(0.5),
            .stored_energy_joule = random_.chance(0.8) ? 1e3 : random_.uniform(-1.0, 1.0)};
        answer = guard_.step(input);
        check(input, answer);
        if (!case_.is_clamped) answer = unclamped(input);
        has_gap = false;
        is_answered = !random_.chance(t.lost_answers) &&
                      (case_.ignores_deadlines || delay_s <= answer.begins_within_s);
        echo_.clear();
      }
      before = reading_;

      // the old effort goes on until the answer comes; one that comes too late is not used
      double left_s = interval_s;
      if (is_answered) {
        hold(std::min(delay_s, left_s));
        left_s -= std::min(delay_s, left_s);
        effort_ = leader_.realised(answer.effort_on_hand);
        lease_left_s_ = t.overrun * answer.lease_s;
        for (std::size_t i = 0; i < leader_.count(); ++i) {
          if (std::abs(effort_[i]) > case_.ports[i].f_co + 0.01) {
            ++case_.rendered;
            break;
          }
        }
      }
      hold(left_s);
    }
  }

 private:
  [[nodiscard]] PortOutput unclamped(const PortInput& input) const {
    PortOutput output;
    for (std::size_t i = 0; i < leader_.count(); ++i) {
      const double asked = input.requested_effort_on_hand[i];
      output.effort_on_hand[i] = std::isfinite(asked) ? asked : 0.0;
    }
    output.lease_s = case_.parameters.times.longest_lease_s;
    output.begins_within_s = case_.timing.longest_delay_s;
    return output;
  }

  void hold(double duration_s) {
    const double leased_s = std::min(duration_s, lease_left_s_);
    const bool is_unread =
        leased_s > 0.0 && leased_s < duration_s && random_.chance(case_.timing.silent_watchdog);
    if (leased_s > 0.0) stretch(leased_s, !is_unread);
    lease_left_s_ -= leased_s;
    if (leased_s < duration_s) {
      for (std::size_t i = 0; i < leader_.count(); ++i) {
        const double most = is_unread ? 0.0 : case_.ports[i].f_co;
        effort_[i] = std::clamp(effort_[i], -most, most);
      }
      stretch(duration_s - leased_s, true);
    }
  }

  void stretch(double duration_s, bool is_read) {
    if (!(duration_s > 0.0)) return;
    leader_.hold(duration_s, effort_);
    PortStretch stretch{.duration_s = duration_s,
                        .effort_on_hand = effort_,
                        .has_position_at_end = is_read,
                        .doubt = leader_.doubt(duration_s)};
    if (is_read) stretch.position_at_end = reading_ = leader_.read();
    is_read_ = is_read;
    echo_.push_back(stretch);
  }

  LeaderCase& case_;
  Random& random_;
  Leader& leader_;
  PortGuard guard_;
  LyingPhysics physics_;
  bool is_attack_ = false;
  bool is_read_ = true;
  PortValues reading_{};
  PortValues effort_{};
  double lease_left_s_ = 0.0;
  std::vector<PortStretch> echo_;
};

/// The least true energy of one run.
inline double least_energy_joule(LeaderCase& a_case, int ticks = 600) {
  LeaderLoop loop(a_case);
  loop.run(ticks, [](const PortInput&, const PortOutput&) {});
  return a_case.leader->least_energy_joule();
}

}  // namespace palpate::test
