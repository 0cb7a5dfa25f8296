// SPDX-License-Identifier: Apache-2.0
// exchange_server.h — mofc_node's end of hops 1 and 4.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/rejections.h"
#include "common/link/socket/link_socket.h"

namespace palpate {

/// Answers are sent to the device whose state was accepted last.
///
/// Serves one device at a time: states of another one are refused and counted until the first has
/// been silent for kSilence or its connection has ended. A device that reconnects is recognised by
/// its session id and continues to be served.
class ExchangeServer final : public Source<DeviceState>, public Sender<ForceCommand> {
 public:
  static constexpr Duration kSilence = std::chrono::seconds(1);
  /// While another device sends states, the connection of the first is tested at this interval.
  static constexpr Duration kTryInterval = std::chrono::milliseconds(10);

  ExchangeServer(ZmqContext& context, const Clock& clock, const Attachment& attachment);

  SendHook on_send;
  WaitHook on_wait;

  [[nodiscard]] bool receive(DeviceState& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }
  /// kNoPeer: no device is connected. Another device may then be served at once.
  SendResult send(const ForceCommand& message) noexcept override;

  [[nodiscard]] const Rejections& rejections() const { return rejections_; }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  [[nodiscard]] bool admit(const DeviceState& message, TimePoint now) noexcept;
  [[nodiscard]] bool has_left(TimePoint now) noexcept;

  const Clock& clock_;
  LinkSocket socket_;
  Codec<DeviceState> states_;
  Codec<ForceCommand> commands_;
  zmq::message_t peer_;  // sender of `frame_`
  zmq::message_t frame_;
  Rejections rejections_;

  // the device being served
  bool is_serving_ = false;
  zmq::message_t served_peer_;
  std::uint64_t served_session_id_ = 0;
  TimePoint heard_at_{};
  std::optional<ForceCommand> answer_;  // the last one to it
  TimePoint next_try_at_{};
};

}  // namespace palpate
