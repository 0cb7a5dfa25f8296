// SPDX-License-Identifier: Apache-2.0
// permission.h — whether this user may open the file of a device.
#pragma once

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace palpate {

/// What to do for the permission to read and write the file; empty: there is nothing to do, or no
/// such file.
[[nodiscard]] inline std::string permission_remedy(const std::filesystem::path& file) {
  struct stat status {};
  if (stat(file.c_str(), &status) != 0 || access(file.c_str(), R_OK | W_OK) == 0) return {};
  const group* const owner = getgrgid(status.st_gid);
  const std::string name = owner != nullptr ? owner->gr_name : "its group";
  const bool has_group = (status.st_mode & (S_IRGRP | S_IWGRP)) == (S_IRGRP | S_IWGRP);
  return (has_group && name != "root" ? "sudo adduser $USER " + name + " and log in anew, or "
                                      : "") +
         std::string(
             "install the package, whose udev rules permit it, and plug the device in anew");
}

}  // namespace palpate
