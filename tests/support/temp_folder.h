// SPDX-License-Identifier: Apache-2.0
// temp_folder.h — a folder for one test, and the content of files.
#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "common/core/user/temp_folder.h"

namespace palpate::test {

using palpate::TempFolder;

/// Content of a file; "" if it cannot be read.
[[nodiscard]] inline std::string text_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace palpate::test
