// SPDX-License-Identifier: Apache-2.0
// frame_bytes.h — the bytes of a ZeroMQ message.
#pragma once

#include <cstddef>
#include <span>
#include <zmq.hpp>

namespace palpate {

[[nodiscard]] inline std::span<const std::byte> bytes_of(const zmq::message_t& frame) {
  return {static_cast<const std::byte*>(frame.data()), frame.size()};
}

}  // namespace palpate
