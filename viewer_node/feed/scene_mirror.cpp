// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/scene_mirror.h"

#include <algorithm>

namespace palpate::viewer {

bool SceneMirror::take(const SceneState& scene) {
  const bool is_known = scene_ && scene_->header.session_id == scene.header.session_id &&
                        scene_->revision == scene.revision;
  if (is_known) return false;
  moved_.clear();
  scene_ = scene;
  return true;
}

bool SceneMirror::take(const MeshFrame& frame) {
  if (!scene_ || frame.header.session_id != scene_->header.session_id ||
      frame.scene_revision != scene_->revision || frame.tissue >= scene_->tissues.size()) {
    return false;
  }
  const std::vector<float>& rest_m = scene_->tissues[frame.tissue].mesh.vertices_m;
  const std::size_t first = 3 * std::size_t{frame.first_vertex};
  if (first > rest_m.size() || frame.vertices_m.size() > rest_m.size() - first) return false;

  auto it = std::find_if(moved_.begin(), moved_.end(),
                         [&](const Moved& m) { return m.tissue == frame.tissue; });
  if (it == moved_.end()) {
    it = moved_.insert(it, {.tissue = frame.tissue, .newest = {}});
  }
  MeshFrame& newest = it->newest;
  if (newest.vertices_m.empty() && !frame.vertices_m.empty()) newest.vertices_m = rest_m;
  newest.header = frame.header;
  newest.scene_revision = frame.scene_revision;
  newest.tissue = frame.tissue;
  newest.device_sequence = frame.device_sequence;
  newest.displacement_world_m = frame.displacement_world_m;
  std::copy(frame.vertices_m.begin(), frame.vertices_m.end(),
            newest.vertices_m.begin() + static_cast<std::ptrdiff_t>(first));
  if (!frame.vertex_strain.empty()) {
    newest.vertex_strain.resize(rest_m.size() / 3);
    std::copy(frame.vertex_strain.begin(), frame.vertex_strain.end(),
              newest.vertex_strain.begin() + static_cast<std::ptrdiff_t>(frame.first_vertex));
  }
  return true;
}

const SceneMirror::Moved* SceneMirror::moved(std::size_t tissue) const {
  const auto it = std::find_if(moved_.begin(), moved_.end(),
                               [&](const Moved& m) { return m.tissue == tissue; });
  return it != moved_.end() ? &*it : nullptr;
}

std::vector<MeshFrame> SceneMirror::whole_frames() const {
  std::vector<MeshFrame> frames;
  for (const Moved& m : moved_) frames.push_back(m.newest);
  return frames;
}

std::vector<float> SceneMirror::vertices_m(std::size_t tissue) const {
  const std::vector<float>& rest_m = scene_->tissues[tissue].mesh.vertices_m;
  const Moved* m = moved(tissue);
  if (m == nullptr) return rest_m;
  std::vector<float> vertices_m = m->newest.vertices_m.empty() ? rest_m : m->newest.vertices_m;
  const Eigen::Vector3f displacement_m = m->newest.displacement_world_m.cast<float>();
  for (std::size_t i = 0; i < vertices_m.size(); ++i) {
    vertices_m[i] += displacement_m[static_cast<Eigen::Index>(i % 3)];
  }
  return vertices_m;
}

}  // namespace palpate::viewer
