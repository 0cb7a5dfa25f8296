// SPDX-License-Identifier: Apache-2.0
// recorded_path.h — the path of a hand from a CSV file: header t,x,y,z, seconds and metres.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/problems.h"
#include "common/session/session.h"

namespace palpate {

/// Reads CSV text. Problems are at `place` (of the field that names the file) as "file:line: …";
/// only the first 5 are reported.
[[nodiscard]] std::vector<RecordedPath::Sample> parse_recorded_path(std::string_view text,
                                                                    const std::string& file_name,
                                                                    const Place& place,
                                                                    Problems& problems);

/// The same from a regular file of at most 64 MB.
[[nodiscard]] std::vector<RecordedPath::Sample> load_recorded_path(
    const std::filesystem::path& file, const Place& place, Problems& problems);

}  // namespace palpate
