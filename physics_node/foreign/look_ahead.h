// SPDX-License-Identifier: Apache-2.0
// look_ahead.h — what an engine that can tell its force anywhere (sdk::Engine::force_at) says of
// tissue that the tool has not touched yet, and of the law where it touches.
#pragma once

#include <functional>
#include <optional>

#include "common/core/vector.h"
#include "physics_node/foreign/contact_estimator.h"

namespace palpate::physics {

/// Force on a tool that rests at a place, both in W [m], [N].
using ForceAt = std::function<Vector3(const Vector3&)>;

struct Ahead {
  std::optional<Foreseen> tissue;  ///< none: nothing between here and …
  Vector3 as_far_as_m = Vector3::Zero();
};

/// The tissue that the tool reaches within 0.15 s, at most 30 mm away, if it goes on as it does:
/// its surface to 0.05 mm, its stiffness between 0.5 and 2 mm of depth. At most 12 calls, one where
/// there is nothing. None: not to be told, as of a tool at rest.
[[nodiscard]] std::optional<Ahead> look_ahead(const ForceAt& force_at, const Vector3& position_m,
                                              const Vector3& velocity_m_per_s);

/// Stiffness over 0.5 mm, and the damping that explains the rest of the force seen. Two calls.
[[nodiscard]] ContactLaw law_of(const ForceAt& force_at, const Observation& seen);

}  // namespace palpate::physics
