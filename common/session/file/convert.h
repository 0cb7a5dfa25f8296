// SPDX-License-Identifier: Apache-2.0
// convert.h — from the written session to the plain structs of common/session/session.h, part by
// part. Ranges, constant defaults and remedies are those of the schema; computed defaults and rules
// between fields are here.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>

#include "common/core/problems.h"
#include "common/session/file/session_fields.h"
#include "common/session/file/session_text.h"
#include "common/session/session.h"

namespace palpate {

/// Checks every rule and fills in every default. What it returns is a session only if there are no
/// problems.
/// @param base_dir  folder of the session file; empty: no other file is read
[[nodiscard]] Session to_session(const SessionText& text, const std::filesystem::path& base_dir,
                                 Problems& problems);

// --- parts ------------------------------------------------------------------------------------

/// A period given with few digits, such as 333.3333 µs for 3 kHz, is accepted as a period.
inline constexpr double kPeriodTolerance = 1e-6;

/// Endpoint → path of the link that uses it, over all sides.
using Endpoints = std::map<std::string, std::string>;

/// Links of a session: defaults are files of its run folder, and no two links share an endpoint.
class LinkRules {
 public:
  /// @param links        of one side
  /// @param owner_of     of all sides so far; grows
  LinkRules(const Fields& links, const std::string& session_name, Endpoints& owner_of);

  /// @param side         its name; "" in a session with one device
  /// @param has_standby  else the links of physics.standby stay empty
  [[nodiscard]] LinksConfig of_side(const std::string& side, bool has_standby) const;
  /// An endpoint that all sides share: "physics_telemetry" or "standby_telemetry".
  [[nodiscard]] std::string shared(const char* name) const;
  /// An ipc file in the run folder; of a link without a setting, so that it never leaves this
  /// machine.
  [[nodiscard]] std::string on_this_machine(const std::string& name) const;

 private:
  struct Endpoint {
    std::string text;
    std::string shown_default;  // for problems of a field that is left out
  };
  [[nodiscard]] Endpoint read(const char* name, const std::string& default_file) const;
  [[nodiscard]] std::string own_endpoint(const char* name, const std::string& side) const;

  const Fields& links_;
  std::filesystem::path folder_;
  Endpoints& owner_of_;
};

/// @param place  of the side among those of the session: 0 for the first
[[nodiscard]] RealtimeConfig to_realtime(const Fields& realtime, std::size_t place);
[[nodiscard]] SecurityConfig to_security(const Fields& security,
                                         const std::filesystem::path& base_dir);
[[nodiscard]] FaultsConfig to_faults(const Fields& faults);
[[nodiscard]] AdversaryConfig to_adversary(const Fields& adversary);

[[nodiscard]] SimulatedDeviceConfig to_simulated_device(const Fields& simulated);
/// The wrist of the device, of the simulation and of the hand, if there is one.
void add_wrist(const Fields& device, const Fields& hand, const Fields& mofc, Side& side);
/// What `device` has from its driver.
struct DriverFigures {
  double peak_force_newton = 0.0;      ///< of the simulated device or the motors
  double position_resolution_m = 0.0;  ///< declared by a real device; 0: none
};
/// The driver that `device` names.
[[nodiscard]] DriverConfig to_driver(const Fields& device, const std::filesystem::path& base_dir);
/// The largest step of the positions that a real device declares; 0 of others.
[[nodiscard]] double declared_step_m(const DriverConfig& driver);
/// What stands in for a real device, as far as its driver knows it; the friction is added by
/// with_friction_of().
[[nodiscard]] SimulatedDeviceConfig simulated_as(const DriverConfig& driver,
                                                 const SimulatedDeviceConfig& simulated);
[[nodiscard]] SimulatedDeviceConfig with_friction_of(const DeviceProfile& profile,
                                                     SimulatedDeviceConfig simulated);
/// @param wait_for_physics_ms  checked; NaN if it has a problem, as the rate of the device
[[nodiscard]] DeviceConfig to_device(const Fields& device, double rate_hz,
                                     double wait_for_physics_ms, const DriverFigures& driver,
                                     const std::filesystem::path& base_dir, Problems& problems);

[[nodiscard]] HandConfig to_hand(const Fields& hand, const std::filesystem::path& base_dir,
                                 Problems& problems);
/// `until_s` of a period that begins at `from_s`.
[[nodiscard]] double to_until_s(const Fields& fields, double from_s);

/// The rates are NaN if they have a problem.
[[nodiscard]] double to_wait_for_physics_ms(const Fields& mofc, double device_rate_hz,
                                            double physics_rate_hz);
/// A deadband may suppress the very message that mofc_node waits for.
void refuse_if_waiting(const Fields& fields, const char* deadband, double wait_for_physics_ms);
[[nodiscard]] MofcConfig to_mofc(const Fields& mofc, double wait_for_physics_ms,
                                 const PhysicsConfig& physics, const DeviceConfig& device);

/// @param mofc  with `controller` and `safety_net`
[[nodiscard]] RivalsConfig to_rivals(const Fields& mofc);

[[nodiscard]] PhysicsConfig to_physics(const Fields& physics);
/// @param base_dir  to which a program with '/' in its name is relative
[[nodiscard]] std::vector<std::string> to_physics_command(const Fields& physics,
                                                          const std::filesystem::path& base_dir);
[[nodiscard]] SceneConfig to_scene(const Fields& scene, const std::filesystem::path& base_dir);
/// What of the tool acts on elastic tissue.
/// @param config  with its tip and its tissues
void add_holders(const Fields& tool, SceneConfig& config);
/// What gives way where the body is held; add_ties() finds what it is tied to.
/// @param material  with its fixed places
void add_attached(const Fields& elastic, ElasticMaterial& material);
/// The tissues that `attached` names, when all are known, with what acts on them.
void add_ties(const Fields& scene, SceneConfig& config);
/// A part of space, or of a mesh.
[[nodiscard]] RegionGeometry to_region(const Fields& place);

/// @param scene  as to_scene() gives it
[[nodiscard]] TaskConfig to_task(const Fields& task, const SceneConfig& scene);

}  // namespace palpate
