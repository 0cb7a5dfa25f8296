// SPDX-License-Identifier: Apache-2.0
// rival_rig.h — a controller between a hand and a tissue on one axis, sampled as the published
// methods assume: each force acts for exactly one period.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include "mofc_node/controllers/force_controller.h"

namespace palpate::controllers {

/// A spring and a damper below z = 0.
struct SpringDamper final : TissueProbe {
  SpringDamper(double stiffness, double damping, bool is_adhesive = false)
      : K(stiffness), B(damping), pulls(is_adhesive) {}
  [[nodiscard]] Force at(const Vector3& x, const Vector3& v) const noexcept override {
    if (x.z() >= 0.0) return {};
    const double f = -K * x.z() - B * v.z();
    return {.force_on_hand_newton = {0.0, 0.0, pulls ? f : std::max(0.0, f)},
            .stored_energy_joule = std::max(0.0, 0.5 * K * x.z() * x.z())};
  }
  double K;
  double B;
  bool pulls;
};

struct RigOptions {
  double T = 0.001;       ///< of the controller and of the hold
  double f_d = 0.0;       ///< true viscous friction of the device
  double q = 0.0;         ///< encoder
  std::size_t delay = 0;  ///< the tissue's force is that many periods old
  std::size_t late = 0;   ///< each answer acts that many periods later
  std::size_t lost = 0;   ///< number of the answer that is lost: the force acts on; 0: none
  double ramp_s = 0.0;    ///< at the start the device renders a growing share of each answer
};

/// A motion source: the hand goes where it is told, in straight lines, whatever the force.
class MotionRig {
 public:
  MotionRig(ForceController& controller, const TissueProbe& tissue, const RigOptions& options)
      : controller_(controller), tissue_(tissue), o_(options) {}

  /// The hand's net work, friction included: E at the last step, and the least so far.
  double energy_joule = 0.0;
  double least_joule = 0.0;
  /// Work against the force alone, as a sampled observer sees it.
  double work_joule = 0.0;
  ControlInput input;
  ControlOutput output;

  /// One reading and answer here, then a straight line to `z` within T.
  void step_to(double z) {
    answer();
    move_to(z);
  }
  /// The same at the velocity that draws most from the force that acts.
  void drain() {
    answer();
    move_to(z_ + o_.T * acting_ / (2.0 * o_.f_d));
  }
  /// In equal steps.
  void go_to(double z, int steps) {
    const double from = z_;
    for (int i = 1; i <= steps; ++i) step_to(from + (z - from) * i / steps);
  }

  [[nodiscard]] double z() const { return z_; }
  [[nodiscard]] double acting_newton() const { return acting_; }

 private:
  void answer() {
    const double measured = o_.q > 0.0 ? o_.q * std::round(z_ / o_.q) : z_;
    input = {};
    input.hand_position_m = {0.0, 0.0, measured};
    const bool is_first = places_.empty();
    const double v = is_first ? 0.0 : (measured - places_.back()) / o_.T;
    stretch_ = {.duration_s = o_.T,
                .force_on_hand_newton = {0.0, 0.0, acting_},
                .hand_position_at_end_m = input.hand_position_m};
    if (!is_first) input.applied = {&stretch_, 1};
    places_.push_back(measured);
    speeds_.push_back(v);
    const std::size_t seen = places_.size() - 1 - std::min(o_.delay, places_.size() - 1);
    input.evaluated_at_m = {0.0, 0.0, places_[seen]};
    const auto force = tissue_.at(input.evaluated_at_m, {0.0, 0.0, speeds_[seen]});
    input.requested_force_on_hand_newton = force.force_on_hand_newton;
    input.stored_energy_joule = force.stored_energy_joule;
    input.hand_velocity_m_per_s = {0.0, 0.0, v};
    input.surface_normal =
        force.force_on_hand_newton.z() > 0.0 ? Vector3(Vector3::UnitZ()) : Vector3(Vector3::Zero());
    input.tissue = o_.delay == 0 ? &tissue_ : nullptr;
    input.acting_force_on_hand_newton = {0.0, 0.0, acting_};
    output = controller_.step(input);
    const bool is_lost = places_.size() == o_.lost;
    answers_.push_back(is_lost ? acting_ : output.force_on_hand_newton.z());
    acting_ = answers_.size() > o_.late ? answers_[answers_.size() - 1 - o_.late] : 0.0;
    const double since_start_s = o_.T * static_cast<double>(answers_.size());
    if (since_start_s < o_.ramp_s) acting_ *= since_start_s / o_.ramp_s;
  }
  void move_to(double z) {
    const double d = z - z_;
    work_joule -= acting_ * d;
    // the friction is the least at constant speed
    energy_joule += o_.f_d * d * d / o_.T - acting_ * d;
    least_joule = std::min(least_joule, energy_joule);
    z_ = z;
  }

  ForceController& controller_;
  const TissueProbe& tissue_;
  RigOptions o_;
  AppliedStretch stretch_;
  std::vector<double> places_;
  std::vector<double> speeds_;
  std::vector<double> answers_;
  double z_ = 0.0;
  double acting_ = 0.0;
};

/// A mass with a hand that presses it down with a constant force; inner steps of T/100.
struct PressOptions {
  double mass = 0.1;
  double damping = 0.1;  ///< of device and hand
  double press_newton = 1.0;
  double seconds = 2.0;
};

struct PressResult {
  double swing_m = 0.0;   ///< peak to peak in the last quarter
  double mean_z_m = 0.0;  ///< then
  double fastest_m_per_s = 0.0;
};

inline PressResult press(ForceController& controller, const TissueProbe& tissue,
                         const RigOptions& rig, const PressOptions& o) {
  constexpr int kInner = 100;
  double z = 0.001;
  double v = 0.0;
  double before = z;
  double acting = 0.0;
  double low = 1.0;
  double high = -1.0;
  double sum = 0.0;
  int count = 0;
  PressResult result;
  std::vector<double> answers;
  const int steps = static_cast<int>(o.seconds / rig.T);
  for (int k = 0; k < steps; ++k) {
    const double measured = rig.q > 0.0 ? rig.q * std::round(z / rig.q) : z;
    ControlInput input;
    input.hand_position_m = {0.0, 0.0, measured};
    const double u = k == 0 ? 0.0 : (measured - before) / rig.T;
    const AppliedStretch stretch{rig.T, {0.0, 0.0, acting}, input.hand_position_m, true};
    if (k > 0) input.applied = {&stretch, 1};
    const auto force = tissue.at(input.hand_position_m, {0.0, 0.0, u});
    input.requested_force_on_hand_newton = force.force_on_hand_newton;
    input.stored_energy_joule = force.stored_energy_joule;
    input.hand_velocity_m_per_s = {0.0, 0.0, u};
    input.evaluated_at_m = input.hand_position_m;
    input.surface_normal = Vector3::UnitZ();
    input.tissue = &tissue;
    answers.push_back(controller.step(input).force_on_hand_newton.z());
    acting = answers.size() > rig.late ? answers[answers.size() - 1 - rig.late] : 0.0;
    before = measured;
    for (int i = 0; i < kInner; ++i) {
      v += rig.T / kInner * (acting - o.press_newton - o.damping * v) / o.mass;
      z += rig.T / kInner * v;
    }
    result.fastest_m_per_s = std::max(result.fastest_m_per_s, std::abs(v));
    if (std::abs(z) > 10.0) break;
    if (4 * k < 3 * steps) continue;
    low = std::min(low, z);
    high = std::max(high, z);
    sum += z;
    ++count;
  }
  result.swing_m = count > 0 ? high - low : 20.0;
  result.mean_z_m = count > 0 ? sum / count : 0.0;
  return result;
}

}  // namespace palpate::controllers
