// SPDX-License-Identifier: Apache-2.0
// hidden_lesions.h — what a viewer passes on of hop 5 while a person searches for lesions or pushes
// a needle through layers: nothing that tells where these are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/link/codec/codec.h"
#include "common/session/session.h"
#include "common/telemetry/telemetry_message.h"

namespace palpate::viewer {

/// Between what is received and every way out of viewer_node: page, Foxglove, relay, OpenIGTLink.
///
/// Until reveal() a scene has neither the session's text, nor the surfaces of parts, nor the
/// stiffness of places; a frame has no strain, and frames of parts are left out. Of the layers of a
/// needle only the outermost has a surface. Of a session without such a task everything passes as
/// it is.
class HiddenLesions {
 public:
  /// A message and its encoding, valid until the next call.
  struct Passed {
    const TelemetryMessage* message = nullptr;
    std::span<const std::byte> payload{};
  };

  explicit HiddenLesions(const Session& session);

  /// What may be seen of the message; none: nothing.
  /// @param payload  the message as received
  [[nodiscard]] std::optional<Passed> pass(const TelemetryMessage& message,
                                           std::span<const std::byte> payload);
  /// From now on everything passes. Returns the whole scene, which is new for everybody, if it has
  /// been received.
  [[nodiscard]] std::optional<Passed> reveal();
  [[nodiscard]] bool is_hiding() const { return hides_ && !is_revealed_; }

 private:
  /// A scene and its frames have another number once it is whole, so that nobody takes it for the
  /// one that he has.
  [[nodiscard]] std::uint64_t number_of(std::uint64_t revision) const {
    return 2 * revision + (is_revealed_ ? 1 : 0);
  }
  template <class T>
  [[nodiscard]] Passed encoded(Codec<T>& codec, T message);
  [[nodiscard]] Passed scene_now();

  bool hides_;
  std::size_t tissues_;                // of the session: parts come after them
  std::vector<std::uint32_t> hidden_;  // of these
  bool is_revealed_ = false;
  std::optional<SceneState> whole_;
  TelemetryMessage message_;
  std::string payload_;
  Codec<SceneState> scenes_;
  Codec<MeshFrame> frames_;
};

}  // namespace palpate::viewer
