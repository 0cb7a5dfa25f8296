// SPDX-License-Identifier: Apache-2.0
// leaders.h — leader arms in a hostile hand, simulated without anything of the clamp: their energy
// is the work of the hand, path by path.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "common/core/random.h"
#include "mofc_node/controllers/ports/ports.h"

namespace palpate::test {

using controllers::kMostPorts;
using controllers::Port;
using controllers::PortValues;

/// What a device with motors looks like to a loop, and what only a simulation knows.
class Leader {
 public:
  virtual ~Leader() = default;
  [[nodiscard]] virtual std::size_t count() const = 0;
  /// What the profile says of it.
  [[nodiscard]] virtual std::array<Port, kMostPorts> profile() const = 0;
  /// What the motors make of a command: in whole steps of current, never more.
  [[nodiscard]] virtual PortValues realised(const PortValues& effort) const = 0;
  /// Lets the hand do its worst for so long while this effort acts.
  virtual void hold(double duration_s, const PortValues& effort) = 0;
  /// Reads the encoders; positions of ports.
  virtual PortValues read() = 0;
  /// By how much the displacement since the last reading may be wrong beyond the resolution.
  [[nodiscard]] virtual PortValues doubt(double duration_s) const = 0;
  /// Another way to move.
  virtual void change() = 0;
  virtual void attack() = 0;

  /// The energy that the hand has put in, without what moving masses hold.
  [[nodiscard]] double energy_joule() const { return energy_joule_; }
  [[nodiscard]] double least_energy_joule() const { return least_energy_joule_; }

 protected:
  void put_in(double joule) {
    energy_joule_ += joule;
    least_energy_joule_ = std::min(least_energy_joule_, energy_joule_);
  }

 private:
  double energy_joule_ = 0.0;
  double least_energy_joule_ = 0.0;
};

/// How far the profile may be wrong: identified within ±20 %, of which the profile takes the least.
inline constexpr double kFrictionMargin = 0.2;

/// A joint or a grip behind a gear: friction that varies with the angle and grows with the torque,
/// an encoder of 4096 steps with a zero of its own, a current that comes in steps.
struct GearedJoint {
  double coulomb_newton_m = 0.05;  // the least along the way round
  double ripple = 0.0;             // of it, more at some teeth
  int teeth = 11;
  double viscous_newton_m_s = 0.02;
  double load_friction = 0.0;  // of the torque, on top
  double resolution_rad = 0.09 / 180.0 * std::numbers::pi;
  double zero_rad = 0.0;
  double torque_step_newton_m = 0.003;
  double peak_newton_m = 4.0;
  double v_max_rad_per_s = 5.0;
  double inertia_kg_m2 = 2e-3;  // of rotor and link, for hands of bounded force

  [[nodiscard]] double coulomb_at(double angle_rad, double torque_newton_m) const {
    return coulomb_newton_m * (1.0 + ripple * (1.0 + std::sin(teeth * angle_rad))) +
           load_friction * std::abs(torque_newton_m);
  }
  [[nodiscard]] double read(double angle_rad) const {
    return std::round((angle_rad - zero_rad) / resolution_rad) * resolution_rad + zero_rad;
  }
  [[nodiscard]] double realised(double torque_newton_m) const {
    const double within = std::clamp(torque_newton_m, -peak_newton_m, peak_newton_m);
    return std::trunc(within / torque_step_newton_m) * torque_step_newton_m;
  }
};

inline GearedJoint random_joint(Random& random) {
  GearedJoint joint;
  joint.coulomb_newton_m = random.chance(0.1) ? 0.0 : random.uniform(0.01, 0.2);
  joint.ripple = random.chance(0.5) ? 0.0 : random.uniform(0.0, 0.5);
  joint.teeth = 7 + static_cast<int>(random.below(40));
  joint.viscous_newton_m_s = random.chance(0.1) ? 0.0 : random.uniform(0.002, 0.1);
  joint.load_friction = random.chance(0.5) ? 0.0 : random.uniform(0.0, 0.15);
  joint.zero_rad = random.uniform(0.0, joint.resolution_rad);
  joint.v_max_rad_per_s = random.uniform(2.0, 10.0);
  joint.inertia_kg_m2 = 1e-3 * std::pow(30.0, random.uniform());
  return joint;
}

/// A chain of geared joints. Its hand moves every joint as it likes (a bounded speed is all that
/// holds it), or pushes with a bounded torque against the joints' inertia.
class JointLeader final : public Leader {
 public:
  JointLeader(Random& random, std::size_t joints) : random_(random), count_(joints) {
    // half of them have no more friction than the profile says
    const bool is_tight = random.chance(0.5);
    for (std::size_t i = 0; i < count_; ++i) {
      joints_[i] = random_joint(random);
      if (is_tight) joints_[i].ripple = joints_[i].load_friction = 0.0;
      identified_[i] = is_tight ? 1.0 + kFrictionMargin
                                : random.uniform(1.0 - kFrictionMargin, 1.0 + kFrictionMargin);
      angle_rad_[i] = random.uniform(-2.0, 2.0);
    }
    change();
  }

  [[nodiscard]] std::size_t count() const override { return count_; }

  [[nodiscard]] std::array<Port, kMostPorts> profile() const override {
    std::array<Port, kMostPorts> ports{};
    for (std::size_t i = 0; i < count_; ++i) {
      const double lower = identified_[i] / (1.0 + kFrictionMargin);
      ports[i] = {.f_d = lower * joints_[i].viscous_newton_m_s,
                  .f_co = lower * joints_[i].coulomb_newton_m,
                  .q = joints_[i].resolution_rad,
                  .v_max = joints_[i].v_max_rad_per_s};
    }
    return ports;
  }

  [[nodiscard]] PortValues realised(const PortValues& effort) const override {
    PortValues real{};
    for (std::size_t i = 0; i < count_; ++i) real[i] = joints_[i].realised(effort[i]);
    return real;
  }

  PortValues read() override {
    PortValues reading{};
    for (std::size_t i = 0; i < count_; ++i) reading[i] = joints_[i].read(angle_rad_[i]);
    return reading;
  }
  [[nodiscard]] PortValues doubt(double) const override { return {}; }

  void change() override {
    is_massive_ = random_.chance(0.2);
    const auto any = [&] {
      return static_cast<Plan>(random_.below(static_cast<std::uint64_t>(kPlans)));
    };
    plan_.fill(any());
    if (random_.chance(0.3)) {
      for (Plan& plan : plan_) plan = any();
    }
    const double share = std::pow(100.0, -random_.uniform());
    for (std::size_t i = 0; i < count_; ++i) {
      speed_rad_per_s_[i] = share * random_.uniform(-1.0, 1.0) * joints_[i].v_max_rad_per_s;
    }
  }
  void attack() override {
    plan_.fill(kDrain);
    is_massive_ = false;
  }

  void hold(double duration_s, const PortValues& effort) override {
    if (is_massive_) return push(duration_s, effort);
    const std::uint64_t pieces = 1 + random_.below(3);
    double left_s = duration_s;
    for (std::uint64_t piece = 1; piece <= pieces; ++piece) {
      const double piece_s = piece == pieces ? left_s : random_.uniform() * left_s;
      left_s -= piece_s;
      if (piece_s > 0.0) glide(piece_s, effort);
    }
  }

  /// Exact encoders, and no more friction than the profile says.
  void make_tight() {
    for (std::size_t i = 0; i < count_; ++i) {
      joints_[i].ripple = joints_[i].load_friction = 0.0;
      joints_[i].resolution_rad = 1e-9;
      identified_[i] = 1.0 + kFrictionMargin;
    }
  }

  double overspeed = 1.0;  // the hand is this many times faster than v_max

 private:
  enum Plan { kDrain, kDrainAlmost, kBank, kReversals, kDither, kRest, kPlans };

  /// Every joint at a constant speed: the energy is linear in time but for the ripple, whose least
  /// is counted.
  void glide(double duration_s, const PortValues& effort) {
    double joule = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const GearedJoint& joint = joints_[i];
      const double v =
          std::clamp(velocity(i, duration_s, effort[i]), -overspeed * joint.v_max_rad_per_s,
                     overspeed * joint.v_max_rad_per_s);
      const double moved = v * duration_s;
      // the ripple's mean over the way, exactly: the integral of 1 + sin
      const double k = joint.teeth;
      const double mean_sine =
          moved == 0.0
              ? std::sin(k * angle_rad_[i])
              : (std::cos(k * angle_rad_[i]) - std::cos(k * (angle_rad_[i] + moved))) / (k * moved);
      const double coulomb = joint.coulomb_newton_m * (1.0 + joint.ripple * (1.0 + mean_sine)) +
                             joint.load_friction * std::abs(effort[i]);
      joule += coulomb * std::abs(moved) + joint.viscous_newton_m_s * v * moved - effort[i] * moved;
      angle_rad_[i] += moved;
      velocity_rad_per_s_[i] = v;
    }
    put_in(joule);
  }

  [[nodiscard]] double velocity(std::size_t i, double duration_s, double torque_newton_m) {
    const GearedJoint& joint = joints_[i];
    const double excess =
        std::abs(torque_newton_m) - joint.coulomb_at(angle_rad_[i], torque_newton_m);
    const double fastest = overspeed * joint.v_max_rad_per_s;
    const double worst =
        excess <= 0.0
            ? 0.0
            : std::copysign(
                  std::min(fastest, excess / std::max(1e-9, 2.0 * joint.viscous_newton_m_s)),
                  torque_newton_m);
    switch (plan_[i]) {
      case kDrain:
        return worst;
      case kDrainAlmost:
        return random_.uniform(0.0, 2.0) * worst;
      case kBank:
        return speed_rad_per_s_[i];
      case kReversals:
        return random_.chance(0.5) ? speed_rad_per_s_[i] : -speed_rad_per_s_[i];
      case kDither: {  // to and fro across the edge of an encoder step
        const double q = joint.resolution_rad;
        const double edge =
            (std::floor((angle_rad_[i] - joint.zero_rad) / q) + 0.5) * q + joint.zero_rad;
        return (edge + (random_.chance(0.5) ? 1e-3 : -1e-3) * q - angle_rad_[i]) / duration_s;
      }
      case kRest:
      case kPlans:
        break;
    }
    return 0.0;
  }

  /// The hand is a torque on the inertia of each joint, in steps of 50 µs. The energy is what that
  /// torque works, less what the inertia holds: friction appears nowhere in it.
  void push(double duration_s, const PortValues& effort) {
    constexpr double kStep_s = 50e-6;
    const int steps = std::max(1, static_cast<int>(std::ceil(duration_s / kStep_s)));
    const double dt = duration_s / steps;
    if (!(dt > 0.0)) return;
    for (int step = 0; step < steps; ++step) {
      double joule = 0.0;
      for (std::size_t i = 0; i < count_; ++i) joule += push_joint(i, dt, effort[i]);
      put_in(joule);
    }
  }

  /// @return the hand's work less what the kinetic energy has grown
  double push_joint(std::size_t i, double dt, double torque_newton_m) {
    const GearedJoint& joint = joints_[i];
    const double inertia = joint.inertia_kg_m2;
    const double v0 = velocity_rad_per_s_[i];
    double hand = 0.0;
    switch (plan_[i]) {
      case kDrain:
      case kDrainAlmost:  // goes with the motor
        hand = 0.3 * torque_newton_m;
        break;
      case kBank:
        hand = 0.5 * (speed_rad_per_s_[i] - v0);
        break;
      case kReversals:
        hand = random_.chance(0.5) ? 1.0 : -1.0;
        break;
      case kDither:
        hand = random_.uniform(-1.0, 1.0);
        break;
      case kRest:
      case kPlans:
        hand = -0.3 * v0;
        break;
    }
    // mean speed of the step: momentum with the mean speed's friction
    const double coulomb = joint.coulomb_at(angle_rad_[i], torque_newton_m);
    const double gain = dt / (2.0 * inertia);
    const double free = v0 + gain * (torque_newton_m + hand);
    double mean = 0.0;
    double v1 = 0.0;
    if (std::abs(free) > gain * coulomb) {
      mean = (free - std::copysign(gain * coulomb, free)) / (1.0 + gain * joint.viscous_newton_m_s);
      v1 = 2.0 * mean - v0;
    }
    // a hand is no faster than it can be: it brakes
    const double fastest = overspeed * joint.v_max_rad_per_s;
    if (std::abs(v1) > fastest || std::abs(mean) > fastest) {
      v1 = std::clamp(v1, -fastest, fastest);
      mean = 0.5 * (v0 + v1);
      const double friction = std::copysign(coulomb, mean) + joint.viscous_newton_m_s * mean;
      hand = (v1 - v0) * inertia / dt - torque_newton_m + friction;
    }
    const double moved = mean * dt;
    angle_rad_[i] += moved;
    velocity_rad_per_s_[i] = v1;
    return hand * moved - 0.5 * inertia * (v1 * v1 - v0 * v0);
  }

  Random& random_;
  std::size_t count_;
  std::array<GearedJoint, kMostPorts> joints_{};
  std::array<double, kMostPorts> identified_{};  // of the true friction
  std::array<double, kMostPorts> angle_rad_{};
  std::array<double, kMostPorts> velocity_rad_per_s_{};
  std::array<Plan, kMostPorts> plan_{};
  std::array<double, kMostPorts> speed_rad_per_s_{};
  bool is_massive_ = false;
};

}  // namespace palpate::test
