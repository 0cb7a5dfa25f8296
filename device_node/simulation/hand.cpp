// SPDX-License-Identifier: Apache-2.0
#include "device_node/simulation/hand.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>
#include <variant>

namespace palpate::device {

namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
/// Of a led hand: longer than the 16 ms between a pointer's steps, short enough to follow promptly.
constexpr double kLeadTimeConstant_s = 0.05;
constexpr double kBackOnPath_m = 1e-7;        // the step from there to the path: 15 µN at 150 N/m
constexpr double kTimeRounding_s = 1e-9;      // of hours
constexpr double kTimeRounding_ratio = 1e-6;  // of a step
constexpr int kTurns = 64;

/// The path if it is a hostile one; else the defaults, which are not used.
HostilePath hostile_part(const PathConfig& path) {
  const HostilePath* hostile = std::get_if<HostilePath>(&path);
  return hostile != nullptr ? *hostile : HostilePath{};
}

std::optional<SinusoidSteps> sinusoid_part(const PathConfig& path) {
  const SinusoidPath* sinusoid = std::get_if<SinusoidPath>(&path);
  return sinusoid != nullptr ? std::optional<SinusoidSteps>(*sinusoid) : std::nullopt;
}

}  // namespace

Target target_on(const VPath& path, double t_s) noexcept {
  const Vector3 down = path.half_width_m * path.tangent - path.height_m * path.normal;
  const Vector3 start = path.apex_m - down;

  // free motion: a circle through the start, above it
  if (t_s < path.free_motion_s) {
    const double omega = kTwoPi * path.free_frequency_hz;
    const auto circle_m = [&](double t) -> Vector3 {
      return path.free_amplitude_m *
             (std::sin(omega * t) * path.tangent + (1.0 - std::cos(omega * t)) * path.normal);
    };
    Target target{start + circle_m(t_s),
                  path.free_amplitude_m * omega *
                      (std::cos(omega * t_s) * path.tangent + std::sin(omega * t_s) * path.normal)};

    // the offset that would remain at its end is removed over the last quarter turn
    const double back_s = std::min(path.free_motion_s, 0.25 / path.free_frequency_hz);
    const double u = (t_s - (path.free_motion_s - back_s)) / back_s;
    if (u > 0.0) {
      const Vector3 left_m = circle_m(path.free_motion_s);
      target.position_m -= u * u * (3.0 - 2.0 * u) * left_m;
      target.velocity_m_per_s -= 6.0 * u * (1.0 - u) / back_s * left_m;
    }
    return target;
  }

  // one leg down, one leg up, then hold
  const double length_m = std::hypot(path.half_width_m, path.height_m);
  const double run_m = path.speed_m_per_s * (t_s - path.free_motion_s);
  const Vector3 first_leg = down / length_m;
  const Vector3 up = path.half_width_m * path.tangent + path.height_m * path.normal;
  const Vector3 second_leg = up / length_m;
  if (run_m < length_m) return {start + run_m * first_leg, path.speed_m_per_s * first_leg};
  if (run_m < 2.0 * length_m) {
    return {path.apex_m + (run_m - length_m) * second_leg, path.speed_m_per_s * second_leg};
  }
  return {path.apex_m + up, Vector3::Zero()};
}

Target target_on(const HoldPath& path, double /*t_s*/) noexcept {
  return {path.position_m, Vector3::Zero()};
}

Target target_on(const SinusoidPath& path, double t_s) noexcept {
  Target target{path.center_m, Vector3::Zero()};
  for (int axis = 0; axis < 3; ++axis) {
    if (path.amplitude_m[axis] == 0.0) continue;
    const double omega = kTwoPi * path.frequency_hz[axis];
    const double phase = omega * t_s + path.phase_rad[axis];
    target.position_m[axis] += path.amplitude_m[axis] * std::sin(phase);
    target.velocity_m_per_s[axis] = path.amplitude_m[axis] * omega * std::cos(phase);
  }
  return target;
}

SinusoidSteps::SinusoidSteps(const SinusoidPath& path)
    : path_(path), omega_rad_per_s_(kTwoPi * path.frequency_hz) {}

Target SinusoidSteps::at(double t_s) noexcept {
  const double step_s = t_s - t_s_;
  const bool is_same = std::abs(step_s - step_s_) < kTimeRounding_ratio * step_s_;
  t_s_ = t_s;
  if (is_same && left_ > 0) {
    --left_;
    for (std::size_t i = 0; i < 3; ++i) {
      if (!has_turn_) {
        const double angle = omega_rad_per_s_[static_cast<int>(i)] * step_s;
        turn_[i] = {std::sin(angle), std::cos(angle)};
      }
      now_[i] = {now_[i].sin * turn_[i].cos + now_[i].cos * turn_[i].sin,
                 now_[i].cos * turn_[i].cos - now_[i].sin * turn_[i].sin};
    }
    has_turn_ = true;
  } else {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<int>(i);
      const double phase = omega_rad_per_s_[axis] * t_s + path_.phase_rad[axis];
      now_[i] = {std::sin(phase), std::cos(phase)};
    }
    left_ = kTurns;
    if (!is_same) has_turn_ = false;
    step_s_ = step_s;
  }
  Target target{path_.center_m, Vector3::Zero()};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<int>(i);
    target.position_m[axis] += path_.amplitude_m[axis] * now_[i].sin;
    target.velocity_m_per_s[axis] = path_.amplitude_m[axis] * omega_rad_per_s_[axis] * now_[i].cos;
  }
  return target;
}

Target target_on(const RecordedPath& path, double t_s) noexcept {
  const auto& samples = path.samples;
  if (samples.empty()) return {};
  const double first_s = samples.front().t_s;
  const double span_s = samples.back().t_s - first_s;
  if (path.loops && span_s > 0.0 && t_s > first_s) {
    t_s = first_s + std::fmod(t_s - first_s, span_s);
  }
  const auto after =
      std::upper_bound(samples.begin(), samples.end(), t_s,
                       [](double t, const RecordedPath::Sample& sample) { return t < sample.t_s; });
  if (after == samples.begin()) return {samples.front().position_m, Vector3::Zero()};
  if (after == samples.end()) return {samples.back().position_m, Vector3::Zero()};
  const auto before = after - 1;
  const Vector3 velocity = (after->position_m - before->position_m) / (after->t_s - before->t_s);
  return {before->position_m + (t_s - before->t_s) * velocity, velocity};
}

// --- hostile --------------------------------------------------------------------------------

HostileHand::HostileHand(const HostilePath& path, const SimulatedDeviceConfig& device,
                         std::uint64_t seed)
    : path_(path),
      viscous_newton_s_per_m_(device.viscous_newton_s_per_m),
      coulomb_newton_(device.coulomb_newton),
      per_axis_(device.per_axis),
      random_(seed),
      position_m_(path.center_m),
      surely_inside_m2_(path.radius_m * path.radius_m * (1.0 - 1e-12)) {}

void HostileHand::sense(const Vector3& force_on_hand_newton) noexcept {
  sensed_newton_ = force_on_hand_newton;
  const double newton = force_on_hand_newton.norm();
  if (newton > 0.0) last_force_direction_ = force_on_hand_newton / newton;
  most_draining_m_per_s_ = most_draining_velocity(force_on_hand_newton);
  turns_s_ = 0.0;
}

void HostileHand::turn(double t_s) noexcept {
  if (t_s >= until_s_) choose(t_s);
  turns_s_ = until_s_;
  switch (way_) {
    case Way::kDrain:
      wanted_m_per_s_ = most_draining_m_per_s_;
      break;
    case Way::kPress:
      wanted_m_per_s_ = speed_m_per_s_ * direction_;
      break;
    case Way::kShake: {
      const double phase_s = std::fmod(t_s - since_s_, 2.0 * half_period_s_);
      const bool is_back = phase_s >= half_period_s_;
      wanted_m_per_s_ = (is_back ? -speed_m_per_s_ : speed_m_per_s_) * direction_;
      // not before; less more than the rounding of the times
      const double left_s = (is_back ? 2.0 : 1.0) * half_period_s_ - phase_s;
      turns_s_ = std::min(until_s_, t_s + left_s - kTimeRounding_s);
      break;
    }
  }
}

void HostileHand::choose(double t_s) noexcept {
  since_s_ = t_s;
  const bool has_sensed = last_force_direction_.squaredNorm() > 0.0;
  const double dice = random_.uniform();
  if (has_sensed && dice < 0.5) {
    way_ = Way::kDrain;
    until_s_ = t_s + random_.uniform(0.002, 0.08);
  } else if (dice < 0.85) {
    // mostly against the last force, with some scatter
    way_ = Way::kPress;
    until_s_ = t_s + random_.uniform(0.005, 0.15);
    speed_m_per_s_ = path_.v_max_m_per_s * random_.uniform(0.05, 1.0);
    direction_ = (random_.uniform(0.2, 1.0) * random_.direction() -
                  (random_.chance(0.8) ? 1.5 : 0.0) * last_force_direction_)
                     .normalized();
  } else {
    way_ = Way::kShake;
    until_s_ = t_s + random_.uniform(0.02, 0.2);
    half_period_s_ = random_.uniform(0.0005, 0.025);
    speed_m_per_s_ = path_.v_max_m_per_s * random_.uniform(0.2, 1.0);
    direction_ = has_sensed ? last_force_direction_ : random_.direction();
  }
}

Vector3 HostileHand::most_draining_velocity(const Vector3& force_on_hand_newton) const noexcept {
  const double v_max = path_.v_max_m_per_s;
  const auto speed = [&](double surplus_newton, double f_d) {
    if (surplus_newton <= 0.0) return 0.0;
    return surplus_newton >= 2.0 * f_d * v_max ? v_max : surplus_newton / (2.0 * f_d);
  };
  if (!per_axis_) {
    return speed(force_on_hand_newton.norm() - coulomb_newton_, viscous_newton_s_per_m_) *
           last_force_direction_;
  }
  const Vector3 surplus_newton =
      (force_on_hand_newton.cwiseAbs() - per_axis_->coulomb_newton).cwiseMax(0.0);
  Vector3 v;
  for (int i = 0; i < 3; ++i) {
    v[i] = speed(surplus_newton[i], per_axis_->viscous_newton_s_per_m[i]);
  }
  // too fast together: friction then matters little, and the best direction is that of the excess
  if (v.norm() > v_max) v = v_max * surplus_newton.normalized();
  return v.cwiseProduct(force_on_hand_newton.cwiseSign());
}

// --- led ------------------------------------------------------------------------------------

void LedHand::lead_to(const Vector3& goal_m) noexcept {
  goal_m_ = config_.center_m + limited_to_norm(goal_m - config_.center_m, config_.reach_m);
}

Target LedHand::target(double t_s) noexcept {
  const double dt_s = t_s - t_s_;
  if (!(dt_s > 0.0)) return {position_m_, Vector3::Zero()};
  t_s_ = t_s;
  // exact for a constant goal, so it never overshoots
  const Vector3 step_m = (1.0 - std::exp(-dt_s / kLeadTimeConstant_s)) * (goal_m_ - position_m_);
  const Vector3 velocity = limited_to_norm(step_m / dt_s, config_.speed_m_per_s);
  position_m_ += dt_s * velocity;
  return {position_m_, velocity};
}

Target LedHand::target_towards(const Target& path, double t_s) noexcept {
  const double dt_s = t_s - t_s_;
  if (!(dt_s > 0.0)) return {position_m_, Vector3::Zero()};
  t_s_ = t_s;
  // with the path's own velocity, so that it does not lag behind
  lead_to(path.position_m);
  const Vector3 step_m = (1.0 - std::exp(-dt_s / kLeadTimeConstant_s)) *
                             (goal_m_ - dt_s * path.velocity_m_per_s - position_m_) +
                         dt_s * path.velocity_m_per_s;
  const Vector3 wanted_m =
      position_m_ + limited_to_norm(step_m, dt_s * config_.speed_m_per_s) - config_.center_m;
  const Vector3 next_m = config_.center_m + limited_to_norm(wanted_m, config_.reach_m);
  const Vector3 velocity = (next_m - position_m_) / dt_s;
  position_m_ = next_m;
  return {next_m, velocity};
}

// --- hand -----------------------------------------------------------------------------------

Hand::Hand(const HandConfig& config, const SimulatedDeviceConfig& device, std::uint64_t seed)
    : config_(config),
      sinusoid_(sinusoid_part(config.path)),
      is_hostile_(std::holds_alternative<HostilePath>(config.path)),
      hostile_(hostile_part(config.path), device, seed),
      intended_m_(Vector3::Zero()) {
  start_position_m_ = target(0.0, Vector3::Zero()).position_m;
}

Target Hand::on_path(double t_s) const noexcept {
  return std::visit(
      [&](const auto& path) -> Target {
        if constexpr (std::is_same_v<std::decay_t<decltype(path)>, HostilePath>) {
          return {path.center_m, Vector3::Zero()};  // not called for it
        } else {
          return target_on(path, t_s);
        }
      },
      config_.path);
}

Target Hand::target_without_sense(double t_s) noexcept {
  if (led_ && !is_returning_) return led_->target(t_s);
  Target target = sinusoid_ ? sinusoid_->at(t_s) : on_path(t_s);
  t_s_ = t_s;
  if (led_) {
    Target back = led_->target_towards(target, t_s);
    if ((back.position_m - target.position_m).norm() > kBackOnPath_m) return back;
    led_.reset();
    is_returning_ = false;
  }
  intended_m_ = target.position_m;
  return target;
}

void Hand::let_go() noexcept {
  is_returning_ = led_.has_value() && !is_hostile_;
  led_buttons_ = 0;
}

void Hand::lead_to(const Vector3& goal_m, std::uint32_t buttons) noexcept {
  if (!config_.pointer) return;
  is_returning_ = false;
  led_buttons_ = buttons;
  if (!led_) {
    led_.emplace(*config_.pointer, is_hostile_ ? hostile_.position_m() : intended_m_,
                 is_hostile_ ? hostile_.t_s() : t_s_);
  }
  led_->lead_to(goal_m);
}

std::uint32_t Hand::buttons(double t_s) const noexcept {
  std::uint32_t held = led_buttons_;
  for (const ButtonPress& press : config_.presses) {
    if (t_s >= press.from_s && t_s < press.until_s) held |= 1U << press.button;
  }
  return held;
}

SimulatedDeviceConfig joints_of(const SimulatedDeviceConfig& device) {
  const SimulatedWristConfig& wrist = *device.wrist;
  SimulatedDeviceConfig joints;
  joints.mass_kg = wrist.inertia_kg_m2;
  joints.per_axis = {.viscous_newton_s_per_m = Vector3::Constant(wrist.viscous_newton_m_s_per_rad),
                     .coulomb_newton = Vector3::Constant(wrist.coulomb_newton_m)};
  joints.viscous_newton_s_per_m = wrist.viscous_newton_m_s_per_rad;
  joints.coulomb_newton = wrist.coulomb_newton_m;
  joints.position_resolution_m = wrist.angle_resolution_rad;
  joints.peak_force_newton = wrist.peak_torque_newton_m;
  joints.inner_step = device.inner_step;
  return joints;
}

HandConfig turning_of(const HandConfig& hand) {
  HandConfig turning;
  turning.mass_kg = hand.wrist.inertia_kg_m2;
  turning.stiffness_newton_per_m = hand.wrist.stiffness_newton_m_per_rad;
  turning.damping_newton_s_per_m = hand.wrist.damping_newton_m_s_per_rad;
  turning.path = hand.wrist.path;
  return turning;
}

PlantParameters plant_of(const SimulatedDeviceConfig& device, const HandConfig& hand) {
  return {.mass_kg = device.mass_kg + hand.mass_kg,
          .hand_stiffness_newton_per_m = hand.stiffness_newton_per_m,
          .hand_damping_newton_s_per_m = hand.damping_newton_s_per_m,
          .viscous_newton_s_per_m = device.viscous_newton_s_per_m,
          .coulomb_newton = device.coulomb_newton,
          .per_axis = device.per_axis};
}

}  // namespace palpate::device
