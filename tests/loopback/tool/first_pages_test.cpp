// SPDX-License-Identifier: Apache-2.0
// The first pages of the documents, followed word by word: every command of theirs that needs
// neither a second machine nor a device ends well, in an empty folder beside the shipped sessions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using testing::AnyOf;
using testing::StartsWith;

/// The lines of the sh blocks of a document.
std::vector<std::string> commands_of(const fs::path& document) {
  std::vector<std::string> commands;
  std::ifstream file(document);
  bool is_in_block = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("```")) {
      is_in_block = line == "```sh";
    } else if (is_in_block && !line.empty()) {
      commands.push_back(line);
    }
  }
  return commands;
}

/// Installing and building, which this test's build has done, and what runs until it is stopped or
/// moves a device.
bool is_left_out(const std::string& command) {
  return testing::Matches(AnyOf(
      StartsWith("./deploy/demo.sh"), StartsWith("cmake --build build/release"),
      StartsWith("PATH="), StartsWith("palpate launch"), StartsWith("palpate devices"),
      StartsWith("palpate identify"), StartsWith("palpate doctor"), StartsWith("pkill")))(command);
}

class FirstPage : public testing::TestWithParam<const char*> {};

TEST_P(FirstPage, ItsCommandsWork) {
  const fs::path root = test::source_dir();
  const fs::path programs = test::binary_dir();
  const test::TempFolder folder;
  fs::create_directory(folder.path() / "build");
  fs::create_directory_symlink(programs.parent_path(), folder.path() / "build/release");
  fs::create_directory_symlink(root / "deploy", folder.path() / "deploy");
  fs::create_directory_symlink(root / "physics_node", folder.path() / "physics_node");

  int run = 0;
  for (const std::string& command : commands_of(root / "docs" / GetParam())) {
    if (is_left_out(command)) continue;
    ++run;
    const std::string log = (folder.path() / "log").string();
    const std::string line = "cd '" + folder.path().string() + "' && HOME='" +
                             folder.path().string() + "' PATH='" + programs.string() +
                             "':$PATH bash -c '" + command + "' > '" + log + "' 2>&1";
    EXPECT_EQ(std::system(line.c_str()), 0)  // NOLINT(cert-env33-c, concurrency-mt-unsafe)
        << command << "\n"
        << test::text_of(log);
  }
  EXPECT_GT(run, 0);
}
std::string name_of_page(const testing::TestParamInfo<const char*>& info) {
  constexpr std::array kNames{"Lesson", "Workstation", "Device"};
  return kNames.at(info.index);
}
INSTANTIATE_TEST_SUITE_P(Documents, FirstPage,
                         testing::Values("first_lesson.md", "first_workstation.md",
                                         "first_device.md"),
                         name_of_page);

}  // namespace
}  // namespace palpate
