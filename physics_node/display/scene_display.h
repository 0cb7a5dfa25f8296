// SPDX-License-Identifier: Apache-2.0
// scene_display.h — sends the scene to viewers: the complete scene once, then what moves.
//
//   out  hop 5  SceneState  physics → viewers  on every subscription with the same revision:
//                                              viewers that have it can ignore the repetition;
//                                              with a higher one if a tissue has changed or
//                                              has been ablated, ≤ 5 Hz
//   out  hop 5  MeshFrame   physics → viewers  ≤ 30 Hz per tissue, of tissue that is dented,
//                                              deformed or has a motion of its own; of many moving
//                                              tissues some in turn
//
// Without subscribers no surface is meshed, no vertex computed and nothing encoded; the counters
// show what was skipped.
// Thread: the publisher's. The haptic step does not depend on it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/core/ports.h"
#include "common/core/scene_messages.h"
#include "common/session/session.h"
#include "physics_node/display/dented_surface.h"
#include "physics_node/display/display.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/surfaces/shape.h"

namespace palpate::physics {

class SceneDisplay final : public Display {
 public:
  /// All references must outlive it. @param session_id  physics_node's
  /// @param elastic  the session's elastic tissues, null if it has none
  /// @throws SetupError  if a file that a tissue's geometry names cannot be used
  SceneDisplay(const Session& session, std::uint64_t session_id, Sender<SceneState>& scene_out,
               Sender<MeshFrame>& mesh_out, std::shared_ptr<ElasticTissues> elastic = {});

  void publish(const Watchers& watchers, std::span<const PhysicsTick> newest,
               TimePoint now) override;
  [[nodiscard]] bool is_too_large() const override { return is_too_large_; }
  void count_into(PhysicsCounters& counters) const override;

  /// Another k and b of a tissue; the next publish() sends the scene.
  void set_material(std::size_t tissue, double stiffness_newton_per_m,
                    double damping_newton_s_per_m);

 private:
  /// Surfaces of an elastic body in the scene: its own, and those of its parts, after all tissues.
  struct ElasticSurface {
    std::size_t tissue;   // in the scene
    std::size_t of_body;  // tissue of the session
    std::size_t first_node;
    std::size_t node_count;
  };
  struct Constants {
    double stiffness_newton_per_m;
    double damping_newton_s_per_m;
  };

  void build();
  void send_scene(TimePoint now);
  void update_material(std::size_t tissue);
  void map_stiffness(std::size_t tissue);
  void forget();
  void send(std::size_t tissue, const VertexRange& range, const PhysicsTick& tick, TimePoint now,
            const ElasticSurface* elastic = nullptr);
  [[nodiscard]] ElasticTissue* elastic(std::size_t tissue) const;
  void add_elastic_surfaces();
  void take_bodies();
  void send_elastic(bool is_new_watcher, const PhysicsTick& tick, TimePoint now);

  const Session& session_;
  std::shared_ptr<ElasticTissues> elastic_;
  struct Deformed {
    std::shared_ptr<const ElasticBody> body;  // of which the rest is
    std::vector<float> vertices_m;
    std::vector<float> strain;
  };
  std::vector<std::shared_ptr<const ElasticBody>>
      bodies_;  // by tissue: in the scene; null: not elastic
  std::vector<ElasticSurface> elastic_surfaces_;
  std::map<std::size_t, Deformed>
      deformed_;               // by tissue of the session: the newest of elastic ones
  std::vector<Shape> shapes_;  // one per tissue
  Sender<SceneState>& scene_out_;
  Sender<MeshFrame>& mesh_out_;
  SceneState scene_;                          // revision 0: not built yet; then from 1
  std::map<std::size_t, Constants> changed_;  // by tissue: other than the session's
  bool is_change_due_ = false;                // not sent yet
  TimePoint next_change_at_{};
  MeshFrame frame_;
  std::vector<std::optional<DentedSurface>> dents_;  // none: the tissue is never dented
  Watchers served_;
  bool is_too_large_ = false;
  TimePoint next_frames_at_{};
  std::size_t next_turn_ = 0;             // tissue that has waited longest
  std::optional<TimePoint> advanced_at_;  // none: no subscriber
  std::uint64_t frames_made_ = 0;
  std::uint64_t frames_skipped_ = 0;
};

}  // namespace palpate::physics
