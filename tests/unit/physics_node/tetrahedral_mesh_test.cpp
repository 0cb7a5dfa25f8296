// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/tetrahedral_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <filesystem>

#include "common/core/check.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/support/text.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

using test::replaced;
using ::testing::HasSubstr;
using ::testing::SizeIs;

// Two tetrahedra on both sides of a triangle: 1 at the origin, 2, 3, 4 along the axes, 5 beyond.
constexpr const char* kNodes = "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n9 1 1 1\n";

std::string version_1() {
  return std::string("$NOD\n5\n") + kNodes +
         "$ENDNOD\n$ELM\n3\n1 15 0 0 1 1\n2 4 1 1 4 1 2 3 4\n3 4 1 1 4 9 2 4 3\n$ENDELM\n";
}
std::string version_2() {
  return std::string(
             "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"a\"\n"
             "$EndPhysicalNames\n$Nodes\n5\n") +
         kNodes +
         "$EndNodes\n$Elements\n3\n1 2 2 0 0 1 2 3\n2 4 2 0 0 1 2 3 4\n3 4 0 9 2 4 "
         "3\n$EndElements\n";
}
std::string version_4() {
  return "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n2 5 1 9\n2 1 1 2\n1\n2\n0 0 0 0.5 0.5\n"
         "1 0 0 0.5 0.5\n3 1 0 3\n3\n4\n9\n0 1 0\n0 0 1\n1 1 1\n$EndNodes\n$Elements\n2 3 1 3\n"
         "0 1 15 1\n1 1\n3 1 4 2\n2 1 2 3 4\n3 9 2 4 3\n$EndElements\n";
}
std::string vtk() {
  return "# vtk DataFile Version 2.0\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\n"
         "POINTS 5 double\n0 0 0 1 0 0 0 1 0\n0 0 1 1 1 1\nCELLS 3 13\n4 0 1 2 3\n4 4 1 3 2\n"
         "2 0 1\nCELL_TYPES 3\n10\n10\n3\n";
}
std::string vtk_5() {
  return "# vtk DataFile Version 5.1\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\n"
         "POINTS 5 float\n0 0 0 1 0 0 0 1 0\n0 0 1 1 1 1\nMETADATA\nINFORMATION 0\n\nCELLS 3 8\n"
         "OFFSETS vtktypeint64\n0 4 8\nCONNECTIVITY vtktypeint64\n0 1 2 3 4 1 3 2\n"
         "CELL_TYPES 2\n10\n10\n";
}
std::string vtk_binary() {
  std::string text =
      "# vtk DataFile Version 3.0\nby hand\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n";
  const auto append = [&](auto value) {
    auto raw = std::bit_cast<std::array<char, sizeof(value)>>(value);
    std::reverse(raw.begin(), raw.end());
    text.append(raw.data(), raw.size());
  };
  for (const float x :
       {0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 0.F, 0.F, 0.F, 1.F, 1.F, 1.F, 1.F}) {
    append(x);
  }
  text += "\nCELLS 2 10\n";
  for (const std::int32_t i : {4, 0, 1, 2, 3, 4, 4, 1, 3, 2}) append(i);
  text += "\nCELL_TYPES 2\n";
  for (const std::int32_t i : {10, 10}) append(i);
  return text + "\n";
}

/// A file of the fuzzers' corpus, without the byte that selects the format.
std::string written_by_others(const std::string& name) {
  return test::text_of(test::source_dir() + "/tests/fuzz/corpus/geometry/" + name).substr(1);
}

TetrahedralMesh parse_any(const std::string& bytes, const std::string& file) {
  if (file.ends_with(".vtu")) return parse_vtu(bytes, file);
  return file.ends_with(".vtk") ? parse_vtk(bytes, file) : parse_msh(bytes, file);
}

std::string mesh_complaint(const std::string& bytes, const std::string& file = "a.msh") {
  try {
    static_cast<void>(parse_any(bytes, file));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "none";
}

void expect_two_tetrahedra(const TetrahedralMesh& mesh) {
  ASSERT_THAT(mesh.nodes_m, SizeIs(5));
  ASSERT_THAT(mesh.tetrahedra, SizeIs(2));
  EXPECT_EQ(mesh.nodes_m[mesh.tetrahedra[1][0]], Vector3(1, 1, 1));

  // 1/6 below the triangle; above it (2,3,4) → (1,1,1): its area √3/2 · height 2/√3 / 3 = 1/3
  const TriangleMesh surface = surface_of(mesh);
  EXPECT_THAT(surface.triangles, SizeIs(6));
  EXPECT_EQ(complaint_about(surface), "");
  EXPECT_NEAR(enclosed_volume_m3(surface), 0.5, 1e-12);
}

TEST(Msh, ReadsVersions1And2And4) {
  expect_two_tetrahedra(parse_msh(version_1(), "a.msh"));
  expect_two_tetrahedra(parse_msh(version_2(), "a.msh"));
  expect_two_tetrahedra(parse_msh(version_4(), "a.msh"));
}

TEST(Msh, ReadsWhatItWrites) {
  const TetrahedralMesh mesh = cube_of_tetrahedra(0.5);
  const TetrahedralMesh read = parse_msh(msh_text(mesh), "a.msh");

  EXPECT_EQ(read.nodes_m, mesh.nodes_m);
  EXPECT_EQ(read.tetrahedra, mesh.tetrahedra);
}

TEST(Msh, KeepsPhysicalVolumes) {
  const std::string second =
      replaced(replaced(replaced(version_2(), "1\n3 1 \"a\"", "2\n2 7 \"wall\"\n3 7 \"a lesion\""),
                        "2 4 2 0 0", "2 4 2 7 1"),
               "3 4 0 9", "3 4 2 5 1 9");
  const std::string fourth = replaced(
      version_4(), "$Nodes",
      "$PhysicalNames\n1\n3 7 \"a lesion\"\n$EndPhysicalNames\n$Entities\n1 0 0 1\n1 0 0 0 1 4\n"
      "1 0 0 0 1 1 1 2 7 8 1 -3\n$EndEntities\n$Nodes");

  for (const std::string& text : {second, fourth}) {
    const TetrahedralMesh mesh = parse_msh(text, "a.msh");
    ASSERT_EQ(mesh.regions.size(), 2u);
    EXPECT_EQ(mesh.region_names[mesh.regions[0]], "a lesion");
  }
  const TetrahedralMesh mesh = parse_msh(second, "a.msh");
  EXPECT_EQ(mesh.region_names[mesh.regions[1]], "5");
  const TetrahedralMesh read = parse_msh(msh_text(mesh), "b.msh");
  EXPECT_EQ(read.regions, mesh.regions);
  EXPECT_EQ(read.region_names, mesh.region_names);
  EXPECT_TRUE(parse_msh(version_1(), "a.msh").region_names.empty());
  EXPECT_THAT(mesh_complaint(replaced(second, "\"a lesion\"", "a lesion")),
              HasSubstr("in quotation marks"));
}

// Written by Gmsh 4.8 and by VTK 9.1: text, binary, base64, appended, compressed.
TEST(TetrahedralFiles, KeepRegionsAsOtherProgramsWriteThem) {
  for (const char* name : {"msh_2_binary", "msh_4_binary"}) {
    const TetrahedralMesh mesh = parse_msh(written_by_others(name), "a.msh");
    SCOPED_TRACE(name);
    expect_two_tetrahedra(mesh);
    ASSERT_EQ(mesh.regions.size(), 2u);
    EXPECT_EQ(mesh.region_names[mesh.regions[0]], "a lesion");
    EXPECT_EQ(mesh.region_names[mesh.regions[1]], "5");
  }
  for (const char* name : {"vtk_4_regions", "vtk_4_binary_regions", "vtk_5_regions",
                           "vtk_5_binary_regions", "vtu_ascii", "vtu_inline", "vtu_inline_zlib",
                           "vtu_base64_zlib", "vtu_raw", "vtu_raw_zlib"}) {
    const bool is_xml = std::string(name).starts_with("vtu");
    const TetrahedralMesh mesh = parse_any(written_by_others(name), is_xml ? "a.vtu" : "a.vtk");
    SCOPED_TRACE(name);
    expect_two_tetrahedra(mesh);
    ASSERT_EQ(mesh.regions.size(), 2u);
    EXPECT_EQ(mesh.region_names[mesh.regions[0]], "3");
    EXPECT_EQ(mesh.region_names[mesh.regions[1]], "7");
  }
}

TEST(TetrahedralFiles, AnyCutEndsWithAComplaint) {
  for (const char* name : {"msh_2_binary", "msh_4_binary"}) {
    const std::string whole = written_by_others(name);
    for (std::size_t bytes = 1; bytes + 20 < whole.size(); ++bytes) {
      EXPECT_NE(mesh_complaint(whole.substr(0, bytes)), "none") << name << ' ' << bytes;
    }
  }
  for (const char* name : {"vtu_inline_zlib", "vtu_ascii"}) {
    const std::string whole = written_by_others(name);
    for (std::size_t bytes = 1; bytes + 12 < whole.size(); ++bytes) {
      EXPECT_NE(mesh_complaint(whole.substr(0, bytes), "a.vtu"), "none") << name << ' ' << bytes;
    }
  }
}

TEST(Vtk, TakesTheArrayThatIsCalledLikeRegions) {
  const std::string data =
      "CELL_DATA 3\nSCALARS id int 1\nLOOKUP_TABLE default\n5 5 0\n"
      "FIELD FieldData 2\nregion 1 3 float\n1 2 0\nflow 1 3 double\n0.5 1 2\n";
  const TetrahedralMesh named = parse_vtk(vtk() + data, "a.vtk");
  EXPECT_EQ(named.region_names[named.regions[1]], "2");
  const TetrahedralMesh first = parse_vtk(vtk() + replaced(data, "region", "number"), "a.vtk");
  EXPECT_EQ(first.region_names[first.regions[1]], "5");
  const std::string none = replaced(replaced(data, "region", "number"), "5 5 0", "5 5 0.5");
  EXPECT_EQ(parse_vtk(vtk() + none, "a.vtk").region_names, std::vector<std::string>{});
  EXPECT_THAT(mesh_complaint(vtk() + replaced(data, "CELL_DATA 3", "CELL_DATA 2"), "a.vtk"),
              HasSubstr("as many as CELLS"));
  EXPECT_THAT(mesh_complaint(vtk() + "CELL_DATA 3\nSCALARS id string 1\na b c\n", "a.vtk"),
              HasSubstr("id = a: must be a finite number"));
}

TEST(Vtu, ReportsFileLineAndRule) {
  const std::string good = written_by_others("vtu_ascii");
  const auto complaint = [&](const std::string& from, const std::string& to) {
    return mesh_complaint(replaced(good, from, to), "a.vtu");
  };
  EXPECT_THAT(mesh_complaint("ply\n", "a.vtu"), HasSubstr("a.vtu:1: is not well-formed XML"));
  EXPECT_THAT(complaint("\"UnstructuredGrid\"", "\"PolyData\""),
              HasSubstr("must be a VTKFile of type UnstructuredGrid"));
  EXPECT_THAT(complaint("NumberOfCells=\"3\"", "NumberOfCells=\"4\""),
              HasSubstr("has 3 numbers: must be 4"));
  EXPECT_THAT(complaint("NumberOfPoints=\"5\"", "NumberOfPoints=\"999999999999\""),
              HasSubstr("NumberOfPoints"));
  EXPECT_THAT(complaint("type=\"UInt8\" Name=\"types\" format=\"ascii\"",
                        "type=\"Float64\" Name=\"types\" format=\"ascii\""),
              "none");
  EXPECT_THAT(complaint("10 10 3", "10 1e300 3"), HasSubstr("must be whole numbers from 0"));
  EXPECT_THAT(complaint("<VTKFile", "<!DOCTYPE a [<!ENTITY b \"c\">]><VTKFile"),
              HasSubstr("<!DOCTYPE: must not be"));
  EXPECT_THAT(complaint("</Piece>", "</Piece><Piece NumberOfPoints=\"0\"></Piece>"),
              HasSubstr("<Piece>: is given twice"));
  EXPECT_THAT(
      mesh_complaint(replaced(written_by_others("vtu_inline_zlib"), "vtkZLibData", "vtkLZMAData"),
                     "a.vtu"),
      HasSubstr("must be vtkZLibDataCompressor; save it with that or without one"));
}

TEST(Vtk, ReadsAsciiBinaryAndVersion5) {
  expect_two_tetrahedra(parse_vtk(vtk(), "a.vtk"));
  expect_two_tetrahedra(parse_vtk(vtk_5(), "a.vtk"));
  expect_two_tetrahedra(parse_vtk(vtk_binary(), "a.vtk"));
}

TEST(Msh, DropsNodesThatNoTetrahedronUses) {
  const std::string text =
      replaced(replaced(version_1(), "\n5\n", "\n6\n"), "9 1 1 1\n", "9 1 1 1\n5 7 7 7\n");

  EXPECT_THAT(parse_msh(text, "a.msh").nodes_m, SizeIs(5));
}

TEST(Msh, TurnsOverAMeshThatIsInvertedAsAWhole) {
  const std::string text =
      replaced(replaced(version_1(), "1 2 3 4\n", "2 1 3 4\n"), "9 2 4 3\n", "2 9 4 3\n");

  EXPECT_NEAR(enclosed_volume_m3(surface_of(parse_msh(text, "a.msh"))), 0.5, 1e-12);
}

TEST(Msh, ReportsFileLineAndRule) {
  const std::string good = version_1();
  // element 2 is in line 12, element 3 in line 13
  EXPECT_THAT(mesh_complaint(replaced(good, "9 2 4 3\n", "2 9 4 3\n")),
              HasSubstr("a.msh:13: element 3: is inverted, as are 1 of 2"));
  EXPECT_THAT(mesh_complaint(replaced(good, "1 2 3 4\n", "1 2 3 3\n")),
              HasSubstr("a.msh:12: element 2: has no volume"));
  EXPECT_THAT(mesh_complaint(replaced(good, "1 2 3 4\n", "1 2 3 8\n")),
              HasSubstr("a.msh:12: element 2: node 8: does not exist"));
  EXPECT_THAT(mesh_complaint(replaced(good, "9 1 1 1", "4 1 1 1")),
              HasSubstr("a.msh:7: node 4: is given twice"));
  EXPECT_THAT(mesh_complaint(replaced(good, "9 1 1 1", "9 1 1e999 1")),
              HasSubstr("a.msh:7: y = 1e999"));
  EXPECT_THAT(mesh_complaint(replaced(good, "$NOD\n5", "$NOD\n4")),
              HasSubstr("must be $ENDNOD; does the count fit?"));
  EXPECT_THAT(mesh_complaint(replaced(good, "$NOD\n5", "$NOD\n999999999")), HasSubstr("too short"));
  EXPECT_THAT(mesh_complaint(replaced(good, "2 4 1 1 4 1", "2 5 1 1 4 1")),
              HasSubstr("a.msh:12: element 2 of type 5: volumes must be tetrahedra"));
  EXPECT_THAT(mesh_complaint(good.substr(0, good.find("$ELM"))),
              HasSubstr("must have nodes and elements"));
  EXPECT_THAT(mesh_complaint("ply\n"), HasSubstr("a.msh:1: 'ply': must begin a section"));
  EXPECT_THAT(mesh_complaint(replaced(version_2(), "2.2 0", "2.2 1")),
              HasSubstr("byte order: must be the number 1"));
  EXPECT_THAT(mesh_complaint(replaced(version_2(), "2.2 0", "3.0 0")),
              HasSubstr("must be 1, 2.2 or 4.1"));
  EXPECT_THAT(mesh_complaint(replaced(version_2(), "$EndPhysicalNames", "$EndNames")),
              HasSubstr("must be $EndPhysicalNames; does the count fit?"));
  EXPECT_THAT(mesh_complaint("$NOD\n1\n1 0 0 0\n$ENDNOD\n$ELM\n0\n$ENDELM\n"),
              HasSubstr("has no tetrahedra"));
}

TEST(Vtk, ReportsFileLineAndRule) {
  EXPECT_THAT(mesh_complaint("ply\n", "a.vtk"), HasSubstr("a.vtk:1: must begin with"));
  EXPECT_THAT(mesh_complaint(replaced(vtk(), "UNSTRUCTURED_GRID", "POLYDATA"), "a.vtk"),
              HasSubstr("a.vtk:4: DATASET POLYDATA"));
  EXPECT_THAT(mesh_complaint(replaced(vtk(), "4 0 1 2 3", "99 0 1 2 3"), "a.vtk"),
              HasSubstr("cell 0: has 99 nodes"));
  EXPECT_THAT(mesh_complaint(replaced(vtk(), "4 0 1 2 3", "4 0 1 2 7"), "a.vtk"),
              HasSubstr("does not exist"));
  EXPECT_THAT(mesh_complaint(replaced(vtk(), "CELL_TYPES 3", "CELL_TYPES 2"), "a.vtk"),
              HasSubstr("as many as CELLS"));
  EXPECT_THAT(mesh_complaint(replaced(vtk_5(), "0 4 8", "0 4 9"), "a.vtk"), HasSubstr("OFFSETS"));
  const std::string binary = vtk_binary();
  for (std::size_t bytes = 30; bytes + 2 < binary.size(); ++bytes) {
    EXPECT_NE(mesh_complaint(binary.substr(0, bytes), "a.vtk"), "none") << bytes;
  }
}

}  // namespace
}  // namespace palpate::physics
