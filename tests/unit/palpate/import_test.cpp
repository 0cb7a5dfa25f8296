// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/imported_organ.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <sstream>

#include "common/core/check.h"
#include "common/core/workspace_map.h"
#include "common/session/materials.h"
#include "common/session/session_file.h"
#include "deploy/palpate/import/import_site.h"
#include "deploy/palpate/import/import_text.h"
#include "deploy/palpate/import/organ_labels.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// A body of 80 × 60 × 50 mm, voxels of 1.5 mm in RAS; a lesion in front, to the patient's left and
/// towards the head; a stalk below.
scan::LabelMap patient() {
  scan::LabelMap map;
  map.size = {60, 40, 48};
  map.ras_of_index_m.linear() = 1.5e-3 * Matrix3::Identity();
  map.segments = {
      {.value = 1, .name = "liver"}, {.value = 2, .name = "tumor"}, {.value = 3, .name = "stalk"}};
  for (int k = 0; k < 48; ++k) {
    for (int j = 0; j < 40; ++j) {
      for (int i = 0; i < 60; ++i) {
        const Vector3 p = 1.5 * Vector3(i - 30, j - 20.2, k - 24.4);
        const bool is_in = p.cwiseQuotient(Vector3(40, 25, 30)).norm() < 1.0;
        const bool is_lesion = (p - Vector3(-12, 10, 8)).norm() < 8.0;
        map.voxels.push_back(!is_in ? 0 : is_lesion ? 2 : p.y() < -15.0 ? 3 : 1);
        if (is_in) ++map.segments[map.voxels.back() - 1U].voxels;
      }
    }
  }
  return map;
}

std::string complaint_of(const ImportOptions& options) {
  try {
    (void)imported_organ(patient(), options, "a.nii.gz");
  } catch (const SetupError& error) {
    return error.what();
  }
  return "";
}

TEST(Import, NeverMirrorsThePatient) {
  for (const char* up : {"anterior", "posterior", "right", "left", "superior", "inferior"}) {
    EXPECT_TRUE(world_of_ras(up).isUnitary(1e-12)) << up;
    EXPECT_NEAR(world_of_ras(up).determinant(), 1.0, 1e-12) << up;
  }
  EXPECT_TRUE((world_of_ras("anterior") * Vector3(1, 2, 3)).isApprox(Vector3(-1, 3, 2)));
  EXPECT_TRUE((world_of_ras("left") * Vector3(1, 2, 3)).isApprox(Vector3(-2, 3, -1)));
  EXPECT_THROW((void)world_of_ras("front"), SetupError);
}

TEST(Import, WritesASessionWithItsLesionWhereThePatientHasIt) {
  const ImportedOrgan organ =
      imported_organ(patient(), {.fixed = {"stalk"}, .tetrahedra = 2500}, "a.nii.gz");

  EXPECT_TRUE(organ.files.contains("surface_tumor.stl"));
  EXPECT_THAT(organ.report, AllOf(HasSubstr("PMC6925591"), HasSubstr("WARNING: assumed"),
                                  HasSubstr("0 slivers")));
  const test::TempFolder folder;
  for (const auto& [name, content] : organ.files) folder.write(name, content);
  const Session session = load_session(folder.path() / kImportedSession, {});
  const auto bodies = physics::elastic_bodies_of(session.scene);
  ASSERT_EQ(bodies.size(), 1u);
  const elastic::Mesh& mesh = bodies[0]->body->mesh();

  // W: x to the patient's left, y to the head, z to the front; the surface above the lesion at 0.
  // The front of the body there: 25 mm · √(1 − (12/40)² − (8/30)²) = 22.9 mm
  Vector3 lesion_m = Vector3::Zero();
  Vector3 stalk_m = Vector3::Zero();
  double lesion_nodes = 0.0;
  double highest_m = -1.0;
  const physics::TetrahedralMesh read =
      physics::parse_msh(organ.files.at(kImportedMesh), "organ.msh");
  for (std::size_t e = 0; e < read.tetrahedra.size(); ++e) {
    for (const std::uint32_t node : read.tetrahedra[e]) {
      highest_m = std::max(highest_m, read.nodes_m[node].z());
      if (read.region_names[read.regions[e]] == "tumor") {
        lesion_m += read.nodes_m[node];
        lesion_nodes += 1.0;
      } else if (read.region_names[read.regions[e]] == "stalk") {
        stalk_m = read.nodes_m[node];
      }
    }
  }
  EXPECT_LT((lesion_m / lesion_nodes - Vector3(0, 0, -0.0129)).norm(), 0.002);
  EXPECT_NEAR(highest_m, 0.0021, 0.001);
  // the middle of the body is to the right of the lesion and nearer to the feet
  Vector3 middle_m = Vector3::Zero();
  for (const Vector3& node_m : read.nodes_m)
    middle_m += node_m / static_cast<double>(read.nodes_m.size());
  EXPECT_LT(middle_m.x(), -0.004);
  EXPECT_LT(middle_m.y(), -0.002);
  EXPECT_LT(stalk_m.z(), -0.03);

  // the report leads from the scan to W: where the middle of the lesion is at 1.5 (22, 26.9, 29.7)
  // mm
  std::istringstream matrix(organ.report.substr(organ.report.find("to W, in mm:\n") + 13));
  Eigen::Matrix4d world_of_image;
  for (int i = 0; i < 16; ++i) matrix >> world_of_image(i / 4, i % 4);
  const Vector3 there_mm = (world_of_image * Eigen::Vector4d(33, 40.3, 44.6, 1)).head<3>();
  EXPECT_LT((1e-3 * there_mm - Vector3(0, 0, -0.0129)).norm(), 0.002);

  // the hand presses in the middle of it, wherever the workspace is laid
  const Side& side = session.side();
  const auto& path = std::get<SinusoidPath>(side.hand.path);
  const WorkspaceMap map(side.device.workspace);
  const Vector3 lowest_m =
      map.tool_position_world_m(path.center_m - Vector3(0, 0, path.amplitude_m.z()));
  EXPECT_NEAR(lowest_m.x(), 0.0, 1e-5);
  EXPECT_NEAR(lowest_m.y(), 0.0, 1e-5);
  EXPECT_NEAR(lowest_m.z(), session.scene.tip_radius_m - 0.008, 1e-5);
  EXPECT_THAT(organ.report, HasSubstr("Reach (a proposal for the simulated device"));

  // the stalk is held, the lesion has a material of its own
  for (const std::uint32_t node : bodies[0]->body->description().fixed_nodes)
    EXPECT_LT(mesh.nodes_m[node].z(), -0.03);
  EXPECT_GT(bodies[0]->body->description().fixed_nodes.size(), 20u);
  double share = 0.0;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) share += mesh.regions[e] != 0 ? 1.0 : 0.0;
  EXPECT_GT(share, 10.0);
  const auto& material = std::get<ElasticMaterial>(session.scene.tissues[0].material);
  EXPECT_DOUBLE_EQ(material.young_pa, 5200.0);
  EXPECT_DOUBLE_EQ(material.parts.at(0).young_pa, 20'200.0);
}

/// The middle of the voxels of a segment, in right, anterior, superior.
Vector3 middle_m(const scan::LabelMap& map, std::size_t segment) {
  Vector3 sum = Vector3::Zero();
  double count = 0.0;
  for (std::uint32_t k = 0; k < map.size[2]; ++k) {
    for (std::uint32_t j = 0; j < map.size[1]; ++j) {
      for (std::uint32_t i = 0; i < map.size[0]; ++i) {
        if (map.at(i, j, k) != segment + 1) continue;
        sum += map.ras_of_index_m * Vector3(i, j, k);
        count += 1.0;
      }
    }
  }
  return sum / count;
}

TEST(OrganLabels, AreTheSameBodyInEveryGridAndFormat) {
  OrganLabels oblique{.voxel_mm = {1.5, 2.0, 3.0}, .oblique_degrees = 25.0};
  const scan::LabelMap nrrd = scan::parse_nrrd(organ_labels_text(oblique, false), "a.seg.nrrd");
  const scan::LabelMap nifti = scan::parse_nifti(organ_labels_text(oblique, true), "a.nii");
  const scan::LabelMap plain = scan::parse_nrrd(organ_labels_text({}, false), "a.seg.nrrd");
  EXPECT_EQ(nrrd.voxels, nifti.voxels);
  EXPECT_TRUE(nrrd.ras_of_index_m.isApprox(nifti.ras_of_index_m, 1e-6));
  ASSERT_EQ(nrrd.segments.size(), 3u);
  EXPECT_EQ(nrrd.segments[1].name, "tumor");
  // 20 mm to the patient's left, 5 mm to the head, 12 mm to the front
  for (const scan::LabelMap* map : {&nrrd, &nifti, &plain}) {
    EXPECT_LT((middle_m(*map, 1) - Vector3(-0.02, 0.012, 0.005)).norm(), 0.0005);
    const double ball_m3 = 4.0 / 3.0 * 3.14159265 * std::pow(0.007, 3);
    EXPECT_NEAR(static_cast<double>(map->segments[1].voxels) * map->voxel_m3() / ball_m3, 1.0, 0.1);
  }
  EXPECT_THROW((void)organ_labels_text({.voxel_mm = {0.1, 0.1, 0.1}}, false), SetupError);
}

TEST(OrganLabels, BecomeAnOrganObliqueWithAThinLobe) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "takes minutes with sanitizers";
#endif
  const OrganLabels labels{
      .voxel_mm = {1.0, 1.5, 2.5}, .oblique_degrees = 25.0, .has_thin_lobe = true};
  const scan::LabelMap map = scan::parse_nrrd(organ_labels_text(labels, false), "a.seg.nrrd");

  const ImportedOrgan organ =
      imported_organ(map, {.fixed = {"ligament"}, .cell_m = 0.004}, "a.seg.nrrd");

  EXPECT_THAT(organ.report, AllOf(HasSubstr("0 slivers"), HasSubstr("tumor")));
  const physics::TetrahedralMesh mesh =
      physics::parse_msh(organ.files.at(kImportedMesh), "organ.msh");
  double left_m = -1.0;
  for (const Vector3& node_m : mesh.nodes_m) left_m = std::max(left_m, node_m.x());
  // the lobe ends 85 mm left of the middle, the lesion is at 20 mm and becomes the origin
  EXPECT_NEAR(left_m, 0.065, 0.004);
}

TEST(Import, ATagThatTheMeshDoesNotHaveIsNamed) {
  const ImportedOrgan organ = imported_organ(patient(), {.tetrahedra = 1500}, "a.nii.gz");
  const test::TempFolder folder;
  for (const auto& [name, content] : organ.files) folder.write(name, content);
  const Session session = load_session(folder.path() / kImportedSession,
                                       {"scene.tissue[0].elastic.part[0].where.tag=\"lesion\""});
  try {
    (void)physics::elastic_bodies_of(session.scene);
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("tag: \"lesion\": the mesh has only the regions"),
                                    HasSubstr("\"liver\"")));
  }
}

/// Two balls of 16 mm and 12 mm radius, 60 mm apart: "kidney left", "kidney right", and a lesion in
/// the second.
scan::LabelMap two_kidneys() {
  scan::LabelMap map;
  map.size = {70, 28, 28};
  map.ras_of_index_m.linear() = 1.5e-3 * Matrix3::Identity();
  map.segments = {{.value = 1, .name = "kidney left"},
                  {.value = 2, .name = "kidney right"},
                  {.value = 3, .name = "cyst"}};
  for (int k = 0; k < 28; ++k) {
    for (int j = 0; j < 28; ++j) {
      for (int i = 0; i < 70; ++i) {
        const Vector3 p = 1.5 * Vector3(i - 14.3, j - 13.7, k - 14.1);
        const Vector3 q = p - Vector3(60, 0, 0);
        map.voxels.push_back(p.norm() < 16.0                       ? 1
                             : q.norm() < 12.0 && (q.norm() < 5.0) ? 3
                             : q.norm() < 12.0                     ? 2
                                                                   : 0);
        if (map.voxels.back() != 0) ++map.segments[map.voxels.back() - 1U].voxels;
      }
    }
  }
  return map;
}

TEST(Import, OfApartBodiesOnlyTheLargestIsMeshedAndTouched) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const ImportedOrgan organ = imported_organ(two_kidneys(), {}, "a.nii.gz");
  const physics::TetrahedralMesh mesh =
      physics::parse_msh(organ.files.at(kImportedMesh), "organ.msh");
  Vector3 low_m = mesh.nodes_m.front();
  Vector3 high_m = low_m;
  for (const Vector3& node_m : mesh.nodes_m) {
    low_m = low_m.cwiseMin(node_m);
    high_m = high_m.cwiseMax(node_m);
  }
  // its highest point is at the origin
  EXPECT_NEAR(high_m.x(), 0.016, 0.001);
  EXPECT_NEAR(low_m.x(), -0.016, 0.001);
  EXPECT_NEAR(high_m.z(), 0.0, 0.001);
  EXPECT_THAT(organ.report, HasSubstr("WARNING: nothing of it is in the mesh"));

  try {
    (void)imported_organ(two_kidneys(), {.lesions = {"cyst"}}, "a.nii.gz");
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("--lesion \"cyst\""), HasSubstr("--label")));
  }
}

TEST(Import, AValueThatTwoSegmentsShareIsNoChoice) {
  scan::LabelMap map = two_kidneys();
  map.segments[1].value = map.segments[0].value;
  map.segments[1].layer = 1;
  const std::string value = std::to_string(map.segments[0].value);
  try {
    (void)imported_organ(std::move(map), {.labels = {value}}, "a.nii.gz");
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("--label " + value), HasSubstr("give a name")));
  }
}

TEST(Import, LongAndSimilarNamesGiveFilesOfTheirOwn) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  scan::LabelMap map = patient();
  map.segments[0].name = std::string(1200, 'x');
  map.segments[1].name = "tumor a/b";
  map.segments[2].name = "tumor a_b";
  const ImportedOrgan organ = imported_organ(std::move(map), {}, "a.nii.gz");
  std::size_t surfaces = 0;
  for (const auto& [name, content] : organ.files) {
    EXPECT_LT(name.size(), 100u);
    if (name.starts_with("surface_")) ++surfaces;
  }
  EXPECT_EQ(surfaces, 3u);
}

TEST(Import, ALineThroughANodeHasATopAndABottom) {
  // a pyramid on its tip: the line through the tip meets four faces at one height, or nearly
  physics::TriangleMesh surface;
  surface.vertices_m = {{0.1, 0.1, 0},
                        {-0.1, 0.1, 0},
                        {-0.1, -0.1, 0},
                        {0.1, -0.1, 0},
                        {1e-9, 0, 0.0300000000000001}};
  surface.triangles = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}, {0, 2, 1}, {0, 3, 2}};
  for (const double x : {0.0, 1e-9, 1e-10}) {
    const Column column = column_at(surface, x, 0.0);
    EXPECT_NEAR(column.top_m, 0.03, 1e-6);
    EXPECT_NEAR(column.below_m, 0.0, 1e-6);
  }
}

TEST(Import, TellsWhatASolutionTakesAndChoosesTheSolveRateByIt) {
  const ImportedOrgan organ = imported_organ(
      patient(), {.fixed = {"stalk"}, .tetrahedra = 1500, .is_timed = true}, "a.nii.gz");
  EXPECT_THAT(organ.report, HasSubstr("a full solution takes"));
  const test::TempFolder folder;
  for (const auto& [name, content] : organ.files) folder.write(name, content);
  const Session session = load_session(folder.path() / kImportedSession, {});
  const auto& material = std::get<ElasticMaterial>(session.scene.tissues[0].material);
  EXPECT_THAT(material.solve_rate_hz, ::testing::AnyOf(50.0, 25.0, 10.0, 5.0));
}

// Their quadratic elements would take gigabytes.
TEST(Import, OfVeryManyTetrahedraTheElementsAreLinear) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const auto is_linear = [](std::size_t tetrahedra) {
    const ImportedOrgan organ = imported_organ(patient(), {.tetrahedra = tetrahedra}, "a.nii.gz");
    return organ.files.at(kImportedSession).find("linear_elements: true") != std::string::npos &&
           organ.report.find("as linear elements") != std::string::npos;
  };
  EXPECT_TRUE(is_linear(28'000));
  EXPECT_FALSE(is_linear(1500));
}

TEST(Import, KeepsNamesInEveryAlphabet) {
  std::string bytes = organ_labels_text({.voxel_mm = {3, 3, 3}}, false);
  const auto rename = [&](const std::string& from, const std::string& to) {
    bytes.replace(bytes.find("_Name:=" + from) + 7, from.size(), to);
  };
  rename("tumor", "tum\xc3\xb6r");
  rename("liver", "\xe8\x82\x9d\xe8\x87\x93");
  rename("ligament", "band\xc3\"\xe2\x82");  // invalid, and a quotation mark
  const scan::LabelMap read = scan::parse_nrrd(bytes, "a.seg.nrrd");
  EXPECT_EQ(read.segments[1].name, "tum\xc3\xb6r");
  EXPECT_EQ(read.segments[0].name, "\xe8\x82\x9d\xe8\x87\x93");
  EXPECT_EQ(read.segments[2].name, "band????");

  const ImportedOrgan organ = imported_organ(
      read, {.lesions = {"tum\xc3\xb6r"}, .fixed = {"band????"}, .tetrahedra = 2000}, "a");

  const test::TempFolder folder;
  for (const auto& [name, content] : organ.files) folder.write(name, content);
  const Session session = load_session(folder.path() / kImportedSession, {});
  EXPECT_EQ(physics::elastic_bodies_of(session.scene).size(), 1u);
}

/// A box of voxels of one label.
scan::LabelMap box(const std::array<std::uint32_t, 3>& size, double voxel_m) {
  scan::LabelMap map;
  map.size = {size[0] + 4, size[1] + 4, size[2] + 4};
  map.ras_of_index_m.linear() = voxel_m * Matrix3::Identity();
  map.segments = {{.value = 1, .name = "liver"}};
  for (std::uint32_t k = 0; k < map.size[2]; ++k) {
    for (std::uint32_t j = 0; j < map.size[1]; ++j) {
      for (std::uint32_t i = 0; i < map.size[0]; ++i) {
        const bool is_in = i - 2U < size[0] && j - 2U < size[1] && k - 2U < size[2];
        map.voxels.push_back(is_in ? 1 : 0);
        map.segments[0].voxels += is_in ? 1 : 0;
      }
    }
  }
  return map;
}

TEST(Import, SaysWhatIsWrongWithTheSizeOfABody) {
  const auto complaint = [](scan::LabelMap map) -> std::string {
    try {
      (void)imported_organ(std::move(map), {.tetrahedra = 600}, "a.nii.gz");
    } catch (const SetupError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(complaint(box({1, 1, 1}, 2e-3)), HasSubstr("as thin as its voxels"));
  // micrometres instead of millimetres
  EXPECT_THAT(complaint(box({20, 15, 12}, 2e-6)),
              AllOf(HasSubstr("a.nii.gz: the body is 0.0"), HasSubstr("check the unit")));
}

// Its volume is right, because what is left is thicker.
TEST(Import, WarnsWherePartsThinnerThanACellAreMissing) {
  const ImportedOrgan organ =
      imported_organ(box({40, 40, 1}, 2e-3), {.tetrahedra = 1000}, "a.nii.gz");
  EXPECT_THAT(organ.report, HasSubstr("WARNING: the mesh ends "));
}

TEST(ImportText, AColumnHasWholeCharacters) {
  EXPECT_EQ(column("\xe8\x82\x9d\xe8\x87\x93", 1), "\xe8\x82\x9d");
  EXPECT_EQ(column("\xe8\x82\x9d", 3), "\xe8\x82\x9d  ");
  EXPECT_EQ(column("liver", 5), "liver");
  EXPECT_EQ(column("", 2), "  ");
}

TEST(Import, NamesALabelThatIsNotThere) {
  EXPECT_THAT(complaint_of({.labels = {"livre"}}), HasSubstr("did you mean \"liver\"?"));
  EXPECT_THAT(complaint_of({.labels = {"liver"}, .fixed = {"stalk"}}),
              HasSubstr("is not one of --label"));
  EXPECT_THAT(complaint_of({.up = "front"}), HasSubstr("--up front"));
  EXPECT_THAT(complaint_of({.labels = {"tumor"}, .fixed = {"tumor"}, .tetrahedra = 400}),
              HasSubstr("all nodes are fixed"));
}

TEST(Materials, AreFoundByNameAndCode) {
  EXPECT_STREQ(material_for("Liver", "")->name, "liver");
  EXPECT_STREQ(material_for("region", "SCT:10200004")->name, "liver");
  EXPECT_STREQ(material_for("liver_tumor", "")->name, "focal lesion");
  EXPECT_EQ(material_for("liver_vessels", ""), nullptr);
  EXPECT_EQ(material_for("spleen", ""), nullptr);
  EXPECT_EQ(material_for("masseter_right", ""), nullptr);
  EXPECT_STREQ(material_for("masses", "")->name, "focal lesion");
  EXPECT_STREQ(material_for("tumors_2", "")->name, "focal lesion");
  EXPECT_TRUE(is_lesion("Segment_1", "SCT:4147007"));
  EXPECT_FALSE(is_lesion("liver", ""));
  for (const TissueMaterial& material : tissue_materials()) {
    EXPECT_LE(material.least_pa, material.young_pa);
    EXPECT_GE(material.largest_pa, material.young_pa);
  }
}

}  // namespace
}  // namespace palpate
