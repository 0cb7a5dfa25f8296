// wave_variables.h — the hand's end of a channel that stays passive at any delay.
#pragma once

#include "interval.h"
#include "wave_channel.h"

namespace palpate::controllers {

struct WaveVariablesParameters {
  double b = 2.0;    ///< > 0, wave impedance [N·s/m]
  double T = 0.001;  ///< > 0, period [s]
};

/// The tissue is not asked where the hand is but where the waves take the tool at the other end
/// (physics_node/wave_end.h):
///
///   F = √(2b) w − b v        u T = √(2b) Δx − w T
///
/// Property: the channel generates no energy at any delay, varying or not, with losses. Broken by:
/// the term b v, a sampled damper, which draws energy from a device of viscous friction below b;
/// slow physics, whose end reflects; a receiver that holds a wave instead of what wave_channel.h
/// does. A wall of K
/// is felt as 1/(1/K + D/b) at a delay of D each way, and b in free motion.
/// Source: [Niemeyer91], [Niemeyer98]. Needs the other end; F = 0 until it has answered.
class WaveVariables final : public ForceController {
 public:
  explicit WaveVariables(const WaveVariablesParameters& parameters) : p_(parameters) {}
  void reset() noexcept override { *this = WaveVariables(p_); }
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
