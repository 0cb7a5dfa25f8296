// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/triangle_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>

#include "common/core/check.h"
#include "tests/support/text.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

using test::replaced;
using ::testing::HasSubstr;
using ::testing::SizeIs;

// four corners, four faces facing outwards; line 6 is the first face
constexpr const char* kTetrahedronObj =
    "# by hand\nv 0 0 0\nv 1 0 0 1.0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1/1 2/2/2 4//3\nf -3 -2 -1\n"
    "usemtl steel\nf 1 4 3\n";

template <class Parse>
std::string complaint(Parse parse, const std::string& bytes) {
  try {
    static_cast<void>(parse(bytes, "a"));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "none";
}

std::string ascii_stl(const TriangleMesh& mesh) {
  std::string text = "solid thing\n";
  for (const auto& triangle : mesh.triangles) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const std::uint32_t corner : triangle) {
      const Vector3& place = mesh.vertices_m[corner];
      text += "vertex " + std::to_string(place.x()) + " " + std::to_string(place.y()) + " " +
              std::to_string(place.z()) + "\n";
    }
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid thing\n";
}

std::string binary_stl(const TriangleMesh& mesh) {
  std::string text = "solid in name only" + std::string(62, ' ');
  const auto append = [&](auto value) {
    const auto raw = std::bit_cast<std::array<char, sizeof(value)>>(value);
    text.append(raw.data(), raw.size());
  };
  append(static_cast<std::uint32_t>(mesh.triangles.size()));
  for (const auto& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) append(0.0F);
    for (const std::uint32_t corner : triangle) {
      for (int axis = 0; axis < 3; ++axis) {
        append(static_cast<float>(mesh.vertices_m[corner][axis]));
      }
    }
    append(std::uint16_t{0});
  }
  return text;
}

TEST(Obj, ReadsVerticesAndFaces) {
  const TriangleMesh mesh = parse_obj(kTetrahedronObj, "a.obj");

  EXPECT_THAT(mesh.vertices_m, SizeIs(4));
  EXPECT_THAT(mesh.triangles, SizeIs(4));
  EXPECT_NEAR(enclosed_volume_m3(mesh), 1.0 / 6.0, 1e-15);
}

TEST(Obj, CutsPolygonsIntoTriangles) {
  const TriangleMesh mesh = parse_obj("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", "a.obj");

  EXPECT_THAT(mesh.triangles, SizeIs(2));
}

TEST(Obj, ReportsFileLineAndRule) {
  EXPECT_THAT(complaint(parse_obj, replaced(kTetrahedronObj, "v 0 1 0", "v 0 nan 0")),
              HasSubstr("a:4: coordinate 'nan': a vertex must have three finite numbers"));
  EXPECT_THAT(complaint(parse_obj, replaced(kTetrahedronObj, "v 0 1 0", "v 0 1")),
              HasSubstr("a:4: coordinate ''"));
  EXPECT_THAT(complaint(parse_obj, replaced(kTetrahedronObj, "f 1 3 2", "f 1 3 7")),
              HasSubstr("a:6: corner '7': must be the number of a vertex before it, 1 … 4"));
  EXPECT_THAT(complaint(parse_obj, replaced(kTetrahedronObj, "f 1 3 2", "f 1 3")),
              HasSubstr("a:6: a face must have three corners"));
  EXPECT_THAT(complaint(parse_obj, replaced(kTetrahedronObj, "f 1 3 2", "f 1 3 3")),
              HasSubstr("triangle 1: its corners lie on a line"));
  EXPECT_THAT(complaint(parse_obj, replaced(kTetrahedronObj, "f 1 3 2", "f 1 2 3")),
              HasSubstr("face opposite sides"));
  EXPECT_THAT(complaint(parse_obj, ""), HasSubstr("no triangles"));
}

TEST(Stl, ReadsAsciiAndBinaryAlike) {
  for (const std::string& text : {ascii_stl(cube_mesh(2.0)), binary_stl(cube_mesh(2.0))}) {
    const TriangleMesh mesh = parse_stl(text, "a.stl");

    // corners at the same place became one
    EXPECT_THAT(mesh.vertices_m, SizeIs(8));
    EXPECT_THAT(mesh.triangles, SizeIs(12));
    EXPECT_NEAR(enclosed_volume_m3(mesh), 8.0, 1e-12);
  }
}

TEST(Stl, ReportsFileLineAndRule) {
  const std::string ascii = ascii_stl(cube_mesh(2.0));
  EXPECT_THAT(complaint(parse_stl, replaced(ascii, "vertex -1", "vertex inf")),
              HasSubstr("a:4: x = inf"));
  EXPECT_THAT(complaint(parse_stl, replaced(ascii, "outer", "inner")),
              HasSubstr("a:3: 'inner': must be 'outer'"));
  EXPECT_THAT(complaint(parse_stl, ascii.substr(0, ascii.size() / 2)), HasSubstr("must be"));
  const std::string binary = binary_stl(cube_mesh(2.0));
  EXPECT_THAT(complaint(parse_stl, "x" + binary.substr(1, 300)),
              HasSubstr("is the file complete?"));
  EXPECT_THAT(complaint(parse_stl, ""), HasSubstr("byte 0"));
}

}  // namespace
}  // namespace palpate::physics
