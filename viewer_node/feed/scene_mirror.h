// scene_mirror.h — the scene as physics_node tells it, kept for viewers that come later.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "common/core/scene_messages.h"

namespace palpate::viewer {

class SceneMirror {
 public:
  /// Replaces everything, also by a scene of a restarted physics_node.
  void take(const SceneState& scene);
  /// False, and nothing changes: before the scene, of another scene, or of vertices that are not
  /// there.
  bool take(const MeshFrame& frame);

  /// None before the first.
  [[nodiscard]] const std::optional<SceneState>& scene() const { return scene_; }
  /// One frame for each tissue that ever moved: with all its vertices as they are now, if it gave
  /// way.
  [[nodiscard]] std::vector<MeshFrame> whole_frames() const;
  /// Vertices of a tissue where they are now; W: x,y,z,…
  [[nodiscard]] std::vector<float> vertices_m(std::size_t tissue) const;

  /// Everything is at rest: from now on no frame comes, or all will come anew.
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
