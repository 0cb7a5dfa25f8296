#include "common/link/socket/peer_watch.h"

#include <atomic>
#include <cstdint>
#include <cstring>
#include <string>

#include "common/core/check.h"

namespace palpate {

PeerWatch::PeerWatch(ZmqContext& context, LinkSocket& socket)
    : watched_(socket.handle()), events_(context.get(), zmq::socket_type::pair) {
  static std::atomic<int> next{0};
  const std::string endpoint = "inproc://peer_watch." + std::to_string(next++);
  const int events = ZMQ_EVENT_HANDSHAKE_SUCCEEDED | ZMQ_EVENT_DISCONNECTED;
  PALPATE_REQUIRE(zmq_socket_monitor(watched_, endpoint.c_str(), events) == 0);
  events_.set(zmq::sockopt::linger, 0);
  events_.connect(endpoint);
}

PeerWatch::~PeerWatch() { zmq_socket_monitor(watched_, nullptr, 0); }

void PeerWatch::update() noexcept {
  // two parts: 16 bits of event, 32 of value; then the address
  while (zmq_msg_recv(part_.handle(), events_.handle(), ZMQ_DONTWAIT) >= 0) {
    std::uint16_t event = 0;
    if (part_.size() >= sizeof(event)) std::memcpy(&event, part_.data(), sizeof(event));
    while (part_.more() && zmq_msg_recv(part_.handle(), events_.handle(), ZMQ_DONTWAIT) >= 0) {
    }
    if (event == ZMQ_EVENT_DISCONNECTED) is_lost_ = true;
    if (event == ZMQ_EVENT_HANDSHAKE_SUCCEEDED) is_lost_ = false;
  }
}

}  // namespace palpate
