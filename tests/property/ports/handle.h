// SPDX-License-Identifier: Apache-2.0
// handle.h — a handle that moves and turns freely, with a grip, in a hostile hand: force, torque
// and grip act along axes that stand still.
#pragma once

#include <Eigen/Geometry>

#include "mofc_node/controllers/ports/turn.h"
#include "tests/property/ports/leaders.h"

namespace palpate::test {

/// Ports 0 … 2 are the position [m], 3 … 5 what has turned about the same axes [rad], 6 the grip
/// [rad]. Friction is isotropic, of the way and of the turning each.
class Handle final : public Leader {
 public:
  explicit Handle(Random& random) : random_(random) {
    coulomb_ = {random.uniform(0.0, 0.3), random.uniform(0.0, 0.02)};
    viscous_ = {random.uniform(0.0, 0.3), random.uniform(0.0, 0.005)};
    grip_ = random_joint(random);
    identified_ = random.chance(0.5) ? 1.0 + kFrictionMargin
                                     : random.uniform(1.0 - kFrictionMargin, 1.0 + kFrictionMargin);
    v_max_ = {random.uniform(0.2, 1.0), random.uniform(2.0, 15.0)};
    resolution_ = {random.uniform(0.0, 0.2e-3), random.uniform(0.0, 1.6e-3)};
    change();
  }

  [[nodiscard]] std::size_t count() const override { return 7; }

  [[nodiscard]] std::array<Port, kMostPorts> profile() const override {
    const double lower = identified_ / (1.0 + kFrictionMargin);
    std::array<Port, kMostPorts> ports{};
    for (std::size_t i = 0; i < 6; ++i) {
      const std::size_t kind = i / 3;
      ports[i] = {
          .f_d = lower * viscous_[kind],
          .f_co = lower * coulomb_[kind] / std::numbers::sqrt3,
          .q = resolution_[kind],
          .v_max = v_max_[kind],
          .priority = static_cast<int>(1 - kind)};  // the torque is reduced before the force
    }
    ports[6] = {.f_d = lower * grip_.viscous_newton_m_s,
                .f_co = lower * grip_.coulomb_newton_m,
                .q = grip_.resolution_rad,
                .v_max = grip_.v_max_rad_per_s,
                .priority = 2};
    return ports;
  }

  [[nodiscard]] PortValues realised(const PortValues& effort) const override {
    PortValues real{};
    for (std::size_t i = 0; i < 3; ++i) real[i] = std::clamp(effort[i], -12.0, 12.0);
    for (std::size_t i = 3; i < 6; ++i) real[i] = std::clamp(effort[i], -0.4, 0.4);
    real[6] = grip_.realised(effort[6]);
    return real;
  }

  PortValues read() override {
    PortValues reading{};
    for (Eigen::Index i = 0; i < 3; ++i) {
      const auto port = static_cast<std::size_t>(i);
      reading[port] = position_m_[i] + resolution_[0] * random_.uniform(-0.5, 0.5);
      error_rad_[i] = resolution_[1] * random_.uniform(-0.5, 0.5);
    }
    const Eigen::Quaterniond seen = rotation(error_rad_) * orientation_;
    turned_rad_ += controllers::turned_rad(seen_, seen);
    seen_ = seen;
    for (Eigen::Index i = 0; i < 3; ++i) reading[static_cast<std::size_t>(3 + i)] = turned_rad_[i];
    reading[6] = grip_.read(grip_rad_);
    return reading;
  }

  [[nodiscard]] PortValues doubt(double duration_s) const override {
    PortValues doubt{};
    const double most =
        controllers::turn_doubt_rad(std::numbers::sqrt3 * v_max_[1], duration_s, resolution_[1]);
    if (counts_doubt) doubt[3] = doubt[4] = doubt[5] = most;
    return doubt;
  }

  void change() override {
    plan_ = static_cast<Plan>(random_.below(static_cast<std::uint64_t>(kPlans)));
    const double slow = std::pow(100.0, -random_.uniform());
    for (double& share : share_) share = slow * random_.uniform(-1.0, 1.0);
  }
  void attack() override { plan_ = random_.chance(0.3) ? kCone : kDrain; }

  /// Up to eight pieces of constant velocity; between two of them the axis of the turning changes.
  void hold(double duration_s, const PortValues& effort) override {
    const std::uint64_t pieces = plan_ == kCone ? 8 : 1 + random_.below(3);
    const double piece_s = duration_s / static_cast<double>(pieces);
    if (!(piece_s > 0.0)) return;
    const double phase = random_.uniform(0.0, 2.0 * std::numbers::pi);
    const Eigen::Vector3d torque(effort[3], effort[4], effort[5]);
    for (std::uint64_t piece = 0; piece < pieces; ++piece) {
      const Eigen::Vector3d force(effort[0], effort[1], effort[2]);
      Eigen::Vector3d v = velocity(force, 0);
      Eigen::Vector3d omega = velocity(torque, 1);
      if (plan_ == kCone && !torque.isZero()) {
        // round a circle about the torque: its end orientation hides what it has turned about it
        const double angle = phase + 2.0 * std::numbers::pi * static_cast<double>(piece) / 8.0;
        const Eigen::Vector3d u = torque.unitOrthogonal();
        const Eigen::Vector3d w = torque.normalized().cross(u);
        omega = v_max_[1] * (std::cos(angle) * u - std::sin(angle) * w);
        v.setZero();
      }
      const double grip =
          std::clamp(share_[6] * grip_.v_max_rad_per_s + (plan_ == kDrain ? 10.0 * effort[6] : 0.0),
                     -grip_.v_max_rad_per_s, grip_.v_max_rad_per_s);
      put_in(piece_s * (watt(force, v, 0) + watt(torque, omega, 1)) +
             squeeze(grip * piece_s, piece_s, effort[6]));
      position_m_ += piece_s * v;
      orientation_ = (rotation(piece_s * omega) * orientation_).normalized();
    }
  }

  /// Turns without friction, and is read without errors.
  void make_free() {
    coulomb_[1] = viscous_[1] = 0.0;
    resolution_[1] = 0.0;
  }

  bool counts_doubt = true;

 private:
  enum Plan { kDrain, kBank, kRandom, kCone, kRest, kPlans };

  static Eigen::Quaterniond rotation(const Eigen::Vector3d& turned_rad) {
    const double angle = turned_rad.norm();
    if (angle == 0.0) return Eigen::Quaterniond::Identity();
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle, turned_rad / angle));
  }

  [[nodiscard]] double watt(const Eigen::Vector3d& effort, const Eigen::Vector3d& v,
                            std::size_t kind) const {
    return coulomb_[kind] * v.norm() + viscous_[kind] * v.squaredNorm() - effort.dot(v);
  }

  double squeeze(double moved_rad, double duration_s, double effort) {
    grip_rad_ += moved_rad;
    return (grip_.coulomb_newton_m - std::copysign(1.0, moved_rad) * effort) * std::abs(moved_rad) +
           grip_.viscous_newton_m_s * moved_rad * moved_rad / duration_s;
  }

  /// Each component within v_max.
  [[nodiscard]] Eigen::Vector3d velocity(const Eigen::Vector3d& effort, std::size_t kind) {
    const double most = v_max_[kind];
    switch (plan_) {
      case kDrain: {
        const double excess = effort.norm() - coulomb_[kind];
        if (excess <= 0.0) return Eigen::Vector3d::Zero();
        const double best = excess / std::max(1e-9, 2.0 * viscous_[kind]);
        const double largest = effort.lpNorm<Eigen::Infinity>() / effort.norm();
        return std::min(best, most / largest) * effort.normalized();
      }
      case kBank: {
        const std::size_t at = 3 * kind;
        return most * Eigen::Vector3d(share_[at], share_[at + 1], share_[at + 2]);
      }
      case kRandom:
        return most * random_.direction();
      case kCone:
      case kRest:
      case kPlans:
        break;
    }
    return Eigen::Vector3d::Zero();
  }

  Random& random_;
  std::array<double, 2> coulomb_{};  // of force [N] and torque [N·m]
  std::array<double, 2> viscous_{};
  std::array<double, 2> v_max_{};
  std::array<double, 2> resolution_{};
  GearedJoint grip_;
  double identified_ = 1.0;
  Plan plan_ = kRest;
  std::array<double, 7> share_{};

  Eigen::Vector3d position_m_ = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation_ = Eigen::Quaterniond::Identity();
  double grip_rad_ = 0.0;
  Eigen::Quaterniond seen_ = Eigen::Quaterniond::Identity();
  Eigen::Vector3d error_rad_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d turned_rad_ = Eigen::Vector3d::Zero();
};

}  // namespace palpate::test
