// SPDX-License-Identifier: Apache-2.0
// black_box.h — the tissue of a session seen only through what another engine would tell of it.
#pragma once

#include <functional>
#include <memory>

#include "common/core/messages.h"
#include "common/session/session.h"
#include "physics_node/engine.h"

namespace palpate::test {

enum class Told : std::uint8_t {
  kForce,   ///< the sum of the forces
  kField,   ///< that, and what it would be at other places
  kPoints,  ///< normal, penetration and force of each contact
};

/// The scene of the session behind the interface of physics_node/sdk/physics.h, with contact models
/// estimated where the session's mofc uses them; for LockstepOptions::make_engine.
/// @param lie  changes what the engine tells, before anything is estimated; may be empty
[[nodiscard]] std::unique_ptr<physics::Engine> black_box(
    const Session& session, Told told, std::function<void(Interaction&)> lie = {});

}  // namespace palpate::test
