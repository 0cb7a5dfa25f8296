// SPDX-License-Identifier: Apache-2.0
/// @file
/// vector_mofc.h — the controller with one pool for all directions.
#pragma once

#include <optional>

#include "force_controller.h"
#include "leased_pool.h"

namespace palpate::controllers {

/// Mode `vector`. One pool for all directions; the force is scaled, its direction kept:
///
///     f_max = f_co + 2 √( f_d / T · max(0, E′ − δ (|F_acting| − f_co)₊² / (4 f_d)) )
///     F     = F_e min(1, f_max / |F_e|)
///
/// [MOFC] eqs. (8)–(14) with Euclidean norms. Differs: E′ accounts for the encoder's resolution
/// (EnergyLedger); T is the time for which every command may act; δ is the longest time from the
/// reading to the switch, during which the force that acts now goes on (LeasedPool). With
/// friction per axis: T drain(F) + δ drain(F_acting) ≤ E′, which for one axis is the same.
///
/// Guarantee: E(t) ≥ 0 for all t, any hand, any environment, if the true friction is at least
/// (f_d, f_co), the encoder error at most q/2 per axis, and no command acts longer than its lease
/// or begins later than δ_max.
class VectorMofc final : public ForceController {
 public:
  /// @param parameters  T: the time for which every command may act, T_hold
  /// @param resolution_m  q ≥ 0    @param delta_max_s  δ ≥ 0
  /// @param per_axis  the friction, instead of the parameters' f_d and f_co
  /// @param longest_lease_s  no command acts longer; below T it counts as T
  /// @param prompt_s  δ_p: for answers within it first; 0: δ
  VectorMofc(const MofcParameters& parameters, double resolution_m, double delta_max_s,
             const std::optional<AxisFriction>& per_axis = {}, double longest_lease_s = 0.0,
             double prompt_s = 0.0)
      : pool_({.mofc = parameters,
               .per_axis = per_axis,
               .resolution_m = resolution_m,
               .delta_max_s = delta_max_s,
               .prompt_s = prompt_s,
               .longest_lease_s = longest_lease_s}) {}
  void reset() noexcept override { pool_.reset(); }
  /// Books what acted and grants a force with its lease.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override {
    static_cast<void>(pool_.book(input));
    return pool_.grant(input);
  }

 private:
  LeasedPool pool_;
};

}  // namespace palpate::controllers
