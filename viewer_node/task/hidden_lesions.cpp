// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/task/hidden_lesions.h"

#include <algorithm>
#include <utility>

#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {

HiddenLesions::HiddenLesions(const Session& session)
    : hides_(session.task && session.task->hides_places()), tissues_(session.scene.tissues.size()) {
  const NeedleTask* needle = session.task ? session.task->needle() : nullptr;
  if (needle == nullptr) return;
  for (const NeedleLayer& layer : needle->layers) hidden_.push_back(layer.tissue);
  hidden_.erase(hidden_.begin());  // the outermost is seen
}

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
    for (const std::uint32_t layer : hidden_) {
      if (layer < scene.tissues.size()) scene.tissues[layer].mesh = {};
    }
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
  const bool is_hidden = frame->tissue >= tissues_ ||
                         std::find(hidden_.begin(), hidden_.end(), frame->tissue) != hidden_.end();
  if (!is_revealed_ && is_hidden) return std::nullopt;
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
