// SPDX-License-Identifier: Apache-2.0
// foreign_display.h — the surfaces of an engine from elsewhere, for viewers.
#pragma once

#include <memory>
#include <vector>

#include "common/core/ports.h"
#include "physics_node/display/display.h"
#include "physics_node/foreign/foreign_engine.h"

namespace palpate::physics {

/// Sends the surfaces on every subscription, and those whose vertices have moved, at 30 Hz.
class ForeignDisplay final : public Display {
 public:
  /// All references must outlive it.
  /// @throws SetupError  if a surface cannot be drawn
  ForeignDisplay(const Session& session, std::uint64_t session_id,
                 const std::vector<sdk::Surface>& surfaces, std::shared_ptr<MovedSurfaces> moved,
                 Sender<SceneState>& scene_out, Sender<MeshFrame>& mesh_out);

  void publish(const Watchers& watchers, std::span<const PhysicsTick> newest,
               TimePoint now) override;
  [[nodiscard]] bool is_too_large() const override { return is_too_large_; }
  void count_into(PhysicsCounters& counters) const override;

 private:
  void send(std::size_t surface, std::uint64_t device_sequence, TimePoint now);

  std::shared_ptr<MovedSurfaces> moved_;
  Sender<SceneState>& scene_out_;
  Sender<MeshFrame>& mesh_out_;
  SceneState scene_;
  MeshFrame frame_;
  std::vector<std::vector<float>> newest_m_;  // of each surface; empty: it never moved
  Watchers served_;
  bool is_too_large_ = false;
  TimePoint next_frames_at_{};
  std::uint64_t frames_made_ = 0;
};

}  // namespace palpate::physics
