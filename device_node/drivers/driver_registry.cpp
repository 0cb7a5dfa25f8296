#include "device_node/drivers/driver_registry.h"

#include "common/core/check.h"

namespace palpate::device {

const Driver& DriverRegistry::at(const std::string& name) const {
  const auto found = drivers_.find(name);
  if (found != drivers_.end()) return found->second;
  std::string known;
  for (const auto& [other, driver] : drivers_) known += (known.empty() ? "" : ", ") + other;
  throw SetupError("device driver \"" + name + "\" is not part of this build; known drivers: " +
                   (known.empty() ? "none" : known));
}

DriverRegistry all_drivers(const DriverOptions& options) {
  DriverRegistry drivers;
  drivers.add(kSimulatedDriver,
              {.open = [simulated = options.simulated](
                           const Clock& clock) { return open_simulated_device(simulated, clock); },
               .is_simulated = true});
  return drivers;
}

}  // namespace palpate::device
