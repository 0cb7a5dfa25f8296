// SPDX-License-Identifier: Apache-2.0
// ownership.h — who could have written a file, or could have put another in its place.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <set>
#include <string>

namespace palpate {

/// Users who decide already what this program does: root, this user, with sudo the user who called
/// it, and every owner of a folder that this program lies in, who could have replaced it.
class OwnUsers {
 public:
  OwnUsers();

  /// Follows the path as the system does, link by link. Every folder, link and file on the way must
  /// belong to one of these users, and nobody else may write it, neither by its mode nor by an
  /// access control list (POSIX). A folder on the way may be sticky, as /tmp is: what lies there
  /// can be replaced by its owner only. The folder that directly holds the file, or a link to it,
  /// may not: somebody could put there what the file loads by name. Of a folder, its files are
  /// examined too, but not what lies deeper.
  /// @param path  absolute
  /// @return the first that is not so, and why; empty: none
  [[nodiscard]] std::string why_strange(const std::filesystem::path& path) const;

 private:
  enum class Sticky : bool { kMayBe, kMayNotBe };
  [[nodiscard]] std::string why_owned_by_others(const std::filesystem::path& path) const;
  [[nodiscard]] std::string why_open(const std::filesystem::path& path, Sticky sticky) const;
  [[nodiscard]] bool may_others_write_by_group(const std::filesystem::path& path,
                                               gid_t group) const;
  [[nodiscard]] bool is_private_group(gid_t group) const;

  std::set<uid_t> users_;
};

}  // namespace palpate
