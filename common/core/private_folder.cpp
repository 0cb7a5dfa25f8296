#include "common/core/private_folder.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kWritableByOthers = S_IWGRP | S_IWOTH;

void create(const fs::path& folder) {
  if (folder.has_parent_path() && folder != folder.parent_path()) create(folder.parent_path());
  mkdir(folder.c_str(), S_IRWXU);  // errors appear when the folder is examined
}

/// The problem of a folder above the private one, or of a link to it.
std::string why_not_safe(const fs::path& above) {
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

std::string why_not_safe_above(const fs::path& folder) {
  for (fs::path above = folder; above.has_parent_path() && above != above.parent_path();) {
    above = above.parent_path();
    if (std::string why = why_not_safe(above); !why.empty()) return why;
  }
  return "";
}

}  // namespace

std::string make_private_folder(const fs::path& given) {
  std::error_code error;
  const fs::path folder = fs::absolute(given, error).lexically_normal();
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
  // the way as written, with its links, and where it leads
  std::string why = why_not_safe_above(folder);
  return why.empty() ? why_not_safe_above(fs::canonical(folder, error)) : why;
}

}  // namespace palpate
