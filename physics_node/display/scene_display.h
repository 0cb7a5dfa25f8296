// scene_display.h — what viewers are told of the scene: once whole, then what moves.
//
//   out  hop 5  SceneState  physics → viewers  on every subscription
//   out  hop 5  MeshFrame   physics → viewers  ≤ 30 Hz and tissue, of tissue that gave way or has a
//                                              motion of its own; of many that move some in turn
//
// Nobody subscribed: no surface is made, no vertex computed, nothing encoded; that is counted.
// Thread: the publisher's. The step never waits for it and never sees it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "common/core/ports.h"
#include "common/core/scene_messages.h"
#include "common/session/session.h"
#include "common/telemetry/telemetry.h"
#include "physics_node/display/dented_surface.h"
#include "physics_node/files/surface_files.h"

namespace palpate::physics {

/// Who looks on.
struct Watchers {
  std::uint64_t scene_subscriptions = 0;  ///< so far
  std::uint64_t mesh_subscriptions = 0;   ///< so far
  bool has_mesh_watcher = false;          ///< now
};

class SceneDisplay {
 public:
  /// All references must outlive it. @param session_id  physics_node's
  /// @throws SetupError  if a file that a tissue's geometry names cannot be used
  SceneDisplay(const Session& session, std::uint64_t session_id, Sender<SceneState>& scene_out,
               Sender<MeshFrame>& mesh_out);

  /// Sends what those who look on lack.
  /// @param newest  physics step of each tool; none before its first motion
  void publish(const Watchers& watchers, std::span<const PhysicsTick> newest, TimePoint now);

  /// The link would not take the scene, which is too long for a message: viewers have none.
  [[nodiscard]] bool is_too_large() const { return is_too_large_; }

  /// Sets the counters of what was made for viewers and what was not.
  void count_into(PhysicsCounters& counters) const;

 private:
  void build();
  void forget();
  void send(std::size_t tissue, const VertexRange& range, const PhysicsTick& tick, TimePoint now);

  const Session& session_;
  std::vector<Shape> shapes_;  // of the tissues
  Sender<SceneState>& scene_out_;
  Sender<MeshFrame>& mesh_out_;
  SceneState scene_;  // revision 0: not built yet
  MeshFrame frame_;
  std::vector<std::optional<DentedSurface>> dents_;  // none: the tissue never gives way
  Watchers served_;
  bool is_too_large_ = false;
  TimePoint next_frames_at_{};
  std::size_t first_told_ = 0;            // tissue that has waited longest
  std::optional<TimePoint> advanced_at_;  // none: nobody looked on
  std::uint64_t frames_made_ = 0;
  std::uint64_t frames_skipped_ = 0;
};

}  // namespace palpate::physics
