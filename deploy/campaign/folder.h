// SPDX-License-Identifier: Apache-2.0
// folder.h — the folder in which a campaign keeps its results until they are collected.
#pragma once

#include <filesystem>

#include "deploy/campaign/campaign.h"

namespace palpate::campaign {

/// Creates the folder, or takes one that a sweep of the same campaign has left.
class Folder {
 public:
  /// @param is_shared  other processes may use it too (one share of the campaign)
  /// Throws SetupError if it belongs to another campaign, if a sweep is using it, or if it holds
  /// links, pipes, sockets or devices.
  Folder(std::filesystem::path path, const Campaign& campaign, bool is_shared);
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int lock_ = -1;
};

/// Where `palpate sweep` keeps the results by default: NAME.sweep in the present folder.
[[nodiscard]] std::filesystem::path default_folder(const Campaign& campaign);

}  // namespace palpate::campaign
