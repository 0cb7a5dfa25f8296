// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "deploy/scan/label_map.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/scan/scan_files.h"

namespace palpate::scan {
namespace {

using test::four_corners;
using test::gzipped;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr const char* kHeader =
    "NRRD0004\n"
    "# made by hand\n"
    "type: unsigned char\n"
    "dimension: 3\n"
    "space: left-posterior-superior\n"
    "sizes: 4 3 2\n"
    "space directions: (2,0,0) (0,0,3) (0,4,0)\n"
    "kinds: domain domain domain\n"
    "encoding: raw\n"
    "space origin: (-10,-20,30)\n";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  PALPATE_REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

std::string complaint_about_file(const std::string& bytes) {
  try {
    (void)parse_nrrd(bytes, "a.nrrd");
  } catch (const SetupError& error) {
    return error.what();
  }
  return "";
}

TEST(Nrrd, IsTheBodyOfANiftiFileInItsOwnDirections) {
  // LPS: x = −10 + 2 i to the left, so 10 − 2 i to the right; y = −20 + 4 k to the back
  const LabelMap map = parse_nrrd(std::string(kHeader) + "\n" + four_corners(), "a.nrrd");
  const LabelMap nifti = parse_nifti(
      test::Nifti1().sform({-2, 0, 0, 10, 0, 0, -4, 20, 0, 3, 0, 30}).with(four_corners()),
      "a.nii");

  EXPECT_EQ(map.voxels, nifti.voxels);
  EXPECT_TRUE(map.ras_of_index_m.isApprox(nifti.ras_of_index_m, 1e-6));
}

TEST(Nrrd, InRightAnteriorSuperiorIsTheMirrorImage) {
  const std::string ras = replaced(kHeader, "left-posterior-superior", "RAS");

  const LabelMap map = parse_nrrd(ras + "\n" + four_corners(), "a.nrrd");

  EXPECT_TRUE((1e3 * (map.ras_of_index_m * Vector3(3, 0, 1))).isApprox(Vector3(-4, -16, 30)));
}

TEST(Nrrd, EncodingsGiveTheSameVoxels) {
  const LabelMap raw = parse_nrrd(std::string(kHeader) + "\n" + four_corners(), "a.nrrd");
  std::string text;
  std::string big;
  for (const char c : four_corners()) {
    text += std::to_string(c) + "\n";
    big += std::string("\0\0\0", 3) + c;
  }
  EXPECT_EQ(parse_nrrd(replaced(kHeader, "raw", "text") + "\n" + text, "a").voxels, raw.voxels);
  EXPECT_EQ(
      parse_nrrd(replaced(kHeader, "raw", "gzip") + "\n" + gzipped(four_corners()), "a").voxels,
      raw.voxels);
  const std::string wide = replaced(kHeader, "unsigned char", "uint32");
  EXPECT_EQ(parse_nrrd(wide + "endian: big\n\n" + big, "a").voxels, raw.voxels);
  EXPECT_THAT(complaint_about_file(wide + "\n" + big), HasSubstr("endian"));
}

/// Two layers of 3 × 1 × 1 voxels: an organ in all three, a lesion in the middle one.
std::string layered(bool is_list_first) {
  std::string header =
      "NRRD0005\r\ntype: uint8\r\ndimension: 4\r\nspace: LPS\r\nencoding: raw\r\nspace origin: "
      "(0,0,0)\r\n";
  header += is_list_first ? "sizes: 2 3 1 1\r\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\r\n"
                          : "sizes: 3 1 1 2\r\nspace directions: (1,0,0) (0,1,0) (0,0,1) none\r\n";
  header +=
      "Segment0_ID:=Segment_1\r\nSegment0_LabelValue:=1\r\nSegment0_Layer:=0\r\nSegment0_Name:="
      "liver\r\n"
      "Segment0_Tags:=Segmentation.Status:inprogress|TerminologyEntry:Segmentation category and "
      "type - 3D Slicer General "
      "Anatomy list~SCT^123037004^Anatomical Structure~SCT^10200004^Liver~^^~Anatomic codes - "
      "DICOM master list~^^~^^|\r\n"
      "Segment1_ID:=Segment_2\r\nSegment1_LabelValue:=1\r\nSegment1_Layer:=1\r\nSegment1_Name:="
      "a\\nlesion\r\n"
      "Segment2_ID:=Segment_3\r\nSegment2_LabelValue:=9\r\nSegment2_Layer:=1\r\nSegment2_Name:="
      "nothing\r\n\r\n";
  const std::string voxels =
      is_list_first ? std::string("\1\0\1\1\1\0", 6) : std::string("\1\1\1\0\1\0", 6);
  return header + voxels;
}

TEST(Nrrd, OfSlicerGivesNamesCodesAndTheSmallerOfOverlappingSegments) {
  for (const bool is_list_first : {true, false}) {
    const LabelMap map = parse_nrrd(layered(is_list_first), "a.seg.nrrd");

    EXPECT_EQ(map.voxels, (std::vector<std::uint16_t>{1, 2, 1}));
    ASSERT_EQ(map.segments.size(), 2u);
    EXPECT_EQ(map.segments[0].name, "liver");
    EXPECT_EQ(map.segments[0].code, "SCT:10200004");
    EXPECT_EQ(map.segments[0].voxels, 2u);
    EXPECT_EQ(map.segments[1].name, "a lesion");
    EXPECT_THAT(map.notes, Contains(HasSubstr("1 voxels are in several segments")));
    EXPECT_THAT(map.notes, Contains(HasSubstr("\"nothing\" has no voxels")));
  }
}

TEST(Nrrd, ALabelThatNoSegmentHasIsRefused) {
  std::string bytes = layered(true);
  bytes.back() = 7;
  EXPECT_THAT(complaint_about_file(bytes), HasSubstr("the label 7 in layer 1"));
}

TEST(Nrrd, NamesWhatIsWrongWithAHeader) {
  const std::vector<std::pair<std::pair<std::string, std::string>, std::string>> cases = {
      {{"NRRD0004", "NRRX"}, "must begin with NRRD"},
      {{"type: unsigned char", "type: block"}, "a.nrrd:3: type"},
      {{"dimension: 3", "dimension: 2"}, "a.nrrd:4: dimension"},
      {{"dimension: 3", "dimension: 4"}, "sizes"},
      {{"space: left-posterior-superior\n", ""}, "which side of the patient is left"},
      {{"space: left-posterior-superior", "space: scanner-xyz"}, "is not guessed"},
      {{"sizes: 4 3 2", "sizes: 4 3 0"}, "a.nrrd:6: sizes"},
      {{"sizes: 4 3 2", "sizes: 4 3 99999999999999999999999"}, "a.nrrd:6: sizes"},
      {{"sizes: 4 3 2", "sizes: 40000 40000 40000"}, "300 million"},
      {{"sizes: 4 3 2", "sizes: 400 300 200"}, "too short"},
      {{"(2,0,0)", "none"}, "three vectors"},
      {{"(2,0,0)", "(2,0)"}, "vectors of three"},
      {{"(2,0,0)", "(2,0,nan)"}, "vectors of three"},
      {{"(2,0,0)", "(2,0,0"}, "space directions"},
      {{"(2,0,0)", "(0,0,2)"}, "lie in a plane"},
      {{"encoding: raw", "encoding: bzip2"}, "a.nrrd:9: encoding"},
      {{"encoding: raw", "encoding: gzip"}, "damaged"},
      {{"encoding: raw", "encoding: raw\nencoding: raw"}, "is given twice"},
      {{"space origin: (-10,-20,30)", "space origin: 3"}, "space origin"},
      {{"space origin: (-10,-20,30)\n", ""}, "space origin"},
      {{"encoding: raw", "data file: b.raw\nencoding: raw"}, "in the same file"},
      {{"# made by hand", "made by hand"}, "field: value"},
  };
  ASSERT_EQ(complaint_about_file(std::string(kHeader) + "\n" + four_corners()), "");
  for (const auto& [change, complaint] : cases) {
    EXPECT_THAT(complaint_about_file(replaced(kHeader, change.first, change.second) + "\n" +
                                     four_corners()),
                HasSubstr(complaint));
  }
  EXPECT_THAT(complaint_about_file(kHeader), HasSubstr("empty line"));
  const std::string whole = std::string(kHeader) + "\n" + four_corners();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_NE(complaint_about_file(whole.substr(0, size)), "") << size;
  }
}

TEST(LabelMapFile, HasTheNamesOfATable) {
  LabelMap map = parse_nrrd(std::string(kHeader) + "\n" + four_corners(), "a.nrrd");

  name_segments(
      map, "# comment\n1\tliver\n 2, left kidney\n\n3 255 0 0 1 1 1 \"portal vein\"\n9 other\n",
      "names.txt");

  EXPECT_EQ(map.segments[0].name, "liver");
  EXPECT_EQ(map.segments[1].name, "left kidney");
  EXPECT_EQ(map.segments[2].name, "portal vein");
  EXPECT_EQ(map.segments[3].name, "label 4");
  EXPECT_THROW(name_segments(map, "1 a\nliver 2\n", "names.txt"), SetupError);
  EXPECT_THROW(name_segments(map, "70000 a\n", "names.txt"), SetupError);
  EXPECT_THROW(name_segments(map, "1\n", "names.txt"), SetupError);
}

TEST(LabelMapFile, IsReadByItsName) {
  const test::TempFolder folder;
  const std::string nrrd = folder.write("A.SEG.NRRD", std::string(kHeader) + "\n" + four_corners());
  EXPECT_EQ(load_label_map(nrrd).segments.size(), 4u);
  EXPECT_THROW((void)load_label_map((folder.path() / "absent.nii").string()), SetupError);
  EXPECT_THROW((void)load_label_map(folder.write("a.stl", "solid")), SetupError);
  try {
    (void)load_label_map(folder.write("a.dcm", "no DICOM"));
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), testing::AnyOf(HasSubstr("build with -DPALPATE_DICOM=ON"),
                                             HasSubstr("a.dcm: cannot be read as DICOM"),
                                             HasSubstr("SOPClassUID")));
  }
}

}  // namespace
}  // namespace palpate::scan
