// SPDX-License-Identifier: Apache-2.0
// scene_engine.h — the tissue of the session: the scene, and what it remembers of one tool.
#pragma once

#include <memory>

#include "common/session/scene_config.h"
#include "physics_node/answer/surface_sender.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/elastic_tissue/patch/patch_sender.h"
#include "physics_node/engine.h"
#include "physics_node/library/scene_tool.h"
#include "physics_node/scene/scene.h"

namespace palpate::physics {

/// The step of a SceneTool, and what hop 3 carries of it; real-time safe as that is.
class SceneEngine final : public Engine {
 public:
  /// @param use  how mofc_node uses an Interaction: only for a local model the near tissue is
  ///             described before it is touched. Elastic tissue is solved within step()
  SceneEngine(const SceneConfig& scene, const PhysicsConfig& physics, InteractionUse use);
  /// In a scene shared with the tools of other engines. The tools meet only in elastic tissue; of
  /// the others each has its own TissueMemory.
  /// @param reach_m  the scene's; needed with elastic tissue only   @param elastic  may be null
  /// @param tool  index in it
  SceneEngine(std::shared_ptr<const Scene> scene, double rate_hz, InteractionUse use,
              double reach_m = 0.0, std::shared_ptr<ElasticTissues> elastic = {},
              std::size_t tool = 0);

  bool step(const ToolMotion& motion, bool is_new, TimePoint now,
            Interaction& answer) noexcept override;
  void count_into(PhysicsCounters& counters) const noexcept override;

  /// The material of a tissue has changed (Scene::set_material). Real-time safe.
  void note_changed(std::uint32_t tissue) noexcept { surface_.forget(tissue); }

 private:
  SceneTool tool_;
  SurfaceSender surface_;
  PatchSender patches_;
  PhysicsCounters counters_;  // of these only what count_into() sets
};

}  // namespace palpate::physics
