// SPDX-License-Identifier: Apache-2.0
// web_limits.h — limits that HTTP connections and WebSocket clients have in common.
#pragma once

#include <chrono>
#include <cstddef>

namespace palpate::viewer {

/// Beyond it, and the clients that an audience may have more than kMaxClients, a newcomer replaces
/// the connection that has waited longest without a request.
inline constexpr std::size_t kMaxConnections = 64;
/// From one address other than loopback and the configured proxies.
inline constexpr std::size_t kMaxConnectionsPerAddress = 24;
inline constexpr std::size_t kMaxClients = 16;       ///< of the connections, WebSockets
inline constexpr std::size_t kMaxAudience = 10'000;  ///< WebSockets of an audience, at most
/// What may wait for all clients together; beyond it, the client with most loses its data.
inline constexpr std::size_t kMaxUnreadBytesOfAll = std::size_t{64} << 20;
/// For the header of a request.
inline constexpr auto kHeaderTimeout = std::chrono::seconds(3);
/// For an upgrade. An answer ends if its client takes none of it for so long.
inline constexpr auto kAnswerTimeout = std::chrono::seconds(10);
/// For a whole answer: the page over 20 kbit/s.
inline constexpr auto kWholeAnswerTimeout = std::chrono::minutes(5);

}  // namespace palpate::viewer
