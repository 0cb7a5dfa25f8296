// run_folder.h — a run folder of its own for one test.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "tests/support/temp_folder.h"

namespace palpate::test {

/// During its life $PALPATE_RUN_DIR names an empty folder, for this process and for programs that
/// it starts. Of several the last one counts.
class RunFolder {
 public:
  RunFolder() {
    if (const char* before = std::getenv(kVariable); before != nullptr) before_ = before;
    use();
  }
  ~RunFolder() {
    if (before_) {
      setenv(kVariable, before_->c_str(), 1);
    } else {
      unsetenv(kVariable);
    }
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  /// Makes $PALPATE_RUN_DIR name this folder again, after another RunFolder.
  void use() const { setenv(kVariable, folder_.path().c_str(), 1); }

  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }

 private:
  static constexpr const char* kVariable = "PALPATE_RUN_DIR";

  TempFolder folder_;
  std::optional<std::string> before_;
};

}  // namespace palpate::test
