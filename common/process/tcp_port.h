// SPDX-License-Identifier: Apache-2.0
// tcp_port.h — a port of this machine: whether it is in use, and holding it for another program.
#pragma once

#include <cstdint>
#include <optional>

namespace palpate {

/// Listens on a port of 127.0.0.1 until its destruction.
class ListeningPort {
 public:
  /// @param port  0: any that is free
  /// @return nothing if a program uses it
  [[nodiscard]] static std::optional<ListeningPort> open(std::uint16_t port);
  ~ListeningPort();
  ListeningPort(ListeningPort&& other) noexcept;
  ListeningPort& operator=(ListeningPort&& other) noexcept;
  ListeningPort(const ListeningPort&) = delete;
  ListeningPort& operator=(const ListeningPort&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// Of the listening socket. Programs that are started do not inherit it by themselves.
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  ListeningPort(int descriptor, std::uint16_t port) : descriptor_(descriptor), port_(port) {}

  int descriptor_ = -1;
  std::uint16_t port_ = 0;
};

/// Whether no program uses this port of 127.0.0.1.
[[nodiscard]] bool is_port_free(std::uint16_t port);

}  // namespace palpate
