// SPDX-License-Identifier: Apache-2.0
// web_client.h — a plain TCP client with just enough HTTP and WebSocket to test a server, valid or
// not. Shares no code with the server.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "tests/support/machine/machine.h"

namespace palpate::test {

class WebClient {
 public:
  static constexpr auto kAmple = std::chrono::seconds(10);  ///< on an idle machine, for any answer

  enum class Link { kLoopback, kSlow };

  /// @param link  kSlow: segments as on Ethernet and little room for what was not read, so that the
  ///              server's kernel takes no more at once than for a client at the end of a slow line
  explicit WebClient(std::uint16_t port, std::uint32_t host = INADDR_LOOPBACK,
                     Link link = Link::kLoopback)
      : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (link == Link::kSlow) {
      const int segment_bytes = 1460;
      const int room_bytes = 4096;
      setsockopt(socket_, IPPROTO_TCP, TCP_MAXSEG, &segment_bytes, sizeof(segment_bytes));
      setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &room_bytes, sizeof(room_bytes));
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(host);
    address.sin_port = htons(port);
    is_connected_ = connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  }
  ~WebClient() { close(socket_); }
  WebClient(const WebClient&) = delete;
  WebClient& operator=(const WebClient&) = delete;

  [[nodiscard]] bool is_connected() const { return is_connected_; }
  /// A small receive buffer, so that the server soon notices a client that does not read.
  void read_slowly() const {
    const int bytes = 64 << 10;
    setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes));
  }

  /// Sends the bytes unchanged. False if the server has closed the connection.
  bool send_raw(const std::string& bytes) const {
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t n = ::send(socket_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (n <= 0) return false;
      sent += static_cast<std::size_t>(n);
    }
    return true;
  }

  /// Half-closes the connection: the server sees its end but can still answer.
  void send_no_more() const { shutdown(socket_, SHUT_WR); }

  /// All bytes until the server closes or the deadline; for small answers.
  std::string read_to_end() {
    while (read_more()) {
    }
    return std::exchange(received_, {});
  }
  /// At most so many bytes; fewer when the server closes or at the deadline.
  std::string read(std::size_t bytes) {
    while (received_.size() < bytes && read_more(bytes - received_.size())) {
    }
    std::string read = received_.substr(0, bytes);
    received_.erase(0, read.size());
    return read;
  }
  /// Head of an HTTP answer with its blank line; "" if the connection ends first.
  std::string read_head() {
    for (;;) {
      const std::size_t end = received_.find("\r\n\r\n");
      if (end != std::string::npos) {
        std::string head = received_.substr(0, end + 4);
        received_.erase(0, end + 4);
        return head;
      }
      if (!read_more()) return {};
    }
  }

  static std::string upgrade(const std::string& extra = {}, const std::string& target = "/") {
    return "GET " + target +
           " HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
           "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
           "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n" +
           extra + "\r\n";
  }
  /// Whether the server accepts the upgrade.
  bool open_web_socket(const std::string& extra = {}) {
    return send_raw(upgrade(extra)) && read_head().starts_with("HTTP/1.1 101");
  }

  /// One masked frame. @param opcode  1 text, 2 binary, 8 close, 9 ping, 10 pong
  static std::string frame(int opcode, const std::string& payload, bool is_masked = true) {
    std::string bytes(1, static_cast<char>(0x80 | opcode));
    const int mask_bit = is_masked ? 0x80 : 0;
    if (payload.size() < 126) {
      bytes += static_cast<char>(mask_bit | static_cast<int>(payload.size()));
    } else {  // the shortest form is required
      const bool is_long = payload.size() >= 65536;
      bytes += static_cast<char>(mask_bit | (is_long ? 127 : 126));
      for (int shift = is_long ? 56 : 8; shift >= 0; shift -= 8) {
        bytes += static_cast<char>(payload.size() >> shift);
      }
    }
    const std::string mask = is_masked ? "abcd" : "";
    bytes += mask;
    for (std::size_t i = 0; i < payload.size(); ++i) {
      bytes += is_masked ? static_cast<char>(payload[i] ^ mask[i % 4]) : payload[i];
    }
    return bytes;
  }
  bool send_text(const std::string& text) const { return send_raw(frame(1, text)); }

  struct Message {
    int opcode = 0;
    std::string payload;
  };
  /// The next frame of the server but pings, which are answered, and pongs; none if the connection
  /// ends or at the deadline.
  std::optional<Message> next() {
    for (;;) {
      std::size_t head = 2;
      std::uint64_t size = 0;
      if (received_.size() >= head) {
        const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(received_[i]); };
        const unsigned announced = byte(1) & 0x7fU;
        head += announced == 126 ? 2 : announced == 127 ? 8 : 0;
        if (received_.size() >= head) {
          size = announced < 126 ? announced : 0;
          for (std::size_t i = 2; announced >= 126 && i < head; ++i) size = size << 8 | byte(i);
          if (received_.size() >= head + size) {
            Message message{byte(0) & 0x0f, received_.substr(head, size)};
            received_.erase(0, head + size);
            if (message.opcode == 9) send_raw(frame(10, message.payload));
            if (message.opcode == 9 || message.opcode == 10) continue;
            return message;
          }
        }
      }
      if (!read_more()) return std::nullopt;
    }
  }
  /// The next text that contains `part`; "" if none arrives.
  std::string await_text(const std::string& part) {
    while (const auto message = next()) {
      if (message->opcode == 1 && message->payload.find(part) != std::string::npos) {
        return message->payload;
      }
    }
    return {};
  }
  /// Payload of the next data frame of the subscription; none if none arrives.
  std::optional<std::string> await_data(std::uint8_t subscription) {
    while (const auto message = next()) {
      if (message->opcode == 2 && message->payload.size() >= 13 &&
          static_cast<std::uint8_t>(message->payload[1]) == subscription) {
        return message->payload.substr(13);
      }
    }
    return std::nullopt;
  }

 private:
  static constexpr std::size_t kReadBytes = 65536;

  bool read_more(std::size_t most_bytes = kReadBytes) {
    pollfd descriptor{.fd = socket_, .events = POLLIN, .revents = 0};
    if (poll(&descriptor, 1, static_cast<int>(patience(kAmple).count())) <= 0) return false;
    char buffer[kReadBytes];
    const ssize_t n = recv(socket_, buffer, std::min(most_bytes, kReadBytes), 0);
    if (n <= 0) return false;
    received_.append(buffer, static_cast<std::size_t>(n));
    return true;
  }

  int socket_;
  bool is_connected_ = false;
  std::string received_;
};

}  // namespace palpate::test
