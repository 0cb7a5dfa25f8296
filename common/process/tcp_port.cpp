// SPDX-License-Identifier: Apache-2.0
#include "common/process/tcp_port.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace palpate {

std::optional<std::uint16_t> free_port(std::uint16_t port) {
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
  const bool is_free =
      bind(file, place, size) == 0 && listen(file, 1) == 0 && getsockname(file, place, &size) == 0;
  close(file);
  if (!is_free) return std::nullopt;
  return ntohs(address.sin_port);
}

}  // namespace palpate
