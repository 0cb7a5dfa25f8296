// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/driver_registry.h"

#include "common/core/check.h"
#include "device_node/drivers/device_claim.h"
#include "device_node/drivers/falcon/falcon_driver.h"
#include "device_node/drivers/hapi/hapi_driver.h"
#include "device_node/drivers/haply/haply_driver.h"
#include "device_node/drivers/plugin/plugin_driver.h"
#include "device_node/drivers/wooden/wooden_driver.h"

namespace palpate::device {

const Driver& DriverRegistry::at(const std::string& name) const {
  const auto found = drivers_.find(name);
  if (found != drivers_.end()) return found->second;
  std::string known;
  for (const auto& [other, driver] : drivers_) known += (known.empty() ? "" : ", ") + other;
  throw SetupError("device driver \"" + name + "\" is not part of this build; known drivers: " +
                   (known.empty() ? "none" : known));
}

namespace {

/// The session's settings of a driver, or its defaults.
template <class Config>
Config settings(const DriverConfig& driver) {
  const Config* const own = std::get_if<Config>(&driver);
  return own != nullptr ? *own : Config{};
}

/// The driver of a real device. The claim on it lasts as long as the driver.
template <class Config, class Open>
Driver real(const DriverConfig& driver, Open open) {
  return {.open = [config = settings<Config>(driver), open, claim = std::shared_ptr<DeviceClaim>()](
                      const Clock& clock, const StartUp& start_up) mutable {
    claim.reset();
    if (const std::string place = place_of(config); !place.empty()) {
      claim = std::make_shared<DeviceClaim>(place);
    }
    return open(config, clock, start_up);
  }};
}

}  // namespace

const char* driver_name(const DriverConfig& driver) {
  if (std::holds_alternative<HaplyConfig>(driver)) return kHaplyDriver;
  if (std::holds_alternative<HapiConfig>(driver)) return kHapiDriver;
  if (std::holds_alternative<FalconConfig>(driver)) return kFalconDriver;
  if (std::holds_alternative<WoodenConfig>(driver)) return kWoodenDriver;
  if (std::holds_alternative<PluginConfig>(driver)) return kPluginDriver;
  return kSimulatedDriver;
}

DriverRegistry all_drivers(const DriverOptions& options) {
  DriverRegistry drivers;
  drivers.add(kSimulatedDriver,
              {.open = [simulated = options.simulated](
                           const Clock& clock,
                           const StartUp&) { return open_simulated_device(simulated, clock); },
               .is_simulated = true});
  drivers.add(kHaplyDriver, real<HaplyConfig>(options.driver, open_haply));
  drivers.add(kHapiDriver, real<HapiConfig>(options.driver, open_hapi));
  drivers.add(kFalconDriver, real<FalconConfig>(options.driver, open_falcon));
  drivers.add(kPluginDriver, real<PluginConfig>(options.driver, open_plugin));
  drivers.add(kWoodenDriver, real<WoodenConfig>(options.driver, open_wooden));
  return drivers;
}

}  // namespace palpate::device
