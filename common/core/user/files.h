// SPDX-License-Identifier: Apache-2.0
// files.h — reading files that the user names, and folders that no other user can replace.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace palpate {

struct FileContent {
  std::string bytes{};
  std::string complaint{};  ///< the problem and its remedy; empty if the file was read
};

/// Never blocks: pipes and devices are refused, as are folders and files above `max_bytes`.
[[nodiscard]] FileContent read_regular_file(const std::filesystem::path& file,
                                            std::uintmax_t max_bytes);

/// The same for text: without the byte order mark that some editors write first. A file with zero
/// bytes, or that is not UTF-8, is refused.
[[nodiscard]] FileContent read_text_file(const std::filesystem::path& file,
                                         std::uintmax_t max_bytes);

/// Checks that no other user but root can change the file or folder or, if it is secret, read it.
/// @return what is wrong and what to do; empty if nothing is
[[nodiscard]] std::string why_exposed(const std::filesystem::path& path, bool is_secret);

/// Creates the folder and its parents, if absent, for this user only (mode 0700), and checks that
/// no other user can put anything in its place: it is a folder, not a link, of the effective user,
/// and nobody else may write it; every folder and link on the way to it (way_to()) belongs to that
/// user or to root, and is writable by others only if it is sticky, as /tmp is.
/// @return what is wrong and what to do; empty if the folder is private
[[nodiscard]] std::string make_private_folder(const std::filesystem::path& folder);

}  // namespace palpate
