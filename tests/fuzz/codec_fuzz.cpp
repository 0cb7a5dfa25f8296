// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes for every decoder. An accepted message can be encoded again, and a second round
// trip does not change it.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/check.h"
#include "common/link/codec/codec.h"
#include "tests/support/random_messages.h"

namespace {

template <class T>
void decode(std::span<const std::byte> frame) {
  static palpate::Codec<T> codec;
  T message;
  const auto error = codec.decode(frame, message);
  PALPATE_REQUIRE(!palpate::explain(error, codec.peer_major()).empty());
  if (error != palpate::DecodeError::kNone) return;

  std::vector<std::byte> again(codec.encode(message));
  codec.write(again.data());
  T second;
  // encoding may need more bytes than the input, so that a large batch may exceed the limit
  const auto second_error = codec.decode(again, second);
  PALPATE_REQUIRE(second_error ==
                  (again.size() > palpate::kMaxFrameBytes<T> ? palpate::DecodeError::kTooLarge
                                                             : palpate::DecodeError::kNone));
  PALPATE_REQUIRE(second_error != palpate::DecodeError::kNone ||
                  palpate::test::same(message, second));
}

}  // namespace

/// The first byte of a frame selects its decoder; the frame is given to all of them.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto frame = std::as_bytes(std::span(data, size));
  decode<palpate::DeviceState>(frame);
  decode<palpate::ForceCommand>(frame);
  decode<palpate::ToolMotion>(frame);
  decode<palpate::Interaction>(frame);
  decode<palpate::DeviceBatch>(frame);
  decode<palpate::MofcBatch>(frame);
  decode<palpate::PhysicsBatch>(frame);
  decode<palpate::SceneState>(frame);
  decode<palpate::MeshFrame>(frame);
  decode<palpate::HandTarget>(frame);
  decode<palpate::RunState>(frame);
  decode<palpate::RunRequest>(frame);
  decode<palpate::TissueChange>(frame);
  decode<palpate::Acknowledgement>(frame);
  return 0;
}
