// SPDX-License-Identifier: Apache-2.0
// session.h — one deployment as plain structs, validated, with every default filled in.
// Fields with units, ranges and defaults: docs/session.md. Loading: common/session/session_file.h.
// A node receives only its own part.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/session/adversary_config.h"
#include "common/session/device_config.h"
#include "common/session/driver_config.h"
#include "common/session/link_config.h"
#include "common/session/mofc_config.h"
#include "common/session/scene_config.h"
#include "common/session/simulation_config.h"
#include "common/session/task_config.h"
#include "common/session/viewer_config.h"

namespace palpate {

/// One device with its hand and its controller: served by one device_node and one mofc_node.
struct Side {
  std::string name;  ///< "" in a session with one device
  LinksConfig links;
  RealtimeConfig realtime;
  DeviceConfig device;
  DriverConfig driver;
  /// The simulated device: the driver's own, or one with the limits of another driver's.
  SimulatedDeviceConfig simulated;
  HandConfig hand;
  MofcConfig mofc;
};

/// A deployment: what all devices share, and a side for each device.
struct Session {
  std::string name;
  std::string file;  ///< as given on the command line; for messages
  std::string text;  ///< with the overrides applied; protobuf text format
  double duration_s = 10.0;
  std::uint64_t seed = 1;
  std::string physics_telemetry;  ///< endpoint: physics → viewers, hop 5
  /// Endpoint: physics ← viewers, hop 8; always an ipc file, used only with viewer.has_control.
  std::string tissue_change;
  /// Endpoint: physics.standby → viewers, hop 5; empty without.
  std::string standby_telemetry;
  PhysicsConfig physics;
  /// Physics from elsewhere: a program, absolute or to be found in PATH, and its arguments, which
  /// `palpate launch` starts instead of physics_node. Empty: none.
  std::vector<std::string> physics_command;
  SceneConfig scene;
  ViewerConfig viewer;
  FaultsConfig faults;
  SecurityConfig security;
  AdversaryConfig adversary;                       ///< lockstep only
  std::optional<TaskConfig> task;                  ///< only with one side
  std::vector<Side> sides = std::vector<Side>(1);  ///< never empty

  /// The only side; with several devices the first.
  [[nodiscard]] const Side& side() const { return sides.front(); }
  [[nodiscard]] Side& side() { return sides.front(); }
};

/// How far from a tool the physics describes tissues before they are touched: physics.reach_m, or 0
/// where no mofc_node uses that.
[[nodiscard]] double reach_of(const Session& session);

/// Whether a page may change the stiffness and damping of tissues: with viewer.control, and if no
/// device is a real one.
[[nodiscard]] bool may_change_tissue(const Session& session);

/// The session reduced to the side of that name; "" for a session with one device. Throws
/// SetupError, which lists the names, if there is no such side.
[[nodiscard]] Session with_only_side(Session session, const std::string& name);

/// "device"; of a side "left.device".
[[nodiscard]] std::string with_side(const std::string& side, const std::string& name);

/// Seed of one random stream: different for every `stream` name, the same in every run.
[[nodiscard]] std::uint64_t stream_seed(std::uint64_t seed, const char* stream);

/// The same for a stream of one side of the session: each side has streams of its own.
[[nodiscard]] std::uint64_t stream_seed(const Session& session, const Side& side,
                                        const char* stream);

}  // namespace palpate
