// SPDX-License-Identifier: Apache-2.0
/// @file
/// wave_variables.h — the hand's end of a channel that stays passive at any delay.
#pragma once

#include "interval.h"
#include "wave_channel.h"

namespace palpate::controllers {

/// The hand's end of the channel.
struct WaveVariablesParameters {
  double b = 2.0;    ///< > 0, wave impedance [N·s/m]
  double T = 0.001;  ///< > 0, period [s]
};

/// The tissue is evaluated not where the hand is but where the waves take the tool at the other end
/// (docs/theory.md §5.2):
///
///     F = √(2b) w − b v        u T = √(2b) Δx − w T
///
/// Property: the channel generates no energy at any delay, varying or not, with losses. Broken by:
/// the term b v, a sampled damper, which draws energy from a device of viscous friction below b;
/// slow physics, whose end reflects; a receiver that holds a wave instead of what wave_channel.h
/// does. A wall of stiffness K is rendered as 1/(1/K + D/b) at a delay of D each way, and free
/// motion with the damping b. Source: [Niemeyer91], [Niemeyer98]. Needs the other end; F = 0 until
/// it has answered.
class WaveVariables final : public ForceController {
 public:
  /// Does not check the parameters.
  explicit WaveVariables(const WaveVariablesParameters& parameters) : p_(parameters) {}
  void reset() noexcept override { *this = WaveVariables(p_); }
  /// Reads ControlInput::returned_wave and fills in ControlOutput::sent_wave.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  WaveVariablesParameters p_;
  IntervalReader interval_;
  bool is_open_ = false;
  WaveSender sender_;
  WaveReceiver receiver_;
  Vector3 spent_ = Vector3::Zero();  // w T since the last wave was sent
};

}  // namespace palpate::controllers
