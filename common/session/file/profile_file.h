// SPDX-License-Identifier: Apache-2.0
// profile_file.h — the friction of a device in a file of its own: `device { profile { … } }` as in
// a session, complete and nothing else.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/problems.h"
#include "common/session/session.h"

namespace palpate {

class Fields;

/// Reads protobuf text format, with the rules of the session's fields; nothing has a default.
/// Problems are at `place` (of the field that names the file) as "file:line:column: …"; a number
/// that has one is NaN.
[[nodiscard]] DeviceProfile parse_profile(std::string_view text, const std::string& file_name,
                                          const Place& place, Problems& problems);

/// The same from a regular file of at most 100 kB.
[[nodiscard]] DeviceProfile load_profile(const std::filesystem::path& file, const Place& place,
                                         Problems& problems);

/// The friction per axis of `device.profile` or `device.simulated`; `fallback` if both vectors are
/// left out. One without the other is a problem.
[[nodiscard]] std::optional<FrictionPerAxis> read_friction_per_axis(
    const Fields& fields, const std::optional<FrictionPerAxis>& fallback);

/// Reports an isotropic Coulomb friction above that of an axis.
void check_isotropic_bound(const Fields& profile_fields, const DeviceProfile& profile);

/// The text that parse_profile reads: the lines of `comment`, then the profile. Bounds are rounded
/// down to multiples of 1e-6.
[[nodiscard]] std::string profile_text(const DeviceProfile& profile,
                                       const std::vector<std::string>& comment);

}  // namespace palpate
