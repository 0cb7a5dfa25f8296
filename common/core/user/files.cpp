// SPDX-License-Identifier: Apache-2.0
#include "common/core/user/files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>

#include "common/core/user/utf8.h"
#include "common/core/user/way.h"

namespace palpate {
namespace {

constexpr mode_t kWritableByOthers = S_IWGRP | S_IWOTH;

void create(const std::filesystem::path& folder) {
  if (folder.has_parent_path() && folder != folder.parent_path()) create(folder.parent_path());
  mkdir(folder.c_str(), S_IRWXU);  // errors appear when the folder is examined
}

/// The problem of a folder above the private one, or of a link to it.
std::string why_not_safe(const std::filesystem::path& above) {
  struct stat status {};
  if (lstat(above.c_str(), &status) != 0) {
    return above.string() + ": " + std::generic_category().message(errno);
  }
  if (status.st_uid != geteuid() && status.st_uid != 0) {
    return above.string() +
           " belongs to another user, who could replace what is in it; choose a folder elsewhere";
  }
  const bool is_open = (status.st_mode & kWritableByOthers) != 0 && !S_ISLNK(status.st_mode);
  if (is_open && (status.st_mode & S_ISVTX) == 0) {
    return "other users may replace what is in " + above.string() + "; chmod go-w " +
           above.string() + ", or choose a folder elsewhere";
  }
  return "";
}

}  // namespace

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

FileContent read_text_file(const std::filesystem::path& file, std::uintmax_t max_bytes) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  FileContent content = read_regular_file(file, max_bytes);
  if (content.bytes.starts_with(kByteOrderMark)) content.bytes.erase(0, kByteOrderMark.size());
  if (content.bytes.find('\0') != std::string::npos) {
    return {.complaint = "contains zero bytes, so it is not UTF-8 text; is it the right file?"};
  }
  if (const std::optional<std::size_t> at = not_utf8_at(content.bytes)) {
    const auto line =
        1 + std::count(content.bytes.begin(),
                       content.bytes.begin() + static_cast<std::ptrdiff_t>(*at), '\n');
    return {.complaint = "line " + std::to_string(line) +
                         " is not UTF-8 text, perhaps Latin-1; save the file as UTF-8"};
  }
  return content;
}

std::string why_exposed(const std::filesystem::path& path, bool is_secret) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return std::generic_category().message(errno);
  if (status.st_uid != geteuid() && status.st_uid != 0) {
    return "belongs to another user, who could change it; change its owner";
  }
  if (is_secret && (status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    return "others may read this secret; make a new one if it may have been read, and then: chmod "
           "600 " +
           path.string();
  }
  if ((status.st_mode & kWritableByOthers) != 0) {
    return "others may change it; chmod go-w " + path.string();
  }
  return {};
}

std::string make_private_folder(const std::filesystem::path& given) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::absolute(given, error).lexically_normal();
  create(folder);

  struct stat status {};
  if (lstat(folder.c_str(), &status) != 0) {
    return "folder " + folder.string() + " cannot be created (" +
           std::generic_category().message(errno) +
           "); choose a path in a folder that you may write";
  }
  if (!S_ISDIR(status.st_mode)) {
    return folder.string() + " is " + (S_ISLNK(status.st_mode) ? "a link" : "a file") +
           ", not a folder; remove it or choose another path";
  }
  if (status.st_uid != geteuid()) {
    return "folder " + folder.string() +
           " belongs to another user, who could replace what is in it; choose a folder of your own";
  }
  if ((status.st_mode & kWritableByOthers) != 0) {
    return "other users may write folder " + folder.string() + "; chmod go-w " + folder.string();
  }
  for (const WayStep& step : way_to(folder)) {
    if (std::string why = why_not_safe(step.path); !why.empty()) return why;
  }
  return {};
}

}  // namespace palpate
