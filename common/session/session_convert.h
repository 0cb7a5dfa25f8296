// session_convert.h — from the written session to the plain structs of common/session/session.h.
#pragma once

#include <filesystem>

#include "common/session/session.h"
#include "common/session/session_problems.h"
#include "common/session/session_text.h"

namespace palpate {

/// Checks every rule of proto/palpate/v1/session.proto and fills in every default. What it returns
/// is a session only if there are no problems.
/// @param base_dir  folder of the session file; empty: no other file is read
[[nodiscard]] Session to_session(const SessionText& text, const std::filesystem::path& base_dir,
                                 Problems& problems);

}  // namespace palpate
