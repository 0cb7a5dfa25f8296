// SPDX-License-Identifier: Apache-2.0
// way.h — what the kernel looks at on the way to a file. Who can write any of it can put another
// file in its place.
#pragma once

#include <filesystem>
#include <vector>

namespace palpate {

struct WayStep {
  std::filesystem::path path{};  ///< absolute, without links before its last part
  bool is_link = false;          ///< else a folder, or the end
  bool is_end = false;  ///< where the path leads, or the folder that holds it or a link to it
};

/// Every folder and link that the path leads through, in the order in which the kernel follows it,
/// and last where it leads; that may not exist. Last is a link if it cannot be followed: it is
/// unreadable, or more than 40 lead on, the limit of the kernel.
/// @param path  absolute
[[nodiscard]] std::vector<WayStep> way_to(const std::filesystem::path& path);

}  // namespace palpate
