// SPDX-License-Identifier: Apache-2.0
// scene_force.h — the result of a scene for one pose of the tool.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/messages.h"
#include "common/core/vector.h"

namespace palpate::physics {

/// Which tissues were evaluated, and which were not.
struct SceneCounts {
  std::uint32_t tissues_skipped = 0;        ///< by the broad phase, without an evaluation
  std::uint32_t tissues_visited = 0;        ///< the others
  std::uint32_t tissues_asleep = 0;         ///< relaxing tissues at rest: not advanced
  std::uint32_t octree_cells_visited = 0;   ///< of all clouds
  std::uint32_t octree_last_cell_hits = 0;  ///< nearest points found in the cell of the last one
};

/// The action of all tissues on the tool; W. All zero where nothing touches.
struct SceneForce : SceneCounts {
  Vector3 force_on_tool_newton = Vector3::Zero();
  Vector3 torque_on_tool_newton_m = Vector3::Zero();  ///< about the tip
  double stored_energy_joule = 0.0;                   ///< elastic
  std::array<Contact, kMaxContacts> contacts{};       ///< the deepest first, then the nearest
  std::uint32_t listed_count = 0;                     ///< entries of `contacts`
  std::uint32_t contact_count = 0;                    ///< all touches; may be larger than the array
};

}  // namespace palpate::physics
