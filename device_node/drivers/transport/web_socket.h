// SPDX-License-Identifier: Apache-2.0
// web_socket.h — one end of a WebSocket connection whose transfers end within a given time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "common/core/time.h"
#include "device_node/drivers/transport/transfer.h"

namespace palpate::device {

/// One thread. send() and receive() do not allocate after the first of each, and do not throw.
class WebSocket {
 public:
  /// Longest message that is taken.
  static constexpr std::size_t kLongestBytes = std::size_t{1} << 18;

  /// A client.
  /// @param host  a numeric IPv4 address or a name that the resolver knows
  /// @throws std::runtime_error  no connection within `within`; says why
  static std::unique_ptr<WebSocket> connect(const std::string& host, std::uint16_t port,
                                            Duration within);
  /// A server's end, of an accepted TCP connection, which it owns from now on.
  /// @throws std::runtime_error  no valid handshake within `within`
  static std::unique_ptr<WebSocket> accept(int socket, Duration within);

  ~WebSocket();
  WebSocket(const WebSocket&) = delete;
  WebSocket& operator=(const WebSocket&) = delete;

  /// Sends a text message.
  [[nodiscard]] Transfer send(std::string_view text, Duration within) noexcept;
  /// The next message, text or binary; valid until the next receive(). After anything but kDone the
  /// connection is of no further use.
  [[nodiscard]] Transfer receive(std::string_view& text, Duration within) noexcept;

  /// Whether a message waits that no receive() has asked for; between two receive() only.
  [[nodiscard]] bool has_message() const noexcept;

  /// Ends a transfer under way, and the connection. Any thread.
  void interrupt() noexcept;

 private:
  class Impl;
  explicit WebSocket(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::device
