// SPDX-License-Identifier: Apache-2.0
// run_folder.h — run and cache folders of its own for one test.
#pragma once

#include <array>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "tests/support/temp_folder.h"

namespace palpate::test {

/// During its life $PALPATE_RUN_DIR names an empty folder and $PALPATE_CACHE_DIR one in it that is
/// not there yet, for this process and for programs that it starts. Of several the last one counts.
class RunFolder {
 public:
  RunFolder() {
    for (std::size_t i = 0; i < kVariables.size(); ++i) {
      if (const char* before = std::getenv(kVariables[i]); before != nullptr) before_[i] = before;
    }
    use();
  }
  ~RunFolder() {
    for (std::size_t i = 0; i < kVariables.size(); ++i) {
      if (before_[i]) {
        setenv(kVariables[i], before_[i]->c_str(), 1);
      } else {
        unsetenv(kVariables[i]);
      }
    }
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  /// Makes the variables name these folders again, after another RunFolder.
  void use() const {
    setenv(kVariables[0], path().c_str(), 1);
    setenv(kVariables[1], cache().c_str(), 1);
  }

  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }
  [[nodiscard]] std::filesystem::path cache() const { return path() / "cache"; }

 private:
  static constexpr std::array kVariables = {"PALPATE_RUN_DIR", "PALPATE_CACHE_DIR"};

  TempFolder folder_;
  std::array<std::optional<std::string>, kVariables.size()> before_;
};

}  // namespace palpate::test
