// peer_watch.h — whether the connection of a socket with one peer is lost.
#pragma once

#include <zmq.hpp>

#include "common/link/socket/link_socket.h"
#include "common/link/socket/zmq_context.h"

namespace palpate {

/// Follows libzmq's events of one socket, ipc and tcp: the connection is lost from its end until
/// the next handshake. A process that is killed ends its connections at once; a stopped one only
/// through heartbeats, a vanished host through heartbeats or the keepalive of TCP.
class PeerWatch {
 public:
  /// @param socket  outlives this
  PeerWatch(ZmqContext& context, LinkSocket& socket);
  ~PeerWatch();
  PeerWatch(const PeerWatch&) = delete;
  PeerWatch& operator=(const PeerWatch&) = delete;

  /// Reads what has happened. Neither blocks nor throws.
  void update() noexcept;
  [[nodiscard]] bool is_lost() const noexcept { return is_lost_; }

 private:
  void* watched_;
  zmq::socket_t events_;
  zmq::message_t part_;
  bool is_lost_ = false;
};

}  // namespace palpate
