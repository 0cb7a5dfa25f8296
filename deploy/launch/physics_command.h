// SPDX-License-Identifier: Apache-2.0
// physics_command.h — how a physics from elsewhere is started (physics.command of a session).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "deploy/launch/supervisor.h"

namespace palpate {

/// The program of session.physics_command, which must not be empty: a name without `/` is looked up
/// beside this program, then in PATH. Throws SetupError if there is no such program.
[[nodiscard]] std::string program_of(const Session& session);

/// The program of session.physics_command, with what it has to know in its environment
/// (docs/extending.md), in the folder of the session file. Throws SetupError if there is no such
/// program.
[[nodiscard]] ChildSpec physics_from_elsewhere(const Session& session,
                                               const std::filesystem::path& session_file,
                                               const std::vector<std::string>& overrides,
                                               bool is_insecure);

}  // namespace palpate
