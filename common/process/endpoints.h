// endpoints.h — the endpoints of a session with the names of their fields.
#pragma once

#include <array>
#include <string>

#include "common/session/session.h"

namespace palpate {

struct NamedEndpoint {
  const char* setting;          ///< "links.exchange"
  const std::string& endpoint;  ///< refers to the session it was taken from
};

/// All that one side uses, in hop order.
[[nodiscard]] inline std::array<NamedEndpoint, 7> endpoints_of(const Session& session,
                                                               const Side& side) {
  const LinksConfig& links = side.links;
  return {{{"links.exchange", links.exchange},
           {"links.tool_motion", links.tool_motion},
           {"links.interaction", links.interaction},
           {"links.device_telemetry", links.device_telemetry},
           {"links.mofc_telemetry", links.mofc_telemetry},
           {"links.physics_telemetry", session.physics_telemetry},
           {"links.hand_target", links.hand_target}}};
}

}  // namespace palpate
