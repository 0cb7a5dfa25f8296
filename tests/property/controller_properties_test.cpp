// Laws of the force controllers over seeded random and hostile hands, environments, encoders and
// timing. PALPATE_SEEDS=10 in the environment tries ten times as many seeds.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "mofc_node/controllers/energy_ledger.h"
#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/mofc_equations.h"
#include "mofc_node/controllers/one_pool_clamp.h"
#include "mofc_node/controllers/paper_mofc.h"
#include "mofc_node/controllers/vector_mofc.h"
#include "tests/support/alloc_guard.h"

namespace palpate::controllers {
namespace {

// Sums of up to some hundred joules in double precision.
constexpr double kRoundingJoule = 1e-9;

std::vector<std::uint64_t> seeds(std::uint64_t count) {
  const char* factor = std::getenv("PALPATE_SEEDS");
  if (factor != nullptr) count *= std::strtoull(factor, nullptr, 10);
  std::vector<std::uint64_t> all;
  for (std::uint64_t seed = 1; seed <= count; ++seed) all.push_back(seed);
  return all;
}

Vector3 quantised(const Vector3& x, double q) {
  if (q <= 0.0) return x;
  return (x / q).array().round().matrix() * q;
}

Vector3 limited(const Vector3& force, double newton) {
  const double norm = force.norm();
  return norm > newton ? Vector3(force * (newton / norm)) : force;
}

/// A device with friction, isotropic or per axis, in a hand that moves it as it likes. While
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

/// What the hand is up to for a while.
class Mischief {
 public:
  Mischief(Random& random, double q) : random_(random), q_(q) { change(); }

  void change() {
    plan_ = static_cast<Plan>(random_.below(static_cast<std::uint64_t>(kPlans)));
    direction_ = random_.direction();
    speed_m_per_s_ = 0.02 * std::pow(50.0, random_.uniform());  // 20 mm/s … 1 m/s
  }

  void drain() { plan_ = kDrain; }

  /// Moves through one stretch of one force, in up to three pieces.
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

/// What the environment asks for: nothing, a steady push, noise, or to push the hand along.
class Environment {
 public:
  explicit Environment(Random& random) : random_(random) { change(); }
  void change() {
    kind_ = random_.below(4);
    force_ = random_.uniform(0.0, 5.0) * random_.direction();
  }
  [[nodiscard]] Vector3 ask(const Vector3& motion) {
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
  double lease_s = 1e-3;  // after which the device falls back to f_co
  double longest_delay_s = 0.0;
  double lost_answers = 0.0;  // shares
  double lost_states = 0.0;   // the echo in them is lost too
  double empty_echoes = 0.0;
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
        mischief_(random, q),
        environment_(random) {
    echo_.reserve(8);
  }

  /// Called with every input and output.
  template <class Check>
  void run(ForceController& controller, int ticks, Check&& check) {
    Vector3 measured_before = quantised(hand_.position_m, q_);
    bool has_gap = false;
    for (int k = 0; k < ticks; ++k) {
      // hand, environment and timing each for itself, or all together against the bound
      if (random_.chance(0.05)) mischief_.change();
      if (random_.chance(0.05)) environment_.change();
      is_attack_ = random_.chance(is_attack_ ? 0.8 : 0.02);
      if (is_attack_) mischief_.drain();
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
      if (random_.chance(timing_.lost_states)) {
        has_gap = true;
      } else {
        if (random_.chance(timing_.empty_echoes)) echo_.clear();
        const Vector3 ask = environment_.ask(measured - measured_before);
        const ControlInput input{
            .hand_position_m = measured,
            .applied = echo_,
            .has_gap = has_gap,
            .asked_force_on_hand_newton = is_attack_ ? Vector3(100.0 * ask) : ask};
        const ControlOutput output = controller.step(input);
        check(input, output);
        has_gap = false;
        is_answered = !random_.chance(timing_.lost_answers);
        answer_newton = output.force_on_hand_newton;
      }
      measured_before = measured;
      echo_.clear();

      // the old force goes on until the answer comes
      double left_s = interval_s;
      if (is_answered) {
        hold(std::min(delay_s, left_s));
        left_s -= std::min(delay_s, left_s);
        force_newton_ = answer_newton;
        lease_left_s_ = timing_.lease_s;
      }
      hold(left_s);
    }
  }

  [[nodiscard]] double least_energy_joule() const { return hand_.least_energy_joule; }

 private:
  void hold(double duration_s) {
    const double leased_s = std::min(duration_s, lease_left_s_);
    const bool lease_ends = leased_s < duration_s;
    if (leased_s > 0.0) stretch(leased_s, !lease_ends || !random_.chance(timing_.silent_watchdog));
    lease_left_s_ -= leased_s;
    if (lease_ends) {
      force_newton_ = limited(force_newton_, fallback_newton_);
      stretch(duration_s - leased_s, true);
    }
  }
  void stretch(double duration_s, bool has_position_at_end) {
    mischief_.move(hand_, duration_s, force_newton_);
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
  Mischief mischief_;
  Environment environment_;
  bool is_attack_ = false;
  Vector3 force_newton_ = Vector3::Zero();
  double lease_left_s_ = 0.0;
  std::vector<AppliedStretch> echo_;
};

/// A random device, rate, network and encoder, and how much of it the controller is told.
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
    timing.empty_echoes = random.chance(0.3) ? random.uniform(0.0, 0.05) : 0.0;
    timing.silent_watchdog = random.chance(0.5) ? random.uniform() : 0.0;
    q = random.chance(0.2) ? 0.0 : random.uniform(0.0, 0.5e-3);

    told = {.f_d = hand.f_d, .f_co = hand.f_co, .T = timing.lease_s};
    told_q = q;
    told_delay_s = timing.longest_delay_s;
    // the profile is a lower bound
    hand.f_d *= random.chance(0.5) ? 1.0 : random.uniform(1.0, 2.0);
    hand.f_co *= random.chance(0.5) ? 1.0 : random.uniform(1.0, 2.0);
  }

  [[nodiscard]] double least_energy_joule() {
    VectorMofc controller(told, told_q, told_delay_s, told_per_axis);
    ClosedLoop loop(random, hand, timing, q, std::min(told.f_co, hand.f_co));
    loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
    return loop.least_energy_joule();
  }

  Random random;
  Hand hand;
  Timing timing;
  double q = 0.0;

  MofcParameters told;
  std::optional<AxisFriction> told_per_axis;
  double told_q = 0.0;
  double told_delay_s = 0.0;
};

/// The least energy over many cases in which `change` has been made.
template <class Change>
double least_energy_joule(std::uint64_t count, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    Case a_case(seed);
    change(a_case);
    least = std::min(least, a_case.least_energy_joule());
  }
  return least;
}

// ------------------------------------------------------------------------------------ equations

MofcParameters random_parameters(Random& random) {
  return {.f_d = 0.01 * std::pow(100.0, random.uniform()),
          .f_co = random.chance(0.2) ? 0.0 : random.uniform(0.0, 0.5),
          .T = 1e-4 * std::pow(1e3, random.uniform())};
}

// E′ + g(d) over d, g as (10): convex, least at d* = T v* of (12).
TEST(ClampLaws, TheWorstNextIntervalEndsAtZeroAtTheBoundAndAboveItInside) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const double energy = 1e-6 * std::pow(1e6, random.uniform());
    const double bound = maximum_force_newton(p, energy);
    const auto after = [&](double d, double f) {
      return energy + interval_energy_joule(p.f_d, p.f_co, p.T, d, f);
    };

    for (const double sign : {-1.0, 1.0}) {
      const double f = sign * bound;
      const double d_star = p.T * most_draining_velocity_m_per_s(p, f);
      EXPECT_NEAR(after(d_star, f), 0.0, 1e-12 * energy);
      for (int i = 0; i < 200; ++i) {
        const double d = random.uniform(-3.0, 3.0) * std::abs(d_star);
        EXPECT_GE(after(d, f), -1e-12 * energy);
        EXPECT_GT(after(d, random.uniform(0.0, 0.99) * f), 0.0);
      }
      // and beyond the bound it does not hold
      const double beyond = 1.01 * f;
      EXPECT_LT(after(p.T * most_draining_velocity_m_per_s(p, beyond), beyond), 0.0);
    }
  }
}

// As above with g(d) = f_d |d|²/T + f_co |d| − F·d and the controller's own F after free motion.
TEST(ClampLaws, TheSameInThreeDimensions) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    VectorMofc controller(p, 0.0, 0.0);
    const Vector3 moved = random.uniform(1e-3, 1e-1) * random.direction();
    const Vector3 ask = random.direction();
    const std::vector<AppliedStretch> free{{p.T, Vector3::Zero(), moved, true}};
    (void)controller.step({});
    const ControlOutput out = controller.step(
        {.hand_position_m = moved, .applied = free, .asked_force_on_hand_newton = 1e6 * ask});
    ASSERT_TRUE(out.is_clamped);
    const Vector3 F = out.force_on_hand_newton;
    const double energy = out.ledger_energy_joule;
    const auto after = [&](const Vector3& d, const Vector3& force) {
      return energy + p.f_d * d.squaredNorm() / p.T + p.f_co * d.norm() - force.dot(d);
    };

    const Vector3 d_star = p.T * (F.norm() - p.f_co) / (2.0 * p.f_d) * ask;
    EXPECT_NEAR(after(d_star, F), 0.0, 1e-12 * energy);
    for (int i = 0; i < 300; ++i) {
      const Vector3 d = d_star + random.uniform(0.0, 2.0) * d_star.norm() * random.direction();
      EXPECT_GE(after(d, F), -1e-12 * energy);
      EXPECT_GT(after(d, random.uniform(0.0, 0.99) * F), 0.0);
    }
  }
}

// --------------------------------------------------------------------------------------- ledger

/// The ledger without the quantisation terms: (8) in vector form on what the encoder says.
struct NaiveLedger {
  Hand hand;  // its friction
  Vector3 position_m;
  double energy_joule = 0.0;
  void book(double duration_s, const Vector3& force_on_hand, const Vector3& measured) {
    const Vector3 d = measured - position_m;
    energy_joule += duration_s * hand.friction_watt(d / duration_s) - force_on_hand.dot(d);
    position_m = measured;
  }
};

struct LedgerRun {
  double worst_excess_joule = -std::numeric_limits<double>::infinity();  // of E′ over the truth
  double worst_naive_excess_joule = worst_excess_joule;
};

AxisFriction random_axis_friction(Random& random) {
  AxisFriction friction;
  for (int i = 0; i < 3; ++i) {
    const MofcParameters axis = random_parameters(random);
    friction.f_d[i] = axis.f_d;
    friction.f_co[i] = axis.f_co;
  }
  return friction;
}

/// One hand, any held forces, intervals of 0.5 … 1.5 T in one to three stretches.
LedgerRun run_ledger(std::uint64_t seed, double q, bool is_per_axis) {
  Random random(seed);
  const MofcParameters p = random_parameters(random);
  Hand hand{.f_d = p.f_d, .f_co = p.f_co, .position_m = 0.1 * random.direction()};
  if (is_per_axis) hand.per_axis = random_axis_friction(random);
  Mischief mischief(random, q);
  EnergyLedger ledger(p, hand.per_axis, q);
  ledger.restart(quantised(hand.position_m, q));
  NaiveLedger naive{hand, quantised(hand.position_m, q)};
  LedgerRun run;
  Vector3 force = Vector3::Zero();

  for (int k = 0; k < 1000; ++k) {
    if (random.chance(0.03)) mischief.change();
    double left_s = random.uniform(0.5, 1.5) * p.T;
    for (std::uint64_t stretches = 1 + random.below(3); stretches > 0; --stretches) {
      if (random.chance(0.5)) force = random.uniform(0.0, 5.0) * random.direction();
      if (random.chance(0.2)) force.setZero();
      const double duration_s = stretches == 1 ? left_s : random.uniform(0.1, 0.9) * left_s;
      left_s -= duration_s;
      mischief.move(hand, duration_s, force);
      const Vector3 measured = quantised(hand.position_m, q);
      ledger.book(duration_s, force, measured);
      naive.book(duration_s, force, measured);
      run.worst_excess_joule =
          std::max(run.worst_excess_joule, ledger.energy_joule() - hand.energy_joule);
      run.worst_naive_excess_joule =
          std::max(run.worst_naive_excess_joule, naive.energy_joule - hand.energy_joule);
    }
  }
  return run;
}

TEST(LedgerLaws, TheLedgerNeverExceedsTheTrueEnergy) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const double q = seed % 5 == 0 ? 0.0 : Random(~seed).uniform(0.0, 0.5e-3);
    EXPECT_LE(run_ledger(seed, q, false).worst_excess_joule, kRoundingJoule);
    EXPECT_LE(run_ledger(seed, q, true).worst_excess_joule, kRoundingJoule);
  }
}

// The sum without the quantisation terms is right for an exact encoder only: a hand that goes to
// and fro across the edge of a step of the encoder is booked q each time, and hardly moves.
TEST(LedgerLaws, TheNaiveSumExceedsTheTrueEnergyUnlessTheEncoderIsExact) {
  for (const bool is_per_axis : {false, true}) {
    double worst_joule = 0.0;
    for (std::uint64_t seed = 1; seed <= 50; ++seed) {
      SCOPED_TRACE(testing::Message() << "seed=" << seed << " per axis: " << is_per_axis);
      EXPECT_LE(run_ledger(seed, 0.0, is_per_axis).worst_naive_excess_joule, kRoundingJoule);
      worst_joule =
          std::max(worst_joule, run_ledger(seed, 0.5e-3, is_per_axis).worst_naive_excess_joule);
    }
    EXPECT_GT(worst_joule, 10e-3);
  }
}

// Staircases too: the path of the play operators alone would see 1/√3 of one along (1, 1, 1).
TEST(LedgerLaws, WithAnExactEncoderTheLedgerIsTheSumOfThePaper) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    Hand hand{.f_d = p.f_d, .f_co = p.f_co};
    if (seed % 2 == 0) hand.per_axis = random_axis_friction(random);
    EnergyLedger ledger(p, hand.per_axis, 0.0);
    ledger.restart(Vector3::Zero());
    NaiveLedger sum{hand, Vector3::Zero()};
    Vector3 x = Vector3::Zero();
    for (int k = 0; k < 300; ++k) {
      const Vector3 step = 1e-3 * random.direction();
      x[static_cast<int>(random.below(3))] += step.x();
      const double duration_s = random.uniform(0.5, 1.5) * p.T;
      const Vector3 force = random.uniform(0.0, 3.0) * random.direction();
      ledger.book(duration_s, force, x);
      sum.book(duration_s, force, x);
      ASSERT_NEAR(ledger.energy_joule(), sum.energy_joule, 1e-12 + 1e-12 * sum.energy_joule);
    }
  }
}

/// What 0.3 s straight down at 0.1 m/s earn, measured at 0.055 mm, after `before_s` round a circle.
double earned_after_circling_joule(double before_s) {
  const double T = 1e-3;
  const double q = 55e-6;
  EnergyLedger ledger(0.1, 0.1, q);
  ledger.restart(Vector3::Zero());
  Vector3 x = Vector3::Zero();
  for (int k = 1; k <= std::lround(before_s / T); ++k) {
    const double angle = std::numbers::pi * k * T;  // 0.5 Hz
    x = 0.02 * Vector3(0.9 * std::sin(angle), 0.4 * std::sin(angle), 1.0 - std::cos(angle));
    ledger.book(T, Vector3::Zero(), quantised(x, q));
  }
  const double before_joule = ledger.energy_joule();
  for (int k = 1; k <= 300; ++k) {
    ledger.book(T, Vector3::Zero(), quantised(x - Vector3(0.0, 0.0, 0.1 * k * T), q));
  }
  return ledger.energy_joule() - before_joule;
}

// 30 mm at 0.1 m/s: 0.1·0.03 + 0.1·0.01·0.3 = 3.3 mJ truly. One bound of the path of the circles
// comes out larger than the other, by more the longer they last: a lead kept for ever would let
// only that bound count in the stroke.
TEST(LedgerLaws, WhatAMotionEarnsDoesNotDependOnHowLongTheHandMovedBefore) {
  const double least_joule = 0.9 * 3.3e-3;
  for (const double before_s : {0.0, 2.0, 14.0, 40.0, 600.0}) {
    SCOPED_TRACE(testing::Message() << before_s << " s");
    EXPECT_GE(earned_after_circling_joule(before_s), least_joule);
    EXPECT_LE(earned_after_circling_joule(before_s), 3.3e-3);
  }
}

// ---------------------------------------------------------------------------------- mode vector

TEST(VectorMofcLaws, NoHandAndNoEnvironmentDrawEnergyAtAnyInstant) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case a_case(seed);
    EXPECT_GE(a_case.least_energy_joule(), -kRoundingJoule);
  }
}

// The same cases, each with one protection taken away: the law above can fail.
// Without Coulomb friction, resolution and delay this is the energy bound of the force bounding
// approach, E ≥ Fᵀ B⁻¹ F / (4 ξ) with B = f_d/T and ξ = 1 ([Kim & Ryu], docs/theory.md §8): every force leaves
// enough in the ledger for the worst that can come, and no more than that where it is clamped.
TEST(VectorMofcLaws, EveryForceLeavesTheEnergyItMayCost) {
  constexpr double f_d = 0.1;
  constexpr double T = 0.001;
  int clamped = 0;
  for (const std::uint64_t seed : seeds(100)) {
    Random random(seed);
    VectorMofc controller({.f_d = f_d, .f_co = 0.0, .T = T}, 0.0, 0.0);
    Vector3 x = Vector3::Zero();
    Vector3 F = Vector3::Zero();
    Vector3 v = Vector3::Zero();
    for (int k = 0; k < 500; ++k) {
      v += 0.1 * random.uniform(0, 1) * random.direction();
      v *= 0.95;
      x += T * v;
      const AppliedStretch stretch{T, F, x, true};
      ControlInput input;
      input.hand_position_m = x;
      if (k > 0) input.applied = {&stretch, 1};
      input.asked_force_on_hand_newton = random.uniform(0, 3) * random.direction();
      const ControlOutput out = controller.step(input);
      F = out.force_on_hand_newton;
      const double cost_joule = F.squaredNorm() * T / (4.0 * f_d);
      ASSERT_LE(cost_joule, std::max(0.0, out.ledger_energy_joule) + 1e-12) << "seed " << seed;
      if (!out.is_clamped) continue;
      ++clamped;
      ASSERT_NEAR(cost_joule, std::max(0.0, out.ledger_energy_joule), 1e-12) << "seed " << seed;
    }
  }
  EXPECT_GT(clamped, 1000);
}

TEST(VectorMofcLaws, WithoutTheQuantisationTermsEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(50, [](Case& c) { c.told_q = 0.0; }), -1e-3);
}

TEST(VectorMofcLaws, WithoutTheReserveForTheDelayEnergyIsDrawn) {
  // nothing else in reserve: the encoder exact, the friction as told
  const auto make_tight = [](Case& c) {
    c.q = c.told_q = 0.0;
    c.hand.f_d = c.told.f_d;
    c.hand.f_co = c.told.f_co;
  };
  EXPECT_GE(least_energy_joule(200, make_tight), -kRoundingJoule);
  EXPECT_LT(least_energy_joule(200,
                               [&](Case& c) {
                                 make_tight(c);
                                 c.told_delay_s = 0.0;
                               }),
            -1e-4);
}

TEST(VectorMofcLaws, WithTheNominalPeriodInsteadOfTheLeaseEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(50, [](Case& c) { c.told.T = 0.5 * c.timing.lease_s; }), -1e-3);
}

TEST(VectorMofcLaws, WithFrictionOverestimatedEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(50, [](Case& c) { c.told.f_d *= 5.0; }), -1e-3);
  EXPECT_LT(least_energy_joule(50, [](Case& c) { c.told.f_co *= 5.0; }), -1e-3);
}

TEST(VectorMofcLaws, WithGapsUnnoticedEnergyIsDrawn) {
  // the controller believes that nothing happened while it did not look
  class Blind final : public ForceController {
   public:
    explicit Blind(VectorMofc controller) : controller_(controller) {}
    void reset() noexcept override { controller_.reset(); }
    ControlOutput step(const ControlInput& input) noexcept override {
      ControlInput without = input;
      without.has_gap = false;
      return controller_.step(without);
    }

   private:
    VectorMofc controller_;
  };
  double least_joule = 0.0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Case c(seed);
    c.timing.lost_states = 0.05;
    Blind controller{VectorMofc(c.told, c.told_q, c.told_delay_s)};
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.told.f_co);
    loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
    least_joule = std::min(least_joule, loop.least_energy_joule());
  }
  EXPECT_LT(least_joule, -1e-3);
}

// ----------------------------------------------------------------------------------- mode guard

// As above, the hand no faster than v_max: d within ±T v_max.
TEST(BoundedSpeedLaws, TheWorstNextIntervalEndsAtZeroAtTheBoundAndAboveItInside) {
  int capped = 0;
  int uncapped = 0;
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    MofcParameters p = random_parameters(random);
    if (seed % 5 == 0) p.f_d = 0.0;
    const double v_max = random.uniform(0.1, 1.0);
    const double energy = 1e-6 * std::pow(1e6, random.uniform());
    const double bound = maximum_force_newton(p, energy, v_max);
    const auto after = [&](double d, double f) {
      return energy + interval_energy_joule(p.f_d, p.f_co, p.T, d, f);
    };

    const bool is_capped = bound - p.f_co > 2.0 * p.f_d * v_max;
    ++(is_capped ? capped : uncapped);
    const double d_star = is_capped ? p.T * v_max : p.T * (bound - p.f_co) / (2.0 * p.f_d);
    EXPECT_NEAR(after(-d_star, bound), 0.0, 1e-12 * energy);
    EXPECT_NEAR(p.T * drain_watt(p, bound, v_max), energy, 1e-12 * energy);
    for (int i = 0; i < 200; ++i) {
      const double d = random.uniform(-1.0, 1.0) * p.T * v_max;
      EXPECT_GE(after(d, bound), -1e-12 * energy);
      EXPECT_GT(after(d, random.uniform(0.0, 0.99) * bound), 0.0);
    }
    EXPECT_LT(after(-d_star, 1.01 * bound), 0.0);
  }
  // both branches were seen
  EXPECT_GT(capped, 100);
  EXPECT_GT(uncapped, 20);
}

TEST(BoundedSpeedLaws, TheBoundIsNeverBelowThePapersAndMeetsItAtTheSeam) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const double v_max = random.uniform(0.1, 1.0);
    const double seam = p.f_d * p.T * v_max * v_max;
    const double at_seam = p.f_co + 2.0 * p.f_d * v_max;
    EXPECT_NEAR(maximum_force_newton(p, seam, v_max), at_seam, 1e-12 * at_seam);
    EXPECT_NEAR(maximum_force_newton(p, seam * (1.0 + 1e-9), v_max), at_seam, 1e-8 * at_seam);
    for (int i = 0; i < 100; ++i) {
      const double energy = seam * std::pow(1e3, random.uniform(-1.0, 1.0));
      const double bound = maximum_force_newton(p, energy, v_max);
      EXPECT_GE(bound, maximum_force_newton(p, energy) * (1.0 - 1e-15));
      EXPECT_GE(bound, maximum_force_newton(p, 0.99 * energy, v_max));
    }
  }
}

/// A controller whose environment says at random whether its force is news and how much energy it
/// has in store, mostly more than any.
class Boasting final : public ForceController {
 public:
  Boasting(ForceController& inner, std::uint64_t seed) : inner_(inner), random_(seed) {}
  void reset() noexcept override { inner_.reset(); }
  ControlOutput step(const ControlInput& honest) noexcept override {
    ControlInput input = honest;
    input.is_asked_fresh = random_.chance(0.5);
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
    hand.v_max_m_per_s = told_v_max = draw.uniform(0.1, 1.0);
    if (draw.chance(0.2)) hand.f_d = told.f_d = 0.0;
    credit_cap_joule = 1e-4 * std::pow(1e5, draw.uniform());
    gate_joule = 1e-4 * std::pow(1e7, draw.uniform());
  }

  [[nodiscard]] GuardParameters parameters() const {
    return {.mofc = told,
            .per_axis = told_per_axis,
            .resolution_m = told_q,
            .delta_max_s = told_delay_s,
            .v_max_m_per_s = told_v_max,
            .credit_cap_joule = credit_cap_joule,
            .gate_joule = gate_joule};
  }

  [[nodiscard]] double least_energy_joule() {
    GuardMofc guard(parameters());
    Boasting controller(guard, 1);
    ClosedLoop loop(random, hand, timing, q, std::min(told.f_co, hand.f_co));
    loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
    return loop.least_energy_joule();
  }

  double told_v_max = 0.5;
  double credit_cap_joule = 0.0;
  double gate_joule = 0.0;
};

template <class Change>
double least_energy_of_guard_joule(std::uint64_t count, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    GuardCase a_case(seed);
    change(a_case);
    least = std::min(least, a_case.least_energy_joule());
  }
  return least;
}

TEST(GuardMofcLaws, NoHandWithinVMaxAndNoEnvironmentDrawEnergyAtAnyInstant) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase a_case(seed);
    EXPECT_GE(a_case.least_energy_joule(), -kRoundingJoule);
  }
}

// Eq. (13) alone would allow f_co and no more.
TEST(GuardMofcLaws, WithoutViscousFrictionItRendersMoreThanFrictionAndKeepsTheLaw) {
  std::uint64_t rendered = 0;
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    c.hand.f_d = c.told.f_d = 0.0;
    GuardMofc guard(c.parameters());
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, std::min(c.told.f_co, c.hand.f_co));
    loop.run(guard, 1500, [&](const ControlInput&, const ControlOutput& out) {
      ASSERT_TRUE(std::isfinite(out.f_max_newton.x()));
      if (out.force_on_hand_newton.norm() > c.told.f_co + 0.1) ++rendered;
    });
    EXPECT_GE(loop.least_energy_joule(), -kRoundingJoule);
  }
  EXPECT_GT(rendered, 1000u);
}

// The same cases, each with one assumption broken: the law above can fail.
TEST(GuardMofcLaws, WithAHandFasterThanVMaxEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.hand.v_max_m_per_s *= 3.0; }),
            -1e-3);
}

TEST(GuardMofcLaws, WithoutTheQuantisationTermsEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.told_q = 0.0; }), -1e-3);
}

/// Nothing in reserve: the encoder exact, the friction as told, the credit unbounded.
void make_tight(GuardCase& c) {
  c.q = c.told_q = 0.0;
  c.hand.f_d = c.told.f_d;
  c.hand.f_co = c.told.f_co;
  c.credit_cap_joule = c.gate_joule = 1e3;
}

TEST(GuardMofcLaws, WithNothingInReserveNoEnergyIsDrawn) {
  EXPECT_GE(least_energy_of_guard_joule(200, make_tight), -kRoundingJoule);
}

TEST(GuardMofcLaws, WithoutTheReserveForTheDelayEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(200,
                                        [](GuardCase& c) {
                                          make_tight(c);
                                          c.told_delay_s = 0.0;
                                        }),
            -1e-4);
}

TEST(GuardMofcLaws, WithTheNominalPeriodInsteadOfTheLeaseEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(200,
                                        [](GuardCase& c) {
                                          make_tight(c);
                                          c.told.T = 0.5 * c.timing.lease_s;
                                        }),
            -1e-3);
}

TEST(GuardMofcLaws, WithFrictionOverestimatedEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.told.f_d *= 5.0; }), -1e-3);
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.told.f_co *= 5.0; }), -1e-3);
}

// Two controllers see the same run, one with next to no bounds of credit; the echo is that of the
// bounded one.
TEST(GuardMofcLaws, CapAndGateOnlyLowerTheCreditAndTheForce) {
  int lowered = 0;
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    GuardMofc bounded(c.parameters());
    Boasting controller(bounded, seed);
    GuardParameters open = c.parameters();
    open.credit_cap_joule = open.gate_joule = 1e12;
    GuardMofc unbounded(open);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, std::min(c.told.f_co, c.hand.f_co));
    loop.run(controller, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      const ControlOutput more = unbounded.step(in);
      const double rounding = 1e-9 * (1.0 + std::abs(more.ledger_energy_joule));
      ASSERT_LE(out.ledger_energy_joule, more.ledger_energy_joule + rounding);
      ASSERT_LE(out.ledger_energy_joule,
                std::max(0.0, controller.stored_joule) + c.credit_cap_joule + 1e-12);
      ASSERT_LE(out.f_max_newton.x(), more.f_max_newton.x() * (1.0 + 1e-9) + 1e-3);
      if (out.f_max_newton.x() < 0.9 * more.f_max_newton.x()) ++lowered;
    });
  }
  EXPECT_GT(lowered, 1000);
}

// A straight path of n intervals T at `speed`, measured with resolution q: (|Δh| − √3 q) / T is a
// lower bound of the speed.
TEST(GuardMofcLaws, AHandFasterThanVMaxIsReportedAndASlowerOneNever) {
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const double T = 1e-3;
    const double q = random.chance(0.3) ? 0.0 : random.uniform(0.0, 1e-4);
    const double v_max = random.uniform(0.2, 1.0);
    for (const bool is_fast : {false, true}) {
      // measured: at least d − √3 q of the way, so 2√3 q more than allowed shows for sure
      const double d = is_fast ? v_max * T + 2.0 * std::numbers::sqrt3 * q + 1e-9
                               : random.uniform(0.0, 1.0) * v_max * T;
      GuardMofc guard(
          {.mofc = {.f_d = 0.1, .f_co = 0.1, .T = T}, .resolution_m = q, .v_max_m_per_s = v_max});
      const Vector3 direction = random.direction();
      Vector3 x = 0.05 * random.direction();
      (void)guard.step({.hand_position_m = quantised(x, q), .applied = {}});
      for (int k = 0; k < 50; ++k) {
        x += d * direction;
        const Vector3 measured = quantised(x, q);
        const std::vector<AppliedStretch> echo{{T, Vector3::Zero(), measured, true}};
        ASSERT_EQ(guard.step({.hand_position_m = measured, .applied = echo}).is_too_fast, is_fast);
      }
    }
  }
}

TEST(GuardMofcLaws, ItShortensTheAskedForceOrLeavesIt) {
  std::uint64_t clamped = 0;
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    GuardMofc guard(c.parameters());
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, std::min(c.told.f_co, c.hand.f_co));
    loop.run(guard, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      const Vector3& asked = in.asked_force_on_hand_newton;
      const Vector3& given = out.force_on_hand_newton;
      ASSERT_LE(given.norm(), asked.norm());
      ASSERT_LE(given.norm(), out.f_max_newton.x() * (1.0 + 1e-15));
      ASSERT_LE(given.cross(asked).norm(), 1e-15 * given.norm() * asked.norm());
      ASSERT_GE(given.dot(asked), 0.0);
      ASSERT_EQ(out.is_clamped, given != asked);
      if (out.is_clamped) ++clamped;
    });
  }
  EXPECT_GT(clamped, 0u);
}

// ---------------------------------------------------------------------------- friction per axis

/// A random force per axis, often with axes that matter little.
Vector3 random_force(Random& random) {
  Vector3 force = random.direction();
  for (double& f : force) f *= random.chance(0.3) ? 0.01 : 1.0;
  return 10.0 * random.uniform() * force;
}

// Worst velocity against f_d,i, f_co,i without a limit: (12) on each axis. At the bound it brings
// the pool to zero within T, any other leaves it above, and beyond the bound it does not hold.
TEST(AxisClampLaws, TheWorstNextIntervalEndsAtZeroAtTheBoundAndAboveItInside) {
  int clamped = 0;
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const Hand hand{.per_axis = random_axis_friction(random)};
    const OnePoolClamp clamp(p, hand.per_axis, hand.v_max_m_per_s);
    const double energy = 1e-6 * std::pow(1e6, random.uniform());
    const ControlOutput out = clamp.clamp(100.0 * random_force(random), energy);
    const Vector3 F = out.force_on_hand_newton;
    const auto after = [&](const Vector3& v, const Vector3& force) {
      return energy + p.T * (hand.friction_watt(v) - force.dot(v));
    };

    if (!out.is_clamped) continue;
    ++clamped;
    const Vector3 v_star = hand.most_draining_velocity(F);
    EXPECT_NEAR(after(v_star, F), 0.0, 1e-9 * energy);
    for (int i = 0; i < 200; ++i) {
      const Vector3 v = v_star + random.uniform(0.0, 2.0) * v_star.norm() * random.direction();
      EXPECT_GE(after(v, F), -1e-9 * energy);
    }
    EXPECT_LT(after(hand.most_draining_velocity(1.01 * F), 1.01 * F), 0.0);
  }
  EXPECT_GT(clamped, 200);
}

TEST(AxisClampLaws, NoHandWithinVMaxDrainsMoreThanIsReckoned) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    Hand hand{.per_axis = random_axis_friction(random), .v_max_m_per_s = random.uniform(0.1, 1.0)};
    if (seed % 4 == 0) hand.per_axis->f_d[static_cast<int>(seed) % 3] = 0.0;
    const OnePoolClamp clamp(p, hand.per_axis, hand.v_max_m_per_s);
    const Vector3 F = random_force(random);
    const double reckoned = clamp.drain_watt(F) * (1.0 + 1e-12);
    const auto drawn = [&](const Vector3& v) { return F.dot(v) - hand.friction_watt(v); };
    EXPECT_LE(drawn(hand.most_draining_velocity(F)), reckoned);
    for (int i = 0; i < 300; ++i) {
      EXPECT_LE(drawn(hand.v_max_m_per_s * random.uniform() * random.direction()), reckoned);
    }
  }
}

TEST(AxisClampLaws, TheReckonedDrainOfEqualAxesWithoutCoulombFrictionIsThatOfTheNorm) {
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    MofcParameters p = random_parameters(random);
    p.f_co = 0.0;
    const AxisFriction same{.f_d = Vector3::Constant(p.f_d), .f_co = Vector3::Zero()};
    for (const double v_max : {0.5, std::numeric_limits<double>::infinity()}) {
      const Vector3 F = random_force(random);
      const double whole = OnePoolClamp(p, {}, v_max).drain_watt(F);
      EXPECT_NEAR(OnePoolClamp(p, same, v_max).drain_watt(F), whole, 1e-12 * whole);
    }
  }
}

TEST(AxisClampLaws, MoreEnergyNeverGivesLessAndTheForceKeepsItsDirectionAndItsBounds) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const double v_max =
        random.chance(0.5) ? random.uniform(0.1, 1.0) : std::numeric_limits<double>::infinity();
    const OnePoolClamp clamp(p, random_axis_friction(random), v_max);
    const Vector3 asked = random_force(random);
    const double gate = random.chance(0.5) ? 1.0 : random.uniform();
    double before = 0.0;
    for (double energy = 1e-7; energy < 1.0; energy *= 1.5) {
      const ControlOutput out = clamp.clamp(asked, energy, gate);
      const Vector3& given = out.force_on_hand_newton;
      ASSERT_GE(given.norm(), before);
      ASSERT_LE(given.norm(), asked.norm());
      ASSERT_LE(given.cross(asked).norm(), 1e-15 * given.norm() * asked.norm());
      ASSERT_GE(given.dot(asked), 0.0);
      for (int i = 0; i < 3; ++i) {
        ASSERT_LE(std::abs(given[i]), out.f_max_newton[i] * (1.0 + 1e-12));
      }
      ASSERT_EQ(out.is_clamped, given != asked);
      before = given.norm();
    }
  }
}

/// Makes the friction of a case act per axis; what is told is at or below it.
void give_friction_per_axis(Case& c, std::uint64_t seed, bool is_tight) {
  Random draw(~seed ^ 0x5eed);
  AxisFriction told;
  AxisFriction truth;
  for (int i = 0; i < 3; ++i) {
    told.f_d[i] = 0.01 * std::pow(50.0, draw.uniform());  // 0.01 … 0.5
    told.f_co[i] = draw.chance(0.2) ? 0.0 : draw.uniform(0.02, 0.4);
    truth.f_d[i] = told.f_d[i] * (is_tight || draw.chance(0.5) ? 1.0 : draw.uniform(1.0, 2.0));
    truth.f_co[i] = told.f_co[i] * (is_tight || draw.chance(0.5) ? 1.0 : draw.uniform(1.0, 2.0));
  }
  c.told_per_axis = told;
  c.hand.per_axis = truth;
  c.told.f_co = c.hand.f_co = told.f_co.minCoeff();  // of the fallback
}

/// The least energy over many cases with friction per axis, in which `change` has been made.
template <class SomeCase, class Change>
double least_energy_per_axis_joule(std::uint64_t count, bool is_tight, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    SomeCase c(seed);
    give_friction_per_axis(c, seed, is_tight);
    change(c);
    least = std::min(least, c.least_energy_joule());
  }
  return least;
}

template <class SomeCase>
class FrictionPerAxisLaws : public testing::Test {};
using ModesWithOnePool = testing::Types<Case, GuardCase>;
TYPED_TEST_SUITE(FrictionPerAxisLaws, ModesWithOnePool);

TYPED_TEST(FrictionPerAxisLaws, NoHandAndNoEnvironmentDrawEnergyAtAnyInstant) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    TypeParam c(seed);
    give_friction_per_axis(c, seed, seed % 2 == 0);
    EXPECT_GE(c.least_energy_joule(), -kRoundingJoule);
  }
}

// The same cases, each with one assumption broken: the law above can fail.
TYPED_TEST(FrictionPerAxisLaws, WithoutTheQuantisationTermsEnergyIsDrawn) {
  EXPECT_LT(least_energy_per_axis_joule<TypeParam>(50, false, [](TypeParam& c) { c.told_q = 0.0; }),
            -1e-3);
}

TYPED_TEST(FrictionPerAxisLaws, WithFrictionOverestimatedOnOneAxisEnergyIsDrawn) {
  EXPECT_LT(least_energy_per_axis_joule<TypeParam>(
                50, true, [](TypeParam& c) { c.told_per_axis->f_d.y() *= 5.0; }),
            -1e-3);
  EXPECT_LT(least_energy_per_axis_joule<TypeParam>(
                50, true, [](TypeParam& c) { c.told_per_axis->f_co.y() *= 5.0; }),
            -1e-3);
}

TYPED_TEST(FrictionPerAxisLaws, TakenForIsotropicOnlyTheSmallestOfEachIsSafe) {
  const auto tell = [](TypeParam& c, double f_d, double f_co) {
    c.told_per_axis.reset();
    c.told.f_d = f_d;
    c.told.f_co = f_co;
  };
  EXPECT_GE(least_energy_per_axis_joule<TypeParam>(100, true,
                                                   [&](TypeParam& c) {
                                                     tell(c, c.hand.per_axis->f_d.minCoeff(),
                                                          c.hand.per_axis->f_co.minCoeff());
                                                   }),
            -kRoundingJoule);
  EXPECT_LT(least_energy_per_axis_joule<TypeParam>(100, true,
                                                   [&](TypeParam& c) {
                                                     tell(c, c.hand.per_axis->f_d.mean(),
                                                          c.hand.per_axis->f_co.mean());
                                                   }),
            -1e-3);
}

/// The least energy on devices with isotropic friction when the Coulomb friction of each axis is
/// told as this share of it.
template <class SomeCase>
double least_energy_taken_per_axis_joule(std::uint64_t count, double share) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    SomeCase c(seed);
    c.hand.f_d = c.told.f_d;
    c.hand.f_co = c.told.f_co;
    c.told_per_axis = {.f_d = Vector3::Constant(c.hand.f_d),
                       .f_co = Vector3::Constant(share * c.hand.f_co)};
    least = std::min(least, c.least_energy_joule());
  }
  return least;
}

// Across the axes Σ|v_i| = √3|v|: told f_co on each, friction is credited with √3 of what it takes.
TYPED_TEST(FrictionPerAxisLaws, IsotropicFrictionTakenForPerAxisNeedsOneOverSqrt3) {
  EXPECT_LT(least_energy_taken_per_axis_joule<TypeParam>(100, 1.0), -1e-3);
  EXPECT_GE(least_energy_taken_per_axis_joule<TypeParam>(100, 1.0 / std::numbers::sqrt3),
            -kRoundingJoule);
}

// Σ drain is infinite where an axis has no viscous friction; a hand of bounded speed is not.
TEST(GuardMofcLaws, WithoutViscousFrictionOnAnAxisItRendersOnItAndKeepsTheLaw) {
  std::uint64_t rendered = 0;
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    give_friction_per_axis(c, seed, false);
    const int axis = static_cast<int>(seed % 3);
    c.told_per_axis->f_d[axis] = c.hand.per_axis->f_d[axis] = 0.0;
    if (seed % 4 == 0) c.told_per_axis->f_d = c.hand.per_axis->f_d = Vector3::Zero();
    GuardMofc guard(c.parameters());
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.told.f_co);
    loop.run(guard, 1500, [&](const ControlInput&, const ControlOutput& out) {
      ASSERT_TRUE(out.f_max_newton.allFinite());
      if (std::abs(out.force_on_hand_newton[axis]) > c.told_per_axis->f_co[axis] + 0.1) ++rendered;
    });
    EXPECT_GE(loop.least_energy_joule(), -kRoundingJoule);
  }
  EXPECT_GT(rendered, 1000u);
}

// ----------------------------------------------------------------------------------- mode paper

Timing exact_timing(double T) {
  return {.shortest_interval_s = 0.5 * T, .longest_interval_s = T, .lease_s = T};
}

Case paper_case(std::uint64_t seed, bool is_on_rail) {
  Case a_case(seed);
  a_case.timing = exact_timing(a_case.told.T);
  a_case.q = 0.0;
  a_case.hand.f_d = a_case.told.f_d;
  a_case.hand.f_co = a_case.told.f_co;
  a_case.hand.is_on_rail = is_on_rail;
  return a_case;
}

double least_energy_of_paper_joule(Case a_case, PaperMofc controller) {
  ClosedLoop loop(a_case.random, a_case.hand, a_case.timing, a_case.q, a_case.told.f_co);
  loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
  return loop.least_energy_joule();
}

TEST(PaperMofcLaws, OnOneAxisWithExactPositionsAndTimingNoEnergyIsDrawn) {
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const Case c = paper_case(seed, true);
    EXPECT_GE(least_energy_of_paper_joule(c, PaperMofc(c.told)), -kRoundingJoule);
  }
}

TEST(PaperMofcLaws, OnThreeAxesWithFrictionPerAxisNoEnergyIsDrawn) {
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c = paper_case(seed, false);
    give_friction_per_axis(c, seed, true);
    EXPECT_GE(least_energy_of_paper_joule(c, PaperMofc(*c.told_per_axis, c.told.T)),
              -kRoundingJoule);
  }
}

// Three axes on a device whose friction is isotropic: motion along (1, 1, 1) is booked
// f_co (|x| + |y| + |z|) = √3 f_co |d|, and with all pools empty a force of f_co on each axis, √3
// f_co together, may still push. Both are √3 of what friction takes.
TEST(PaperMofcLaws, OnThreeAxesWithIsotropicFrictionEnergyIsDrawnUnlessEachCountsOneOverSqrt3) {
  double least_joule = 0.0;
  for (const std::uint64_t seed : seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const Case c = paper_case(seed, false);
    least_joule = std::min(least_joule, least_energy_of_paper_joule(c, PaperMofc(c.told)));
    EXPECT_GE(least_energy_of_paper_joule(c, PaperMofc::isotropic(c.told)), -kRoundingJoule);
  }
  EXPECT_LT(least_joule, -1e-3);
}

// f_d = f_co = 0.1, empty pools, F = (0.1, 0.1, 0.1) for ever: the hand goes with it at
// v* = (√3 − 1)·0.1/0.2 = 0.366 m/s and draws ((√3 − 1)·0.1)²/0.4 = 13.4 mW, 13.4 mJ in a second.
TEST(PaperMofcLaws, AlongTheDiagonalItPaysOutForEver) {
  const MofcParameters p{.f_d = 0.1, .f_co = 0.1, .T = 0.001};
  const auto energy_after_a_second = [&](PaperMofc paper) {
    Hand hand{.f_d = p.f_d, .f_co = p.f_co};
    std::vector<AppliedStretch> echo;
    for (int k = 0; k < 1000; ++k) {
      const ControlOutput out = paper.step({.hand_position_m = hand.position_m,
                                            .applied = echo,
                                            .asked_force_on_hand_newton = {0.1, 0.1, 0.1}});
      const Vector3 F = out.force_on_hand_newton;
      hand.move(p.T, hand.most_draining_velocity(F), F);
      echo = {{p.T, F, hand.position_m, true}};
    }
    return hand.energy_joule;
  };
  EXPECT_NEAR(energy_after_a_second(PaperMofc(p)), -13.4e-3, 0.05e-3);
  // with f_co/√3 each: f_co together, which friction takes
  EXPECT_NEAR(energy_after_a_second(PaperMofc::isotropic(p)), 0.0, 1e-9);
}

// ---------------------------------------------------------------------------------------- frame

/// The forces a controller gives along a fixed walk under fixed asks, both turned by R, and turned
/// back. The echo is what the controller gave.
std::vector<Vector3> forces_in_frame(ForceController& controller, std::uint64_t seed,
                                     const Eigen::Matrix3d& R, double T) {
  Random random(seed);
  std::vector<Vector3> forces;
  std::vector<AppliedStretch> echo;
  Vector3 x = Vector3::Zero();
  Vector3 direction = random.direction();
  for (int k = 0; k < 500; ++k) {
    if (random.chance(0.05)) direction = random.direction();
    const Vector3 ask = random.uniform(0.0, 3.0) * random.direction();
    const ControlOutput out = controller.step(
        {.hand_position_m = R * x, .applied = echo, .asked_force_on_hand_newton = R * ask});
    forces.push_back(R.transpose() * out.force_on_hand_newton);
    x += random.uniform(0.0, 0.2) * T * direction;
    echo = {{T, out.force_on_hand_newton, R * x, true}};
  }
  return forces;
}

double largest_difference_newton(ForceController& a, ForceController& b, std::uint64_t seed,
                                 double T) {
  Random random(~seed);
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(random.uniform(0.5, 2.5), random.direction()).toRotationMatrix();
  const auto plain = forces_in_frame(a, seed, Eigen::Matrix3d::Identity(), T);
  const auto turned = forces_in_frame(b, seed, R, T);
  double largest = 0.0;
  for (std::size_t k = 0; k < plain.size(); ++k) {
    largest = std::max(largest, (plain[k] - turned[k]).norm());
  }
  return largest;
}

TEST(FrameLaws, TurningTheFrameChangesNothingInVectorModeWithAnExactEncoder) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const MofcParameters p{.f_d = 0.1, .f_co = 0.1, .T = 2e-3};
    VectorMofc a(p, 0.0, 0.5e-3);
    VectorMofc b(p, 0.0, 0.5e-3);
    // an empty pool amplifies rounding: √(1e−17 J · 4 f_d/T) is 0.04 µN
    EXPECT_LT(largest_difference_newton(a, b, seed, p.T), 1e-6);
  }
}

TEST(FrameLaws, TurningTheFrameChangesTheForceInPaperMode) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const MofcParameters p{.f_d = 0.1, .f_co = 0.1, .T = 2e-3};
    PaperMofc a(p);
    PaperMofc b(p);
    EXPECT_GT(largest_difference_newton(a, b, seed, p.T), 0.01);
  }
}

// --------------------------------------------------------------------------------------- output

TEST(OutputLaws, VectorModeShortensTheAskedForceOrLeavesIt) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c(seed);
    VectorMofc controller(c.told, c.told_q, c.told_delay_s);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.told.f_co);
    std::uint64_t clamped = 0;
    loop.run(controller, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      const Vector3& asked = in.asked_force_on_hand_newton;
      const Vector3& given = out.force_on_hand_newton;
      ASSERT_LE(given.norm(), asked.norm());
      ASSERT_LE(given.norm(), out.f_max_newton.x() * (1.0 + 1e-15));
      ASSERT_LE(given.cross(asked).norm(), 1e-15 * given.norm() * asked.norm());
      ASSERT_GE(given.dot(asked), 0.0);
      ASSERT_EQ(out.is_clamped, given != asked);
      if (out.is_clamped) ++clamped;
    });
    EXPECT_GT(clamped, 0u);
  }
}

TEST(OutputLaws, PaperModeShortensEachAxisOrLeavesIt) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c(seed);
    PaperMofc controller(c.told);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.told.f_co);
    std::uint64_t clamped = 0;
    loop.run(controller, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      for (int i = 0; i < 3; ++i) {
        const double asked = in.asked_force_on_hand_newton[i];
        const double given = out.force_on_hand_newton[i];
        ASSERT_LE(std::abs(given), std::abs(asked));
        ASSERT_LE(std::abs(given), out.f_max_newton[i]);
        ASSERT_GE(given * asked, 0.0);
      }
      ASSERT_EQ(out.is_clamped, out.force_on_hand_newton != in.asked_force_on_hand_newton);
      if (out.is_clamped) ++clamped;
    });
    EXPECT_GT(clamped, 0u);
  }
}

/// Any finite double, of any size: all bit patterns but those of infinity and NaN.
double any_finite(Random& random) {
  for (;;) {
    const double x = std::bit_cast<double>(random.bits());
    if (std::isfinite(x)) return x;
  }
}
Vector3 any_finite_vector(Random& random) {
  return {any_finite(random), any_finite(random), any_finite(random)};
}

std::vector<std::unique_ptr<ForceController>> all_controllers(const Case& c) {
  std::vector<std::unique_ptr<ForceController>> all;
  all.push_back(std::make_unique<PassThrough>());
  all.push_back(std::make_unique<PaperMofc>(c.told));
  all.push_back(std::make_unique<VectorMofc>(c.told, c.told_q, c.told_delay_s));
  all.push_back(std::make_unique<GuardMofc>(
      GuardParameters{.mofc = c.told, .resolution_m = c.told_q, .delta_max_s = c.told_delay_s}));
  const AxisFriction axes{.f_d = {c.told.f_d, 0.0, 0.2}, .f_co = {c.told.f_co, 0.1, 0.0}};
  all.push_back(std::make_unique<PaperMofc>(axes, c.told.T));
  all.push_back(std::make_unique<VectorMofc>(c.told, c.told_q, c.told_delay_s, axes));
  all.push_back(std::make_unique<GuardMofc>(GuardParameters{
      .mofc = c.told, .per_axis = axes, .resolution_m = c.told_q, .delta_max_s = c.told_delay_s}));
  return all;
}

TEST(OutputLaws, FiniteInputOfAnySizeNeverGivesAForceThatIsNotANumberOrMoreThanAsked) {
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c(seed);
    if (seed % 4 == 0) c.told.f_d = 0.0;
    if (seed % 3 == 0) c.told.f_co = 0.0;
    for (const auto& controller : all_controllers(c)) {
      for (int k = 0; k < 200; ++k) {
        const bool is_huge = c.random.chance(0.5);
        const auto any = [&] {
          return is_huge ? any_finite_vector(c.random) : Vector3(c.random.direction());
        };
        std::vector<AppliedStretch> echo(c.random.below(5));
        for (AppliedStretch& stretch : echo) {
          stretch = {.duration_s = c.random.chance(0.2) ? 0.0 : c.random.uniform(0.0, 0.01),
                     .force_on_hand_newton = any(),
                     .hand_position_at_end_m = any(),
                     .has_position_at_end = c.random.chance(0.9)};
        }
        const ControlInput input{.hand_position_m = any(),
                                 .applied = echo,
                                 .has_gap = c.random.chance(0.05),
                                 .asked_force_on_hand_newton = any()};
        const Vector3 F = controller->step(input).force_on_hand_newton;
        ASSERT_TRUE(F.allFinite());
        for (int i = 0; i < 3; ++i) {
          ASSERT_LE(std::abs(F[i]), std::abs(input.asked_force_on_hand_newton[i]));
        }
        if (c.random.chance(0.02)) controller->reset();
      }
    }
  }
}

static_assert(noexcept(std::declval<ForceController&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<PassThrough&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<PaperMofc&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<VectorMofc&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<VectorMofc&>().reset()));
static_assert(noexcept(std::declval<GuardMofc&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<GuardMofc&>().reset()));

TEST(OutputLaws, StepDoesNotAllocate) {
  Case c(1);
  c.timing.lost_answers = c.timing.lost_states = c.timing.silent_watchdog = 0.1;
  for (const auto& controller : all_controllers(c)) {
    class Guarded final : public ForceController {
     public:
      explicit Guarded(ForceController& inner) : inner_(inner) {}
      void reset() noexcept override { inner_.reset(); }
      ControlOutput step(const ControlInput& input) noexcept override {
        const test::AllocGuard guard;
        const ControlOutput output = inner_.step(input);
        allocations += guard.count();
        ++steps;
        return output;
      }
      std::uint64_t allocations = 0;
      std::uint64_t steps = 0;

     private:
      ForceController& inner_;
    };
    Guarded guarded(*controller);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.told.f_co);
    loop.run(guarded, 1000, [](const ControlInput&, const ControlOutput&) {});
    EXPECT_GT(guarded.steps, 500u);
    EXPECT_EQ(guarded.allocations, 0u);
  }
}

}  // namespace
}  // namespace palpate::controllers
