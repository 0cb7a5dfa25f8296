// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "deploy/scan/label_map.h"
#include "tests/unit/scan/scan_files.h"

namespace palpate::scan {
namespace {

using test::four_corners;
using test::gzipped;
using test::Nifti1;
using ::testing::Contains;
using ::testing::HasSubstr;

/// Where the first voxel of a label is, RAS in mm.
Vector3 ras_mm(const LabelMap& map, std::uint32_t value) {
  for (std::int64_t k = 0; k < map.size[2]; ++k) {
    for (std::int64_t j = 0; j < map.size[1]; ++j) {
      for (std::int64_t i = 0; i < map.size[0]; ++i) {
        const std::uint16_t there = map.at(i, j, k);
        if (there != 0 && map.segments[there - 1U].value == value) {
          const Vector3 index(static_cast<double>(i), static_cast<double>(j),
                              static_cast<double>(k));
          return 1e3 * (map.ras_of_index_m * index);
        }
      }
    }
  }
  return Vector3::Constant(kNaN);
}

void expect_at(const LabelMap& map, std::uint32_t value, const Vector3& expected_mm) {
  EXPECT_LT((ras_mm(map, value) - expected_mm).norm(), 1e-4)
      << value << ": " << ras_mm(map, value).transpose();
}

std::string complaint_of(const std::string& bytes) {
  try {
    (void)parse_nifti(bytes, "a.nii");
  } catch (const SetupError& error) {
    return error.what();
  }
  return "";
}

TEST(Nifti, TheMatrixPutsEachVoxelIntoThePatient) {
  // i to the left, j to the head, k to the back: x = 10 − 2 i, y = 20 − 4 k, z = 30 + 3 j
  const std::string bytes =
      Nifti1().sform({-2, 0, 0, 10, 0, 0, -4, 20, 0, 3, 0, 30}).with(four_corners());

  const LabelMap map = parse_nifti(bytes, "a.nii");

  ASSERT_EQ(map.segments.size(), 4u);
  EXPECT_EQ(map.segments[1].name, "label 2");
  EXPECT_EQ(map.segments[1].voxels, 1u);
  expect_at(map, 1, {10, 20, 30});
  expect_at(map, 2, {4, 20, 30});
  expect_at(map, 3, {10, 20, 36});
  expect_at(map, 4, {10, 16, 30});
  EXPECT_NEAR(map.voxel_m3(), 24e-9, 1e-15);
}

TEST(Nifti, TheQuaternionTurnsAndMirrors) {
  // 30° about the axis to the head: cos 15°, d = sin 15°; the third axis mirrored by pixdim[0] = −1
  const auto d = static_cast<float>(std::sin(15.0 * std::numbers::pi / 180.0));
  const double c30 = std::sqrt(0.75);
  for (const float factor : {1.0F, -1.0F}) {
    const LabelMap map =
        parse_nifti(Nifti1().qform(0, 0, d, {1, 2, 3}, factor).with(four_corners()), "a.nii");
    expect_at(map, 1, {1, 2, 3});
    expect_at(map, 2, {1 + 6 * c30, 2 + 6 * 0.5, 3});
    expect_at(map, 3, {1 - 6 * 0.5, 2 + 6 * c30, 3});
    expect_at(map, 4, {1, 2, 3 + 4 * static_cast<double>(factor)});
  }
}

TEST(Nifti, TheMatrixCountsAndADifferentQuaternionIsMentioned) {
  Nifti1 header;
  header.sform({2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0}).qform(0, 0, 0, {0, 0, 0}, 1);
  const LabelMap same = parse_nifti(header.with(four_corners()), "a.nii");
  EXPECT_THAT(same.notes, ::testing::Not(Contains(HasSubstr("WARNING"))));

  header.qform(0, 0, 1, {0, 0, 0}, 1);  // turned by 180°
  const LabelMap map = parse_nifti(header.with(four_corners()), "a.nii");

  EXPECT_THAT(map.notes, Contains(HasSubstr("WARNING: the quaternion")));
  expect_at(map, 2, {6, 0, 0});
}

TEST(Nifti, IsNotGuessedWhereTheFileGivesNoOrientation) {
  EXPECT_THAT(complaint_of(Nifti1().with(four_corners())),
              HasSubstr("sform_code and qform_code are 0"));
}

TEST(Nifti, IsTheSameBigEndianCompressedScaledAndOfAnyType) {
  const std::array<float, 12> rows = {2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0};
  const std::string corners = four_corners();
  const LabelMap plain = parse_nifti(Nifti1().sform(rows).with(corners), "a.nii");
  const auto expect_same = [&](const std::string& bytes) {
    const LabelMap map = parse_nifti(bytes, "a.nii");
    EXPECT_EQ(map.voxels, plain.voxels);
    EXPECT_TRUE(map.ras_of_index_m.isApprox(plain.ras_of_index_m, 1e-6));
  };

  expect_same(gzipped(Nifti1().sform(rows).with(corners)));
  const std::string whole = Nifti1().sform(rows).with(corners);
  expect_same(gzipped(whole.substr(0, 100)) + gzipped(whole.substr(100)));

  Nifti1 big(true);
  big.sform(rows).put<std::int16_t>(70, 4);
  std::string shorts;
  for (const char c : corners) shorts += std::string(1, '\0') + c;
  expect_same(big.with(shorts));

  Nifti1 scaled;  // stored 0, 2, 4, 6, 8; slope ½
  scaled.sform(rows).put<std::int16_t>(70, 16).put(112, 0.5F);
  std::string floats;
  for (const char c : corners) {
    const auto value = static_cast<float>(2 * c);
    floats.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  expect_same(scaled.with(floats));
}

TEST(Nifti, OfTheSecondVersionIsRead) {
  std::string bytes(544, '\0');
  const auto put = [&](std::size_t at, auto value) {
    std::memcpy(bytes.data() + at, &value, sizeof value);
  };
  put(0, std::int32_t{540});
  std::memcpy(bytes.data() + 4, "n+2\0\r\n\032\n", 8);
  put(12, std::int16_t{2});
  const std::array<std::int64_t, 8> dim = {3, 4, 3, 2, 1, 1, 1, 1};
  for (std::size_t i = 0; i < 8; ++i) put(16 + 8 * i, dim[i]);
  put(168, std::int64_t{544});
  put(348, std::int32_t{1});
  const std::array<double, 12> rows = {-2, 0, 0, 10, 0, 0, -4, 20, 0, 3, 0, 30};
  for (std::size_t i = 0; i < 12; ++i) put(400 + 8 * i, rows[i]);
  put(500, std::int32_t{2});

  const LabelMap map = parse_nifti(bytes + four_corners(), "a.nii");

  expect_at(map, 2, {4, 20, 30});
  expect_at(map, 4, {10, 16, 30});
}

TEST(Nifti, TakesNamesFromTheTableInItsExtension) {
  std::string xml =
      R"(<LabelTable><Label Key="1" Red="1">liver</Label><Label Key="4"><![CDATA[portal vein]]></Label></LabelTable>)";
  xml.resize(168, ' ');
  Nifti1 header;
  header.sform({2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0});
  header.put(108, 528.0F);  // 352 + 8 + 168
  header.bytes[348] = 1;
  std::string extension(8, '\0');
  extension[0] = static_cast<char>(176);

  const LabelMap map = parse_nifti(header.with(extension + xml + four_corners()), "a.nii");

  EXPECT_EQ(map.segments[0].name, "liver");
  EXPECT_EQ(map.segments[1].name, "label 2");
  EXPECT_EQ(map.segments[3].name, "portal vein");
}

TEST(Nifti, NamesWhatIsWrongWithAHeader) {
  struct Case {
    std::function<void(Nifti1&)> change;
    const char* complaint;
  };
  const std::vector<Case> cases = {
      {[](Nifti1& n) { n.put<std::int32_t>(0, 347); }, "sizeof_hdr"},
      {[](Nifti1& n) { n.bytes[345] = 'x'; }, "magic"},
      {[](Nifti1& n) { n.bytes[345] = 'i'; }, "in another file"},
      {[](Nifti1& n) { n.put<std::int16_t>(40, 2); }, "dim[0] = 2"},
      {[](Nifti1& n) { n.put<std::int16_t>(42, -3); }, "dim[1] = -3"},
      {[](Nifti1& n) {
         n.put<std::int16_t>(42, 32'767)
             .put<std::int16_t>(44, 32'767)
             .put<std::int16_t>(46, 32'767);
       },
       "300 million"},
      {[](Nifti1& n) {
         n.put<std::int16_t>(42, 600).put<std::int16_t>(44, 600).put<std::int16_t>(46, 600);
       },
       "too short"},
      {[](Nifti1& n) { n.put<std::int16_t>(40, 4).put<std::int16_t>(48, 7); }, "dim[4] = 7"},
      {[](Nifti1& n) { n.put<std::int16_t>(70, 128); }, "datatype = 128"},
      {[](Nifti1& n) { n.put(108, 4.0F); }, "vox_offset"},
      {[](Nifti1& n) { n.put(108, static_cast<float>(kNaN)); }, "vox_offset"},
      {[](Nifti1& n) { n.put(284, static_cast<float>(kNaN)); }, "srow"},
      {[](Nifti1& n) { n.put(280, 0.0F); }, "voxels must be"},
      {[](Nifti1& n) { n.put(280, 0.0F).put(296, 2.0F); }, "lie in a plane"},
      {[](Nifti1& n) { n.bytes[123] = 5; }, "xyzt_units"},
      {[](Nifti1& n) { n.put(112, 0.3F); }, "whole numbers"},
      {[](Nifti1& n) {
         n.put<std::int16_t>(254, 0).put<std::int16_t>(252, 1).put(256, 0.9F).put(260, 0.9F);
       },
       "quatern"},
  };
  for (const Case& wrong : cases) {
    Nifti1 header;
    header.sform({2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0});
    ASSERT_EQ(complaint_of(header.with(four_corners())), "");
    wrong.change(header);
    EXPECT_THAT(complaint_of(header.with(four_corners())), HasSubstr(wrong.complaint));
  }
}

TEST(Nifti, RefusesDamagedAndTruncatedFilesAndBombs) {
  Nifti1 header;
  header.sform({2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0});
  const std::string whole = header.with(four_corners());
  EXPECT_THAT(complaint_of(""), HasSubstr("ends 348 bytes or more too early"));
  for (std::size_t size = 1; size < whole.size(); ++size) {
    EXPECT_NE(complaint_of(whole.substr(0, size)), "") << size;
  }
  const std::string packed = gzipped(whole);
  for (std::size_t size = 2; size < packed.size(); ++size) {
    EXPECT_NE(complaint_of(packed.substr(0, size)), "") << size;
  }
  std::string damaged = packed;
  damaged[damaged.size() - 6] ^= 1;  // the check sum
  EXPECT_THAT(complaint_of(damaged), HasSubstr("damaged"));
  // 200 MB of zeros behind the voxels, 200 kB compressed
  const std::string zeros(200'000'000, '\0');  // NOLINT: it is meant
  EXPECT_THAT(complaint_of(gzipped(whole + zeros)), HasSubstr("goes on after"));
  EXPECT_THAT(complaint_of(header.with(std::string(24, '\0'))), HasSubstr("all voxels are 0"));
}

// The reference library of the format takes numbers that are not finite as 0, which is not scaled.
TEST(Nifti, ASlopeThatIsNotANumberMeansNotScaled) {
  test::Nifti1 file;
  file.sform({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
  file.put(112, static_cast<float>(kNaN)).put(116, static_cast<float>(kNaN));
  const LabelMap map = parse_nifti(file.with(test::four_corners()), "a.nii");
  EXPECT_EQ(map.segments.size(), 4u);
  EXPECT_FALSE(map.notes.empty());
}

}  // namespace
}  // namespace palpate::scan
