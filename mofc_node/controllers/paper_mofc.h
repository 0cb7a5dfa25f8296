// SPDX-License-Identifier: Apache-2.0
/// @file
/// paper_mofc.h — the controller as published: one axis, one pool, three times.
#pragma once

#include <numbers>

#include "axis_friction.h"
#include "force_controller.h"

namespace palpate::controllers {

/// Mode `paper`. Each axis has its own E′ and clamps alone, [MOFC] eqs. (4)–(14).
///
/// With exact positions and timing E(t) ≥ 0, if the friction is per axis, as the paper's equations
/// take it to be. On a device whose friction is isotropic, f_co|v|, three axes that each count f_co
/// count too much, as published; `isotropic` gives each f_co/√3.
///
/// Not guaranteed: it does not account for quantised positions, late or lost answers, and does not
/// keep the direction of the force. Mode `vector` does.
class PaperMofc final : public ForceController {
 public:
  /// @param friction  of each axis   @param T  > 0, period [s]
  explicit PaperMofc(const AxisFriction& friction, double T) : friction_(friction), T_(T) {}
  /// As published: f_d and f_co on every axis.
  explicit PaperMofc(const MofcParameters& p)
      : PaperMofc({.f_d = Vector3::Constant(p.f_d), .f_co = Vector3::Constant(p.f_co)}, p.T) {}
  /// f_d and f_co/√3 on every axis, for an isotropic friction f_d v + f_co v/|v|.
  /// Lemma: three_pools.
  [[nodiscard]] static PaperMofc isotropic(const MofcParameters& p) {
    return PaperMofc({.f_d = p.f_d, .f_co = p.f_co / std::numbers::sqrt3, .T = p.T});
  }
  void reset() noexcept override;
  /// Equations (8) to (14), axis by axis. Energy of intervals whose ends were not read is not
  /// counted: what credit there was is forfeited.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  AxisFriction friction_;
  double T_;
  Vector3 energy_joule_ = Vector3::Zero();  // E′ per axis
  Vector3 position_m_ = Vector3::Zero();    // where the last interval ended
  bool has_position_ = false;
};

}  // namespace palpate::controllers
