// SPDX-License-Identifier: Apache-2.0
// session_warnings.h — likely mistakes in a session that is valid.
#pragma once

#include <string>
#include <vector>

#include "common/session/session.h"

namespace palpate {

/// What is probably not meant, one text each: "scene.tool.tip_radius_m = 3 m: …; give it in
/// metres". Reads the geometry and follows the intended path of a simulated hand, which takes up to
/// a few seconds with large files. Runs and loads nothing that the session names. Throws SetupError
/// if a file of a tissue cannot be used.
[[nodiscard]] std::vector<std::string> session_warnings(const Session& session);

}  // namespace palpate
