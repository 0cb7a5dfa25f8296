// SPDX-License-Identifier: Apache-2.0
// link_settings.h — socket options of every link, as listed in docs/wire.md.
#pragma once

#include <cstdint>
#include <zmq.hpp>

namespace palpate {

// --- common to all links ----------------------------------------------------------------------
//
// No socket has heartbeats: libzmq up to 4.3.5 aborts the process if a heartbeat replaces a
// connection whose receive queue is full and the queue is read then (libzmq issue 3937). No socket
// conflates: libzmq aborts the process if a peer sends a message of several parts.

inline constexpr int kReconnectMs = 10;
/// A connection attempt or handshake that takes longer is aborted and repeated.
inline constexpr int kConnectMs = 500;
inline constexpr int kHandshakeMs = 2000;
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
inline constexpr std::int64_t kLargestFrameBytes = std::int64_t{16} << 10;
inline constexpr std::int64_t kLargestFrameOfHop5Bytes = std::int64_t{17} << 20;
/// For sockets that receive subscriptions only. CURVE's handshake needs 400 bytes.
inline constexpr std::int64_t kLargestSubscriptionBytes = std::int64_t{1} << 10;
/// What a tcp connection may have sent beyond one incomplete frame since its last complete message:
/// the kernel's buffers, and handshakes.
inline constexpr std::int64_t kMostIncompleteBytes = std::int64_t{256} << 10;

// --- options of one socket --------------------------------------------------------------------

struct LinkSettings {
  zmq::socket_type type;
  int send_queue = 0;     ///< messages per peer; 0: no limit
  int receive_queue = 0;  ///< messages per peer; 0: no limit
  int buffer_bytes = 0;   ///< kernel buffer in each direction (tcp); 0: the system's default
  int linger_ms = 0;      ///< time for sending the last messages after closing
  /// Connecting ends: what is sent without a connection waits for the next.
  bool keeps_queues = false;
  std::int64_t largest_frame_bytes = kLargestFrameBytes;
};

// Hops 1 and 4. For every half queue of messages libzmq signals the other thread, which wakes a
// waiting thread: with a queue of 8 every fourth answer took 20 µs longer. ExchangeClient keeps the
// number of queued messages small.
inline constexpr LinkSettings kExchangeServer{
    .type = zmq::socket_type::router, .send_queue = 512, .receive_queue = 512};
inline constexpr LinkSettings kExchangeClient{
    .type = zmq::socket_type::dealer, .send_queue = 512, .receive_queue = 512};

// Hops 2 and 6, where the receiver binds. Short queues and kernel buffers of the sender: messages
// that wait in them are outdated on arrival. The receiver reads its whole queue at once; it holds
// the motions of one step of a slow physics.
inline constexpr LinkSettings kOneWayReceiver{
    .type = zmq::socket_type::pull, .send_queue = 1, .receive_queue = 256, .buffer_bytes = 8 << 10};
inline constexpr LinkSettings kOneWaySender{.type = zmq::socket_type::push,
                                            .send_queue = 4,
                                            .receive_queue = 1,
                                            .buffer_bytes = 8 << 10,
                                            .largest_frame_bytes = kLargestSubscriptionBytes};

// Hop 3, where the sender binds.
inline constexpr LinkSettings kInteractionSender{.type = zmq::socket_type::router,
                                                 .send_queue = 4,
                                                 .receive_queue = 4,
                                                 .buffer_bytes = 8 << 10,
                                                 .largest_frame_bytes = kLargestSubscriptionBytes};
inline constexpr LinkSettings kInteractionReceiver{.type = zmq::socket_type::dealer,
                                                   .send_queue = 4,
                                                   .receive_queue = 256,
                                                   .buffer_bytes = 8 << 10};

// Hop 5. A closing node lingers so that its last batch is sent.
inline constexpr LinkSettings kTelemetrySender{.type = zmq::socket_type::router,
                                               .send_queue = 8,
                                               .receive_queue = 4,
                                               .buffer_bytes = 64 << 10,
                                               .linger_ms = 200,
                                               .largest_frame_bytes = kLargestSubscriptionBytes};
/// physics_node. The queue holds the meshes of all tissues of a scene, which are sent at once.
inline constexpr LinkSettings kSceneSender = [] {
  LinkSettings settings = kTelemetrySender;
  settings.send_queue = 32;
  return settings;
}();
/// The queue holds 2 s of one node and its meshes, for the time in which a viewer starts.
inline constexpr LinkSettings kTelemetryReceiver{.type = zmq::socket_type::dealer,
                                                 .send_queue = 4,
                                                 .receive_queue = 128,
                                                 .buffer_bytes = 64 << 10,
                                                 .keeps_queues = true,
                                                 .largest_frame_bytes = kLargestFrameOfHop5Bytes};

/// The relay of hop 5: libzmq's XPUB for the viewers that follow it. The queue holds 1 s of one
/// session. A follower may send kMostIncompleteBytes of topics.
inline constexpr LinkSettings kRelaySender{.type = zmq::socket_type::xpub,
                                           .send_queue = 256,
                                           .receive_queue = 64,
                                           .buffer_bytes = 64 << 10,
                                           .linger_ms = 200,
                                           .largest_frame_bytes = kLargestSubscriptionBytes};
inline constexpr LinkSettings kRelayReceiver{.type = zmq::socket_type::sub,
                                             .send_queue = 4,
                                             .receive_queue = 256,
                                             .buffer_bytes = 64 << 10,
                                             .keeps_queues = true,
                                             .largest_frame_bytes = kLargestFrameOfHop5Bytes};

/// PlotJuggler's port: the ticks of four seconds at 1 kHz. A subscriber may send
/// kMostIncompleteBytes of topics.
inline constexpr LinkSettings kPlotSender{.type = zmq::socket_type::pub,
                                          .send_queue = 4000,
                                          .receive_queue = 4,
                                          .largest_frame_bytes = kLargestSubscriptionBytes};

}  // namespace palpate
