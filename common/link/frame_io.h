// SPDX-License-Identifier: Apache-2.0
// frame_io.h — internal header of the links: sends and receives the frames of a codec.
#pragma once

#include <cstddef>
#include <zmq.hpp>

#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/rejections.h"
#include "common/link/socket/frame_bytes.h"
#include "common/link/socket/link_socket.h"
#include "common/link/subscribers.h"

namespace palpate {

/// Refused frames per call of receive(): bounds the time that a flood of bad frames can take.
inline constexpr int kMaxRejectedPerCall = 16;

/// The frame of a message; empty if it is longer than kMaxFrameBytes.
template <class T>
zmq::message_t frame_of(Codec<T>& codec, const T& message) noexcept {
  const std::size_t size = codec.encode(message);
  if (size > kMaxFrameBytes<T>) return {};
  zmq::message_t frame(size);
  codec.write(static_cast<std::byte*>(frame.data()));
  return frame;
}

/// kDropped: the frame is longer than kMaxFrameBytes, or the queue is full.
template <class T>
SendResult send_frame(LinkSocket& socket, Codec<T>& codec, const T& message) noexcept {
  zmq::message_t frame = frame_of(codec, message);
  return frame.empty() ? SendResult::kDropped : socket.send(frame, 0);
}

/// The same to all that want T. kNoPeer: none does; the message was not encoded.
template <class T>
SendResult send_frame(Subscribers& subscribers, Codec<T>& codec, const T& message) noexcept {
  subscribers.take();
  if (!subscribers.has(kKindOf<T>)) return SendResult::kNoPeer;
  zmq::message_t frame = frame_of(codec, message);
  return frame.empty() ? SendResult::kDropped : subscribers.send(kKindOf<T>, frame);
}

/// The next valid message of a socket; false if there is none.
template <class T>
bool receive_frame(LinkSocket& socket, Codec<T>& codec, zmq::message_t& frame,
                   Rejections& rejections, T& message) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall; ++i) {
    const Reception reception = socket.receive(frame);
    if (reception == Reception::kNothing) return false;
    const DecodeError error = reception == Reception::kMalformed
                                  ? DecodeError::kMalformed
                                  : codec.decode(bytes_of(frame), message);
    if (error == DecodeError::kNone) return true;
    rejections.count(error, codec.peer_major());
  }
  return false;
}

}  // namespace palpate
