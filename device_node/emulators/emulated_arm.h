// SPDX-License-Identifier: Apache-2.0
// emulated_arm.h — the mechanics behind every emulated leader arm: joints with gears, friction and
// play in a hand, and the account of what the hand has put in. Nothing here is of a driver.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

namespace palpate::device {

/// A motor's rotor and the link that a hand holds, with play between them; both as seen at the
/// horn.
struct GearedJoint {
  double rotor_kg_m2 = 0.004;
  double link_kg_m2 = 0.004;
  double rotor_coulomb_newton_m = 0.06;
  double link_coulomb_newton_m = 0.03;
  double rotor_viscous_newton_m_s_per_rad = 0.010;
  double link_viscous_newton_m_s_per_rad = 0.005;
  double play_rad = 0.0044;  ///< end to end; 15 arc minutes, as ROBOTIS says of the X series
  double tooth_newton_m_per_rad = 400.0;
  double tooth_newton_m_s_per_rad = 0.2;
};

/// Follows a joint step by step; its energies are sums over its path.
class JointPlant {
 public:
  explicit JointPlant(const GearedJoint& joint, double start_rad = 0.0)
      : joint_(joint), rotor_rad_(start_rad), link_rad_(start_rad) {}

  /// @param motor_newton_m  at the horn   @param hand_newton_m  at the link
  void advance(double step_s, double motor_newton_m, double hand_newton_m) noexcept;

  [[nodiscard]] double link_rad() const noexcept { return link_rad_; }
  [[nodiscard]] double link_rad_per_s() const noexcept { return link_rad_per_s_; }
  /// What the hand has put in, without what moves or is tense: friction, less the motor's work. A
  /// hand that has been driven finds it below 0.
  [[nodiscard]] double energy_joule() const noexcept { return dissipated_joule_ - motor_joule_; }
  /// The same by the work of the hand, less what moves and is tense.
  [[nodiscard]] double energy_by_hand_joule() const noexcept;

 private:
  struct Mass {
    double kg_m2, coulomb, viscous;
  };
  /// Moves one mass by momentum. What its friction takes is added up.
  void move(const Mass& mass, double newton_m, double step_s, double& rad,
            double& rad_per_s) noexcept;
  [[nodiscard]] double gap_rad() const noexcept;

  GearedJoint joint_;
  double rotor_rad_;
  double link_rad_;
  double rotor_rad_per_s_ = 0.0;
  double link_rad_per_s_ = 0.0;
  double dissipated_joule_ = 0.0;
  double motor_joule_ = 0.0;
  double hand_joule_ = 0.0;
};

/// The torque of a hand at one joint.
/// @param time_s  since the emulator's start
using JointHand =
    std::function<double(std::size_t joint, double rad, double rad_per_s, double time_s)>;
/// A hand that leads every joint to and fro by 0.5 rad, with a grip that is loose enough to be
/// driven.
[[nodiscard]] JointHand leading_hand();
/// Motors that move joints in a hand, step by step. A Motor has joint(), torque_newton_m() and
/// advance(now_s, step_s, hand_newton_m).
template <class Motor>
class EmulatedArm {
 public:
  EmulatedArm(std::vector<Motor> motors, JointHand hand)
      : motors_(std::move(motors)), hand_(std::move(hand)) {}

  /// @param before_step  called with the time of each step
  template <class BeforeStep>
  void advance_to(double now_s, const BeforeStep& before_step) {
    // a clock that jumps further is followed by no more than this
    constexpr double kLongestCatchUpS = 2.0;
    constexpr double kStepS = 50e-6;
    time_s_ = std::max(time_s_, now_s - kLongestCatchUpS);
    while (time_s_ + kStepS <= now_s) {
      time_s_ += kStepS;
      before_step(time_s_);
      double energy_joule = 0.0;
      for (std::size_t i = 0; i < motors_.size(); ++i) {
        Motor& motor = motors_[i];
        const double speed = motor.joint().link_rad_per_s();
        const double hand = hand_ ? hand_(i, motor.joint().link_rad(), speed, time_s_) : 0.0;
        motor.advance(time_s_, kStepS, hand);
        energy_joule += motor.joint().energy_joule();
        fastest_rad_per_s_ = std::max(fastest_rad_per_s_, std::abs(speed));
        if (motor.torque_newton_m() != 0.0) torque_until_s_ = time_s_;
      }
      least_energy_joule_ = std::min(least_energy_joule_, energy_joule);
    }
  }

  [[nodiscard]] std::vector<Motor>& motors() noexcept { return motors_; }
  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  /// Σ |torque| that acts.
  [[nodiscard]] double acting_newton_m() const noexcept {
    double sum = 0.0;
    for (const Motor& motor : motors_) sum += std::abs(motor.torque_newton_m());
    return sum;
  }
  /// The time until which some torque acted.
  [[nodiscard]] double torque_until_s() const noexcept { return torque_until_s_; }
  /// Least energy that the hand has put in so far; below 0 it has been driven.
  [[nodiscard]] double least_energy_joule() const noexcept { return least_energy_joule_; }
  [[nodiscard]] double fastest_rad_per_s() const noexcept { return fastest_rad_per_s_; }

 private:
  std::vector<Motor> motors_;
  JointHand hand_;
  double time_s_ = 0.0;
  double least_energy_joule_ = 0.0;
  double torque_until_s_ = 0.0;
  double fastest_rad_per_s_ = 0.0;
};

}  // namespace palpate::device
