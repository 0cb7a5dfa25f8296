// SPDX-License-Identifier: Apache-2.0
// trust.h — sessions from strangers: a session can name a program (physics.command) and libraries
// (device.plugin), which run with the rights of the user. Whoever could have written the session or
// what it names decides what runs.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/session/session.h"

namespace palpate {

/// A program, a file or folder among its arguments, or a library.
struct ForeignCode {
  std::string field;           ///< "physics.command"
  std::filesystem::path file;  ///< absolute; a library that is looked up in system paths: its name
};
/// What the session makes other programs run: physics.command unless physics runs elsewhere, and
/// the libraries of plug-ins unless the devices do. Throws SetupError if there is no such program.
[[nodiscard]] std::vector<ForeignCode> foreign_code_of(const Session& session,
                                                       bool has_physics = true,
                                                       bool has_device = true);

/// "physics.command runs /usr/bin/python3 scene.py", a line each; empty: nothing.
[[nodiscard]] std::vector<std::string> foreign_code_lines(const Session& session,
                                                          const std::vector<ForeignCode>& code);

/// Refuses a session that names code if somebody else may have written it or that code: the file,
/// or a folder or link on the way to it, belongs to another user or may be written by one
/// (ownership.h). Never asks.
///
/// @param is_trusted  --trust: accepts it, and remembers session, program and libraries by hash in
///                    the state folder; while they stay as they are, --trust is not needed again
/// @return the hash of what was trusted; empty: nobody else may have written it
/// @throws SetupError
std::string require_trust(const Session& session, const std::vector<ForeignCode>& code,
                          bool is_trusted);

/// Before it runs once more: nobody else may have written it, or it is what was trusted.
/// @param trusted  as require_trust() returned it
/// @throws SetupError
void require_same_trust(const Session& session, const std::vector<ForeignCode>& code,
                        const std::string& trusted);

}  // namespace palpate
