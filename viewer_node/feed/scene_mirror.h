// SPDX-License-Identifier: Apache-2.0
// scene_mirror.h — the newest scene of physics_node and its motion, kept for viewers that connect
// later.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/core/scene_messages.h"

namespace palpate::viewer {

class SceneMirror {
 public:
  /// Replaces everything. False, and nothing changes, if the scene is known already: of the same
  /// session and revision.
  bool take(const SceneState& scene);
  /// False, and nothing changes, if the frame does not fit: before the scene, of another scene, or
  /// with vertices out of range.
  bool take(const MeshFrame& frame);

  /// None before the first.
  [[nodiscard]] const std::optional<SceneState>& scene() const { return scene_; }
  /// One frame for each tissue that has moved, with all its current vertices if it was deformed.
  [[nodiscard]] std::vector<MeshFrame> whole_frames() const;
  /// Current vertices of a tissue, W: x,y,z,…
  [[nodiscard]] std::vector<float> vertices_m(std::size_t tissue) const;

  /// Back to rest: for a subscription to frames that starts over.
  void forget_motion() { moved_.clear(); }

 private:
  struct Moved {
    std::size_t tissue = 0;
    MeshFrame newest;  // whole, or without vertices
  };
  [[nodiscard]] const Moved* moved(std::size_t tissue) const;

  std::optional<SceneState> scene_;
  std::vector<Moved> moved_;
};

}  // namespace palpate::viewer
