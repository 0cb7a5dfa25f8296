// SPDX-License-Identifier: Apache-2.0
// session_support.h — loading a session in a test, and what is wrong with it.
#pragma once

#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"

namespace palpate {

/// The lines of the SetupError; none if the session loads. Line 0 is the count.
inline std::vector<std::string> complaints(std::string_view text,
                                           const std::vector<std::string>& overrides = {},
                                           const std::filesystem::path& base_dir = {}) {
  std::vector<std::string> lines;
  try {
    static_cast<void>(parse_session(text, "x.txtpb", overrides, base_dir));
  } catch (const SetupError& error) {
    std::istringstream stream(error.what());
    for (std::string line; std::getline(stream, line);) lines.push_back(line);
  }
  return lines;
}

}  // namespace palpate
