// files.h — reading files that the user names, checks on the files to be written, and folders that
// no other user can replace.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <utility>

namespace palpate {

struct FileContent {
  std::string bytes{};
  std::string complaint{};  ///< the problem and its remedy; empty if the file was read
};

/// Never blocks: pipes and devices are refused, as are folders and files above `max_bytes`.
[[nodiscard]] FileContent read_regular_file(const std::filesystem::path& file,
                                            std::uintmax_t max_bytes);

/// Checks that no other user but root can change the file or folder or, if it is secret, read it.
/// @return what is wrong and what to do; empty if nothing is
[[nodiscard]] std::string why_exposed(const std::filesystem::path& path, bool is_secret);

/// Replaces the content of `file`.
/// @return what is wrong and what to do; empty if the text was written
[[nodiscard]] std::string write_file(const std::filesystem::path& file, const std::string& text);

/// Throws SetupError if two options name the same file. Empty names and "-" are ignored.
/// @param outputs  pairs of option and file
void refuse_shared_file(std::initializer_list<std::pair<const char*, std::string>> outputs);

/// Creates the folder and its parents, if absent, for this user only (mode 0700), and checks that
/// no other user can put anything in its place: it is a folder, not a link, of the effective user,
/// and nobody else may write it; every folder above it, and every link on the way, belongs to that
/// user or to root, and is writable by others only if it is sticky, as /tmp is.
/// @return what is wrong and what to do; empty if the folder is private
[[nodiscard]] std::string make_private_folder(const std::filesystem::path& folder);

}  // namespace palpate
