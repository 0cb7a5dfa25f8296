// regular_file.h — reading a file that the user named.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace palpate {

struct FileContent {
  std::string bytes{};
  std::string complaint{};  ///< what is wrong and what to do; empty if the file was read
};

/// Never waits: pipes and devices are refused, as are folders and larger files.
[[nodiscard]] FileContent read_regular_file(const std::filesystem::path& file,
                                            std::uintmax_t max_bytes);

}  // namespace palpate
