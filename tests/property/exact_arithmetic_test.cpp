// SPDX-License-Identifier: Apache-2.0
// The equations, the ledger, what is granted, and the monitor's own count in doubles beside the
// same in rational numbers or 100 digits: rounding never makes credit.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "common/core/random.h"
#include "device_node/monitor/force_monitor.h"
#include "mofc_node/controllers/energy_ledger.h"
#include "mofc_node/controllers/leased_pool.h"
#include "mofc_node/controllers/mofc_equations.h"
#include "tests/property/controller_cases.h"
#include "tests/property/seeds.h"

namespace palpate::controllers {
namespace {

using Exact = boost::multiprecision::cpp_rational;
using Digits100 = boost::multiprecision::cpp_bin_float_100;

constexpr double kOfLargestTerm = 1e-14;

/// Random magnitudes over twelve decades, extreme ones, and those of the lemmas' counterexamples,
/// where one side of an inequality equals the other.
double magnitude(Random& random) {
  static const std::array<double, 9> special{0.0, 1e-12, 1e-6, 0.125, 0.5, 1.0, 2.0, 4.0, 1e6};
  if (random.chance(0.4)) return special[random.below(special.size())];
  return std::pow(10.0, random.uniform(-9.0, 3.0));
}
double number(Random& random) { return (random.chance(0.5) ? 1.0 : -1.0) * magnitude(random); }

TEST(ExactArithmetic, TheEnergyOfAnIntervalIsRightToOneUnitIn1e14) {
  Random random(1);
  for (std::uint64_t i = 0; i < test::seed_count(20000); ++i) {
    const double f_d = magnitude(random);
    const double f_co = magnitude(random);
    const double T = std::max(1e-9, magnitude(random));
    const double d = number(random);
    const double f = number(random);
    const Exact viscous = Exact(f_d) * Exact(d) * Exact(d) / Exact(T);
    const Exact coulomb = Exact(f_co) * abs(Exact(d));
    const Exact work = Exact(f) * Exact(d);
    const Exact largest = std::max({viscous, coulomb, Exact(abs(work))});
    const Exact error =
        abs(Exact(interval_energy_joule(f_d, f_co, T, d, f)) - Exact(viscous + coulomb + work));
    EXPECT_LE(error, Exact(kOfLargestTerm) * largest) << f_d << ' ' << f_co << ' ' << T << ' ' << d;
  }
}

// T D(f_max) ≤ E′ up to rounding, with and without a highest speed.
TEST(ExactArithmetic, TheBoundDrainsNoMoreThanThereIs) {
  Random random(2);
  for (std::uint64_t i = 0; i < test::seed_count(20000); ++i) {
    const MofcParameters p{.f_d = std::max(1e-9, magnitude(random)),
                           .f_co = magnitude(random),
                           .T = std::max(1e-9, magnitude(random))};
    const double energy = magnitude(random);
    const double v_max = std::max(1e-6, magnitude(random));
    for (const bool is_bounded : {false, true}) {
      const double f =
          is_bounded ? maximum_force_newton(p, energy, v_max) : maximum_force_newton(p, energy);
      // what f_max rounds off f_co is lost, and may come back as excess: count it with the largest
      const Exact excess = std::max(Exact(0), Exact(Exact(f) - Exact(p.f_co)));
      Exact drain = excess * excess / (4 * Exact(p.f_d));
      if (is_bounded && excess > 2 * Exact(p.f_d) * Exact(v_max)) {
        drain = Exact(v_max) * (excess - Exact(p.f_d) * Exact(v_max));
      }
      const Exact slope = is_bounded ? std::min(Exact(v_max), Exact(excess / (2 * Exact(p.f_d))))
                                     : Exact(excess / (2 * Exact(p.f_d)));
      const Exact largest = std::max(Exact(energy), Exact(Exact(p.T) * slope * Exact(f)));
      EXPECT_LE(Exact(p.T) * drain, Exact(energy) + Exact(kOfLargestTerm) * largest)
          << p.f_d << ' ' << p.f_co << ' ' << p.T << ' ' << energy << ' ' << v_max;
    }
  }
}

TEST(ExactArithmetic, TheDrainIsRightToOneUnitIn1e14) {
  Random random(3);
  for (std::uint64_t i = 0; i < test::seed_count(20000); ++i) {
    const MofcParameters p{.f_d = std::max(1e-9, magnitude(random)), .f_co = magnitude(random)};
    const double f = magnitude(random);
    const double v_max = std::max(1e-6, magnitude(random));
    const Exact excess = std::max(Exact(0), Exact(Exact(f) - Exact(p.f_co)));
    Exact exact = excess * excess / (4 * Exact(p.f_d));
    Exact largest = exact;
    if (excess > 2 * Exact(p.f_d) * Exact(v_max)) {
      exact = Exact(v_max) * (excess - Exact(p.f_d) * Exact(v_max));
      largest = Exact(v_max) * excess;
    }
    EXPECT_LE(abs(Exact(drain_watt(p, f, v_max)) - exact), Exact(kOfLargestTerm) * largest);
  }
}

Digits100 length_of(const Vector3& v) {
  Digits100 sum = 0;
  for (int i = 0; i < 3; ++i) sum += Digits100(v[i]) * Digits100(v[i]);
  return sqrt(sum);
}

/// The count of docs/theory.md §2.3 for isotropic friction, written from there: the force g in
/// doubles, as it is free, and the energy with it in 100 digits. The encoder's resolution is a
/// power of two, so that windows close where they do in doubles.
class LedgerIn100Digits {
 public:
  /// @param rounding  by which the shares of friction are lowered
  LedgerIn100Digits(double f_d, double f_co, double q, const Vector3& start, double rounding)
      : f_d_(f_d), f_co_(f_co), q_(q), rounding_(rounding), at_(start), play_(start) {
    begin_window();
  }

  void book(double duration_s, const Vector3& force_on_hand, const Vector3& end) {
    const Vector3 held = chosen(-force_on_hand, end);
    Digits100 friction2 = 0;
    for (int i = 0; i < 3; ++i) {
      variation_ += abs(Digits100(held[i]) - Digits100(held_[i]));
      work_ += Digits100(held[i]) * (Digits100(end[i]) - Digits100(at_[i]));
      const Digits100 h = Digits100(held[i]) + Digits100(force_on_hand[i]);
      friction2 += h * h;
    }
    exceeds_friction_ |= friction2 > Digits100(f_co_) * Digits100(f_co_);
    held_ = held;
    at_ = end;
    window_s_ += Digits100(duration_s);
    if (window_length() >= 16 * Digits100(q_)) {
      viscous_ += window_viscous();
      begin_window();
    }
  }

  [[nodiscard]] Digits100 energy() const {
    Digits100 force = 0;
    for (const double g : held_) force += abs(Digits100(g));
    return work_ - Digits100(q_) / 2 * (force + variation_) + viscous_ + window_viscous();
  }
  /// Sum of the magnitudes of all that was ever added.
  [[nodiscard]] Digits100 turnover() const {
    return abs(work_) + Digits100(q_) * variation_ + viscous_ + window_viscous();
  }
  /// |h| was more than f_co.
  [[nodiscard]] bool exceeds_friction() const { return exceeds_friction_; }

 private:
  [[nodiscard]] Vector3 chosen(const Vector3& f, const Vector3& end) {
    const Vector3 toward = end - play_;
    Vector3 sure;
    for (int i = 0; i < 3; ++i) {
      sure[i] = std::clamp(play_[i], end[i] - 0.5 * q_, end[i] + 0.5 * q_) - play_[i];
    }
    play_ += sure;
    const double length = sure.lpNorm<1>();
    if (length > 0.0) path_ = path_ * (16.0 * q_ / (16.0 * q_ + length)) + sure.cwiseAbs();
    Vector3 held;
    for (int i = 0; i < 3; ++i) {
      const double share = path_.norm() > 0.0 ? f_co_ * (path_[i] / path_.norm()) : 0.0;
      const double rounded = rounding_ * std::abs(f[i]);
      const double most = std::max(0.0, share - rounded - rounding_ * (share + rounded));
      const bool goes_on = toward[i] * (end[i] - at_[i]) > 0.0 && std::abs(toward[i]) >= 0.499 * q_;
      held[i] = goes_on ? f[i] + std::copysign(most, toward[i])
                        : std::clamp(held_[i], f[i] - most, f[i] + most);
    }
    return held;
  }
  void begin_window() {
    window_start_ = at_;
    window_s_ = 0;
  }
  [[nodiscard]] Digits100 window_length() const {
    Digits100 sum = 0;
    for (int i = 0; i < 3; ++i) {
      const Digits100 d = Digits100(at_[i]) - Digits100(window_start_[i]);
      sum += d * d;
    }
    return sqrt(sum);
  }
  [[nodiscard]] Digits100 window_viscous() const {
    const Digits100 sure = window_length() - sqrt(Digits100(3)) * Digits100(q_);
    if (window_s_ == 0 || sure <= 0) return 0;
    return Digits100(f_d_) * sure * sure / window_s_;
  }

  double f_d_, f_co_, q_, rounding_;
  Vector3 at_, play_;
  Vector3 path_ = Vector3::Zero();
  Vector3 held_ = Vector3::Zero();
  bool exceeds_friction_ = false;
  Digits100 work_ = 0, variation_ = 0, viscous_ = 0;
  Vector3 window_start_ = Vector3::Zero();
  Digits100 window_s_ = 0;
};

// A hand that wanders in whole counts against changing forces.
TEST(ExactArithmetic, LedgerAndMonitorAreNeverAboveTheExactCountAndStayCloseToIt) {
  for (std::uint64_t seed = 0; seed < 2; ++seed) {
    Random random(seed);
    const double q = std::ldexp(1.0, -14);  // 0.061 mm
    const double f_d = random.uniform(0.0, 1.0);
    const double f_co = random.uniform(0.0, 0.5);
    Vector3 at = Vector3::Zero();
    EnergyLedger ledger(f_d, f_co, q);
    ledger.restart(at);
    device::EnergyAccount account(
        {.viscous_newton_s_per_m = f_d, .coulomb_newton = f_co, .position_resolution_m = q});
    account.restart(at, 0.0);
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    LedgerIn100Digits exact_ledger(f_d, f_co, q, at, 8.0 * kEpsilon);
    LedgerIn100Digits exact_account(f_d, f_co, q, at, 4.0 * kEpsilon);
    Vector3 force = Vector3::Zero();
    Vector3 drift = Vector3::Zero();
    for (std::uint64_t k = 1; k <= test::seed_count(10000); ++k) {
      if (random.chance(0.02)) drift = 3.0 * random.direction();
      if (random.chance(0.3)) force = random.uniform(0.0, 5.0) * random.direction();
      Vector3 moved;
      for (int i = 0; i < 3; ++i) moved[i] = q * std::round(drift[i] + random.uniform(-0.8, 0.8));
      at += moved;
      const double duration_s = random.uniform(1e-4, 2e-3);
      ledger.book(duration_s, force, at);
      account.book(duration_s, force, at);
      exact_ledger.book(duration_s, force, at);
      exact_account.book(duration_s, force, at);
      if (k % 100 != 0) continue;
      const auto is_close_below = [&](double joule, const LedgerIn100Digits& exact) {
        const Digits100 credit = Digits100(joule) - exact.energy();
        return credit <= 0 && credit >= -Digits100(kOfLargestTerm) * k * exact.turnover() &&
               !exact.exceeds_friction();
      };
      ASSERT_TRUE(is_close_below(ledger.energy_joule(), exact_ledger)) << seed << ", step " << k;
      ASSERT_TRUE(is_close_below(account.joule(), exact_account)) << seed << ", step " << k;
    }
  }
}

/// D(F) for isotropic friction, docs/theory.md §2.6.
Digits100 exact_drain_watt(double f_d, double f_co, double v_max, const Vector3& force) {
  const Digits100 excess = length_of(force) - Digits100(f_co);
  if (excess <= 0) return 0;
  const Digits100 fastest = f_d > 0 ? Digits100(excess / (2 * Digits100(f_d))) : Digits100(v_max);
  const Digits100 v = std::min(fastest, Digits100(v_max));
  return (excess - Digits100(f_d) * v) * v;
}

// (★): what the granted force and the acting one can draw in their leases. A rounding of |F| counts
// as much as the hand makes of it, v_max.
TEST(ExactArithmetic, WhatClampAndMonitorGrantIsCovered) {
  constexpr double kReplyS = 0.0005;
  constexpr double kHoldS = 0.002;
  Random random(4);
  int granted = 0;
  int covered = 0;
  for (std::uint64_t run = 0; run < test::seed_count(2000); ++run) {
    const double f_d = random.chance(0.2) ? 0.0 : random.uniform(0.01, 1.0);
    const double f_co = random.chance(0.2) ? 0.0 : random.uniform(0.01, 0.5);
    const double v_max = random.chance(0.2) ? std::ldexp(1.0, -10) : random.uniform(0.1, 2.0);
    const Vector3 hand = random.uniform(0.0, 0.1) * random.direction();
    const Vector3 acting = random.uniform(0.0, 2.0 * f_co + 0.2) * random.direction();
    const Vector3 requested = magnitude(random) * random.direction();
    const double acting_s = random.uniform(0.0, 0.002);
    const auto is_covered = [&](double lease_s, const Vector3& force, double delta_s, double joule,
                                double passes_joule) {
      const Digits100 drawn = Digits100(lease_s) * exact_drain_watt(f_d, f_co, v_max, force);
      const Digits100 spent = Digits100(delta_s) * exact_drain_watt(f_d, f_co, v_max, acting);
      const Digits100 left = std::max(Digits100(0), Digits100(Digits100(joule) - spent));
      const Digits100 largest =
          Digits100(std::abs(joule)) + spent + Digits100(lease_s * v_max) * length_of(force);
      return drawn <= left + Digits100(kOfLargestTerm) * largest + Digits100(passes_joule);
    };

    LeasedPool pool({.mofc = {.f_d = f_d, .f_co = f_co, .T = kHoldS},
                     .delta_max_s = kReplyS,
                     .longest_lease_s = 0.01,
                     .v_max_m_per_s = v_max});
    static_cast<void>(pool.book({}));
    const std::array<AppliedStretch, 1> free_motion{
        AppliedStretch{.duration_s = 0.1, .hand_position_at_end_m = hand}};
    ControlInput moved;
    moved.hand_position_m = hand;
    moved.applied = free_motion;
    static_cast<void>(pool.book(moved));
    ControlInput input;
    input.hand_position_m = hand;
    input.acting_force_on_hand_newton = acting;
    input.acting_lease_s = acting_s;
    input.requested_force_on_hand_newton = requested;
    const ControlOutput output = pool.grant(input);
    granted += output.force_on_hand_newton.norm() > f_co ? 1 : 0;
    EXPECT_TRUE(is_covered(output.lease_s, output.force_on_hand_newton, std::min(acting_s, kReplyS),
                           output.ledger_energy_joule, 0.0))
        << "run " << run << ", requested " << requested.norm() << " N";

    DeviceConfig config;
    config.profile = {
        .viscous_newton_s_per_m = f_d, .coulomb_newton = f_co, .position_resolution_m = 0.0};
    config.reply = from_seconds(kReplyS);
    config.lease = from_seconds(kHoldS);
    config.monitor.v_max_m_per_s = v_max;
    device::ForceMonitor monitor(config);
    monitor.read(TimePoint{}, Vector3::Zero());
    const TimePoint now{std::chrono::milliseconds(100)};
    const Duration acting_lease = from_seconds(acting_s);
    monitor.switched(now, hand, acting, acting_lease);
    monitor.read(now, hand);
    const auto passed = monitor.cover(requested, std::chrono::milliseconds(10));
    const double lease_s = to_seconds(passed.lease);
    // 1 nJ and the drain of 1 ns pass
    const double passes_joule = 1e-9 + 1e-9 * static_cast<double>(exact_drain_watt(
                                                  f_d, f_co, v_max, passed.force_on_hand_newton));
    covered += passed.force_on_hand_newton.norm() > f_co ? 1 : 0;
    EXPECT_TRUE(is_covered(lease_s, passed.force_on_hand_newton,
                           std::min(to_seconds(acting_lease), kReplyS), monitor.joule(),
                           passes_joule))
        << "run " << run << ", requested " << requested.norm() << " N";
  }
  EXPECT_GT(granted, 100);
  EXPECT_GT(covered, 100);
}

// The figure of docs/theory.md §9.
TEST(ExactArithmetic, AHeldForceLosesLessThanANanojouleIn1e5Steps) {
  const double q = std::ldexp(1.0, -14);
  EnergyLedger ledger(0.1, 0.1, q);
  ledger.restart(Vector3::Zero());
  const Vector3 force(1.0 / 3.0, -2.0 / 3.0, 0.7);
  Exact work = 0;
  Vector3 at = Vector3::Zero();
  for (int k = 0; k < 100000; ++k) {
    const Vector3 next = (k % 2 == 0 ? 0.5 * q : 0.0) * Vector3(1.0, 1.0, -1.0);
    for (int i = 0; i < 3; ++i) work += Exact(-force[i]) * (Exact(next[i]) - Exact(at[i]));
    ledger.book(1e-3, force, next);
    at = next;
  }
  const Exact quantisation = Exact(q) * (Exact(1.0 / 3.0) + Exact(2.0 / 3.0) + Exact(0.7));
  const double lost = static_cast<double>(work - quantisation) - ledger.energy_joule();
  EXPECT_GE(lost, 0.0);
  EXPECT_LT(lost, 1e-9);
  std::printf("lost in 1e5 steps: %.3g J\n", lost);
}

}  // namespace
}  // namespace palpate::controllers
