// SPDX-License-Identifier: Apache-2.0
#include "physics_node/library/shared_scene.h"

#include <utility>

#include "physics_node/elastic_tissue/elastic_tissues.h"

namespace palpate::physics {

SharedScene::SharedScene(SceneConfig config, double reach_m)
    : config_(std::move(config)),
      reach_m_(reach_m),
      scene_(std::make_shared<const Scene>(config_, reach_m)),
      bodies_(compliances_of(elastic_bodies_of(config_))) {}

}  // namespace palpate::physics
