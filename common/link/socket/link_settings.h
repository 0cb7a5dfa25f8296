// link_settings.h — socket options of every link, as listed in proto/README.md.
#pragma once

#include <cstdint>
#include <zmq.hpp>

namespace palpate {

// --- common to all links ----------------------------------------------------------------------

inline constexpr int kReconnectMs = 10;
/// A connection attempt or handshake that takes longer is aborted and repeated.
inline constexpr int kConnectMs = 500;
inline constexpr int kHandshakeMs = 2000;
/// For sockets with heartbeats. A peer that misses three heartbeats is disconnected.
inline constexpr int kHeartbeatMs = 100;
inline constexpr int kHeartbeatTimeoutMs = 300;
/// A TCP peer that acknowledges nothing for this long is disconnected.
inline constexpr int kTcpMaxRetransmitMs = 500;
/// TCP keepalive detects a vanished host: after one second of silence three probes.
inline constexpr int kTcpKeepaliveSeconds = 1;
inline constexpr int kTcpKeepaliveProbes = 3;

/// Over inproc nothing may be lost: in lockstep many messages may be sent before the receiver runs.
inline constexpr int kInprocQueue = 1000;

/// libzmq disconnects a peer that announces a longer frame before it allocates memory for it. The
/// limits exceed kMaxFrameBytes, so that a moderately oversized frame reaches the codec, which
/// counts and explains it.
inline constexpr std::int64_t kLargestFrameBytes = std::int64_t{2} << 20;
inline constexpr std::int64_t kLargestFrameOfHop5Bytes = std::int64_t{17} << 20;

// --- options of one socket --------------------------------------------------------------------

struct LinkSettings {
  zmq::socket_type type;
  int send_queue = 0;      ///< messages per peer; 0: no limit
  int receive_queue = 0;   ///< messages per peer; 0: no limit
  int buffer_bytes = 0;    ///< kernel buffer in each direction (tcp); 0: the system's default
  int linger_ms = 0;       ///< time for sending the last messages after closing
  bool conflates = false;  ///< keeps only the newest message
  bool heartbeats = false;
  bool subscribes_to_all = true;  ///< subscriber: receives every kind of message from the start
  /// Publisher: is notified of every subscription, not only of the first one to each topic.
  bool reports_every_subscription = false;
  std::int64_t largest_frame_bytes = kLargestFrameBytes;
};

/// How an incoming one-way link treats messages that arrive faster than they are read.
enum class Delivery : std::uint8_t {
  kNewest,  ///< the socket keeps only the newest one
  kEvery,   ///< they are queued, so that a fault line behind the socket receives each of them
};

// Hops 1 and 4. For every half queue of messages libzmq signals the other thread, which wakes a
// waiting thread: with a queue of 8 every fourth answer took 20 µs longer. ExchangeClient keeps the
// number of queued messages small.
inline constexpr LinkSettings kExchangeServer{
    .type = zmq::socket_type::router, .send_queue = 4096, .receive_queue = 4096};
inline constexpr LinkSettings kExchangeClient{
    .type = zmq::socket_type::dealer, .send_queue = 4096, .receive_queue = 4096};

// Hops 2, 3 and 6. Short queues and kernel buffers: messages that wait in them are outdated on
// arrival.
inline constexpr LinkSettings kOneWaySender{
    .type = zmq::socket_type::xpub, .send_queue = 4, .receive_queue = 4, .buffer_bytes = 8 << 10};
/// kEvery has no heartbeats. libzmq up to 4.3.5 aborts the process if heartbeats replace a
/// connection whose receive queue is full and the queue is read then (libzmq issue 3937). So
/// receivers that may lag behind have no heartbeats, nor have publishers, since their peers may
/// send them anything.
[[nodiscard]] constexpr LinkSettings one_way_receiver(Delivery delivery) {
  LinkSettings settings = kOneWaySender;
  settings.type = zmq::socket_type::sub;
  settings.conflates = delivery == Delivery::kNewest;
  settings.heartbeats = delivery == Delivery::kNewest;
  if (delivery == Delivery::kEvery) settings.receive_queue = 64;
  return settings;
}

// Hop 5. A closing node lingers so that its last batch is sent. No heartbeats: see
// one_way_receiver().
inline constexpr LinkSettings kTelemetrySender{.type = zmq::socket_type::xpub,
                                               .send_queue = 8,
                                               .receive_queue = 8,
                                               .buffer_bytes = 64 << 10,
                                               .linger_ms = 200};
/// physics_node. The queue holds the meshes of all tissues of a scene, which are sent at once.
inline constexpr LinkSettings kSceneSender = [] {
  LinkSettings settings = kTelemetrySender;
  settings.send_queue = 32;
  settings.reports_every_subscription = true;
  return settings;
}();
/// The queue holds 0.7 s of three nodes and a mesh, for the time in which a viewer starts.
inline constexpr LinkSettings kTelemetrySubscriber = [] {
  LinkSettings settings = kTelemetrySender;
  settings.type = zmq::socket_type::sub;
  settings.receive_queue = 128;
  settings.subscribes_to_all = false;
  settings.largest_frame_bytes = kLargestFrameOfHop5Bytes;
  return settings;
}();

/// PlotJuggler's port: the ticks of four seconds at 1 kHz.
inline constexpr LinkSettings kPlotSender{.type = zmq::socket_type::pub, .send_queue = 4000};

}  // namespace palpate
