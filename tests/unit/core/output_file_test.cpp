// SPDX-License-Identifier: Apache-2.0
#include "common/core/user/output_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>

#include "common/core/check.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using Kind = OutputFile::Kind;

std::size_t files_in(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(OutputFile, AWholeFileAppearsWhenItIsClosed) {
  const test::TempFolder folder;
  const std::string path = (folder.path() / "file").string();
  OutputFile file("table", path, Kind::kWhole, false);
  EXPECT_TRUE(file.write("one "));
  EXPECT_FALSE(fs::exists(path));
  EXPECT_TRUE(file.write("two"));
  EXPECT_TRUE(file.close());
  EXPECT_EQ(test::text_of(path), "one two");
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(OutputFile, AWholeFileThatIsNotClosedLeavesNothing) {
  const test::TempFolder folder;
  const std::string path = folder.write("file", "before");
  {
    OutputFile file("table", path, Kind::kWhole, true);
    EXPECT_TRUE(file.write("after"));
  }
  EXPECT_EQ(test::text_of(path), "before");
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(OutputFile, AFileThatAppearsMeanwhileIsNotReplaced) {
  const test::TempFolder folder;
  const std::string path = (folder.path() / "file").string();
  OutputFile file("table", path, Kind::kWhole, false);
  EXPECT_TRUE(file.write("late"));
  folder.write("file", "early");
  EXPECT_FALSE(file.close());
  EXPECT_THAT(file.complaint(), testing::HasSubstr("File exists"));
  EXPECT_EQ(test::text_of(path), "early");
  EXPECT_EQ(files_in(folder.path()), 1u);
}

TEST(OutputFile, AStreamShowsWhatIsWritten) {
  const test::TempFolder folder;
  const std::string path = (folder.path() / "file").string();
  OutputFile file("table", path, Kind::kStream, false);
  EXPECT_TRUE(file.write("one"));
  EXPECT_EQ(test::text_of(path), "one");
}

TEST(OutputFile, ALinkKeepsItsTarget) {
  const test::TempFolder folder;
  const std::string target = folder.write("target", "before");
  const fs::path link = folder.path() / "link";
  fs::create_symlink("target", link);
  write_file("table", link.string(), "after", true);
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_EQ(test::text_of(target), "after");

  fs::remove(target);
  EXPECT_THROW(write_file("table", link.string(), "after", true), SetupError);
}

TEST(OutputFile, HasThePermissionsOfTheUmask) {
  const test::TempFolder folder;
  const std::string path = (folder.path() / "file").string();
  const mode_t before = umask(027);
  write_file("table", path, "text", false);
  umask(before);
  struct stat status {};
  ASSERT_EQ(stat(path.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0640u);
}

TEST(CheckOutputs, ReadsTheFilesOfAFolderAsInputs) {
  const test::TempFolder folder;
  const std::string key = folder.write("keys/viewer.key_secret", "secret");
  const std::string keys = (folder.path() / "keys").string();
  EXPECT_THROW(check_outputs({{"--json", key}}, {keys}, true), SetupError);
  EXPECT_NO_THROW(check_outputs({{"--json", keys + "/run.json"}}, {keys}, true));
}

TEST(CheckOutputs, TakesTwoSpellingsOfAPathForOneFile) {
  const test::TempFolder folder;
  const std::string base = folder.path().string();
  EXPECT_THROW(check_outputs({{"--json", base + "/x"}, {"--csv", base + "/./y/../x"}}, {}, false),
               SetupError);
}

}  // namespace
}  // namespace palpate
