// SPDX-License-Identifier: Apache-2.0
// server.h — clients of OpenIGTLink on this machine. Never waits for one: what a client does not
// read is left out, and what it sends is read in small parts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <string>

#include "common/core/time.h"
#include "common/process/tcp_port.h"
#include "viewer_node/openigtlink/message.h"
#include "viewer_node/openigtlink/reader.h"

namespace palpate::viewer::igtl {

/// As Slicer expects it.
inline constexpr std::uint16_t kPort = 18944;
inline constexpr std::size_t kMostClients = 8;
/// That wait for a client which does not read.
inline constexpr std::size_t kMostWaitingBytes = std::size_t{256} * 1024;
/// Read from a client in a call of pump().
inline constexpr std::size_t kMostReadBytes = std::size_t{64} * 1024;
/// A client that reads nothing of what waits for so long is disconnected.
inline constexpr Duration kStalledAfter = std::chrono::seconds(10);

struct Client {
  std::uint64_t id = 0;
  Pose image_of_world = Pose::Identity();  ///< its registration
  bool is_new = true;                      ///< nothing was sent to it yet
  std::string reply{};                     ///< to what it sent, the newest; empty: none is due
  TimePoint reply_after{};

  // of the server
  int descriptor = -1;
  std::string waiting{};  ///< to be written
  std::size_t written = 0;
  TimePoint wrote_at{};
  Reader reader{};
  bool is_gone = false;
};

/// Bound to 127.0.0.1. One thread.
class Server {
 public:
  /// @param port  0: any that is free   @throws SetupError  it is in use
  explicit Server(std::uint16_t port);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_.port(); }

  /// @see Reader; both before the first call of pump()
  std::function<void(Client&, const Header&, const std::string& body)> on_message;
  std::function<bool(const Header&)> wants;

  /// Accepts, reads and writes what is possible at once.
  void pump(TimePoint now);
  /// Writes what is possible at once; the rest waits. Left out, false: too much waits already.
  bool send(Client& client, const std::string& message, TimePoint now);

  [[nodiscard]] std::list<Client>& clients() { return clients_; }
  struct Counters {
    std::uint64_t accepted = 0;
    std::uint64_t refused = 0;   ///< beyond kMostClients
    std::uint64_t left_out = 0;  ///< messages
    std::uint64_t invalid = 0;   ///< clients disconnected for what is no header
    std::uint64_t stalled = 0;   ///< clients disconnected that did not read
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  void accept(TimePoint now);
  void read(Client& client);
  void write(Client& client, TimePoint now);

  ListeningPort port_;
  std::list<Client> clients_;
  Counters counters_;
  std::uint64_t next_id_ = 1;
};

}  // namespace palpate::viewer::igtl
