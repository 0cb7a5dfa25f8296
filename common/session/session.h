// session.h — one deployment as plain structs, validated and with every default filled in.
// The file's schema, with units, ranges and defaults: proto/palpate/v1/session.proto.
// Loading: common/session/session_file.h. A node is handed only its own part.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/session/device_config.h"
#include "common/session/link_config.h"
#include "common/session/mofc_config.h"
#include "common/session/scene_config.h"
#include "common/session/simulation_config.h"
#include "common/session/viewer_config.h"

namespace palpate {

/// The whole deployment.
struct Session {
  std::string name;
  std::string file;  ///< as given on the command line, for messages
  std::string text;  ///< as it counts, overrides applied; protobuf text format
  double duration_s = 10.0;
  std::uint64_t seed = 1;
  LinksConfig links;
  RealtimeConfig realtime;
  DeviceConfig device;
  SimulatedDeviceConfig simulated;
  HandConfig hand;
  MofcConfig mofc;
  PhysicsConfig physics;
  SceneConfig scene;
  ViewerConfig viewer;
  FaultsConfig faults;
  SecurityConfig security;

  /// Several devices in one tissue: the session as it is for each of them; what stands above is
  /// that of the first. Empty for one device.
  std::vector<Session> sides;
  std::string side;  ///< in `sides`: its name
};

/// One session for each device: its sides, or itself if it has none.
[[nodiscard]] std::span<const Session> sides_of(const Session& session);

/// That of the side. Throws SetupError, naming those there are, if `name` is none of them; "" is
/// for a session without sides.
[[nodiscard]] const Session& side_of(const Session& session, const std::string& name);

/// "device"; of a side "left.device".
[[nodiscard]] std::string with_side(const std::string& side, const std::string& name);

/// Seed of one random stream of a session: different for every `stream` name, same on every run.
[[nodiscard]] std::uint64_t stream_seed(std::uint64_t session_seed, const char* stream);

}  // namespace palpate
