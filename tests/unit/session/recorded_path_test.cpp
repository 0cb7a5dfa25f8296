// SPDX-License-Identifier: Apache-2.0
// The recorded path of a hand: a CSV file.
#include "common/session/file/recorded_path.h"
#include "tests/support/temp_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr const char* kWithPath =
    "name: \"x\"\nhand { recorded { file: \"path.csv\" loop: true } }";

/// A folder with path.csv in it, gone after the test.
class RecordedPathFile : public ::testing::Test {
 protected:
  void write(const std::string& csv) const { temporary_.write("path.csv", csv); }
  [[nodiscard]] std::vector<std::string> problems(const std::string& csv) const {
    write(csv);
    std::vector<std::string> lines = complaints(kWithPath, {}, folder_);
    // the folder's name is random
    const std::string prefix = folder_.string() + "/";
    for (std::string& line : lines) {
      if (line.starts_with(prefix)) line.erase(0, prefix.size());
    }
    return lines;
  }

  const test::TempFolder temporary_;
  const std::filesystem::path& folder_ = temporary_.path();
};

TEST_F(RecordedPathFile, SamplesAreRead) {
  write("t, x, y, z\r\n0,1,2,3\r\n\n 0.5 , -1e-3 ,0,0\r\n");
  temporary_.write("s.txtpb", kWithPath);

  const Session session = load_session(folder_ / "s.txtpb");

  const auto& path = std::get<RecordedPath>(session.side().hand.path);
  EXPECT_TRUE(path.loops);
  ASSERT_THAT(path.samples, SizeIs(2));
  EXPECT_EQ(path.samples[0].t_s, 0.0);
  EXPECT_EQ(path.samples[0].position_m, Vector3(1, 2, 3));
  EXPECT_EQ(path.samples[1].t_s, 0.5);
  EXPECT_EQ(path.samples[1].position_m, Vector3(-1e-3, 0, 0));
}

TEST_F(RecordedPathFile, ProblemsAreReportedWithTheirLines) {
  EXPECT_THAT(problems("t,x,y,z\n"
                       "0,0,0,0\n"
                       "1,0,0\n"
                       "1,0,a,0\n"
                       "1,0,nan,0\n"
                       "0,0,0,0\n"),
              ElementsAre("x.txtpb: 4 problems",  //
                          "path.csv:3: 3 columns: must be 4, t,x,y,z",
                          "path.csv:4: 'a': must be a number, e.g. -0.0125",
                          "path.csv:5: 'nan': must be a finite number within ±10; x, y, z are in "
                          "metres",
                          "path.csv:6: t = 0: must be later than the line before"));
}

TEST_F(RecordedPathFile, OnlyTheFirstFiveProblemsAreReported) {
  EXPECT_THAT(problems("t,x,y,z\n1\n2\n3\n4\n5\n6\n7\n"), SizeIs(1 + 5));
}

TEST_F(RecordedPathFile, BadNumbersAreRefused) {
  for (const std::string number : {"", "1 2", "0x10", "1e999", "-inf", "1,5", "1e7", "--1"}) {
    SCOPED_TRACE(number);
    EXPECT_THAT(problems("t,x,y,z\n0,0,0," + number + "\n"), SizeIs(2));
  }
}

TEST_F(RecordedPathFile, HeaderIsRequired) {
  EXPECT_THAT(problems("0,0,0,0\n").at(1),
              StartsWith("path.csv:1: '0,0,0,0': the first line must"));
  EXPECT_THAT(problems("").at(1), StartsWith("path.csv:1: '': the first line must be t,x,y,z"));
}

TEST_F(RecordedPathFile, EmptyPathIsRefused) {
  EXPECT_THAT(problems("t,x,y,z\n\n").at(1), HasSubstr("no positions; give at least one line"));
}

TEST_F(RecordedPathFile, MissingFileAndFolderAreRefused) {
  EXPECT_THAT(complaints(kWithPath, {}, folder_).at(1),
              AllOf(StartsWith("x.txtpb:"), HasSubstr("hand.recorded.file: "),
                    HasSubstr("path.csv: no such file")));
  EXPECT_THAT(complaints(kWithPath, {"hand.recorded.file=."}, folder_).at(1),
              HasSubstr("is a folder"));
  EXPECT_THAT(complaints(kWithPath, {"hand.recorded.file=/dev/zero"}, folder_).at(1),
              HasSubstr("is not a regular file"));
  EXPECT_THAT(complaints(kWithPath, {"hand.recorded.file='path.csv\\0'"}, folder_).at(1),
              HasSubstr("must not contain control characters"));
}

TEST_F(RecordedPathFile, HugeFileIsRefusedUnread) {
  write("t,x,y,z\n");
  std::filesystem::resize_file(folder_ / "path.csv", 64'000'001);  // sparse

  EXPECT_THAT(complaints(kWithPath, {}, folder_).at(1), HasSubstr("more than 64000000 bytes"));
}

TEST(RecordedPath, NoFileIsReadWithoutAFolder) {
  EXPECT_THAT(complaints(kWithPath).at(1), HasSubstr("this session has no folder"));
  EXPECT_THAT(complaints(kWithPath, {"hand.recorded.file=/etc/passwd"}).at(1),
              HasSubstr("this session has no folder"));
}

}  // namespace
}  // namespace palpate
