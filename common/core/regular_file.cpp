#include "common/core/regular_file.h"

#include <array>
#include <cerrno>
#include <fstream>
#include <system_error>

#include "common/core/check.h"

namespace palpate {

FileContent read_regular_file(const std::filesystem::path& file, std::uintmax_t max_bytes) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (status.type() == std::filesystem::file_type::not_found) {
    return {.complaint = "no such file; check the path"};
  }
  if (status.type() == std::filesystem::file_type::directory) {
    return {.complaint = "is a folder; give a file in it"};
  }
  if (status.type() != std::filesystem::file_type::regular) {
    return {.complaint = "is not a regular file; copy its content into one"};
  }
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  const std::string too_large =
      "has more than " + std::to_string(max_bytes) + " bytes; is it the right file?";
  if (!error && size > max_bytes) return {.complaint = too_large};
  std::ifstream stream(file, std::ios::binary);
  if (error || !stream) return {.complaint = "cannot be read; check its permissions"};

  // the reported size is not used: the file may grow meanwhile, and files in /proc report 0
  FileContent content;
  std::array<char, 65536> chunk{};
  while (stream.read(chunk.data(), chunk.size()) || stream.gcount() > 0) {
    content.bytes.append(chunk.data(), static_cast<std::size_t>(stream.gcount()));
    if (content.bytes.size() > max_bytes) return {.complaint = too_large};
  }
  if (stream.bad()) return {.complaint = "cannot be read; check the disk"};
  return content;
}

std::string write_file(const std::filesystem::path& file, const std::string& text) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  stream.close();
  if (stream) return {};
  return "cannot be written (" + std::generic_category().message(errno) + "); choose another place";
}

void refuse_shared_file(std::initializer_list<std::pair<const char*, std::string>> outputs) {
  for (const auto* a = outputs.begin(); a != outputs.end(); ++a) {
    if (a->second.empty() || a->second == "-") continue;
    for (const auto* b = a + 1; b != outputs.end(); ++b) {
      std::error_code error;
      const auto whole = [&](const std::string& file) {
        return std::filesystem::weakly_canonical(std::filesystem::absolute(file, error), error);
      };
      if (b->second.empty() || whole(a->second) != whole(b->second)) {
        continue;
      }
      throw SetupError(std::string(a->first) + " and " + b->first + ": both name " + a->second +
                       "; give each a file of its own");
    }
  }
}

}  // namespace palpate
