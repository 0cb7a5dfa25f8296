// SPDX-License-Identifier: Apache-2.0
#include "common/core/user/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

TEST(WhyExposed, AcceptsWhatOnlyItsOwnerCanChange) {
  const test::TempFolder folder;
  const std::string file = folder.write("file", "text");
  for (const mode_t mode : {0600u, 0640u, 0644u}) {
    ASSERT_EQ(chmod(file.c_str(), mode), 0);
    EXPECT_EQ(why_exposed(file, false), "") << std::oct << mode;
  }
  ASSERT_EQ(chmod(file.c_str(), 0400), 0);
  EXPECT_EQ(why_exposed(file, true), "");
}

TEST(WhyExposed, NamesTheRightsOfOthersAndTheRemedy) {
  const test::TempFolder folder;
  const std::string file = folder.write("file", "text");
  for (const mode_t mode : {0640u, 0604u, 0602u, 0610u}) {
    ASSERT_EQ(chmod(file.c_str(), mode), 0);
    EXPECT_THAT(why_exposed(file, true),
                AllOf(HasSubstr("others may read this secret"), HasSubstr("chmod 600 " + file)))
        << std::oct << mode;
  }
  for (const mode_t mode : {0620u, 0602u}) {
    ASSERT_EQ(chmod(file.c_str(), mode), 0);
    EXPECT_EQ(why_exposed(file, false), "others may change it; chmod go-w " + file);
  }
  EXPECT_EQ(why_exposed(folder.path() / "none", false), "No such file or directory");
}

TEST(WhyExposed, RefusesTheFileOfAnotherUser) {
  if (geteuid() != 0) GTEST_SKIP() << "only root may change the owner";
  const test::TempFolder folder;
  const std::string file = folder.write("file", "text");
  ASSERT_EQ(chmod(file.c_str(), 0600), 0);
  ASSERT_EQ(chown(file.c_str(), 12345, 12345), 0);
  EXPECT_THAT(why_exposed(file, true), StartsWith("belongs to another user"));
}

TEST(ReadTextFile, RefusesWhatIsNotUtf8AndNamesTheLine) {
  const test::TempFolder folder;
  const auto complaint = [&](const std::string& bytes) {
    return read_text_file(folder.write("file", bytes), 1000).complaint;
  };
  EXPECT_EQ(complaint(""), "");
  EXPECT_EQ(complaint("\xEF\xBB\xBFKnoten f\xC3\xBCr\n\xE2\x82\xAC \xF0\x9F\xA9\xBA\n"), "");
  EXPECT_THAT(complaint("one\nKnoten f\xFCr\n"), StartsWith("line 2 is not UTF-8 text"));
  for (const char* const bad : {"\xC0\x80", "\xE0\x80\xAF", "\xED\xA0\x80", "\xF4\x90\x80\x80",
                                "\xE2\x82", "\x80", "\xFF"}) {
    EXPECT_THAT(complaint(bad), StartsWith("line 1 is not UTF-8 text"));
  }
}

}  // namespace
}  // namespace palpate
