// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/ply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>

#include "common/core/check.h"
#include "tests/support/text.h"

namespace palpate::physics {
namespace {

using test::replaced;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

/// Ten vertices (i, 2i, 3i).
std::string ascii(const std::string& more_header = "", const std::string& more_row = "") {
  std::string text =
      "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 10\nproperty float x\n"
      "property float y\nproperty float z\n" +
      more_header + "end_header\n";
  for (int i = 0; i < 10; ++i) {
    text += std::to_string(i) + " " + std::to_string(2 * i) + " " + std::to_string(3 * i) +
            more_row + "\n";
  }
  return text;
}

std::string ply_complaint(const std::string& bytes, const std::string& property = "") {
  try {
    static_cast<void>(parse_ply(bytes, "a.ply", property));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "none";
}

TEST(Ply, ReadsAscii) {
  const PointCloud cloud = parse_ply(ascii(), "a.ply");

  ASSERT_THAT(cloud.points_m, SizeIs(10));
  EXPECT_EQ(cloud.points_m[3], Vector3(3, 6, 9));
  EXPECT_THAT(cloud.normals, IsEmpty());
  EXPECT_THAT(cloud.stiffness_ratios, IsEmpty());
}

TEST(Ply, ReadsNormalsAndScalesThemToOne) {
  const PointCloud cloud = parse_ply(
      ascii("property double nx\nproperty double ny\nproperty double nz\n", " 0 3 4"), "a.ply");

  ASSERT_THAT(cloud.normals, SizeIs(10));
  EXPECT_EQ(cloud.normals[9], Vector3(0, 0.6, 0.8));
}

TEST(Ply, ReadsTheNamedPropertyAsStiffness) {
  const std::string text = ascii("property uchar firmness\n", " 7");

  EXPECT_EQ(parse_ply(text, "a.ply", "firmness").stiffness_ratios[4], 7.0);
  EXPECT_THAT(parse_ply(text, "a.ply").stiffness_ratios, IsEmpty());
  EXPECT_THAT(ply_complaint(text, "softness"), HasSubstr("'softness'"));
}

template <class T>
void append(std::string& text, T value, std::endian endian) {
  auto raw = std::bit_cast<std::array<char, sizeof(T)>>(value);
  if (endian != std::endian::native) std::reverse(raw.begin(), raw.end());
  text.append(raw.data(), raw.size());
}

TEST(Ply, ReadsBothByteOrdersAndSkipsWhatItDoesNotKnow) {
  for (const std::endian endian : {std::endian::little, std::endian::big}) {
    std::string text = std::string("ply\r\nformat binary_") +
                       (endian == std::endian::little ? "little" : "big") +
                       "_endian 1.0\nelement before 2\nproperty list uchar short n\n"
                       "element vertex 10\nproperty uchar red\nproperty double x\n"
                       "property float y\nproperty int16 z\nproperty list uint16 float l\n"
                       "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    for (int i = 0; i < 2; ++i) {
      append<std::uint8_t>(text, 1, endian);
      append<std::int16_t>(text, 300, endian);
    }
    for (std::int16_t i = 0; i < 10; ++i) {
      append<std::uint8_t>(text, 255, endian);
      append<double>(text, 0.5 + i, endian);
      append<float>(text, -1.5F, endian);
      append<std::int16_t>(text, i, endian);
      append<std::uint16_t>(text, 1, endian);
      append<float>(text, 9.0F, endian);
    }
    const PointCloud cloud = parse_ply(text, "a.ply");
    ASSERT_THAT(cloud.points_m, SizeIs(10));
    EXPECT_EQ(cloud.points_m[7], Vector3(7.5, -1.5, 7));

    // cut short anywhere inside the vertices: an error, not a crash
    for (std::size_t bytes = text.find("end_header"); bytes < text.size(); bytes += 7) {
      EXPECT_NE(ply_complaint(text.substr(0, bytes)), "none") << bytes;
    }
  }
}

TEST(Ply, ReadsWhatItWrites) {
  PointCloud cloud;
  for (int i = 0; i < 12; ++i) {
    cloud.points_m.push_back({0.5 * i, -0.25, 0.125});
    cloud.normals.push_back(Vector3::UnitY());
    cloud.stiffness_ratios.push_back(0.5 * i);
  }
  const PointCloud read = parse_ply(ply_text(cloud), "a.ply", "stiffness_ratio");

  EXPECT_EQ(read.points_m, cloud.points_m);
  EXPECT_EQ(read.normals, cloud.normals);
  EXPECT_EQ(read.stiffness_ratios, cloud.stiffness_ratios);
}

TEST(Ply, ReportsFileLineAndRule) {
  EXPECT_THAT(ply_complaint("solid x"), HasSubstr("a.ply:1: must begin with 'ply'"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "ascii", "utf8")),
              HasSubstr("a.ply:2: format 'utf8'"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "format ascii 1.0\n", "")), HasSubstr("no 'format'"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "float y", "quad y")),
              HasSubstr("a.ply:6: type 'quad'"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "float y", "float q")), HasSubstr("no property 'y'"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "float y", "float x")),
              HasSubstr("'x': is given twice"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "float y", "list uchar float y")),
              HasSubstr("'y': is a list"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "vertex 10", "vertex -1")), HasSubstr("count = -1"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "vertex 10", "vertex 11")),
              HasSubstr("file ends here"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "vertex 10", "vertex 1000000")),
              HasSubstr("too short"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "vertex 10", "vertex 9")), HasSubstr("at least 10"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "element vertex", "element corner")),
              HasSubstr("no element 'vertex'"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "end_header\n", "")), HasSubstr("is not a keyword"));
  // the header has 8 lines, so the row of vertex 3 is line 12
  EXPECT_THAT(ply_complaint(replaced(ascii(), "\n3 6 9", "\n3 6 nine")),
              HasSubstr("a.ply:12: z = nine: must be a finite number"));
  EXPECT_THAT(ply_complaint(replaced(ascii(), "\n3 6 9", "\n3 nan 9")),
              HasSubstr("a.ply:12: y = nan"));
}

TEST(Ply, RefusesNormalsThatAreNone) {
  const std::string normals = "property float nx\nproperty float ny\nproperty float nz\n";

  EXPECT_THAT(ply_complaint(ascii(normals, " 0 0 0")), HasSubstr("vertex 0: its normal"));
  EXPECT_THAT(ply_complaint(ascii("property float nx\nproperty float nz\n", " 0 1")),
              HasSubstr("nx, ny and nz"));
}

TEST(Ply, RefusesAStiffnessBelowZero) {
  EXPECT_THAT(ply_complaint(ascii("property float s\n", " -0.5"), "s"), HasSubstr("vertex 0: 's'"));
}

}  // namespace
}  // namespace palpate::physics
