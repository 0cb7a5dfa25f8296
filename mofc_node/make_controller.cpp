#include "mofc_node/make_controller.h"

#include <algorithm>
#include <optional>

#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/paper_mofc.h"
#include "mofc_node/controllers/vector_mofc.h"

namespace palpate::mofc {

using controllers::AxisFriction;
using controllers::MofcParameters;
using controllers::PaperMofc;

std::unique_ptr<controllers::ForceController> make_controller(const MofcConfig& mofc,
                                                              const ClampedDevice& device) {
  const DeviceProfile& profile = device.profile;
  std::optional<AxisFriction> per_axis;
  if (profile.per_axis) {
    per_axis = {.f_d = profile.per_axis->viscous_newton_s_per_m,
                .f_co = profile.per_axis->coulomb_newton};
  }
  if (mofc.controller == ControllerKind::kNone) return std::make_unique<controllers::PassThrough>();
  if (mofc.mode == MofcMode::kPaper) {
    const MofcParameters parameters{.f_d = profile.viscous_newton_s_per_m,
                                    .f_co = profile.coulomb_newton,
                                    .T = 1.0 / device.rate_hz};
    if (per_axis) return std::make_unique<PaperMofc>(*per_axis, parameters.T);
    return std::make_unique<PaperMofc>(mofc.paper_friction == PaperFriction::kIsotropic
                                           ? PaperMofc::isotropic(parameters)
                                           : PaperMofc(parameters));
  }
  const MofcParameters parameters{.f_d = profile.viscous_newton_s_per_m,
                                  .f_co = profile.coulomb_newton,
                                  .T = to_seconds(device.lease)};
  const double longest_lease_s = to_seconds(device.longest_lease);
  if (mofc.mode == MofcMode::kVector) {
    return std::make_unique<controllers::VectorMofc>(parameters, profile.position_resolution_m,
                                                     to_seconds(mofc.delta_max), per_axis,
                                                     longest_lease_s);
  }
  // what one hold of the largest force can leak: at low rates more than the gate's and the cap's
  // own
  const double hold_joule =
      parameters.T *
      controllers::drain_watt(parameters, device.peak_force_newton, mofc.guard.v_max_m_per_s);
  const double cap_joule = mofc.guard.credit_cap_joule;
  return std::make_unique<controllers::GuardMofc>(controllers::GuardParameters{
      .mofc = parameters,
      .per_axis = per_axis,
      .resolution_m = profile.position_resolution_m,
      .delta_max_s = to_seconds(mofc.delta_max),
      .longest_lease_s = longest_lease_s,
      .v_max_m_per_s = mofc.guard.v_max_m_per_s,
      .credit_cap_joule = cap_joule,
      .contact_credit_joule = hold_joule > cap_joule ? hold_joule : 0.0,
      .gate_joule = std::max(mofc.guard.gate_joule, hold_joule),
      .gate_recovery_s = to_seconds(mofc.guard.gate_recovery)});
}

}  // namespace palpate::mofc
