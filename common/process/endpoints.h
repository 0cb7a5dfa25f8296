// SPDX-License-Identifier: Apache-2.0
// endpoints.h — the endpoints of a session with the names of their fields.
#pragma once

#include <string>
#include <vector>

#include "common/session/session.h"

namespace palpate {

struct NamedEndpoint {
  const char* setting;          ///< "links.exchange"
  const std::string& endpoint;  ///< refers to the session it was taken from
};

/// All that one side uses, in hop order; those of physics.standby last, if there is one.
[[nodiscard]] inline std::vector<NamedEndpoint> endpoints_of(const Session& session,
                                                             const Side& side) {
  const LinksConfig& links = side.links;
  std::vector<NamedEndpoint> all{{"links.exchange", links.exchange},
                                 {"links.tool_motion", links.tool_motion},
                                 {"links.interaction", links.interaction},
                                 {"links.device_telemetry", links.device_telemetry},
                                 {"links.mofc_telemetry", links.mofc_telemetry},
                                 {"links.physics_telemetry", session.physics_telemetry},
                                 {"links.hand_target", links.hand_target}};
  if (session.physics.standby) {
    all.push_back({"links.standby_tool_motion", links.standby_tool_motion});
    all.push_back({"links.standby_interaction", links.standby_interaction});
    all.push_back({"links.standby_telemetry", session.standby_telemetry});
  }
  return all;
}

}  // namespace palpate
