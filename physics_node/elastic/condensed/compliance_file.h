// SPDX-License-Identifier: Apache-2.0
// compliance_file.h — columns of a surface compliance kept on disk between runs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "physics_node/elastic/condensed/condensed_contact.h"

namespace palpate::elastic {

/// Hash of everything that the columns of the undeformed body depend on: mesh, materials, law,
/// fixed nodes, the nodes of the surface, the version of the format.
[[nodiscard]] std::uint64_t fingerprint_of(const SurfaceCompliance& compliance);

/// Where to keep the columns: FOLDER/<fingerprint>.compliance.
[[nodiscard]] std::filesystem::path compliance_file(const std::filesystem::path& folder,
                                                    const SurfaceCompliance& compliance);

/// Writes the columns made so far: to a file beside it, which then takes its place, so that a
/// reader sees all or nothing. Follows no link. @pre the columns are those of the undeformed body
/// @throws std::runtime_error  with the file and the reason
void save_columns(const SurfaceCompliance& compliance, const std::filesystem::path& file);

/// Takes the columns of a file, if some of them, at random, are those that are computed again.
/// Returns an empty text, or why it took none: no such file, another version, another body, cut
/// short or damaged, no regular file, one that another user may have written, or with columns of
/// nobody's. Those that are there already are kept then.
[[nodiscard]] std::string load_columns(const std::filesystem::path& file,
                                       SurfaceCompliance& compliance);

}  // namespace palpate::elastic
