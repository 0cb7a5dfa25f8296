// SPDX-License-Identifier: Apache-2.0
// scene_description.h — the tissues of a scene as they are sent to mofc_node: descriptions, and
// surfaces cut into tiles.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "common/contact/bounds.h"
#include "common/core/tissue.h"
#include "physics_node/surfaces/box_tree.h"
#include "physics_node/surfaces/shape.h"

namespace palpate::physics {

/// One tissue. Without a description (too many inclusions) only contact models of it are sent.
struct DescribedTissue {
  std::optional<TissueDescription> description;  ///< without slot and version
  std::vector<SurfaceTile> tiles;                ///< without slots and version
  std::vector<Bounds> bounds;                    ///< of the tiles
  std::vector<double> radii_m;                   ///< of spheres around the centres of these
  BoxTree tree;                                  ///< of the tiles
};

/// Not for the tick: allocates, and takes about as long as building the surface's own tree.
[[nodiscard]] DescribedTissue described(const Shape& shape, const KelvinVoigtMaterial& material,
                                        const TissueMotionConfig& motion, const ToolShape& tool,
                                        std::size_t index);

}  // namespace palpate::physics
