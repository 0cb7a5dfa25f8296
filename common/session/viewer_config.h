// viewer_config.h — what viewer_node shows and serves.
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

/// The page and the Foxglove WebSocket of viewer_node, on loopback.
struct WebConfig {
  bool is_on = true;
  std::uint16_t port = 8765;  ///< 0: any free one
};

struct ViewerConfig {
  Duration status_interval = std::chrono::milliseconds(500);
  WebConfig web;
};

}  // namespace palpate
