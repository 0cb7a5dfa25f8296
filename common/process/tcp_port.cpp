// SPDX-License-Identifier: Apache-2.0
#include "common/process/tcp_port.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <utility>

namespace palpate {

std::optional<ListeningPort> ListeningPort::open(std::uint16_t port) {
  const int file = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (file < 0) return std::nullopt;
  const int yes = 1;  // as a server: a port whose last connection has just ended is free
  setsockopt(file, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const place = reinterpret_cast<sockaddr*>(&address);
  const bool is_free = bind(file, place, size) == 0 && listen(file, SOMAXCONN) == 0 &&
                       getsockname(file, place, &size) == 0;
  ListeningPort held(file, ntohs(address.sin_port));
  if (!is_free) return std::nullopt;
  return held;
}

ListeningPort::~ListeningPort() {
  if (descriptor_ >= 0) close(descriptor_);
}
ListeningPort::ListeningPort(ListeningPort&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), port_(other.port_) {}
ListeningPort& ListeningPort::operator=(ListeningPort&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(port_, other.port_);
  return *this;
}

bool is_port_free(std::uint16_t port) { return ListeningPort::open(port).has_value(); }

}  // namespace palpate
