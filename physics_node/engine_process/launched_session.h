// SPDX-License-Identifier: Apache-2.0
// launched_session.h — the session of a physics that `palpate launch` started.
#pragma once

#include <optional>

#include "common/process/run_node.h"

namespace palpate::physics {

/// What the environment variable PALPATE_PHYSICS says, as docs/extending.md describes it; none if
/// the program was started by hand. Throws SetupError.
[[nodiscard]] std::optional<LaunchedSession> launched_session();

}  // namespace palpate::physics
