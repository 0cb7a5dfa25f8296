// SPDX-License-Identifier: Apache-2.0
// shared_scene.h — what all simulations of a scene share: surfaces, elastic bodies, their factors
// and compliances.
#pragma once

#include <memory>
#include <vector>

#include "common/session/scene_config.h"
#include "physics_node/elastic_tissue/body_compliance.h"
#include "physics_node/scene/scene.h"

namespace palpate::physics {

/// Read by any number of threads at once.
class SharedScene {
 public:
  /// Reads the files of the tissues. Takes up to seconds.
  /// @param reach_m  ≥ 0; tissues this near to the tool are described before they are touched
  /// @throws SetupError  a file cannot be used, or an elastic body
  SharedScene(SceneConfig config, double reach_m);

  [[nodiscard]] const SceneConfig& config() const noexcept { return config_; }
  [[nodiscard]] double reach_m() const noexcept { return reach_m_; }
  [[nodiscard]] const std::shared_ptr<const Scene>& scene() const noexcept { return scene_; }
  /// In the order of the scene; empty: none.
  [[nodiscard]] const std::vector<std::shared_ptr<BodyCompliance>>& bodies() const noexcept {
    return bodies_;
  }

 private:
  SceneConfig config_;
  double reach_m_;
  std::shared_ptr<const Scene> scene_;
  std::vector<std::shared_ptr<BodyCompliance>> bodies_;
};

}  // namespace palpate::physics
