// SPDX-License-Identifier: Apache-2.0
// source_tree.h — the files of the source tree, without what tools and builds leave beside them.
#pragma once

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "tests/support/machine/places.h"

namespace palpate::test {

/// Every regular file of the project; paths from the root, sorted.
inline std::vector<std::string> tracked_files() {
  namespace fs = std::filesystem;
  const std::set<std::string> of_tools{".git", ".cache", ".idea", ".vscode", "Testing"};
  const fs::path root(test::source_dir());
  std::vector<std::string> files;
  for (auto entry = fs::recursive_directory_iterator(root);
       entry != fs::recursive_directory_iterator(); ++entry) {
    const std::string name = entry->path().filename().string();
    if ((entry.depth() == 0 && (name.starts_with("build") || of_tools.contains(name))) ||
        name == "node_modules") {
      if (entry->is_directory()) entry.disable_recursion_pending();
      continue;
    }
    if (entry->is_regular_file() && !entry->is_symlink()) {
      files.push_back(entry->path().lexically_relative(root).string());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Of those the C++ sources in these folders.
inline std::vector<std::string> sources_below(const std::vector<std::string>& folders) {
  std::vector<std::string> sources;
  for (const std::string& file : tracked_files()) {
    if (!file.ends_with(".h") && !file.ends_with(".cpp")) continue;
    for (const std::string& folder : folders) {
      if (file.starts_with(folder + "/")) sources.push_back(file);
    }
  }
  return sources;
}

}  // namespace palpate::test
