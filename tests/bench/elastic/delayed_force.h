// SPDX-License-Identifier: Apache-2.0
// delayed_force.h — the force of elastic tissue as mofc_node finds it, at the other end of a
// network with delay, loss and a physics that stalls. Open loop, on a virtual clock.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "mofc_node/tissue/held_tissue.h"

namespace palpate::bench {

struct Network {
  double delay_s = 0.0;     ///< each way
  double loss_ratio = 0.0;  ///< each way
  double physics_hz = 1e3;  ///< steps of the tool
  double stall_s = 0.0;     ///< physics stands still for so long, every half second
  bool has_rate = true;     ///< false: as for a mofc_node that takes viscous forces for elastic
  std::uint64_t seed = 1;
  std::function<bool(double)> is_closed{};  ///< the jaws, by time [s]; none: never
};

struct DelayedForces {
  std::vector<Vector3> newton;  ///< on the tool, at every tick of 1 ms from time 0
  std::vector<double> us;       ///< processor time of mofc_node's model in each of these ticks
  std::vector<mofc::HeldTissue::State> grip;  ///< at these ticks
  std::uint32_t points_held = 0;              ///< at most
  double bytes_per_s = 0.0;                   ///< of hop 3, frames as they are sent
};

/// mofc's TissueModel with what SceneEngine sends it.
/// @param tip_m  by time [s]; before 0 the tip is where it is at 0   @param lead_ticks  before time
/// 0
[[nodiscard]] DelayedForces delayed_forces(const SceneConfig& scene,
                                           const std::function<Vector3(double)>& tip_m,
                                           double seconds, int lead_ticks, const Network& network);

}  // namespace palpate::bench
