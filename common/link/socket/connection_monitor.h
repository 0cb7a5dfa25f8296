// SPDX-License-Identifier: Apache-2.0
// connection_monitor.h — follows the connections of the sockets of one ZeroMQ context, in a thread
// of its own, which also answers ZAP requests.
//
// libzmq by itself
//   - never connects again after the other end violated the protocol: the monitor makes the
//   socket's
//     thread do so;
//   - stores the parts of an unfinished message without limit: the monitor ends a tcp connection
//     that has sent too much of it;
//   - reports refused handshakes to a monitor only: they are counted.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <zmq.hpp>

#include "common/core/time.h"
#include "common/link/security/refused_peers.h"
#include "common/link/security/zap_handler.h"

namespace palpate {

/// Connections to one binding socket over tcp; further ones are ended at once.
inline constexpr std::size_t kMostConnections = 64;
/// Interval of the test of tcp connections for too many bytes.
inline constexpr Duration kTrafficInterval = std::chrono::milliseconds(20);
/// A connection that libzmq has given up is replaced after this time, then after twice as long and
/// so on up to kReconnectMost, until one has lasted kReconnectReset.
inline constexpr Duration kReconnectLeast = std::chrono::milliseconds(50);
inline constexpr Duration kReconnectMost = std::chrono::milliseconds(800);
inline constexpr Duration kReconnectReset = std::chrono::seconds(1);

/// What the thread of a socket and the monitor tell each other. Neither blocks.
struct Connections {
  // written by the monitor
  std::atomic<std::uint32_t> established{0};  ///< handshakes that succeeded so far
  std::atomic<bool> is_connected{false};      ///< for sockets with one peer
  std::atomic<bool> is_lost{false};         ///< for sockets with one peer: the connection has ended
  std::atomic<bool> must_reconnect{false};  ///< libzmq has given up; cleared by the socket's thread
  // written by the socket's thread
  std::atomic<std::uint32_t> emptied{0};  ///< times that it found nothing more to read
  /// Messages read, by file descriptor of their connection modulo the size.
  std::array<std::atomic<std::uint32_t>, 1024> read_from{};
};

class ConnectionMonitor {
 public:
  struct Watch {
    std::string_view link;  ///< for counters; outlives the monitor
    bool binds = false;
    bool has_keys = false;
    bool is_tcp = false;
    /// Bytes that may arrive without a complete message, once the socket has been read empty.
    std::int64_t most_unread_bytes = 0;
    /// The same while the socket is not being read.
    std::int64_t most_queued_bytes = 0;
    bool is_never_read = false;  ///< the first limit always applies
  };

  /// @param zap          null without keys
  /// @param is_realtime  libzmq reads in a SCHED_FIFO thread: takes the least of those priorities,
  ///                     so that ordinary programs do not delay the end of a flood
  ConnectionMonitor(zmq::context_t& context, RefusedPeers& refused, std::optional<ZapHandler>& zap,
                    bool is_realtime);
  ~ConnectionMonitor();
  ConnectionMonitor(const ConnectionMonitor&) = delete;
  ConnectionMonitor& operator=(const ConnectionMonitor&) = delete;

  /// Ends the monitoring of a socket; to be called before the socket is closed.
  struct StopWatching {
    void operator()(void* socket) const noexcept;
  };
  using Watched = std::unique_ptr<void, StopWatching>;
  /// To be called before the socket is attached.
  [[nodiscard]] Watched watch(zmq::socket_t& socket, const Watch& what,
                              std::shared_ptr<Connections> connections);
  /// Sockets that are being monitored. A closed socket is removed shortly after. Any thread.
  [[nodiscard]] int sockets() const { return sockets_.load(std::memory_order_relaxed); }

 private:
  struct Monitor;

  void run();
  void take_events(Monitor& monitor, TimePoint now);
  void take_event(Monitor& monitor, std::uint16_t event, std::uint32_t value,
                  const std::string& address, TimePoint now);
  void limit_traffic(Monitor& monitor);

  zmq::context_t& context_;
  RefusedPeers& refused_;
  std::optional<ZapHandler>& zap_;
  std::mutex mutex_;  // protects the next four
  zmq::socket_t wake_;
  std::list<Monitor> new_monitors_;
  bool is_stopping_ = false;
  int monitors_made_ = 0;
  std::atomic<int> sockets_{0};
  zmq::socket_t woken_;
  std::thread thread_;
};

}  // namespace palpate
