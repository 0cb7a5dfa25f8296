#include "mofc_node/make_controller.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/paper_mofc.h"
#include "mofc_node/controllers/rivals/safety_net.h"
#include "mofc_node/controllers/vector_mofc.h"
#include "mofc_node/make_rival.h"

namespace palpate::mofc {

using controllers::AxisFriction;
using controllers::MofcParameters;
using controllers::PaperMofc;

namespace {

std::optional<AxisFriction> axis_friction(const DeviceProfile& profile) {
  if (!profile.per_axis) return std::nullopt;
  return AxisFriction{.f_d = profile.per_axis->viscous_newton_s_per_m,
                      .f_co = profile.per_axis->coulomb_newton};
}

MofcParameters leased_parameters(const ClampedDevice& device) {
  return {.f_d = device.profile.viscous_newton_s_per_m,
          .f_co = device.profile.coulomb_newton,
          .T = to_seconds(device.lease)};
}

std::unique_ptr<controllers::ForceController> make_paper(const MofcConfig& mofc,
                                                         const ClampedDevice& device) {
  MofcParameters parameters = leased_parameters(device);
  parameters.T = 1.0 / device.rate_hz;
  if (const auto per_axis = axis_friction(device.profile)) {
    return std::make_unique<PaperMofc>(*per_axis, parameters.T);
  }
  return std::make_unique<PaperMofc>(mofc.paper_friction == PaperFriction::kIsotropic
                                         ? PaperMofc::isotropic(parameters)
                                         : PaperMofc(parameters));
}

controllers::GuardParameters guard_parameters(const MofcConfig& mofc, const ClampedDevice& device) {
  const MofcParameters parameters = leased_parameters(device);
  // what one hold of the largest force can leak: at low rates more than the gate's and the cap's
  // own
  const double hold_joule =
      parameters.T *
      controllers::drain_watt(parameters, device.peak_force_newton, mofc.guard.v_max_m_per_s);
  const double cap_joule = mofc.guard.credit_cap_joule;
  return {.mofc = parameters,
          .per_axis = axis_friction(device.profile),
          .resolution_m = device.profile.position_resolution_m,
          .delta_max_s = to_seconds(mofc.delta_max),
          .longest_lease_s = to_seconds(device.longest_lease),
          .v_max_m_per_s = mofc.guard.v_max_m_per_s,
          .credit_cap_joule = cap_joule,
          .contact_credit_joule = hold_joule > cap_joule ? hold_joule : 0.0,
          .gate_joule = std::max(mofc.guard.gate_joule, hold_joule),
          .gate_recovery_s = to_seconds(mofc.guard.gate_recovery)};
}

std::unique_ptr<controllers::ForceController> make_mofc(const MofcConfig& mofc,
                                                        const ClampedDevice& device) {
  if (mofc.mode == MofcMode::kPaper) return make_paper(mofc, device);
  if (mofc.mode == MofcMode::kVector) {
    return std::make_unique<controllers::VectorMofc>(
        leased_parameters(device), device.profile.position_resolution_m, to_seconds(mofc.delta_max),
        axis_friction(device.profile), to_seconds(device.longest_lease));
  }
  return std::make_unique<controllers::GuardMofc>(guard_parameters(mofc, device));
}

std::unique_ptr<controllers::ForceController> make_alone(const MofcConfig& mofc,
                                                         const ClampedDevice& device) {
  switch (mofc.controller) {
    case ControllerKind::kNone:
      return std::make_unique<controllers::PassThrough>();
    case ControllerKind::kMofc:
      return make_mofc(mofc, device);
    case ControllerKind::kOutputLimiter:
      return make_paper(mofc, device);
    default:
      return make_rival(mofc, device);
  }
}

}  // namespace

std::unique_ptr<controllers::ForceController> make_controller(const MofcConfig& mofc,
                                                              const ClampedDevice& device) {
  auto controller = make_alone(mofc, device);
  if (!mofc.has_safety_net) return controller;
  return std::make_unique<controllers::SafetyNet>(std::move(controller),
                                                  guard_parameters(mofc, device));
}

}  // namespace palpate::mofc
