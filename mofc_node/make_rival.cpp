#include "mofc_node/make_rival.h"

#include <algorithm>

#include "mofc_node/controllers/rivals/bounding.h"
#include "mofc_node/controllers/rivals/energy_tank.h"
#include "mofc_node/controllers/rivals/input_to_state.h"
#include "mofc_node/controllers/rivals/lyapunov.h"
#include "mofc_node/controllers/rivals/memory_based.h"
#include "mofc_node/controllers/rivals/passivity_control.h"
#include "mofc_node/controllers/rivals/two_port.h"
#include "mofc_node/controllers/rivals/virtual_coupling.h"

namespace palpate::mofc {

namespace {

controllers::VirtualCouplingParameters coupling(const VirtualCouplingConfig& config, double f_d,
                                                double T) {
  if (config.stiffness_newton_per_m > 0.0) {
    return {.K_c = config.stiffness_newton_per_m, .B_c = config.damping_newton_s_per_m, .T = T};
  }
  // a device without viscous friction allows no coupling: the least that has a solution
  const double b = std::max(f_d, 1e-6);
  return config.criterion == VirtualCouplingConfig::Criterion::kSampledData
             ? controllers::sampled_data_coupling(b, T)
             : controllers::llewellyn_coupling(b, T);
}

controllers::PassivityControlParameters passivity(const PassivityControlConfig& config, double T) {
  using Observer = controllers::PassivityControlParameters::Observer;
  controllers::PassivityControlParameters p{.T = T,
                                            .most_damping = config.most_damping_newton_s_per_m,
                                            .least_speed = config.least_speed_m_per_s};
  if (config.observer == PassivityControlConfig::Observer::kProduct) {
    p.observer = Observer::kProduct;
  } else if (config.observer == PassivityControlConfig::Observer::kReference) {
    p.observer = Observer::kReference;
  }
  return p;
}

}  // namespace

std::unique_ptr<controllers::ForceController> make_rival(const MofcConfig& mofc,
                                                         const ClampedDevice& device) {
  const DeviceProfile& profile = device.profile;
  const RivalsConfig& rivals = mofc.rivals;
  const double T = 1.0 / device.rate_hz;
  // the published methods know one friction: the least of the axes
  const double f_d = profile.per_axis ? profile.per_axis->viscous_newton_s_per_m.minCoeff()
                                      : profile.viscous_newton_s_per_m;
  switch (mofc.controller) {
    case ControllerKind::kVirtualCoupling:
      return std::make_unique<controllers::VirtualCoupling>(
          coupling(rivals.virtual_coupling, f_d, T));
    case ControllerKind::kEnergyBounding:
      return std::make_unique<controllers::EnergyBounding>(
          controllers::BoundingParameters{.f_d = f_d, .T = T});
    case ControllerKind::kForceBounding:
      if (rivals.force_bounding.is_more_conservative) {
        return std::make_unique<controllers::MoreConservativeBounding>(
            controllers::BoundingParameters{.f_d = f_d, .T = T});
      }
      return std::make_unique<controllers::LessConservativeBounding>(
          controllers::BoundingParameters{.f_d = f_d, .T = T});
    case ControllerKind::kPassivityControl:
      return std::make_unique<controllers::PassivityControl>(
          passivity(rivals.passivity_control, T));
    case ControllerKind::kMemoryBased:
      return std::make_unique<controllers::MemoryBased>(profile.position_resolution_m);
    case ControllerKind::kInputToState: {
      const double tau_s = to_seconds(rivals.input_to_state.time_constant);
      return std::make_unique<controllers::InputToState>(tau_s > 0.0 ? tau_s : 1.5 * T);
    }
    case ControllerKind::kTwoPort:
      return std::make_unique<controllers::TwoPort>(passivity(rivals.passivity_control, T));
    case ControllerKind::kEnergyTank:
      return std::make_unique<controllers::EnergyTank>(
          controllers::EnergyTankParameters{.initial_joule = rivals.energy_tank.initial_joule,
                                            .most_joule = rivals.energy_tank.most_joule,
                                            .valve_joule = rivals.energy_tank.valve_joule,
                                            .damping = rivals.energy_tank.damping_newton_s_per_m});
    case ControllerKind::kLyapunov:
      return std::make_unique<controllers::LyapunovLimiter>(
          controllers::LyapunovParameters{.T = T,
                                          .least_mass = rivals.lyapunov.least_mass_kg,
                                          .most_mass = rivals.lyapunov.most_mass_kg,
                                          .hand_force = rivals.lyapunov.hand_force_newton,
                                          .slack_watt = rivals.lyapunov.slack_watt});
    case ControllerKind::kNone:
    case ControllerKind::kMofc:
    case ControllerKind::kOutputLimiter:
      break;
  }
  return std::make_unique<controllers::PassThrough>();
}

}  // namespace palpate::mofc
