// SPDX-License-Identifier: Apache-2.0
#include "common/link/socket/connection_monitor.h"

#include <linux/tcp.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sched.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"

namespace palpate {
namespace {

constexpr const char* kWakeEndpoint = "inproc://palpate.monitor.wake";
constexpr auto kRelaxed = std::memory_order_relaxed;

/// MONITOR_STOPPED reports that a socket was closed, so that its monitor is removed.
///
/// HANDSHAKE_FAILED_PROTOCOL must not be among them: libzmq 4.3.4 and 4.3.5 set errno to EPROTO
/// where a message of CURVE cannot be decrypted, but sending this event replaces it by EAGAIN. The
/// connection then stays open and is never read again.
constexpr int kServerEvents = ZMQ_EVENT_ACCEPTED | ZMQ_EVENT_DISCONNECTED |
                              ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL |
                              ZMQ_EVENT_HANDSHAKE_FAILED_AUTH | ZMQ_EVENT_MONITOR_STOPPED;
constexpr int kClientEvents = kServerEvents | ZMQ_EVENT_CONNECTED | ZMQ_EVENT_CONNECT_RETRIED;

/// Bytes received over a tcp connection so far; nullopt if the descriptor is none (any more).
std::optional<std::uint64_t> bytes_received(int descriptor) {
  tcp_info info{};
  socklen_t size = sizeof(info);
  if (getsockopt(descriptor, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return std::nullopt;
  return info.tcpi_bytes_received;
}

}  // namespace

/// The monitor of one socket and the state of its connections.
struct ConnectionMonitor::Monitor {
  struct Connection {
    std::uint64_t outcomes_before = 0;  // the monitor's `outcomes` when it began
    std::uint64_t bytes = 0;            // received until the last test
    std::uint32_t read = 0;             // messages read until the last test
    std::int64_t unread_bytes = 0;      // received since the last message that was read
  };

  zmq::socket_t events;
  Watch what;
  std::shared_ptr<Connections> shared;
  bool has_ended = false;
  std::uint64_t outcomes = 0;               // handshakes that succeeded or failed
  std::map<int, Connection> connections{};  // by descriptor
  std::uint32_t emptied = 0;                // until the last test

  // connecting ends
  bool is_counted = false;  // the failure of the present connection
  std::optional<TimePoint> given_up_at{};
  TimePoint connected_at{};
  Duration reconnect_after = kReconnectLeast;
};

void ConnectionMonitor::StopWatching::operator()(void* socket) const noexcept {
  zmq_socket_monitor(socket, nullptr, 0);
}

ConnectionMonitor::ConnectionMonitor(zmq::context_t& context, RefusedPeers& refused,
                                     std::optional<ZapHandler>& zap, bool is_realtime)
    : context_(context),
      refused_(refused),
      zap_(zap),
      wake_(context, zmq::socket_type::pair),
      woken_(context, zmq::socket_type::pair) {
  for (zmq::socket_t* socket : {&wake_, &woken_}) socket->set(zmq::sockopt::linger, 0);
  woken_.bind(kWakeEndpoint);
  wake_.connect(kWakeEndpoint);
  thread_ = std::thread([this, is_realtime] {
    const sched_param least{.sched_priority = sched_get_priority_min(SCHED_FIFO)};
    if (is_realtime) pthread_setschedparam(pthread_self(), SCHED_FIFO, &least);
    run();
  });
}

ConnectionMonitor::~ConnectionMonitor() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
    wake_.send(zmq::message_t(), zmq::send_flags::none);
  }
  thread_.join();
}

ConnectionMonitor::Watched ConnectionMonitor::watch(zmq::socket_t& socket, const Watch& what,
                                                    std::shared_ptr<Connections> connections) {
  const std::lock_guard lock(mutex_);
  const std::string endpoint = "inproc://palpate.monitor" + std::to_string(monitors_made_++);
  PALPATE_REQUIRE(zmq_socket_monitor(socket.handle(), endpoint.c_str(),
                                     what.binds ? kServerEvents : kClientEvents) == 0);
  Watched watched(socket.handle());
  Monitor& monitor =
      new_monitors_.emplace_back(Monitor{.events = zmq::socket_t(context_, zmq::socket_type::pair),
                                         .what = what,
                                         .shared = std::move(connections)});
  monitor.events.set(zmq::sockopt::linger, 0);
  monitor.events.set(zmq::sockopt::rcvhwm, 0);  // a full queue would block libzmq's I/O thread
  monitor.events.connect(endpoint);
  sockets_.fetch_add(1, kRelaxed);
  wake_.send(zmq::message_t(), zmq::send_flags::none);
  return watched;
}

void ConnectionMonitor::run() {
  const SteadyClock clock;
  std::list<Monitor> monitors;
  std::vector<zmq_pollitem_t> items;
  std::vector<std::string> parts;
  TimePoint next_test{};
  for (;;) {
    items.assign({{woken_.handle(), 0, ZMQ_POLLIN, 0}});
    if (zap_) items.push_back({zap_->requests().handle(), 0, ZMQ_POLLIN, 0});
    TimePoint due = TimePoint::max();
    for (Monitor& monitor : monitors) {
      items.push_back({monitor.events.handle(), 0, ZMQ_POLLIN, 0});
      if (!monitor.connections.empty() && monitor.what.is_tcp) due = std::min(due, next_test);
      if (monitor.given_up_at) due = std::min(due, *monitor.given_up_at + monitor.reconnect_after);
    }
    const auto wait =
        std::chrono::ceil<std::chrono::milliseconds>(std::max(due - clock.now(), Duration::zero()));
    const long timeout = due == TimePoint::max() ? -1 : static_cast<long>(wait.count());
    if (zmq_poll(items.data(), static_cast<int>(items.size()), timeout) < 0) continue;  // a signal

    if (zap_) zap_->answer();
    const TimePoint now = clock.now();
    for (Monitor& monitor : monitors) take_events(monitor, now);
    if (now >= next_test) {
      next_test = now + kTrafficInterval;
      for (Monitor& monitor : monitors) {
        if (monitor.what.is_tcp) limit_traffic(monitor);
      }
    }
    const auto ended = monitors.remove_if([](const Monitor& monitor) { return monitor.has_ended; });
    sockets_.fetch_sub(static_cast<int>(ended), kRelaxed);
    while (receive_parts(woken_, parts)) {
      const std::lock_guard lock(mutex_);
      monitors.splice(monitors.end(), new_monitors_);
      if (is_stopping_) return;
    }
  }
}

void ConnectionMonitor::take_events(Monitor& monitor, TimePoint now) {
  // event and value, then the endpoint
  std::vector<std::string> parts;
  while (receive_parts(monitor.events, parts)) {
    std::uint16_t event = 0;
    std::uint32_t value = 0;
    if (parts.size() != 2 || parts[0].size() != sizeof(event) + sizeof(value)) continue;
    std::memcpy(&event, parts[0].data(), sizeof(event));
    std::memcpy(&value, parts[0].data() + sizeof(event), sizeof(value));
    take_event(monitor, event, value, monitor.what.binds ? "" : parts[1], now);
  }
  if (monitor.given_up_at && now >= *monitor.given_up_at + monitor.reconnect_after) {
    monitor.given_up_at.reset();
    monitor.reconnect_after = std::min(2 * monitor.reconnect_after, kReconnectMost);
    monitor.shared->must_reconnect.store(true, std::memory_order_release);
    if (!monitor.is_counted) refused_.count(monitor.what.link, Refusal::kOtherBroken, "");
  }
}

void ConnectionMonitor::take_event(Monitor& monitor, std::uint16_t event, std::uint32_t value,
                                   const std::string& address, TimePoint now) {
  const bool binds = monitor.what.binds;
  const int descriptor = static_cast<int>(value);
  std::optional<Refusal> refusal;
  switch (event) {
    case ZMQ_EVENT_ACCEPTED:
    case ZMQ_EVENT_CONNECTED:
      monitor.connections[descriptor] = {
          .outcomes_before = monitor.outcomes,
          .read =
              monitor.shared->read_from[value % monitor.shared->read_from.size()].load(kRelaxed)};
      monitor.given_up_at.reset();
      monitor.is_counted = false;
      if (binds && monitor.what.is_tcp && monitor.connections.size() > kMostConnections) {
        shutdown(descriptor, SHUT_RDWR);
        refused_.count(monitor.what.link, Refusal::kTooMany, address);
      }
      break;
    case ZMQ_EVENT_CONNECT_RETRIED:
      monitor.given_up_at.reset();
      break;
    case ZMQ_EVENT_DISCONNECTED: {
      // A handshake that violates the protocol has no outcome among the events. If connections
      // overlap, the outcome of another one may hide this: the count may then be too low, never too
      // high.
      const auto connection = monitor.connections.find(descriptor);
      if (connection != monitor.connections.end() &&
          connection->second.outcomes_before == monitor.outcomes) {
        refusal = binds ? Refusal::kBadHandshake : Refusal::kOtherUnknown;
      }
      if (connection != monitor.connections.end()) monitor.connections.erase(connection);
      if (binds) break;
      // CONNECT_RETRIED follows unless libzmq has given up
      monitor.given_up_at = now;
      if (now - monitor.connected_at >= kReconnectReset &&
          monitor.shared->is_connected.load(kRelaxed)) {
        monitor.reconnect_after = kReconnectLeast;
      }
      monitor.shared->is_connected.store(false, kRelaxed);
      monitor.shared->is_lost.store(true, kRelaxed);
      break;
    }
    case ZMQ_EVENT_HANDSHAKE_SUCCEEDED:
      ++monitor.outcomes;
      monitor.connected_at = now;
      monitor.shared->is_lost.store(false, kRelaxed);
      monitor.shared->is_connected.store(true, kRelaxed);
      monitor.shared->established.fetch_add(1, kRelaxed);
      break;
    case ZMQ_EVENT_HANDSHAKE_FAILED_AUTH:
      ++monitor.outcomes;
      if (!binds) refusal = Refusal::kRefusedByOther;  // binding ends: counted by the ZapHandler
      break;
    case ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL:
      ++monitor.outcomes;
      refusal = binds ? Refusal::kLeft : Refusal::kOtherUnknown;
      break;
    case ZMQ_EVENT_MONITOR_STOPPED:
      monitor.has_ended = true;
      break;
    default:
      break;
  }
  // without keys a failed handshake says little: only what is given up is counted, in take_events()
  if (!refusal || !monitor.what.has_keys) return;
  refused_.count(monitor.what.link, *refusal, address);
  monitor.is_counted = true;
}

/// Once the socket has been read empty, a connection holds of what came before one incomplete frame
/// at most, and what the kernel has not delivered. The parts of an incomplete message are neither
/// readable nor counted by libzmq's queue limit. So the connection that holds most is ended if all
/// together exceed the limit. What has come since the last test may have come after the reading.
void ConnectionMonitor::limit_traffic(Monitor& monitor) {
  const std::uint32_t emptied = monitor.shared->emptied.load(kRelaxed);
  const bool is_empty = std::exchange(monitor.emptied, emptied) != emptied;
  std::int64_t unread_bytes = 0;
  std::int64_t earlier_bytes = 0;  // of these, what had come by the last test
  std::pair<std::int64_t, int> most{0, -1};
  for (auto& [descriptor, connection] : monitor.connections) {
    const auto bytes = bytes_received(descriptor);
    if (!bytes) continue;
    const std::uint32_t read =
        monitor.shared
            ->read_from[static_cast<std::size_t>(descriptor) % monitor.shared->read_from.size()]
            .load(kRelaxed);
    const std::uint64_t before = std::exchange(connection.bytes, *bytes);
    if (std::exchange(connection.read, read) != read || *bytes < before) {
      connection.unread_bytes = 0;
    } else {
      earlier_bytes += connection.unread_bytes;
      connection.unread_bytes += static_cast<std::int64_t>(*bytes - before);
    }
    unread_bytes += connection.unread_bytes;
    most = std::max(most, {connection.unread_bytes, descriptor});
  }
  const std::int64_t incomplete_bytes = monitor.what.is_never_read ? unread_bytes
                                        : is_empty                 ? earlier_bytes
                                                                   : 0;
  if (incomplete_bytes <= monitor.what.most_unread_bytes &&
      unread_bytes <= monitor.what.most_queued_bytes) {
    return;
  }
  shutdown(most.second, SHUT_RDWR);
  refused_.count(monitor.what.link, Refusal::kTooMuch, "");
}

}  // namespace palpate
