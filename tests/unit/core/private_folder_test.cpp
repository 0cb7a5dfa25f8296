// SPDX-License-Identifier: Apache-2.0
#include "common/core/user/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <string>
#include <vector>

#include "common/core/user/way.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;

class PrivateFolder : public testing::Test {
 protected:
  /// A folder that another user made beforehand.
  fs::path theirs(const char* name, mode_t mode) {
    fs::path folder = temp_.path() / name;
    mkdir(folder.c_str(), 0700);
    EXPECT_EQ(chown(folder.c_str(), 12345, 12345), 0);
    EXPECT_EQ(chmod(folder.c_str(), mode), 0);
    return folder;
  }
  static mode_t mode_of(const fs::path& folder) {
    struct stat status {};
    EXPECT_EQ(stat(folder.c_str(), &status), 0);
    return status.st_mode & 0777u;
  }

  test::TempFolder temp_;
};

TEST_F(PrivateFolder, IsMadeWithItsParentsForThisUserOnly) {
  const fs::path folder = temp_.path() / "run" / "session";
  EXPECT_THAT(make_private_folder(folder), IsEmpty());
  EXPECT_EQ(mode_of(folder), 0700u);
  EXPECT_EQ(mode_of(folder.parent_path()), 0700u);
  EXPECT_THAT(make_private_folder(folder), IsEmpty()) << "the second time";
}

TEST_F(PrivateFolder, MayBeReadableByOthers) {
  const fs::path folder = temp_.path() / "run";
  mkdir(folder.c_str(), 0755);
  EXPECT_THAT(make_private_folder(folder), IsEmpty());
}

TEST_F(PrivateFolder, MustNotBeWritableByOthers) {
  for (const mode_t mode : {0720u, 0702u, 0777u, 01777u}) {
    const fs::path folder = temp_.path() / std::to_string(mode);
    mkdir(folder.c_str(), 0700);
    ASSERT_EQ(chmod(folder.c_str(), mode), 0);
    EXPECT_THAT(make_private_folder(folder), HasSubstr("chmod go-w")) << std::oct << mode;
  }
}

TEST_F(PrivateFolder, MustBeNeitherLinkNorFile) {
  const fs::path folder = temp_.path() / "run";
  mkdir(folder.c_str(), 0700);
  fs::create_symlink(folder, temp_.path() / "link");
  EXPECT_THAT(make_private_folder(temp_.path() / "link"), HasSubstr("is a link"));
  EXPECT_THAT(make_private_folder(temp_.write("file", "")), HasSubstr("is a file"));
}

TEST_F(PrivateFolder, MustNotBeBelowAFolderWhoseEntriesOthersMayReplace) {
  const fs::path open = temp_.path() / "open";
  mkdir(open.c_str(), 0700);
  ASSERT_EQ(chmod(open.c_str(), 0777), 0);
  EXPECT_THAT(make_private_folder(open / "run"), HasSubstr(open.string()));
  ASSERT_EQ(chmod(open.c_str(), 01777), 0);
  EXPECT_THAT(make_private_folder(open / "run"), IsEmpty()) << "sticky, as /tmp is";
  // a link of one's own there is harmless, an open folder behind it is not
  fs::create_symlink(temp_.path(), open / "link");
  EXPECT_THAT(make_private_folder(open / "link" / "other"), IsEmpty());
  ASSERT_EQ(chmod(open.c_str(), 0777), 0);
  fs::create_symlink(open, temp_.path() / "way");
  EXPECT_THAT(make_private_folder(temp_.path() / "way" / "run"), HasSubstr(open.string()));
}

// our link, to a link in an open folder, to a folder of ours
TEST_F(PrivateFolder, MustNotBeBehindALinkThatOthersMayReplace) {
  const fs::path open = temp_.path() / "open";
  fs::create_directories(open);
  fs::create_directories(temp_.path() / "ours");
  ASSERT_EQ(chmod(open.c_str(), 0777), 0);
  fs::create_symlink("../ours", open / "link");
  fs::create_symlink("open/link", temp_.path() / "way");
  EXPECT_THAT(make_private_folder(temp_.path() / "way" / "run"), HasSubstr(open.string()));
  ASSERT_EQ(chmod(open.c_str(), 0755), 0);
  EXPECT_THAT(make_private_folder(temp_.path() / "way" / "run"), IsEmpty());
}

TEST(Way, HasEveryFolderAndLinkOnce) {
  const test::TempFolder temp;
  const fs::path root = fs::canonical(temp.path());
  fs::create_directories(root / "a" / "b");
  fs::create_symlink("b", root / "a" / "link");
  fs::create_symlink("loop", root / "loop");
  std::vector<std::string> parts;
  for (const WayStep& step : way_to(root / "a" / "." / "link" / ".." / "file")) {
    if (!step.path.string().starts_with(root.string())) continue;
    parts.push_back(step.path.string().substr(root.string().size()) + (step.is_link ? "@" : "") +
                    (step.is_end ? "!" : ""));
  }
  EXPECT_THAT(parts, testing::ElementsAre("", "/a", "/a/link@", "/a", "/a/b", "/a!", "/a/file!"));
  EXPECT_TRUE(way_to(root / "loop").back().is_link);
}

TEST_F(PrivateFolder, MustNotHaveBeenPreparedByAnotherUser) {
  if (geteuid() != 0) GTEST_SKIP() << "only root may give files away";
  EXPECT_THAT(make_private_folder(theirs("a", 0777)), HasSubstr("belongs to another user"));
  EXPECT_THAT(make_private_folder(theirs("b", 0700)), HasSubstr("belongs to another user"));
  EXPECT_THAT(make_private_folder(theirs("c", 0777) / "session"),
              HasSubstr("belongs to another user"));

  // their link to a folder of ours, which they could redirect later
  const fs::path link = temp_.path() / "link";
  fs::create_symlink(temp_.path(), link);
  ASSERT_EQ(lchown(link.c_str(), 12345, 12345), 0);
  EXPECT_THAT(make_private_folder(link / "session"), HasSubstr("belongs to another user"));
}

}  // namespace
}  // namespace palpate
