#include "common/core/files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

TEST(WriteFile, ReplacesTheContent) {
  const test::TempFolder folder;
  const std::string file = folder.write("file", "a longer text");

  EXPECT_EQ(write_file(file, "text\n"), "");

  EXPECT_EQ(test::text_of(file), "text\n");
}

TEST(WriteFile, ReportsTheReasonAndTheRemedy) {
  EXPECT_EQ(write_file("/nonexistent/file", "text"),
            "cannot be written (No such file or directory); choose another place");
}

// A full disk is noticed when the buffered text is written.
TEST(WriteFile, ReportsAFullDisk) {
  EXPECT_THAT(write_file("/dev/full", "text"),
              AllOf(StartsWith("cannot be written"), HasSubstr("No space left on device")));
}

}  // namespace
}  // namespace palpate
