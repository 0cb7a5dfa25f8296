// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/task/hidden_lesions.h"

#include <algorithm>
#include <utility>

#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {

template <class T>
HiddenLesions::Passed HiddenLesions::encoded(Codec<T>& codec, T message) {
  payload_ = payload_of(codec, message);
  message_ = std::move(message);
  return {&message_, std::as_bytes(std::span(payload_))};
}

HiddenLesions::Passed HiddenLesions::scene_now() {
  SceneState scene = *whole_;
  scene.revision = number_of(scene.revision);
  if (!is_revealed_) {
    scene.session_text.clear();
    scene.tissues.resize(std::min(scene.tissues.size(), tissues_));
    for (TissueSurface& tissue : scene.tissues) tissue.vertex_stiffness_newton_per_m.clear();
  }
  return encoded(scenes_, std::move(scene));
}

std::optional<HiddenLesions::Passed> HiddenLesions::pass(const TelemetryMessage& message,
                                                         std::span<const std::byte> payload) {
  if (!hides_) return Passed{&message, payload};
  if (const auto* scene = std::get_if<SceneState>(&message)) {
    whole_ = *scene;
    return scene_now();
  }
  const auto* frame = std::get_if<MeshFrame>(&message);
  if (frame == nullptr) return Passed{&message, payload};
  if (!is_revealed_ && frame->tissue >= tissues_) return std::nullopt;
  MeshFrame passed = *frame;
  passed.scene_revision = number_of(passed.scene_revision);
  if (!is_revealed_) passed.vertex_strain.clear();
  return encoded(frames_, std::move(passed));
}

std::optional<HiddenLesions::Passed> HiddenLesions::reveal() {
  if (!is_hiding()) return std::nullopt;
  is_revealed_ = true;
  if (!whole_) return std::nullopt;
  return scene_now();
}

}  // namespace palpate::viewer
