// SPDX-License-Identifier: Apache-2.0
// mesh_steps.h — what an audience sees of the deformed tissue: displacements in whole steps, of the
// displaced vertices only.
#pragma once

#include <array>
#include <span>

#include "common/core/scene_messages.h"
#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {

/// The steps in m, one for each detail; a client gets a coarser one while it reads too slowly.
inline constexpr std::array<double, 3> kDetailSteps_m{0.05e-3, 0.2e-3, 0.8e-3};

/// Rounds to the nearest step, so that each coordinate errs by at most step_m / 2. A vertex whose
/// three displacements round to 0 is left out.
/// @param frames  complete frames of the tissues that have moved, of that scene
[[nodiscard]] MeshSteps mesh_steps(const SceneState& scene, std::span<const MeshFrame> frames,
                                   double step_m);

}  // namespace palpate::viewer
