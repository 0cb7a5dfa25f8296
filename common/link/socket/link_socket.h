// SPDX-License-Identifier: Apache-2.0
// link_socket.h — a ZeroMQ socket that is configured and attached to its endpoints.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/link/socket/alarm.h"
#include "common/link/socket/connection_monitor.h"
#include "common/link/socket/endpoint.h"
#include "common/link/socket/link_settings.h"
#include "common/link/socket/zmq_context.h"

namespace palpate {

// Hooks for schedulers of virtual time, as in MemoryLink: `on_send` runs after each message sent,
// `on_wait` replaces blocking.
using SendHook = std::function<void()>;
using WaitHook = std::function<void(TimePoint deadline)>;

/// What LinkSocket::receive() found.
enum class Reception : std::uint8_t {
  kNothing,
  kMessage,
  kMalformed,  ///< a message of several parts, which is dropped
};

/// The common part of all ends of links: bound to one endpoint or connected to one.
///
/// A connecting socket connects again whenever libzmq has given up because the other end violated
/// the protocol; the next call of any function does so.
///
/// Real time: receiving and sending neither block nor throw; the constructor throws SetupError. A
/// socket is used by one thread at a time.
class LinkSocket {
 public:
  /// Throws SetupError; also for tcp beyond loopback if the context's rules forbid it.
  LinkSocket(ZmqContext& context, const LinkSettings& settings, const Attachment& attachment);

  /// As libzmq reports it, with the actual port instead of "*".
  [[nodiscard]] const std::string& endpoint() const { return endpoint_; }
  [[nodiscard]] bool is_inproc() const { return connections_ == nullptr; }
  /// Of a connecting socket, not over inproc: handshakes that have succeeded so far, whether there
  /// is a connection, and whether there was one that has ended. A process that is killed ends its
  /// connections at once; a vanished host only by the time-outs of TCP.
  [[nodiscard]] std::uint32_t established() const noexcept {
    return is_inproc() ? 0 : connections_->established.load(std::memory_order_relaxed);
  }
  [[nodiscard]] bool is_connected() const noexcept {
    return is_inproc() || connections_->is_connected.load(std::memory_order_relaxed);
  }
  [[nodiscard]] bool has_lost_peer() const noexcept {
    return !is_inproc() && connections_->is_lost.load(std::memory_order_relaxed);
  }

  /// See LinkSettings.
  [[nodiscard]] bool keeps_queues() const noexcept { return keeps_queues_; }

  /// SUB only: libzmq itself subscribes again when the socket reconnects.
  [[nodiscard]] bool has_topics() const noexcept { return has_topics_; }
  void set_topic(char topic, bool is_wanted) noexcept;

  [[nodiscard]] void* handle() noexcept { return socket_.handle(); }
  /// Signals that the state may have changed; see is_ready().
  [[nodiscard]] int descriptor() const noexcept { return descriptor_; }
  /// Reads the next message. Messages of several parts are dropped, at most kMostPartsPerCall parts
  /// in one call. @param peer  ROUTER only: receives its sender
  [[nodiscard]] Reception receive(zmq::message_t& frame, zmq::message_t* peer = nullptr) noexcept;
  [[nodiscard]] SendResult send(zmq::message_t& part, int flags) noexcept;
  /// `events`: ZMQ_POLLIN or ZMQ_POLLOUT.
  [[nodiscard]] bool is_ready(int events) noexcept;
  /// Returns when ready, on a signal, or at `deadline` to within the kernel's timer slack.
  void wait_until(int events, const Clock& clock, TimePoint deadline) noexcept;
  /// See Source::prepare_wait().
  void prepare_wait(TimePoint deadline) noexcept;
  /// Implements wait_until() of the ends; calls the hook instead of blocking if there is one.
  void wait_for_message(const WaitHook& on_wait, const Clock& clock, TimePoint deadline) noexcept;

 private:
  static constexpr int kMostPartsPerCall = 256;
  static constexpr Duration kConnectionPoll = std::chrono::milliseconds(1);

  void protect(ZmqContext& context);
  void attach();
  void reconnect_if_needed() noexcept;
  [[nodiscard]] bool may_send() const noexcept { return !must_be_connected_ || is_connected(); }
  [[nodiscard]] bool read(zmq::message_t& part) noexcept;
  [[nodiscard]] bool drop_rest() noexcept;
  bool sleep_until(const Clock& clock, TimePoint deadline) noexcept;

  Attachment attachment_;
  std::optional<IpcClaim> claim_;  // outlives the socket
  zmq::socket_t socket_;
  std::shared_ptr<Connections> connections_;  // null over inproc
  ConnectionMonitor::Watched watched_;        // destroyed before the socket
  std::string endpoint_;
  int descriptor_ = -1;
  Alarm alarm_;
  bool spins_;
  bool keeps_queues_;
  bool has_topics_;
  bool must_be_connected_;  // to send; libzmq would queue
  bool is_tcp_ = false;
  bool has_rest_ = false;  // of a message of several parts, still to be dropped
  /// The last read() found nothing, so that the descriptor will signal the next message.
  bool is_empty_ = false;
};

}  // namespace palpate
