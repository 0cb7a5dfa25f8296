// SPDX-License-Identifier: Apache-2.0
// raw_zmtp.h — ZMTP 3.0 byte by byte, for peers that violate it: greeting, handshake without keys,
// frames, and streams to and from an endpoint. A peer of libzmq would itself abort where its socket
// is closed and its connection ends within a message of several parts.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "tests/support/machine/machine.h"

namespace palpate::test {

/// 64 bytes. @param mechanism  "NULL", "PLAIN", "CURVE"
inline std::string zmtp_greeting(std::string_view mechanism = "NULL") {
  std::string bytes("\xff\0\0\0\0\0\0\0\1\x7f\3\0", 12);
  bytes += mechanism;
  bytes.resize(64, '\0');
  return bytes;
}

/// Bits of the first byte of a frame.
enum ZmtpFlags : std::uint8_t { kLastPart = 0, kMoreParts = 1, kCommand = 4 };

/// The head of a frame of this length, which need not follow.
inline std::string zmtp_head(std::uint8_t flags, std::uint64_t length) {
  constexpr std::uint8_t kLong = 2;
  std::string bytes;
  if (length < 256) {
    bytes += static_cast<char>(flags);
    bytes += static_cast<char>(length);
    return bytes;
  }
  bytes += static_cast<char>(flags | kLong);
  for (int shift = 56; shift >= 0; shift -= 8) bytes += static_cast<char>(length >> shift);
  return bytes;
}
inline std::string zmtp_frame(std::uint8_t flags, std::string_view body) {
  return zmtp_head(flags, body.size()) + std::string(body);
}

/// The handshake of the mechanism NULL. @param type  of the socket: "PUSH", "DEALER"
inline std::string zmtp_ready(std::string_view type) {
  std::string body("\5READY\xbSocket-Type\0\0\0", 21);
  body += static_cast<char>(type.size());
  body += type;
  return zmtp_frame(kCommand, body);
}

/// The address of "ipc://…" or "tcp://127.0.0.1:…".
class RawAddress {
 public:
  explicit RawAddress(const std::string& endpoint) {
    if (endpoint.starts_with("ipc://")) {
      family_ = AF_UNIX;
      local_.sun_family = AF_UNIX;
      endpoint.copy(local_.sun_path, sizeof(local_.sun_path) - 1, 6);
    } else {
      inet_.sin_family = AF_INET;
      inet_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      inet_.sin_port =
          htons(static_cast<std::uint16_t>(std::stoi(endpoint.substr(endpoint.rfind(':') + 1))));
    }
  }
  [[nodiscard]] int family() const { return family_; }
  [[nodiscard]] const char* path() const { return local_.sun_path; }
  [[nodiscard]] const sockaddr* get() const {
    return family_ == AF_UNIX ? reinterpret_cast<const sockaddr*>(&local_)
                              : reinterpret_cast<const sockaddr*>(&inet_);
  }
  [[nodiscard]] socklen_t size() const {
    return family_ == AF_UNIX ? sizeof(local_) : sizeof(inet_);
  }

 private:
  int family_ = AF_INET;
  sockaddr_un local_{};
  sockaddr_in inet_{};
};

/// A stream of bytes to or from an endpoint; closed at its destruction.
class RawStream {
 public:
  explicit RawStream(const std::string& endpoint) {
    const RawAddress address(endpoint);
    descriptor_ = socket(address.family(), SOCK_STREAM | SOCK_CLOEXEC, 0);
    is_open_ = connect(descriptor_, address.get(), address.size()) == 0;
    limit_silence();
  }
  /// @param accepted  descriptor of a connection, which the stream closes
  explicit RawStream(int accepted) : descriptor_(accepted), is_open_(true) { limit_silence(); }
  ~RawStream() { close(descriptor_); }
  RawStream(const RawStream&) = delete;
  RawStream& operator=(const RawStream&) = delete;

  [[nodiscard]] bool is_open() const { return is_open_; }
  /// The other end has closed the connection.
  [[nodiscard]] bool was_closed() const { return was_closed_; }
  /// Ends both directions; from any thread.
  void hang_up() { shutdown(descriptor_, SHUT_RDWR); }
  /// Blocks until everything is written; false if the other end closed the connection, also while
  /// it leaves bytes unread, or has read nothing for test::patience(kAmple).
  bool write(std::string_view bytes) {
    const auto limit = std::chrono::ceil<std::chrono::milliseconds>(patience(kAmple));
    while (is_open_ && !bytes.empty()) {
      pollfd ready{.fd = descriptor_, .events = POLLOUT | POLLRDHUP, .revents = 0};
      is_open_ = poll(&ready, 1, static_cast<int>(limit.count())) > 0;
      if (!is_open_) break;
      const bool has_ended = (ready.revents & POLLRDHUP) != 0;
      const ssize_t n =
          has_ended ? -1
                    : ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n < 0 && !has_ended && errno == EAGAIN) continue;
      is_open_ = n > 0;
      was_closed_ = !is_open_;
      if (is_open_) bytes.remove_prefix(static_cast<std::size_t>(n));
    }
    return is_open_;
  }
  /// The whole handshake without keys. A frame that arrives before libzmq has sent its READY would
  /// be an error.
  bool shake_hands(std::string_view type) {
    if (!write(zmtp_greeting() + zmtp_ready(type))) return false;
    read(zmtp_greeting().size());
    const std::string head = read(2);
    return head.size() == 2 && !read(static_cast<unsigned char>(head[1])).empty();
  }

 private:
  void limit_silence() {
    const auto limit = std::chrono::ceil<std::chrono::seconds>(patience(kAmple));
    const timeval silence{.tv_sec = limit.count(), .tv_usec = 0};
    setsockopt(descriptor_, SOL_SOCKET, SO_RCVTIMEO, &silence, sizeof(silence));
  }
  std::string read(std::size_t size) {
    std::string bytes(size, '\0');
    const ssize_t n = recv(descriptor_, bytes.data(), size, MSG_WAITALL);
    bytes.resize(n < 0 ? 0 : static_cast<std::size_t>(n));
    return bytes;
  }

  static constexpr auto kAmple = std::chrono::seconds(5);

  int descriptor_ = -1;
  bool is_open_ = false;
  bool was_closed_ = false;
};

/// Listens at an endpoint until its destruction.
class RawListener {
 public:
  explicit RawListener(const std::string& endpoint) : address_(endpoint) {
    descriptor_ = socket(address_.family(), SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int reuse = 1;
    setsockopt(descriptor_, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof(reuse));
    if (address_.family() == AF_UNIX) unlink(address_.path());
    is_open_ = bind(descriptor_, address_.get(), address_.size()) == 0 &&
               listen(descriptor_, SOMAXCONN) == 0;
  }
  ~RawListener() {
    close(descriptor_);
    if (address_.family() == AF_UNIX) unlink(address_.path());
  }
  RawListener(const RawListener&) = delete;
  RawListener& operator=(const RawListener&) = delete;

  [[nodiscard]] bool is_open() const { return is_open_; }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// Of a listener on tcp, with its actual port.
  [[nodiscard]] std::string tcp_endpoint() const {
    sockaddr_in address{};
    socklen_t size = sizeof(address);
    getsockname(descriptor_, reinterpret_cast<sockaddr*>(&address), &size);
    return "tcp://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  }
  /// The next connection; -1 if there is none for 10 ms.
  [[nodiscard]] int accept() const {
    pollfd ready{.fd = descriptor_, .events = POLLIN, .revents = 0};
    constexpr int kWaitMs = 10;
    if (poll(&ready, 1, kWaitMs) != 1) return -1;
    return accept4(descriptor_, nullptr, nullptr, SOCK_CLOEXEC);
  }

 private:
  RawAddress address_;
  int descriptor_ = -1;
  bool is_open_ = false;
};

}  // namespace palpate::test
