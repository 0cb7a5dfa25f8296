// SPDX-License-Identifier: Apache-2.0
#include "deploy/launch/ownership.h"

#include <grp.h>
#include <linux/posix_acl.h>
#include <linux/posix_acl_xattr.h>
#include <pwd.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <system_error>
#include <vector>

#include "common/core/user/way.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

std::string with_error(const fs::path& path) {
  return path.string() + ": " + std::generic_category().message(errno);
}

struct AclEntry {
  std::uint16_t tag = 0;
  std::uint16_t permissions = 0;
  std::uint32_t id = 0;
};

/// Of an access control list; none: the mode says it all.
std::optional<std::vector<AclEntry>> acl_of(const fs::path& path) {
  const std::vector<AclEntry> anybody{{.tag = ACL_USER, .permissions = ACL_WRITE, .id = ~0U}};
  std::vector<char> bytes(65536);
  const ssize_t size =
      lgetxattr(path.c_str(), "system.posix_acl_access", bytes.data(), bytes.size());
  if (size < 0) {
    if (errno == ENODATA || errno == ENOTSUP) return std::nullopt;
    return anybody;
  }
  constexpr std::size_t kEntryBytes = sizeof(posix_acl_xattr_entry);
  const auto end = static_cast<std::size_t>(size);
  std::vector<AclEntry> entries;
  for (std::size_t at = sizeof(posix_acl_xattr_header); at + kEntryBytes <= end;
       at += kEntryBytes) {
    posix_acl_xattr_entry entry{};  // little-endian, as every machine that this runs on
    std::memcpy(&entry, &bytes[at], kEntryBytes);
    entries.push_back({entry.e_tag, entry.e_perm, entry.e_id});
  }
  return entries;
}

}  // namespace

OwnUsers::OwnUsers() : users_{0, geteuid()} {
  if (geteuid() == 0) {
    // NOLINTNEXTLINE(concurrency-mt-unsafe): nothing sets it
    if (const char* caller = std::getenv("SUDO_UID"); caller != nullptr) {
      char* end = nullptr;
      const unsigned long uid = std::strtoul(caller, &end, 10);
      if (*caller != '\0' && *end == '\0') users_.insert(static_cast<uid_t>(uid));
    }
  }
  std::error_code error;
  for (fs::path at = fs::read_symlink("/proc/self/exe", error); at.has_relative_path();
       at = at.parent_path()) {
    struct stat status {};
    if (lstat(at.c_str(), &status) == 0) users_.insert(status.st_uid);
  }
}

std::string OwnUsers::why_strange(const fs::path& path) const {
  const std::vector<WayStep> way = way_to(path);
  for (const WayStep& step : way) {
    std::string why = why_owned_by_others(step.path);
    if (why.empty() && !step.is_link) {
      why = why_open(step.path, step.is_end ? Sticky::kMayNotBe : Sticky::kMayBe);
    }
    if (!why.empty()) return why;
  }
  const fs::path& at = way.back().path;
  if (way.back().is_link) return at.string() + ": a link that leads nowhere";
  std::error_code error;
  if (!fs::is_directory(at, error)) return {};
  for (const auto& entry : fs::directory_iterator(at, error)) {
    if (std::string why = why_owned_by_others(entry.path()); !why.empty()) return why;
    if (entry.is_symlink(error)) continue;
    if (std::string why = why_open(entry.path(), Sticky::kMayNotBe); !why.empty()) return why;
  }
  return error ? at.string() + ": " + error.message() : std::string();
}

std::string OwnUsers::why_owned_by_others(const fs::path& path) const {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0) return with_error(path);
  return users_.contains(status.st_uid) ? std::string()
                                        : path.string() + " belongs to another user";
}

std::string OwnUsers::why_open(const fs::path& path, Sticky sticky) const {
  struct stat status {};
  if (lstat(path.c_str(), &status) != 0) return with_error(path);
  const bool is_sticky = (status.st_mode & S_ISVTX) != 0;
  if (is_sticky && sticky == Sticky::kMayBe) return {};
  const bool is_open =
      (status.st_mode & S_IWOTH) != 0 ||
      // with an access control list: the most that it gives to anybody but owner and others
      ((status.st_mode & S_IWGRP) != 0 && may_others_write_by_group(path, status.st_gid));
  if (!is_open) return {};
  return (is_sticky ? "other users may put files into " : "other users may write ") + path.string();
}

bool OwnUsers::may_others_write_by_group(const fs::path& path, gid_t group) const {
  const auto acl = acl_of(path);
  if (!acl) return !is_private_group(group);
  return std::any_of(acl->begin(), acl->end(), [&](const AclEntry& entry) {
    if ((entry.permissions & ACL_WRITE) == 0) return false;
    switch (entry.tag) {
      case ACL_USER:
        return !users_.contains(entry.id);
      case ACL_GROUP_OBJ:
        return !is_private_group(group);
      case ACL_GROUP:
        return !is_private_group(entry.id);
      default:
        return false;
    }
  });
}

/// The group of a user's own: of that name, without other members.
bool OwnUsers::is_private_group(gid_t group) const {
  // NOLINTBEGIN(concurrency-mt-unsafe): called before any other thread uses them
  const struct group* entry = getgrgid(group);
  if (entry == nullptr) return false;
  const std::string name = entry->gr_name;
  for (char** member = entry->gr_mem; *member != nullptr; ++member) {
    if (name != *member) return false;
  }
  const struct passwd* user = getpwnam(name.c_str());
  return user != nullptr && user->pw_gid == group && users_.contains(user->pw_uid);
  // NOLINTEND(concurrency-mt-unsafe)
}

}  // namespace palpate
