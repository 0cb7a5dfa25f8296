// frame_io.h — internal header of the links: sends and receives the frames of a codec.
#pragma once

#include <cstddef>
#include <zmq.hpp>

#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/rejections.h"
#include "common/link/socket/frame_bytes.h"
#include "common/link/socket/link_socket.h"

namespace palpate {

/// Refused frames per call of receive(): bounds the time that a flood of bad frames can take.
inline constexpr int kMaxRejectedPerCall = 16;

/// kDropped: the frame is longer than kMaxFrameBytes, or the queue is full.
template <class T>
SendResult send_frame(LinkSocket& socket, Codec<T>& codec, const T& message) noexcept {
  const std::size_t size = codec.encode(message);
  if (size > kMaxFrameBytes<T>) return SendResult::kDropped;
  zmq::message_t frame(size);
  codec.write(static_cast<std::byte*>(frame.data()));
  return socket.send(frame, 0);
}

/// The next valid message of a socket whose messages have one part; false if there is none.
template <class T>
bool receive_frame(LinkSocket& socket, Codec<T>& codec, zmq::message_t& frame,
                   Rejections& rejections, T& message) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall && socket.receive(frame); ++i) {
    const DecodeError error = socket.drop_more_parts(frame)
                                  ? DecodeError::kMalformed
                                  : codec.decode(bytes_of(frame), message);
    if (error == DecodeError::kNone) return true;
    rejections.count(error, codec.peer_major());
  }
  return false;
}

}  // namespace palpate
