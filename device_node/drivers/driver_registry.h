// SPDX-License-Identifier: Apache-2.0
// driver_registry.h — the drivers by name. Each has a folder of its own below this one.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "common/core/clock.h"
#include "common/session/driver_config.h"
#include "device_node/device.h"
#include "device_node/drivers/simulated/simulated_driver.h"
#include "device_node/drivers/start_up.h"

namespace palpate::device {

/// One kind of device.
struct Driver {
  /// Opens the device: ready to be read, motors limp. The clock must outlive it and stamps its
  /// readings. Throws SetupError if the device is absent or does not become ready.
  std::function<std::unique_ptr<HapticDevice>(const Clock&, const StartUp&)> open;
  /// True: a simulation, which runs on any clock, virtual ones too. False: hardware, which runs on
  /// the steady clock of this host only.
  bool is_simulated = false;
};

class DriverRegistry {
 public:
  /// Replaces a driver of that name.
  void add(const std::string& name, Driver driver) { drivers_[name] = std::move(driver); }
  /// @throws SetupError  no driver has that name; the text lists the known ones
  [[nodiscard]] const Driver& at(const std::string& name) const;

 private:
  std::map<std::string, Driver> drivers_;
};

/// What the drivers need from a session; each driver reads its own part only.
struct DriverOptions {
  SimulatedDriverOptions simulated;
  DriverConfig driver = {};  ///< of the session's own driver, if it is another one
};

/// The name of the driver that a session asks for.
[[nodiscard]] const char* driver_name(const DriverConfig& driver);

/// All drivers of this build, with these options.
[[nodiscard]] DriverRegistry all_drivers(const DriverOptions& options);

}  // namespace palpate::device
