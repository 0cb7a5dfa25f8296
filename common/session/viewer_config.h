// SPDX-License-Identifier: Apache-2.0
// viewer_config.h — the status line and the web server of viewer_node.
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

/// Web page and Foxglove WebSocket of viewer_node, on loopback.
struct WebConfig {
  bool is_on = true;
  std::uint16_t port = 8765;  ///< 0: any free one
};

struct ViewerConfig {
  Duration status_interval = std::chrono::milliseconds(500);
  WebConfig web;
  /// A page may acknowledge a device that waits for it, and change tissues: may_change_tissue().
  bool has_control = false;
};

}  // namespace palpate
