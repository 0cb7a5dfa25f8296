// SPDX-License-Identifier: Apache-2.0
// page.h — the address of the page of a run or a replay.
#pragma once

#include <optional>

#include "common/process/tcp_port.h"
#include "common/session/session.h"

namespace palpate {

/// Takes the port of the page and prints its address, alone on its line, before anything else is
/// printed. If another program uses the session's port, the page gets a free one. It keeps its port
/// when the viewer restarts.
/// @return what the viewer inherits; nothing: viewer_node opens the port, or reports why not
[[nodiscard]] std::optional<ListeningPort> announce_page(const WebConfig& web);

}  // namespace palpate
