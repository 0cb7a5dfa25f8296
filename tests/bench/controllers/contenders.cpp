// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/controllers/contenders.h"

namespace palpate::bench {

std::vector<Contender> contenders() {
  const auto of = [](const char* controller) {
    return Overrides{std::string("mofc.controller=") + controller};
  };
  const auto with = [&](const char* controller, const char* setting) {
    Overrides overrides = of(controller);
    overrides.emplace_back(setting);
    return overrides;
  };
  return {{"none", of("none")},
          {"mofc paper, output limiter", {"mofc.mode=paper"}},
          {"mofc vector", {"mofc.mode=vector"}},
          {"mofc guard", {"mofc.mode=guard"}},
          {"virtual coupling", of("virtual_coupling"), true},
          {"virtual coupling, sampled data",
           with("virtual_coupling", "mofc.virtual_coupling_settings.criterion=sampled_data"), true},
          {"energy bounding", of("energy_bounding")},
          {"force bounding, less",
           with("force_bounding", "mofc.force_bounding_settings.variant=less_conservative")},
          {"force bounding, more", of("force_bounding")},
          {"PO/PC, product",
           with("passivity_control", "mofc.passivity_control_settings.observer=product")},
          {"PO/PC, sampled", of("passivity_control")},
          {"PO/PC, reference",
           with("passivity_control", "mofc.passivity_control_settings.observer=reference")},
          {"memory based", of("memory_based")},
          {"input to state", of("input_to_state")},
          {"two ports", of("two_port")},
          {"energy tank", of("energy_tank")},
          {"Lyapunov", of("lyapunov"), true},
          {"wave variables", of("wave_variables"), true}};
}

}  // namespace palpate::bench
