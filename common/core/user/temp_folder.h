// SPDX-License-Identifier: Apache-2.0
// temp_folder.h — a folder for one piece of work, removed with it.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "common/core/check.h"

namespace palpate {

/// Its path is short, because the path of a Unix socket has 107 bytes at most.
class TempFolder {
 public:
  /// Throws SetupError.
  TempFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "palpate_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw SetupError(name + ": no such folder can be made; set TMPDIR to one that you may write");
    }
    path_ = name;
  }
  ~TempFolder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  /// Writes a file and creates the folders of `name`. Throws std::runtime_error.
  /// @return path of the new file
  std::string write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((path_ / name).parent_path());
    std::string file = (path_ / name).string();
    std::ofstream out(file, std::ios::binary);
    out << text;
    out.close();
    if (!out) throw std::runtime_error(file + ": cannot be written; is the disk full?");
    return file;
  }

 private:
  std::filesystem::path path_;
};

}  // namespace palpate
