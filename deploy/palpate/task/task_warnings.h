// SPDX-License-Identifier: Apache-2.0
// task_warnings.h — what of a valid task can probably not be done.
#pragma once

#include <string>
#include <vector>

#include "common/session/session.h"

namespace palpate {

/// One text each: lesions outside the tissue or the area to be searched, an area that meets no
/// surface, a place of traction that nothing can be pulled to. Reads the geometry.
/// @throws SetupError  if a file of a tissue cannot be used
[[nodiscard]] std::vector<std::string> task_warnings(const Session& session);

}  // namespace palpate
