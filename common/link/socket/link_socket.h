// link_socket.h — a ZeroMQ socket that is configured and attached to its endpoints.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/security/zap_handler.h"
#include "common/link/socket/alarm.h"
#include "common/link/socket/endpoint.h"
#include "common/link/socket/link_settings.h"
#include "common/link/socket/zmq_context.h"

namespace palpate {

// Hooks for schedulers of virtual time, as in MemoryLink: `on_send` runs after each message sent,
// `on_wait` replaces blocking.
using SendHook = std::function<void()>;
using WaitHook = std::function<void(TimePoint deadline)>;

/// The common part of all ends of links.
///
/// Real time: receiving and sending neither block nor throw; the constructor throws SetupError. A
/// socket is used by one thread at a time.
class LinkSocket {
 public:
  /// Throws SetupError; also for tcp beyond loopback if the context's rules forbid it.
  LinkSocket(ZmqContext& context, const LinkSettings& settings,
             const std::vector<Attachment>& attachments);

  /// The endpoint attached last, as libzmq reports it, with the actual port instead of "*".
  [[nodiscard]] const std::string& endpoint() const { return endpoint_; }

  [[nodiscard]] void* handle() noexcept { return socket_.handle(); }
  /// Reads the next part; false if there is none.
  [[nodiscard]] bool receive(zmq::message_t& part) noexcept;
  /// Discards the remaining parts of a message; false if `part` was the last one.
  bool drop_more_parts(const zmq::message_t& part) noexcept;
  [[nodiscard]] SendResult send(zmq::message_t& part, int flags) noexcept;
  /// Subscribers only: starts or stops receiving messages of this kind.
  void subscribe(MessageKind kind);
  void unsubscribe(MessageKind kind);
  /// `events`: ZMQ_POLLIN or ZMQ_POLLOUT.
  [[nodiscard]] bool is_ready(int events) noexcept;
  /// Returns when ready, on a signal, or at `deadline` to within the kernel's timer slack.
  void wait_until(int events, const Clock& clock, TimePoint deadline) noexcept;
  /// See Source::prepare_wait().
  void prepare_wait(TimePoint deadline) noexcept;
  /// Implements wait_until() of the ends; calls the hook instead of blocking if there is one.
  void wait_for_message(const WaitHook& on_wait, const Clock& clock, TimePoint deadline) noexcept;

 private:
  void protect(ZmqContext& context, const Attachment& attachment);
  void attach(const Attachment& attachment);
  bool sleep_until(const Clock& clock, TimePoint deadline) noexcept;

  std::optional<IpcClaim> claim_;  // outlives the socket
  zmq::socket_t socket_;
  ZapHandler::Watched watched_;  // destroyed before the socket
  std::string endpoint_;
  int descriptor_ = -1;
  Alarm alarm_;
  bool spins_;
  /// The last receive() found nothing, so that the descriptor will signal the next message.
  bool is_empty_ = false;
};

}  // namespace palpate
