// SPDX-License-Identifier: Apache-2.0
// session_file.h — reads a session: protobuf text format (proto/palpate/v1/session.proto) into the
// structs of common/session/session.h, checked, with every default filled in.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/session/session.h"

namespace palpate {

/// @param overrides  "path=value", the last one wins: mofc.controller=none,
///                   scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=600,
///                   hand.hold={ position_m { z: -0.01 } } (a message is replaced),
///                   faults.interaction.outage={ from_s: 1 until_s: 2 } (a list grows)
/// @throws SetupError  with all problems, sorted by place: a count, then one line for each:
///     x.txtpb: 1 problem
///     x.txtpb:12:7: device.simulated.mass_kg = -1: must be > 0; give the mass of the moving parts
///     in kg
[[nodiscard]] Session load_session(const std::filesystem::path& file,
                                   const std::vector<std::string>& overrides = {});

/// The same from memory.
/// @param file_name  for messages, and Session::file
/// @param base_dir   base of the relative paths in the session; empty: no other file is read
[[nodiscard]] Session parse_session(std::string_view text, const std::string& file_name,
                                    const std::vector<std::string>& overrides = {},
                                    const std::filesystem::path& base_dir = {});

/// The text of a session without the targets of its task, the lesions that they are, and the
/// recorded path and the presses of a hand that has searched for them; "" if it cannot be read.
[[nodiscard]] std::string without_targets(std::string_view text);

/// The file of the session and every file and folder that it names, whether or not this process
/// reads them.
[[nodiscard]] std::vector<std::string> files_of(const Session& session);

/// The file of a session, and every file and folder that it can name with any choice of these
/// overrides, in any order: those of its text and those of each override. More than one choice
/// names, never less.
[[nodiscard]] std::vector<std::string> files_of_any(const std::filesystem::path& file,
                                                    const std::vector<std::string>& overrides);

/// A complaint about a file that the session names, "organ.ply: no such file", with the place where
/// it does so: "x.txtpb:12:7: scene.tissue[0].point_cloud.file = …". Any other one as it is.
[[nodiscard]] std::string with_place(const Session& session, const std::string& complaint);

/// Folder of the session's ipc files: a folder with the name of the session in `$PALPATE_RUN_DIR`,
/// else in `$XDG_RUNTIME_DIR/palpate`, else in `/tmp/palpate-<uid>`. Not created here.
[[nodiscard]] std::filesystem::path run_folder(const std::string& session_name);

/// Where programs keep what they can compute again: `$PALPATE_CACHE_DIR`, else `$CACHE_DIRECTORY`
/// (of systemd), else `$XDG_CACHE_HOME/palpate`, else `$HOME/.cache/palpate`; empty: nowhere. Not
/// created here.
[[nodiscard]] std::filesystem::path cache_folder();

/// Where programs keep what the user has decided: `$PALPATE_STATE_DIR`, else `$STATE_DIRECTORY` (of
/// systemd), else `$XDG_STATE_HOME/palpate`, else `$HOME/.local/state/palpate`; empty: nowhere. Not
/// created here.
[[nodiscard]] std::filesystem::path state_folder();

}  // namespace palpate
