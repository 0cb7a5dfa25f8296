// SPDX-License-Identifier: Apache-2.0
#include "common/link/exchange_client.h"

#include "common/link/frame_io.h"

namespace palpate {

ExchangeClient::ExchangeClient(ZmqContext& context, const Clock& clock,
                               const Attachment& attachment)
    : clock_(clock), socket_(context, kExchangeClient, attachment) {}

SendResult ExchangeClient::send(const DeviceState& message) noexcept {
  if (++unanswered_ > kMaxUnanswered && unanswered_ % kSendOneIn != 0) {
    return SendResult::kDropped;
  }
  const SendResult result = send_frame(socket_, states_, message);
  if (result != SendResult::kSent) unanswered_ = 0;
  if (result == SendResult::kSent && on_send) on_send();
  return result;
}

bool ExchangeClient::receive(ForceCommand& message, TimePoint& received_at) noexcept {
  if (!receive_frame(socket_, commands_, frame_, rejections_, message)) return false;
  unanswered_ = 0;
  received_at = clock_.now();
  return true;
}

void ExchangeClient::wait_until(TimePoint deadline) noexcept {
  socket_.wait_for_message(on_wait, clock_, deadline);
}

bool ExchangeClient::wait_for_peer(Duration timeout) noexcept {
  const SteadyClock clock;
  socket_.wait_until(ZMQ_POLLOUT, clock, clock.now() + timeout);
  return socket_.is_ready(ZMQ_POLLOUT);
}

}  // namespace palpate
