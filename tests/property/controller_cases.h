// SPDX-License-Identifier: Apache-2.0
// controller_cases.h — random and hostile hands, environments, encoders and timing round a force
// controller. PALPATE_SEEDS=10 in the environment tries ten times as many seeds.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "common/core/random.h"
#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/mofc_equations.h"
#include "mofc_node/controllers/vector_mofc.h"
#include "tests/property/seeds.h"

namespace palpate::controllers {

// Sums of up to some hundred joules in double precision.
inline constexpr double kRoundingJoule = 1e-9;

using test::seeds;

inline Vector3 quantised(const Vector3& x, double q) {
  if (q <= 0.0) return x;
  return (x / q).array().round().matrix() * q;
}

inline Vector3 limited(const Vector3& force, double newton) {
  const double norm = force.norm();
  return norm > newton ? Vector3(force * (newton / norm)) : force;
}

/// A device with friction, isotropic or per axis, in a hand that moves it in any way. While
/// velocity and force stand, the energy is linear in time: its least value lies at an end of such a
/// piece.
struct Hand {
  double f_d = 0.1;
  double f_co = 0.1;
  std::optional<AxisFriction> per_axis = {};  // instead of the two above
  Vector3 position_m = Vector3::Zero();
  double energy_joule = 0.0;  // put in by the hand, no inertia
  double least_energy_joule = 0.0;
  bool is_on_rail = false;  // moves along x only
  double v_max_m_per_s = std::numeric_limits<double>::infinity();

  void move(double duration_s, Vector3 velocity, const Vector3& force_on_hand) {
    if (is_on_rail) velocity = Vector3(velocity.x(), 0.0, 0.0);
    velocity = limited(velocity, v_max_m_per_s);
    energy_joule += duration_s * (friction_watt(velocity) - force_on_hand.dot(velocity));
    least_energy_joule = std::min(least_energy_joule, energy_joule);
    position_m += duration_s * velocity;
  }

  [[nodiscard]] double friction_watt(const Vector3& velocity) const {
    if (per_axis) {
      return velocity.dot(per_axis->f_d.cwiseProduct(velocity)) +
             per_axis->f_co.dot(velocity.cwiseAbs());
    }
    const double speed = velocity.norm();
    return f_d * speed * speed + f_co * speed;
  }

  /// [MOFC] eq. (12) as a vector: along the force, so that it does most work on the hand; or axis
  /// by axis, and along what friction leaves of the force where that is too fast.
  [[nodiscard]] Vector3 most_draining_velocity(Vector3 force_on_hand) const {
    if (is_on_rail) force_on_hand = Vector3(force_on_hand.x(), 0.0, 0.0);
    if (per_axis) {
      const Vector3 excess = (force_on_hand.cwiseAbs() - per_axis->f_co).cwiseMax(0.0);
      Vector3 speed = Vector3::Zero();
      for (int i = 0; i < 3; ++i) {
        if (excess[i] > 0.0)
          speed[i] = std::min(v_max_m_per_s, excess[i] / (2.0 * per_axis->f_d[i]));
      }
      if (speed.norm() > v_max_m_per_s) speed = v_max_m_per_s * excess.normalized();
      return speed.cwiseProduct(force_on_hand.cwiseSign());
    }
    const double norm = force_on_hand.norm();
    if (norm <= f_co) return Vector3::Zero();
    return std::min(v_max_m_per_s, (norm - f_co) / (2.0 * f_d)) * force_on_hand / norm;
  }
};

/// How the hand moves for a while.
class HandStrategy {
 public:
  HandStrategy(Random& random, double q) : random_(random), q_(q) { change(); }

  void change() {
    plan_ = static_cast<Plan>(random_.below(static_cast<std::uint64_t>(kPlans)));
    direction_ = random_.direction();
    speed_m_per_s_ = 0.02 * std::pow(50.0, random_.uniform());  // 20 mm/s … 1 m/s
  }

  void drain() { plan_ = kDrain; }

  /// Moves during one interval of constant force, in up to three pieces.
  void move(Hand& hand, double duration_s, const Vector3& force_on_hand) {
    const std::uint64_t pieces = 1 + random_.below(3);
    double left_s = duration_s;
    for (std::uint64_t i = 1; i <= pieces; ++i) {
      const double piece_s = i == pieces ? left_s : random_.uniform() * left_s;
      left_s -= piece_s;
      if (piece_s > 0.0) hand.move(piece_s, velocity(hand, piece_s, force_on_hand), force_on_hand);
    }
  }

 private:
  enum Plan { kDrain, kDrainAlmost, kBank, kReversals, kRandom, kDither, kRest, kPlans };

  Vector3 velocity(const Hand& hand, double piece_s, const Vector3& force_on_hand) {
    switch (plan_) {
      case kDrain:
        return hand.most_draining_velocity(force_on_hand);
      case kDrainAlmost:
        return random_.uniform(0.0, 2.0) * hand.most_draining_velocity(force_on_hand);
      case kBank:
        return speed_m_per_s_ * direction_;
      case kReversals:
        return (random_.chance(0.5) ? 1.0 : -1.0) * speed_m_per_s_ * direction_;
      case kRandom:
        return speed_m_per_s_ * random_.direction();
      case kDither: {  // to and fro across the edge of an encoder step
        Vector3 edge = (hand.position_m / std::max(q_, 1e-6)).array().floor() + 0.5;
        edge *= std::max(q_, 1e-6);
        edge.x() += (random_.chance(0.5) ? 1e-3 : -1e-3) * q_;
        return (edge - hand.position_m) / piece_s;
      }
      case kRest:
      case kPlans:
        break;
    }
    return Vector3::Zero();
  }

  Random& random_;
  double q_;
  Plan plan_ = kRest;
  Vector3 direction_;
  double speed_m_per_s_ = 0.0;
};

/// The requested force: none, a constant push, noise, or a push along the motion.
class Environment {
 public:
  explicit Environment(Random& random) : random_(random) { change(); }
  void change() {
    kind_ = random_.below(4);
    force_ = random_.uniform(0.0, 5.0) * random_.direction();
  }
  [[nodiscard]] Vector3 request(const Vector3& motion) {
    switch (kind_) {
      case 0:
        return Vector3::Zero();
      case 1:
        return force_;
      case 2:
        return random_.uniform(0.0, 5.0) * random_.direction();
      default:  // active: along the motion seen last
        return motion.norm() > 0.0 ? Vector3(force_.norm() * motion.normalized()) : force_;
    }
  }

 private:
  Random& random_;
  std::uint64_t kind_ = 0;
  Vector3 force_;
};

/// What can go wrong between hand and controller.
struct Timing {
  double shortest_interval_s = 0.5e-3;
  double longest_interval_s = 1e-3;
  double lease_s = 1e-3;  // of a command that does not say; then the device falls back to f_co
  double overrun = 1.0;   // a command acts this many times its lease
  double longest_delay_s = 0.0;
  double lost_answers = 0.0;     // shares
  double lost_states = 0.0;      // the next one reports what they did
  double lost_echoes = 0.0;      // it is not known what acted
  double silent_watchdog = 0.0;  // of the leases that end: where the hand was is not known
};

/// The device with its guard, the hand and the environment round a controller.
class ClosedLoop {
 public:
  ClosedLoop(Random& random, Hand hand, const Timing& timing, double q, double fallback_newton)
      : hand_(hand),
        random_(random),
        timing_(timing),
        q_(q),
        fallback_newton_(fallback_newton),
        strategy_(random, q),
        environment_(random) {
    echo_.reserve(8);
  }

  /// Called with every input and output.
  template <class Check>
  void run(ForceController& controller, int ticks, Check&& check) {
    Vector3 measured_before = quantised(hand_.position_m, q_);
    bool has_gap = false;
    for (int k = 0; k < ticks; ++k) {
      // hand, environment and timing independently, or all together against the bound
      if (random_.chance(0.05)) strategy_.change();
      if (random_.chance(0.05)) environment_.change();
      is_attack_ = random_.chance(is_attack_ ? 0.8 : 0.02);
      if (is_attack_) strategy_.drain();
      const double interval_s =
          is_attack_ || random_.chance(0.3)
              ? timing_.longest_interval_s
              : random_.uniform(timing_.shortest_interval_s, timing_.longest_interval_s);
      double delay_s = random_.uniform() * timing_.longest_delay_s;
      if (is_attack_) delay_s = random_.chance(0.5) ? 0.0 : timing_.longest_delay_s;

      // the reading; the controller's answer, unless state or answer get lost
      const Vector3 measured = quantised(hand_.position_m, q_);
      bool is_answered = false;
      Vector3 answer_newton = Vector3::Zero();
      double answer_lease_s = 0.0;
      if (!random_.chance(timing_.lost_states)) {
        if (random_.chance(timing_.lost_echoes)) {
          has_gap = true;
          echo_.clear();
        }
        const Vector3 ask = environment_.request(measured - measured_before);
        const ControlInput input{
            .hand_position_m = measured,
            .applied = echo_,
            .has_gap = has_gap,
            .acting_force_on_hand_newton = force_newton_,
            .acting_lease_s =
                lease_left_s_ > 0.0 ? lease_left_s_ : std::numeric_limits<double>::infinity(),
            .requested_force_on_hand_newton = is_attack_ ? Vector3(100.0 * ask) : ask};
        const ControlOutput output = controller.step(input);
        check(input, output);
        has_gap = false;
        is_answered = !random_.chance(timing_.lost_answers);
        answer_newton = output.force_on_hand_newton;
        answer_lease_s = output.lease_s > 0.0 ? output.lease_s : timing_.lease_s;
        echo_.clear();
      }
      measured_before = measured;

      // the old force goes on until the answer comes
      double left_s = interval_s;
      if (is_answered) {
        hold(std::min(delay_s, left_s));
        left_s -= std::min(delay_s, left_s);
        force_newton_ = answer_newton;
        lease_left_s_ = timing_.overrun * answer_lease_s;
      }
      hold(left_s);
    }
  }

  [[nodiscard]] double least_energy_joule() const { return hand_.least_energy_joule; }

 private:
  void hold(double duration_s) {
    const double leased_s = std::min(duration_s, lease_left_s_);
    const bool is_ended_by_watchdog =
        leased_s > 0.0 && leased_s < duration_s && random_.chance(timing_.silent_watchdog);
    if (leased_s > 0.0) stretch(leased_s, !is_ended_by_watchdog);
    lease_left_s_ -= leased_s;
    if (leased_s < duration_s) {
      force_newton_ = is_ended_by_watchdog ? Vector3(Vector3::Zero())
                                           : limited(force_newton_, fallback_newton_);
      stretch(duration_s - leased_s, true);
    }
  }
  void stretch(double duration_s, bool has_position_at_end) {
    strategy_.move(hand_, duration_s, force_newton_);
    echo_.push_back({.duration_s = duration_s,
                     .force_on_hand_newton = force_newton_,
                     .hand_position_at_end_m = quantised(hand_.position_m, q_),
                     .has_position_at_end = has_position_at_end});
  }

  Hand hand_;
  Random& random_;
  Timing timing_;
  double q_;
  double fallback_newton_;
  HandStrategy strategy_;
  Environment environment_;
  bool is_attack_ = false;
  Vector3 force_newton_ = Vector3::Zero();
  double lease_left_s_ = 0.0;
  std::vector<AppliedStretch> echo_;
};

/// A random device, rate, network and encoder, and how much of it the controller is assumed.
struct Case {
  explicit Case(std::uint64_t seed) : random(seed) {
    hand.f_d = random.uniform(0.05, 0.3);
    hand.f_co = random.chance(0.2) ? 0.0 : random.uniform(0.05, 0.26);
    hand.position_m = random.uniform(0.0, 0.1) * random.direction();
    timing.lease_s = 1e-3 * std::pow(40.0, random.uniform());  // 1 … 40 ms
    timing.longest_interval_s = timing.lease_s * (random.chance(0.5) ? 1.0 : 0.75);
    timing.shortest_interval_s = timing.longest_interval_s / 3.0;
    timing.longest_delay_s = random.uniform(0.1, 0.9) * timing.shortest_interval_s;
    timing.lost_answers = random.chance(0.5) ? random.uniform(0.0, 0.3) : 0.0;
    timing.lost_states = random.chance(0.5) ? random.uniform(0.0, 0.05) : 0.0;
    timing.lost_echoes = random.chance(0.3) ? random.uniform(0.0, 0.05) : 0.0;
    timing.silent_watchdog = random.chance(0.5) ? random.uniform() : 0.0;
    q = random.chance(0.2) ? 0.0 : random.uniform(0.0, 0.5e-3);

    assumed = {.f_d = hand.f_d, .f_co = hand.f_co, .T = timing.lease_s};
    assumed_q = q;
    assumed_delay_s = timing.longest_delay_s;
    longest_lease_s = timing.lease_s * (random.chance(0.3) ? 1.0 : random.uniform(1.0, 5.0));
    // the assumed friction is a lower bound
    hand.f_d *= random.chance(0.5) ? 1.0 : random.uniform(1.0, 2.0);
    hand.f_co *= random.chance(0.5) ? 1.0 : random.uniform(1.0, 2.0);
  }

  [[nodiscard]] double least_energy_joule() {
    VectorMofc controller(assumed, assumed_q, assumed_delay_s, assumed_per_axis, longest_lease_s);
    ClosedLoop loop(random, hand, timing, q, std::min(assumed.f_co, hand.f_co));
    loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
    return loop.least_energy_joule();
  }

  Random random;
  Hand hand;
  Timing timing;
  double q = 0.0;

  MofcParameters assumed;
  std::optional<AxisFriction> assumed_per_axis;
  double assumed_q = 0.0;
  double assumed_delay_s = 0.0;
  double longest_lease_s = 0.0;
};

/// The least energy over many cases in which `change` has been made.
template <class Change>
double least_energy_joule(std::uint64_t count, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= test::seed_count(count); ++seed) {
    Case a_case(seed);
    change(a_case);
    least = std::min(least, a_case.least_energy_joule());
  }
  return least;
}

inline MofcParameters random_parameters(Random& random) {
  return {.f_d = 0.01 * std::pow(100.0, random.uniform()),
          .f_co = random.chance(0.2) ? 0.0 : random.uniform(0.0, 0.5),
          .T = 1e-4 * std::pow(1e3, random.uniform())};
}
inline AxisFriction random_axis_friction(Random& random) {
  AxisFriction friction;
  for (int i = 0; i < 3; ++i) {
    const MofcParameters axis = random_parameters(random);
    friction.f_d[i] = axis.f_d;
    friction.f_co[i] = axis.f_co;
  }
  return friction;
}

/// A controller whose environment claims at random that its force was evaluated and how much energy
/// it stores, mostly more than there is.
class RandomClaims final : public ForceController {
 public:
  RandomClaims(ForceController& inner, std::uint64_t seed) : inner_(inner), random_(seed) {}
  void reset() noexcept override { inner_.reset(); }
  ControlOutput step(const ControlInput& honest) noexcept override {
    ControlInput input = honest;
    input.is_request_fresh = random_.chance(0.5);
    input.stored_energy_joule = random_.chance(0.8) ? 1e3 : random_.uniform(-1.0, 1.0);
    stored_joule = input.stored_energy_joule;
    return inner_.step(input);
  }
  double stored_joule = 0.0;

 private:
  ForceController& inner_;
  Random random_;
};

/// A Case for mode guard: a hand of bounded speed, sometimes no viscous friction, any bounds of
/// credit.
struct GuardCase : Case {
  explicit GuardCase(std::uint64_t seed) : Case(seed) {
    Random draw(~seed);
    hand.v_max_m_per_s = assumed_v_max = draw.uniform(0.1, 1.0);
    if (draw.chance(0.2)) hand.f_d = assumed.f_d = 0.0;
    credit_cap_joule = 1e-4 * std::pow(1e5, draw.uniform());
    gate_joule = 1e-4 * std::pow(1e7, draw.uniform());
    contact_credit_joule = draw.chance(0.5) ? 0.0 : 1e-3 * std::pow(1e4, draw.uniform());
  }

  [[nodiscard]] GuardParameters parameters() const {
    return {.mofc = assumed,
            .per_axis = assumed_per_axis,
            .resolution_m = assumed_q,
            .delta_max_s = assumed_delay_s,
            .longest_lease_s = longest_lease_s,
            .v_max_m_per_s = assumed_v_max,
            .credit_cap_joule = credit_cap_joule,
            .contact_credit_joule = contact_credit_joule,
            .gate_joule = gate_joule};
  }

  [[nodiscard]] double least_energy_joule() {
    GuardMofc guard(parameters());
    RandomClaims controller(guard, 1);
    ClosedLoop loop(random, hand, timing, q, std::min(assumed.f_co, hand.f_co));
    loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
    return loop.least_energy_joule();
  }

  double assumed_v_max = 0.5;
  double credit_cap_joule = 0.0;
  double contact_credit_joule = 0.0;
  double gate_joule = 0.0;
};

/// An isotropic clamp keeps the direction of the requested force, raises nothing, and says so.
inline void expect_reduced_or_kept(const ControlInput& in, const ControlOutput& out) {
  const Vector3& requested = in.requested_force_on_hand_newton;
  const Vector3& given = out.force_on_hand_newton;
  ASSERT_LE(given.norm(), requested.norm());
  ASSERT_LE(given.norm(), out.f_max_newton.x() * (1.0 + 1e-15));
  ASSERT_LE(given.cross(requested).norm(), 1e-15 * given.norm() * requested.norm());
  ASSERT_GE(given.dot(requested), 0.0);
  ASSERT_EQ(out.is_clamped, given != requested);
}

/// Makes the friction of a case act per axis; what the controller assumes is at or below it.
inline void give_friction_per_axis(Case& c, std::uint64_t seed, bool is_tight) {
  Random draw(~seed ^ 0x5eed);
  AxisFriction assumed;
  AxisFriction truth;
  for (int i = 0; i < 3; ++i) {
    assumed.f_d[i] = 0.01 * std::pow(50.0, draw.uniform());  // 0.01 … 0.5
    assumed.f_co[i] = draw.chance(0.2) ? 0.0 : draw.uniform(0.02, 0.4);
    truth.f_d[i] = assumed.f_d[i] * (is_tight || draw.chance(0.5) ? 1.0 : draw.uniform(1.0, 2.0));
    truth.f_co[i] = assumed.f_co[i] * (is_tight || draw.chance(0.5) ? 1.0 : draw.uniform(1.0, 2.0));
  }
  c.assumed_per_axis = assumed;
  c.hand.per_axis = truth;
  c.assumed.f_co = c.hand.f_co = assumed.f_co.minCoeff();  // of the fallback
}

}  // namespace palpate::controllers
