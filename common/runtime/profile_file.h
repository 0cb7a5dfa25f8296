// profile_file.h — the friction of a device from a file of its own: what a session would say in
// `device { profile { … } }`, all of it and nothing else.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/session.h"
#include "common/runtime/session_problems.h"

namespace palpate {

/// Reads protobuf text format. Problems stand at `place` (of the field that names the file) as
/// "file:line:column: …"; a number that has one is NaN.
[[nodiscard]] DeviceProfile parse_profile(std::string_view text, const std::string& file_name,
                                          const Place& place, Problems& problems);

/// The same from a regular file of at most 100 kB.
[[nodiscard]] DeviceProfile load_profile(const std::filesystem::path& file, const Place& place,
                                         Problems& problems);

/// What parse_profile reads: `comment`, a line each, and the profile. Bounds are rounded towards 0,
/// to whole 1e-6.
[[nodiscard]] std::string profile_text(const DeviceProfile& profile,
                                       const std::vector<std::string>& comment);

}  // namespace palpate
