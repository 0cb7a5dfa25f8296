// SPDX-License-Identifier: Apache-2.0
// run_folder.h — the folder of the ipc files of one launch.
#pragma once

#include <filesystem>
#include <string>

namespace palpate {

/// The folder of the session's ipc files. One launch at a time holds it; it is removed at the end.
class RunFolder {
 public:
  /// Throws SetupError, also if the session is already launched.
  explicit RunFolder(const std::string& session_name);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Whether the folder at the path is the one that is held.
  [[nodiscard]] bool is_present() const;

 private:
  /// Makes the folder if it is missing, and locks it.
  void hold(const std::string& session_name);
  [[noreturn]] void refuse(const std::string& why);
  /// Removes sockets and their lock files, except those that a node started by hand still holds.
  void remove_left_files() const;

  std::filesystem::path path_;
  int folder_ = -1;
};

}  // namespace palpate
