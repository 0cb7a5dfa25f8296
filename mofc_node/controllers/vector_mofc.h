// vector_mofc.h — the controller with one pool for all directions.
#pragma once

#include <limits>
#include <optional>

#include "energy_ledger.h"
#include "force_controller.h"
#include "one_pool_clamp.h"

namespace palpate::controllers {

/// Mode `vector`. One pool for all directions; the force is scaled, its direction kept:
///
///   f_max = f_co + 2 √( f_d / T · max(0, E′ − δ (|F_acting| − f_co)₊² / (4 f_d)) )
///   F     = F_e min(1, f_max / |F_e|)
///
/// [MOFC] eqs. (8)–(14) with Euclidean norms. Differs: E′ accounts for the encoder's resolution
/// (EnergyLedger); T is the longest time one command may act, its lease; δ is the longest time from
/// the reading to the switch, during which the force that acts now goes on. With friction per axis:
/// T drain(F) + δ drain(F_acting) ≤ E′ (OnePoolClamp), which for one axis is the same.
///
/// Guarantee: E(t) ≥ 0 for all t, any hand, any environment, if the true friction is at least
/// (f_d, f_co), the encoder error at most q/2 per axis, and no command acts longer than T or begins
/// later than δ. After a gap in the echo E′ starts again at 0, because every lease that began in
/// time was reserved for.
class VectorMofc final : public ForceController {
 public:
  /// @param resolution_m  q ≥ 0    @param delta_max_s  δ ≥ 0
  /// @param per_axis  the friction, instead of the parameters' f_d and f_co
  VectorMofc(const MofcParameters& parameters, double resolution_m, double delta_max_s,
             const std::optional<AxisFriction>& per_axis = {})
      : delta_max_s_(delta_max_s),
        clamp_(parameters, per_axis, std::numeric_limits<double>::infinity()),
        ledger_(parameters, per_axis, resolution_m) {}
  void reset() noexcept override;
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  double delta_max_s_;
  OnePoolClamp clamp_;
  EnergyLedger ledger_;
  bool has_started_ = false;
};

}  // namespace palpate::controllers
