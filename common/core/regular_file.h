// regular_file.h — files that the user named.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <utility>

namespace palpate {

struct FileContent {
  std::string bytes{};
  std::string complaint{};  ///< what is wrong and what to do; empty if the file was read
};

/// Never waits: pipes and devices are refused, as are folders and larger files.
[[nodiscard]] FileContent read_regular_file(const std::filesystem::path& file,
                                            std::uintmax_t max_bytes);

/// Replaces the content of `file`.
/// @return what is wrong and what to do; empty if the text was written
[[nodiscard]] std::string write_file(const std::filesystem::path& file, const std::string& text);

/// Throws SetupError if two options name the same file. Empty names and "-" name none.
/// @param outputs  option and file
void refuse_shared_file(std::initializer_list<std::pair<const char*, std::string>> outputs);

}  // namespace palpate
