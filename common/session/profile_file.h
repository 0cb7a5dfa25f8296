// profile_file.h — the friction of a device from a file of its own: what a session would say in
// `device { profile { … } }`, all of it and nothing else.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/session/session.h"
#include "common/session/session_problems.h"

namespace palpate {

class Fields;

/// Reads protobuf text format. Problems stand at `place` (of the field that names the file) as
/// "file:line:column: …"; a number that has one is NaN.
[[nodiscard]] DeviceProfile parse_profile(std::string_view text, const std::string& file_name,
                                          const Place& place, Problems& problems);

/// The same from a regular file of at most 100 kB.
[[nodiscard]] DeviceProfile load_profile(const std::filesystem::path& file, const Place& place,
                                         Problems& problems);

/// The two vectors of `device.profile` or `device.simulated`; `fallback` if both are left out. One
/// without the other is a problem.
[[nodiscard]] std::optional<FrictionPerAxis> read_friction_per_axis(
    const Fields& fields, const std::optional<FrictionPerAxis>& fallback);

/// Makes a problem of an isotropic Coulomb friction that is more than an axis has.
void check_isotropic_bound(const Fields& profile_fields, const DeviceProfile& profile);

/// What parse_profile reads: `comment`, a line each, and the profile. Bounds are rounded towards 0,
/// to whole 1e-6.
[[nodiscard]] std::string profile_text(const DeviceProfile& profile,
                                       const std::vector<std::string>& comment);

}  // namespace palpate
