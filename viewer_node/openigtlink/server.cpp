// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/openigtlink/server.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>
#include <utility>

#include "common/core/check.h"

namespace palpate::viewer::igtl {
namespace {

constexpr int kMostAccepted = 4;  // in a call of pump()
constexpr int kSocketBytes = 1024 * 1024;

bool would_wait(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

ListeningPort port_for(std::uint16_t port) {
  std::optional<ListeningPort> opened = ListeningPort::open(port);
  if (!opened) {
    throw SetupError("--openigtlink " + std::to_string(port) +
                     ": the port is in use; give another one, or 0 for any that is free");
  }
  fcntl(opened->descriptor(), F_SETFL, O_NONBLOCK);
  return std::move(*opened);
}

}  // namespace

Server::Server(std::uint16_t port) : port_(port_for(port)) {}

Server::~Server() {
  for (const Client& client : clients_) close(client.descriptor);
}

void Server::accept(TimePoint now) {
  for (int i = 0; i < kMostAccepted; ++i) {
    const int descriptor =
        accept4(port_.descriptor(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (descriptor < 0) return;
    if (clients_.size() >= kMostClients) {
      ++counters_.refused;
      close(descriptor);
      continue;
    }
    // room for a surface, no more: a slow client gets new poses, not old ones
    const int bytes = kSocketBytes;
    setsockopt(descriptor, SOL_SOCKET, SO_SNDBUF, &bytes, sizeof bytes);
    const int yes = 1;
    setsockopt(descriptor, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    ++counters_.accepted;
    Client& client = clients_.emplace_back();
    client.id = next_id_++;
    client.descriptor = descriptor;
    client.wrote_at = now;
  }
}

void Server::pump(TimePoint now) {
  accept(now);
  for (Client& client : clients_) {
    read(client);
    write(client, now);
    if (!client.is_gone && !client.waiting.empty() && now - client.wrote_at > kStalledAfter) {
      ++counters_.stalled;
      client.is_gone = true;
    }
  }
  clients_.remove_if([](const Client& client) {
    if (client.is_gone) close(client.descriptor);
    return client.is_gone;
  });
}

void Server::read(Client& client) {
  std::array<char, 4096> part{};
  for (std::size_t all = 0; all < kMostReadBytes && !client.is_gone;) {
    const ssize_t count = recv(client.descriptor, part.data(), part.size(), 0);
    if (count <= 0) {
      client.is_gone = count == 0 || !would_wait(errno);
      return;
    }
    all += static_cast<std::size_t>(count);
    const bool is_good = client.reader.take(
        {part.data(), static_cast<std::size_t>(count)}, wants,
        [&](const Header& header, const std::string& body) { on_message(client, header, body); });
    if (is_good) continue;
    ++counters_.invalid;
    client.is_gone = true;
  }
}

bool Server::send(Client& client, const std::string& message, TimePoint now) {
  client.waiting.erase(0, std::exchange(client.written, 0));
  const std::size_t waits = client.waiting.size();
  if (client.is_gone || (waits > 0 && waits + message.size() > kMostWaitingBytes)) {
    ++counters_.left_out;
    return false;
  }
  client.waiting += message;
  write(client, now);
  return true;
}

void Server::write(Client& client, TimePoint now) {
  while (!client.is_gone && client.written < client.waiting.size()) {
    const ssize_t count = ::send(client.descriptor, client.waiting.data() + client.written,
                                 client.waiting.size() - client.written, MSG_NOSIGNAL);
    if (count < 0) {
      client.is_gone = !would_wait(errno);
      return;
    }
    client.written += static_cast<std::size_t>(count);
    client.wrote_at = now;
  }
  client.waiting.clear();
  client.written = 0;
  client.wrote_at = now;
}

}  // namespace palpate::viewer::igtl
