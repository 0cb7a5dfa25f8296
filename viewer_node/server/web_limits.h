// web_limits.h — limits that HTTP connections and WebSocket clients have in common.
#pragma once

#include <chrono>
#include <cstddef>

namespace palpate::viewer {

inline constexpr std::size_t kMaxConnections = 64;
inline constexpr std::size_t kMaxClients = 16;  ///< of the connections, WebSockets
/// For a request or an upgrade.
inline constexpr auto kRequestTimeout = std::chrono::seconds(10);

}  // namespace palpate::viewer
