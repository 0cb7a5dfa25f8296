// SPDX-License-Identifier: Apache-2.0
#include "common/link/exchange_server.h"

#include "common/link/frame_io.h"

namespace palpate {

ExchangeServer::ExchangeServer(ZmqContext& context, const Clock& clock,
                               const Attachment& attachment)
    : clock_(clock), socket_(context, kExchangeServer, attachment) {}

bool ExchangeServer::admit(const DeviceState& message, TimePoint now) noexcept {
  const bool is_served =
      is_serving_ && (message.header.session_id == served_session_id_ || peer_ == served_peer_);
  if (!is_served && is_serving_ && now - heard_at_ < kSilence && !has_left(now)) return false;
  if (!is_served) answer_.reset();
  is_serving_ = true;
  served_session_id_ = message.header.session_id;
  served_peer_.copy(peer_);
  heard_at_ = now;
  return true;
}

/// libzmq reports the end of a connection only when sending. So the last answer is sent again; a
/// device that is still connected drops it as a duplicate.
bool ExchangeServer::has_left(TimePoint now) noexcept {
  if (!answer_ || now < next_try_at_) return false;
  next_try_at_ = now + kTryInterval;
  return send(*answer_) == SendResult::kNoPeer;
}

bool ExchangeServer::receive(DeviceState& message, TimePoint& received_at) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall; ++i) {
    const Reception reception = socket_.receive(frame_, &peer_);
    if (reception == Reception::kNothing) return false;
    const DecodeError error = reception == Reception::kMalformed
                                  ? DecodeError::kMalformed
                                  : states_.decode(bytes_of(frame_), message);
    if (error != DecodeError::kNone) {
      rejections_.count(error, states_.peer_major());
      continue;
    }
    const TimePoint now = clock_.now();
    if (!admit(message, now)) {
      rejections_.count_second_writer();
      continue;
    }
    received_at = now;
    return true;
  }
  return false;
}

void ExchangeServer::wait_until(TimePoint deadline) noexcept {
  socket_.wait_for_message(on_wait, clock_, deadline);
}

SendResult ExchangeServer::send(const ForceCommand& message) noexcept {
  if (!is_serving_) return SendResult::kNoPeer;
  zmq::message_t peer;
  peer.copy(served_peer_);
  SendResult result = socket_.send(peer, ZMQ_SNDMORE);
  if (result == SendResult::kSent) result = send_frame(socket_, commands_, message);
  if (result == SendResult::kSent) answer_ = message;
  if (result == SendResult::kNoPeer) is_serving_ = false;
  if (result == SendResult::kSent && on_send) on_send();
  return result;
}

}  // namespace palpate
