// SPDX-License-Identifier: Apache-2.0
#include "physics_node/foreign/foreign_display.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/core/check.h"

namespace palpate::physics {
namespace {

constexpr std::size_t kVerticesPerFrame = 100'000;  // 1.2 MB; a larger surface is sent in parts
constexpr float kLongestShown_m = 1e3F;

void check(const sdk::Surface& surface) {
  const std::string name = "surface " + surface.name + ": ";
  if (surface.vertices_m.size() % 3 != 0) {
    throw SetupError(name + "vertices_m has " + std::to_string(surface.vertices_m.size()) +
                     " numbers; give three a vertex");
  }
  if (!std::all_of(surface.vertices_m.begin(), surface.vertices_m.end(),
                   [](float x) { return std::abs(x) <= kLongestShown_m; })) {
    throw SetupError(name + "a vertex is not finite or beyond ±1000 m; give m in W");
  }
  const std::size_t vertices = surface.vertices_m.size() / 3;
  if (surface.triangles.size() % 3 != 0 ||
      std::any_of(surface.triangles.begin(), surface.triangles.end(),
                  [&](std::uint32_t index) { return index >= vertices; })) {
    throw SetupError(name + "triangles must be three indices each, below " +
                     std::to_string(vertices));
  }
}

}  // namespace

ForeignDisplay::ForeignDisplay(const Session& session, std::uint64_t session_id,
                               const std::vector<sdk::Surface>& surfaces,
                               std::shared_ptr<MovedSurfaces> moved, Sender<SceneState>& scene_out,
                               Sender<MeshFrame>& mesh_out)
    : moved_(std::move(moved)),
      scene_out_(scene_out),
      mesh_out_(mesh_out),
      scene_(scene_of(session, session_id)),
      newest_m_(surfaces.size()) {
  scene_.revision = 1;
  for (const sdk::Surface& surface : surfaces) {
    check(surface);
    TissueSurface& tissue = scene_.tissues.emplace_back();
    tissue.name = surface.name;
    tissue.shape = TissueShape::kTriangleSurface;
    tissue.mesh = {.vertices_m = surface.vertices_m, .triangles = surface.triangles};
  }
  frame_.header.session_id = session_id;
  frame_.scene_revision = scene_.revision;
}

void ForeignDisplay::publish(const Watchers& watchers, std::span<const PhysicsTick> newest,
                             TimePoint now) {
  if (watchers.scene_subscriptions > served_.scene_subscriptions) {
    scene_.header.sampled_at = now;
    is_too_large_ = scene_out_.send(scene_) == SendResult::kDropped;
    ++scene_.header.sequence;
  }
  const bool is_new_watcher = watchers.mesh_subscriptions > served_.mesh_subscriptions;
  served_ = watchers;
  if (newest.empty() || !watchers.has_mesh_watcher) return;
  if (now < next_frames_at_ && !is_new_watcher) return;
  next_frames_at_ = std::max(next_frames_at_ + kFrameInterval, now);
  for (std::size_t i = 0; i < newest_m_.size(); ++i) {
    const bool has_moved = moved_->take(i, newest_m_[i]);
    if (has_moved || (is_new_watcher && !newest_m_[i].empty())) {
      send(i, newest.front().device_sequence, now);
    }
  }
  moved_->request();
}

void ForeignDisplay::send(std::size_t surface, std::uint64_t device_sequence, TimePoint now) {
  const std::vector<float>& vertices_m = newest_m_[surface];
  frame_.tissue = static_cast<std::uint32_t>(surface);
  frame_.device_sequence = device_sequence;
  frame_.header.sampled_at = now;
  for (std::size_t first = 0; first < vertices_m.size(); first += 3 * kVerticesPerFrame) {
    const std::size_t end = std::min(first + 3 * kVerticesPerFrame, vertices_m.size());
    frame_.first_vertex = static_cast<std::uint32_t>(first / 3);
    frame_.vertices_m.assign(vertices_m.begin() + static_cast<std::ptrdiff_t>(first),
                             vertices_m.begin() + static_cast<std::ptrdiff_t>(end));
    mesh_out_.send(frame_);
    ++frame_.header.sequence;
    ++frames_made_;
  }
}

void ForeignDisplay::count_into(PhysicsCounters& counters) const {
  counters.mesh_frames = frames_made_;
}

}  // namespace palpate::physics
