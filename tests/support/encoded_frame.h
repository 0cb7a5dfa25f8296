// SPDX-License-Identifier: Apache-2.0
// encoded_frame.h — the bytes that a link would send of a message.
#pragma once

#include <cstddef>
#include <string>

#include "common/link/codec/codec.h"

namespace palpate::test {

template <class T>
[[nodiscard]] std::string frame_of(const T& message) {
  Codec<T> codec;
  std::string frame(codec.encode(message), '\0');
  codec.write(reinterpret_cast<std::byte*>(frame.data()));
  return frame;
}

}  // namespace palpate::test
