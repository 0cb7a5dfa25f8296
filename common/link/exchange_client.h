// SPDX-License-Identifier: Apache-2.0
// exchange_client.h — device_node's end of hops 1 and 4.
#pragma once

#include <cstdint>
#include <string>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/rejections.h"
#include "common/link/socket/link_socket.h"

namespace palpate {

/// Sends states and receives the answers to them.
class ExchangeClient final : public Sender<DeviceState>, public Source<ForceCommand> {
 public:
  /// After this many unanswered states, only every kSendOneIn-th one is sent, so that mofc_node
  /// finds no long backlog when it resumes.
  static constexpr std::uint64_t kMaxUnanswered = 256;
  static constexpr std::uint64_t kSendOneIn = 16;

  ExchangeClient(ZmqContext& context, const Clock& clock, const Attachment& attachment);

  SendHook on_send;
  WaitHook on_wait;

  /// kDropped: mofc_node is not connected, or kMaxUnanswered was exceeded.
  SendResult send(const DeviceState& message) noexcept override;
  [[nodiscard]] bool receive(ForceCommand& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  void prepare_wait(TimePoint deadline) noexcept override { socket_.prepare_wait(deadline); }
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  /// Waits in real time until mofc_node is connected; false after `timeout`.
  [[nodiscard]] bool wait_for_peer(Duration timeout) noexcept;
  [[nodiscard]] const Rejections& rejections() const { return rejections_; }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  const Clock& clock_;
  LinkSocket socket_;
  Codec<DeviceState> states_;
  Codec<ForceCommand> commands_;
  zmq::message_t frame_;
  Rejections rejections_;
  std::uint64_t unanswered_ = 0;  // states since the last answer or the last failure to send
};

}  // namespace palpate
