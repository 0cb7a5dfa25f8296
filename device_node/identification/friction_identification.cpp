// SPDX-License-Identifier: Apache-2.0
#include "device_node/identification/friction_identification.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "common/core/check.h"
#include "common/core/tick_schedule.h"
#include "device_node/release.h"

namespace palpate::device {

namespace {

constexpr double kSigmas = 3.0;
constexpr double kWobbleRatio = 0.0015;       // of the friction; see fit_friction
constexpr double kForceAccuracyRatio = 0.02;  // of the motors; the loop's transients fit in as well

// bounds of the motors while no clamp can be used
constexpr double kPeakForceNewton = 1.0;
constexpr double kPeakForceRatio = 2.0;  // of the force that last set the device moving
constexpr double kTopSpeed_m_per_s = 0.1;
constexpr std::size_t kSpeedTicks = 10;  // over which the speed is measured
constexpr double kLeasePeriods = 3.0;
constexpr int kTries = 5;  // of a sweep that a late tick disturbs

// from rest: the force grows until the device moves
constexpr double kForceRate_newton_per_s = 0.5;
constexpr double kMoved_m = 0.2e-3;  // beyond the error of the encoder

// PI velocity loop, its integral written as a spring to a moving reference. With masses of
// 0.02 … 0.1 kg its slowest mode decays faster than 10/s; heavier ones get looser bounds.
constexpr double kIntegral_newton_per_m = 40.0;
constexpr double kProportional_newton_s_per_m = 3.0;
constexpr double kVelocityFilter_s = 0.015;
constexpr double kVelocityFilter_m_per_s =
    0.01;  // or as long as a count of the encoder lasts at it
constexpr double kAcceleration_m_per_s2 = 0.3;
constexpr double kLargestLag_m = 0.02;
constexpr double kWindowRatio = 0.4;  // of the line, in its middle: where the force is averaged

// back to rest
constexpr double kAtRest_m_per_s = 2e-3;
constexpr double kBrakeLimit_s = 2.0;
constexpr double kRest_s = 0.05;
constexpr double kDrift_m = 0.5e-3;  // let go, in kRest_s
constexpr double kTravelSpeed_m_per_s = 0.03;

std::string in_mm(const Vector3& position_m) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "(%.1f, %.1f, %.1f) mm", 1e3 * position_m.x(),
                1e3 * position_m.y(), 1e3 * position_m.z());
  return text.data();
}

std::string in_newton(double force_newton) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f N", force_newton);
  return text.data();
}

/// The device under the sweeps' own bounds.
class Rig {
 public:
  Rig(HapticDevice& device, Clock& clock, const SweepPlan& plan)
      : device_(device),
        clock_(clock),
        plan_(plan),
        q_m_(device.specification().position_resolution_m),
        peak_newton_(std::min({kPeakForceNewton, device.specification().peak_force_newton,
                               device.specification().continuous_force_newton})),
        schedule_(clock.now(), plan.rate_hz),
        filter_s_(std::max(kVelocityFilter_s, q_m_ / kVelocityFilter_m_per_s)),
        lease_(from_seconds(kLeasePeriods / plan.rate_hz)) {
    DeviceSample sample;
    if (!device_.read(sample)) throw IdentificationError("the device cannot be read");
    if (!is_in_box(sample.hand_position_m)) {
      throw SetupError("the device is at " + in_mm(sample.hand_position_m) +
                       ", outside the box of ±" + in_mm(plan_.box_half_extent_m) +
                       " in which friction is measured; move it inside and let go");
    }
    if (!is_held(sample)) {
      throw SetupError("nobody holds the dead-man button, button " +
                       std::to_string(*plan_.dead_man_button) +
                       ": hold it from the acknowledgement on, until the device has come to rest; "
                       "it must not be on the handle, which nobody may hold");
    }
    readings_.fill(sample);
  }
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;
  ~Rig() {
    if (!is_released_) static_cast<void>(release_for_certain(device_, clock_));
  }

  /// The end of the sweeps.
  void release() {
    is_released_ = true;
    if (release_for_certain(device_, clock_)) return;
    throw IdentificationError(std::string("the device was measured, but ") + kNotReleased);
  }

  /// From rest to rest at `target`; sets is_disturbed_. Mean speed and force over the window around
  /// `window_middle_m`, along the motion; no meaning if the motion does not cross the window.
  FrictionPoint sweep_to(const Vector3& target_m, double speed_m_per_s,
                         const Vector3& window_middle_m) {
    const Vector3 start_m = position_m();
    const double length_m = (target_m - start_m).norm();
    const Vector3 along = (target_m - start_m) / length_m;

    const double moving_newton = set_moving(along);
    leases_run_out_ = 0;
    is_disturbed_ = false;
    limit_newton_ = std::min(peak_newton_, kPeakForceRatio * moving_newton);

    // to speed, and on; the brake takes up the rest of the way
    Vector3 reference_m = position_m();
    double reference_speed = std::clamp(velocity_.dot(along), 0.0, speed_m_per_s);
    const double brake_m = 0.5 * speed_m_per_s * speed_m_per_s / kAcceleration_m_per_s2;
    const double half_window_m = kWindowRatio * plan_.half_length_m;
    std::optional<Switch> entry;
    std::optional<Switch> exit;
    const auto follow = [&](double acceleration) {
      const double dt_s = 1.0 / plan_.rate_hz;
      reference_speed = std::clamp(reference_speed + acceleration * dt_s, 0.0, speed_m_per_s);
      reference_m += reference_speed * dt_s * along;
      step(moving_newton * along + kIntegral_newton_per_m * (reference_m - position_m()) +
           kProportional_newton_s_per_m * (reference_speed * along - velocity_));
      const double in_window_m = along.dot(switch_.position_m - window_middle_m);
      if (!entry && in_window_m >= -half_window_m) entry = switch_;
      if (!exit && in_window_m >= half_window_m) {
        exit = switch_;
        is_disturbed_ = leases_run_out_ > 0;
      }
    };
    while (along.dot(position_m() - start_m) < length_m - brake_m) {
      follow(kAcceleration_m_per_s2);
      if ((reference_m - position_m()).norm() > kLargestLag_m) {
        fail("stuck: " + in_newton(limit_newton_) + " no longer move it; clear its way");
      }
    }

    // to rest, and let go
    double braked_s = 0.0;
    while (reference_speed > 0.0 || velocity_.norm() > kAtRest_m_per_s) {
      follow(-kAcceleration_m_per_s2);
      braked_s += 1.0 / plan_.rate_hz;
      if (braked_s > kBrakeLimit_s) fail("does not come to rest; take the hand off the device");
    }
    rest();

    if (!entry || !exit || exit->at <= entry->at) return {};
    const double window_s = to_seconds(exit->at - entry->at);
    return {.speed_m_per_s = along.dot(exit->position_m - entry->position_m) / window_s,
            .force_newton = along.dot(exit->impulse - entry->impulse) / window_s};
  }

  /// There and back between the line's ends, from the near one; repeated until each way was swept
  /// without a tick so late that a lease ran out.
  FrictionPoint pair_of_sweeps(const SweepLine& line, double speed_m_per_s) {
    const Vector3 reach_m = plan_.half_length_m * line.direction;
    std::optional<FrictionPoint> there;
    std::optional<FrictionPoint> back;
    const auto sweep = [&](const Vector3& target_m, std::optional<FrictionPoint>& found) {
      const FrictionPoint point = sweep_to(target_m, speed_m_per_s, line.middle_m);
      if (!is_disturbed_) found = point;
    };
    for (int i = 0; i < kTries; ++i) {
      sweep(line.middle_m + reach_m, there);
      sweep(line.middle_m - reach_m, back);
      if (!there || !back) continue;
      return {.speed_m_per_s = 0.5 * (there->speed_m_per_s + back->speed_m_per_s),
              .force_newton = 0.5 * (there->force_newton + back->force_newton)};
    }
    fail(
        "cannot be held at a speed: this computer's ticks come too late too often; permit "
        "real-time scheduling, and end what else runs on it");
  }

 private:
  /// An instant at which the force changed.
  struct Switch {
    TimePoint at{};
    Vector3 position_m = Vector3::Zero();
    Vector3 impulse = Vector3::Zero();  ///< ∫ F dt up to then [N·s]
  };

  [[nodiscard]] const Vector3& position_m() const { return readings_[newest_].hand_position_m; }
  [[nodiscard]] bool is_in_box(const Vector3& p) const {
    return (p.array().abs() <= plan_.box_half_extent_m.array()).all();
  }

  [[noreturn]] void fail(const std::string& what) {
    is_released_ = true;
    const bool is_confirmed = release_for_certain(device_, clock_);
    throw IdentificationError("at " + in_mm(position_m()) + " the device " + what + "; " +
                              (is_confirmed ? "its motors were released" : kNotReleased));
  }

  [[nodiscard]] bool is_held(const DeviceSample& sample) const noexcept {
    return !plan_.dead_man_button || ((sample.buttons >> *plan_.dead_man_button) & 1U) != 0;
  }

  /// One period under the force.
  void step(const Vector3& force_newton) {
    if (plan_.stop.stop_requested()) fail("was stopped");
    const Vector3 force = limited_to_norm(force_newton, limit_newton_);
    DeviceSample at_switch;
    if (!device_.apply(force, lease_, at_switch)) fail("failed to take a force");

    // the impulse of the previous force; if its lease ran out, it ended early
    if (force_) {
      const Duration acted = std::min(at_switch.sampled_at - switch_.at, lease_);
      if (at_switch.sampled_at - switch_.at > lease_) ++leases_run_out_;
      switch_.impulse += to_seconds(acted) * *force_;
    }
    switch_.at = at_switch.sampled_at;
    switch_.position_m = at_switch.hand_position_m;
    force_ = at_switch.applied_force_newton;

    // wait and read
    schedule_.finish(clock_.now());
    clock_.sleep_until(schedule_.next());
    const DeviceSample before = readings_[newest_];
    const std::size_t oldest = (newest_ + 1) % readings_.size();
    DeviceSample now;
    if (!device_.read(now)) fail("can no longer be read");
    if (!now.hand_position_m.allFinite()) fail("reads no finite position");
    if (!is_held(now)) fail("was stopped: its dead-man button was released");
    readings_[newest_ = oldest] = now;

    const double dt_s = to_seconds(now.sampled_at - before.sampled_at);
    if (dt_s > 0.0) {
      const Vector3 difference = (now.hand_position_m - before.hand_position_m) / dt_s;
      velocity_ += dt_s / (filter_s_ + dt_s) * (difference - velocity_);
    }
    if (!is_in_box(position_m())) fail("left the box in which it may move; start in its middle");

    // the distance since the oldest reading, less the error of the encoder
    const DeviceSample& old = readings_[(newest_ + 1) % readings_.size()];
    const double span_s = to_seconds(now.sampled_at - old.sampled_at);
    const double way_m = (position_m() - old.hand_position_m).norm() - std::sqrt(3.0) * q_m_;
    if (way_m > kTopSpeed_m_per_s * span_s) fail("ran faster than 0.1 m/s");
  }

  /// Raises the force until the device moves; that force [N].
  double set_moving(const Vector3& along) {
    const Vector3 start_m = position_m();
    const double moved_m = kMoved_m + 2.0 * q_m_;
    limit_newton_ = peak_newton_;
    for (double force = 0.0; force < peak_newton_;
         force += kForceRate_newton_per_s / plan_.rate_hz) {
      step(force * along);
      const Vector3 way_m = position_m() - start_m;
      if (along.dot(way_m) > moved_m) return force;
      if (way_m.norm() > 2.0 * moved_m) {
        fail("moves, but not where its motors push: take the hand off, check axes and signs");
      }
    }
    fail("does not move at " + in_newton(peak_newton_) +
         ": its friction is too high to be measured so, or it is held or switched off");
  }

  /// Limp; the device must stay where it is.
  void rest() {
    const Vector3 start_m = position_m();
    const int ticks = static_cast<int>(std::ceil(kRest_s * plan_.rate_hz));
    for (int i = 0; i < ticks; ++i) step(Vector3::Zero());
    velocity_.setZero();
    if ((position_m() - start_m).norm() > kDrift_m + 2.0 * q_m_) {
      fail("moves by itself with its motors off: take the hand off, balance its weight");
    }
  }

  HapticDevice& device_;
  Clock& clock_;
  const SweepPlan& plan_;
  double q_m_;
  double peak_newton_;
  TickSchedule schedule_;
  double filter_s_;
  Duration lease_;

  double limit_newton_ = 0.0;
  std::optional<Vector3> force_;  ///< acting since switch_
  Switch switch_;
  std::array<DeviceSample, kSpeedTicks + 1> readings_{};  ///< ring
  std::size_t newest_ = 0;
  Vector3 velocity_ = Vector3::Zero();  ///< filtered [m/s]
  bool is_released_ = false;            ///< there is no more to come
  int leases_run_out_ = 0;              ///< since the motion began
  bool is_disturbed_ = false;           ///< the last sweep, until it left its window
};

struct Line {
  double f_d = 0.0;
  double f_co = 0.0;
  double sigma_d = 0.0;
  double sigma_co = 0.0;
  double mean_F = 0.0;
};

Line line_through(std::span<const FrictionPoint> points) {
  PALPATE_REQUIRE(points.size() >= 3);
  const auto n = static_cast<double>(points.size());

  double mean_v = 0.0;
  double mean_F = 0.0;
  for (const auto& [v, F] : points) {
    mean_v += v / n;
    mean_F += F / n;
  }
  double D = 0.0;
  double vF = 0.0;
  for (const auto& [v, F] : points) {
    D += (v - mean_v) * (v - mean_v);
    vF += (v - mean_v) * F;
  }
  PALPATE_REQUIRE(D > 0.0);
  const double f_d = vF / D;
  const double f_co = mean_F - f_d * mean_v;

  double residual2 = 0.0;
  for (const auto& [v, F] : points) residual2 += std::pow(F - f_co - f_d * v, 2);
  const double s = std::sqrt(residual2 / (n - 2.0));
  return {.f_d = f_d,
          .f_co = f_co,
          .sigma_d = s / std::sqrt(D),
          .sigma_co = s * std::sqrt(1.0 / n + mean_v * mean_v / D),
          .mean_F = mean_F};
}

}  // namespace

FrictionFit fit_friction(std::span<const FrictionPoint> points) {
  const Line all = line_through(points);
  std::vector<FrictionPoint> by_speed(points.begin(), points.end());
  std::stable_sort(by_speed.begin(), by_speed.end(),
                   [](const auto& a, const auto& b) { return a.speed_m_per_s < b.speed_m_per_s; });
  const Line fast = line_through(std::span(by_speed).subspan(points.size() / 3));

  constexpr double kKnown = 1.0 - kForceAccuracyRatio;
  const double range = by_speed.back().speed_m_per_s - by_speed.front().speed_m_per_s;
  const double slope = std::min(all.f_d - kSigmas * all.sigma_d, fast.f_d - kSigmas * fast.sigma_d);
  const double f_d_bound = std::max(0.0, kKnown * (slope - kWobbleRatio * all.mean_F / range));
  double f_co_bound = kKnown * (all.f_co - kSigmas * all.sigma_co);
  for (const auto& [v, F] : points) f_co_bound = std::min(f_co_bound, kKnown * (F - f_d_bound * v));
  return {.viscous_newton_s_per_m = all.f_d,
          .coulomb_newton = all.f_co,
          .viscous_bound_newton_s_per_m = f_d_bound,
          .coulomb_bound_newton = std::max(0.0, f_co_bound)};
}

std::vector<Vector3> axes_with_motors(const DeviceSpecification& specification) {
  constexpr double kAlong = 0.7;  // of a unit force, at least: else the axes beside it have it
  std::vector<Vector3> axes;
  for (int i = 0; i < 3; ++i) {
    const Vector3 given = specification.force_axes * Vector3::Unit(i);
    if (given.norm() > kAlong) axes.push_back(given.normalized());
  }
  PALPATE_REQUIRE(!axes.empty());
  return axes;
}

SweepPlan default_sweep_plan(const DeviceSpecification& specification) {
  const Vector3 half_m = specification.workspace_half_extent_m;
  const std::vector<Vector3> axes = axes_with_motors(specification);
  SweepPlan plan;
  plan.box_half_extent_m = 0.9 * half_m;
  plan.half_length_m = half_m.maxCoeff();
  for (const Vector3& axis : axes) {
    plan.half_length_m = std::min(plan.half_length_m, 0.5 * half_m.dot(axis.cwiseAbs()));
  }
  plan.speeds_m_per_s = {0.02, 0.035, 0.05};
  plan.repeats = 3;
  for (const Vector3& corner :
       {Vector3(1, 1, 1), Vector3(-1, -1, 1), Vector3(-1, 1, -1), Vector3(1, -1, -1)}) {
    std::vector<Vector3> directions = axes;
    if (axes.size() > 1) directions.push_back((specification.force_axes * corner).normalized());
    for (const Vector3& direction : directions) {
      plan.lines.push_back(
          {.middle_m = 0.3 * (specification.force_axes * half_m.cwiseProduct(corner)),
           .direction = direction});
    }
  }
  return plan;
}

FrictionPerAxis friction_per_axis(const FrictionReport& report) {
  constexpr double kAlong = 1.0 - 1e-9;
  FrictionPerAxis found{.viscous_newton_s_per_m = Vector3::Zero(),
                        .coulomb_newton = Vector3::Zero()};
  for (int i = 0; i < 3; ++i) {
    bool has_line = false;
    for (const auto& [line, fit] : report.lines) {
      if (std::abs(line.direction[i]) < kAlong) continue;
      double& viscous = found.viscous_newton_s_per_m[i];
      double& coulomb = found.coulomb_newton[i];
      viscous = has_line ? std::min(viscous, fit.viscous_bound_newton_s_per_m)
                         : fit.viscous_bound_newton_s_per_m;
      coulomb = has_line ? std::min(coulomb, fit.coulomb_bound_newton) : fit.coulomb_bound_newton;
      has_line = true;
    }
  }
  // claimed along u: Σ f_d,i u_i² and Σ f_co,i |u_i|
  double viscous_share = 1.0;
  double coulomb_share = 1.0;
  for (const auto& [line, fit] : report.lines) {
    const double viscous = found.viscous_newton_s_per_m.dot(line.direction.cwiseAbs2());
    const double coulomb = found.coulomb_newton.dot(line.direction.cwiseAbs());
    if (viscous > fit.viscous_bound_newton_s_per_m) {
      viscous_share = std::min(viscous_share, fit.viscous_bound_newton_s_per_m / viscous);
    }
    if (coulomb > fit.coulomb_bound_newton) {
      coulomb_share = std::min(coulomb_share, fit.coulomb_bound_newton / coulomb);
    }
  }
  found.viscous_newton_s_per_m *= viscous_share;
  found.coulomb_newton *= coulomb_share;
  return found;
}

void check_consent(const DeviceSpecification& specification, const SweepConsent& consent) {
  if (!specification.is_simulated && !consent.may_move) {
    throw SetupError("device \"" + specification.model_name +
                     "\" is real and would move by itself, with up to 1 N; clear its workspace, "
                     "take the hand off and give --i-understand-this-moves-the-device");
  }
  if (!specification.has_motor_watchdog && !consent.may_lack_watchdog) {
    throw SetupError("device \"" + specification.model_name +
                     "\" has no motor-side watchdog: it would go on pushing, with up to 1 N, if "
                     "this program stopped; with a hand at its power switch, `palpate identify "
                     "--without-watchdog` measures it");
  }
}

FrictionReport identify_friction(HapticDevice& device, Clock& clock, const SweepPlan& plan,
                                 const SweepConsent& consent,
                                 const std::function<void(const LineFriction&)>& on_line) {
  PALPATE_REQUIRE(!plan.lines.empty());
  check_consent(device.specification(), consent);

  FrictionReport report;
  Rig rig(device, clock, plan);
  for (const SweepLine& line : plan.lines) {
    const Vector3 reach_m = plan.half_length_m * line.direction;
    rig.sweep_to(line.middle_m - reach_m, kTravelSpeed_m_per_s, line.middle_m);
    std::vector<FrictionPoint> points;
    for (int i = 0; i < plan.repeats; ++i) {
      for (const double speed : plan.speeds_m_per_s) {
        points.push_back(rig.pair_of_sweeps(line, speed));
      }
    }
    report.lines.push_back({.line = line, .fit = fit_friction(points)});
    if (on_line) on_line(report.lines.back());
  }
  rig.release();

  const auto smallest = [&](double FrictionFit::*bound) {
    double least = report.lines.front().fit.*bound;
    for (const LineFriction& line : report.lines) least = std::min(least, line.fit.*bound);
    return least;
  };
  report.viscous_bound_newton_s_per_m = smallest(&FrictionFit::viscous_bound_newton_s_per_m);
  report.coulomb_bound_newton = smallest(&FrictionFit::coulomb_bound_newton);
  return report;
}

}  // namespace palpate::device
