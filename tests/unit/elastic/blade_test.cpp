// SPDX-License-Identifier: Apache-2.0
// A blade that cuts an elastic body.
#include "physics_node/elastic_tissue/blade/blade_sweep.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <ostream>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "physics_node/elastic/cut/separated_mesh.h"
#include "physics_node/elastic/support.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/temp_folder.h"

namespace palpate::elastic {
namespace {

Mesh unit_box(int cells) {
  const std::vector<double> planes = equal_planes(0.0, 1.0, cells);
  return box_mesh(planes, planes, planes);
}

std::vector<std::uint32_t> all_of(const Mesh& mesh) {
  std::vector<std::uint32_t> elements(mesh.element_count());
  for (std::uint32_t e = 0; e < elements.size(); ++e) elements[e] = e;
  return elements;
}

Vector3d centroid_m(const Mesh& mesh, std::size_t element) {
  Vector3d sum = Vector3d::Zero();
  for (const std::uint32_t node : mesh.element(element).first(4)) sum += 0.25 * mesh.nodes_m[node];
  return sum;
}

Vector3d face_m(const Mesh& mesh, FaceSide side) {
  Vector3d sum = Vector3d::Zero();
  for (const int k : kFaces[side % 4]) {
    sum += mesh.nodes_m[mesh.element(side / 4)[static_cast<std::size_t>(k)]] / 3.0;
  }
  return sum;
}

/// Between the two sides of the plane x = 0.5, as far as y < until.
FaceCuts cuts_until(const Mesh& mesh, const std::vector<std::int32_t>& opposite, double until) {
  FaceCuts cuts{.opposite = opposite, .is_cut = std::vector<char>(opposite.size(), 0)};
  for (FaceSide side = 0; side < opposite.size(); ++side) {
    if (opposite[side] == kNoSide) continue;
    const auto other = static_cast<std::size_t>(opposite[side]) / 4;
    const bool is_left = centroid_m(mesh, side / 4).x() < 0.5;
    const bool is_other_left = centroid_m(mesh, other).x() < 0.5;
    if (is_left != is_other_left && face_m(mesh, side).y() < until) cuts.is_cut[side] = 1;
  }
  return cuts;
}

double volume_m3(const Mesh& mesh) { return quality_of(mesh).volume_m3; }

// A plane of the mesh: its 4 × 4 squares of two faces each, and 5 × 5 nodes.
TEST(SeparatedMesh, ACutThroughAllLeavesTwoBodies) {
  const Mesh whole = unit_box(4);
  const std::vector<std::int32_t> opposite = opposite_sides(whole);
  const FaceCuts cuts = cuts_until(whole, opposite, 2.0);
  const SeparatedMesh made = separated_mesh(whole, all_of(whole), cuts);
  EXPECT_EQ(made.nodes.size(), whole.nodes_m.size() + 25);
  const CutArea cut = cut_area(whole, all_of(whole), cuts, made.mesh);
  EXPECT_EQ(cut.faces, 32U);
  EXPECT_NEAR(cut.area_m2, 1.0, 1e-12);
  EXPECT_NEAR(volume_m3(made.mesh), 1.0, 1e-12);
  EXPECT_EQ(surface_of(made.mesh).size(), surface_of(whole).size() + 64);
  // only the left half is held: the right one falls
  const auto held = nodes_where(made.mesh, [](const Vector3d& at) { return at.x() < 1e-9; });
  EXPECT_EQ(loose_elements(made.mesh, held).size(), whole.element_count() / 2);
}

// Half of it: the nodes of the front are one.
TEST(SeparatedMesh, AtItsFrontACutHasOneCopyOfEachNode) {
  const Mesh whole = unit_box(4);
  const std::vector<std::int32_t> opposite = opposite_sides(whole);
  const SeparatedMesh made = separated_mesh(whole, all_of(whole), cuts_until(whole, opposite, 0.5));
  EXPECT_EQ(made.nodes.size(), whole.nodes_m.size() + 10);  // y = 0 and 0.25, 5 each
  std::map<std::uint32_t, int> copies;
  for (const std::uint32_t node : made.nodes) ++copies[node];
  for (const auto& [node, count] : copies) {
    const Vector3d& at = whole.nodes_m[node];
    EXPECT_EQ(count, std::abs(at.x() - 0.5) < 1e-9 && at.y() < 0.5 - 1e-9 ? 2 : 1);
  }
}

/// Faces of any kind: whatever is cut, elements keep their shape and what is not cut holds.
class RandomCuts : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(LinearAndQuadratic, RandomCuts, testing::Bool());
TEST_P(RandomCuts, KeepEveryElementAndEveryFaceThatIsNotCut) {
  const Mesh whole = GetParam() ? quadratic(unit_box(3)) : unit_box(3);
  const std::vector<std::int32_t> opposite = opposite_sides(whole);
  int copied = 0;
  for (const std::uint64_t seed : test::seeds(30)) {
    std::mt19937_64 random(seed);
    FaceCuts wild{.opposite = opposite, .is_cut = std::vector<char>(opposite.size(), 0)};
    const double share = std::uniform_real_distribution<double>(0.01, 0.6)(random);
    for (FaceSide side = 0; side < opposite.size(); ++side) {
      if (opposite[side] == kNoSide || opposite[side] < static_cast<std::int32_t>(side)) continue;
      if (std::uniform_real_distribution<double>(0, 1)(random) > share) continue;
      wild.is_cut[side] = wild.is_cut[static_cast<std::size_t>(opposite[side])] = 1;
    }
    const FaceCuts cuts = clean_cuts(whole, all_of(whole), wild);
    const SeparatedMesh made = separated_mesh(whole, all_of(whole), cuts);
    copied += static_cast<int>(made.nodes.size() - whole.nodes_m.size());
    ASSERT_EQ(made.mesh.element_count(), whole.element_count());
    EXPECT_TRUE(std::is_sorted(made.nodes.begin(), made.nodes.end()));
    for (std::size_t e = 0; e < whole.element_count(); ++e) {
      for (std::size_t k = 0; k < whole.element(e).size(); ++k) {
        ASSERT_EQ(made.nodes[made.mesh.element(e)[k]], whole.element(e)[k]);
      }
    }
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> faces_at;
    for (const Face& face : surface_of(made.mesh)) {
      for (std::size_t i = 0; i < 3; ++i) {
        ++faces_at[std::minmax(face.nodes[i], face.nodes[(i + 1) % 3])];
      }
    }
    for (const auto& [edge, count] : faces_at) ASSERT_EQ(count, 2) << seed;
    for (FaceSide side = 0; side < opposite.size(); ++side) {
      if (opposite[side] == kNoSide || cuts.is_there(side)) continue;
      const auto other = made.mesh.element(static_cast<std::size_t>(opposite[side]) / 4);
      for (const int corner : kFaces[side % 4]) {
        const std::uint32_t node = made.mesh.element(side / 4)[static_cast<std::size_t>(corner)];
        ASSERT_NE(std::find(other.begin(), other.end(), node), other.end()) << seed;
      }
    }
  }
  EXPECT_GT(copied, 100) << "this says nothing";
}

}  // namespace
}  // namespace palpate::elastic

namespace palpate::physics {
namespace {

constexpr double kBladeTip_m = 0.002;
constexpr double kCutToughness_joule_per_m2 = 100.0;
constexpr double kCutDepth_m = 0.008;  // of the tip below the top, which is at z = 0
constexpr double kBladeEdge_m = 0.02;
constexpr double kBladeReach_m = 0.05;
constexpr double kBladeTick_s = 1e-3;
constexpr double kCutSpeed_m_per_s = 0.02;
constexpr double kCutForce_newton = kCutToughness_joule_per_m2 * kCutDepth_m;

class BladeScene : public testing::Test {
 protected:
  BladeScene() { set(15, 7, 5); }

  /// A block of 60 × 30 × 20 mm of so many cells, five tetrahedra each.
  void set(int along, int across, int up) {
    const elastic::Mesh box = elastic::box_mesh(elastic::equal_planes(-0.03, 0.03, along),
                                                elastic::equal_planes(-0.015, 0.015, across),
                                                elastic::equal_planes(-0.02, 0.0, up));
    ElasticMaterial material{.young_pa = 20e3, .viscosity_s = 0.002};
    material.is_linear = true;
    material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0199}}};
    material.pierced = {.toughness_joule_per_m2 = kCutToughness_joule_per_m2};
    scene_.tip_radius_m = kBladeTip_m;
    scene_.blade = BladeConfig{.length_m = kBladeEdge_m, .reach_m = 0.005};
    scene_.tissues = {
        {.name = "block",
         .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                  .file = folder_.write("block" + std::to_string(along) + ".msh",
                                                        msh_text(test::tetrahedra_of(box)))},
         .material = material}};
  }
  ElasticMaterial::Pierced& pierced() {
    return *std::get<ElasticMaterial>(scene_.tissues[0].material).pierced;
  }

  TempFolder folder_;
  SceneConfig scene_;
};

/// Leads a blade along x, and counts the work of the hand.
class BladeHand {
 public:
  explicit BladeHand(const SceneConfig& scene, double y_m = 0.001)
      : elastic_(ElasticTissues::of(scene, 1, ElasticPace::kVirtual)),
        tip_m_(-0.034, y_m, -kCutDepth_m) {}

  void step(const Vector3& way_m) {
    tip_m_ += way_m;
    time_s_ += kBladeTick_s;
    SceneForce force;
    std::optional<GripReport> report;
    if (reported_slip_m_ && is_in()) {
      report = {.number = contact_->grip.number, .slip_m = *reported_slip_m_};
    }
    elastic_->step(0, tip_m_, time_s_, kBladeReach_m, force,
                   {.velocity_m_per_s = way_m / kBladeTick_s,
                    .report = report,
                    .inward_world = Vector3::UnitX(),
                    .is_felt_elsewhere = is_felt_elsewhere_});
    const Vector3 before = newton_;
    const double depth_m = this->depth_m();
    newton_ = force.force_on_tool_newton;
    work_joule_ -= 0.5 * (before + newton_).dot(way_m);
    least_work_joule_ = std::min(least_work_joule_, work_joule_);
    contact_ = force.listed_count > 0 ? std::optional(force.contacts[0]) : std::nullopt;
    if (!is_in()) return;
    blade_joule_ -= newton_.x() * (this->depth_m() - depth_m);
    // tissue that is raised in front of it has more of the edge in it
    const double further_m = std::max(0.0, this->depth_m() - deepest_m_);
    swept_m2_ += further_m * (kCutDepth_m - contact_->grip.slip_m.z());
    deepest_m_ += further_m;
  }
  /// The hand feels what mofc_node computes, once that knows of the blade.
  void be_far_away() { is_felt_elsewhere_ = true; }
  /// From now on mofc_node says how far it has slipped.
  void report_slip(const Vector3& slip_m) { reported_slip_m_ = slip_m; }
  [[nodiscard]] Vector3 slip_m() const {
    return is_in() ? Vector3(contact_->grip.slip_m) : Vector3(Vector3::Zero());
  }
  [[nodiscard]] double cut_joule() { return tissue().ablation().figures().cut_joule; }
  /// At 20 mm/s.
  void go_to(const Vector3& to_m, double m_per_s = kCutSpeed_m_per_s) {
    const double length_m = (to_m - tip_m_).norm();
    const int ticks = std::max(1, static_cast<int>(std::ceil(length_m / (m_per_s * kBladeTick_s))));
    const Vector3 way_m = (to_m - tip_m_) / ticks;
    for (int tick = 0; tick < ticks; ++tick) step(way_m);
  }
  void go_to(double x_m) { go_to(Vector3(x_m, tip_m_.y(), tip_m_.z())); }
  void wait(double seconds) {
    for (int tick = 0; tick < seconds / kBladeTick_s; ++tick) step(Vector3::Zero());
  }
  [[nodiscard]] bool is_in() const { return contact_ && contact_->grip.needle.is_blade(); }
  [[nodiscard]] double depth_m() const { return is_in() ? contact_->grip.slip_m.x() : 0.0; }
  [[nodiscard]] const Vector3& newton() const { return newton_; }
  [[nodiscard]] double work_joule() const { return work_joule_; }
  [[nodiscard]] double least_work_joule() const { return least_work_joule_; }
  /// Of that: what it has done along its way past the tissue.
  [[nodiscard]] double blade_joule() const { return blade_joule_; }
  /// By its way past the tissue alone.
  [[nodiscard]] double swept_m2() const { return swept_m2_; }
  [[nodiscard]] ElasticTissue& tissue() { return *elastic_->tissues()[0]; }
  [[nodiscard]] ElasticTissues& tissues() { return *elastic_; }

 private:
  std::shared_ptr<ElasticTissues> elastic_;
  Vector3 tip_m_;
  double time_s_ = 0.0;
  Vector3 newton_ = Vector3::Zero();
  double work_joule_ = 0.0;
  double least_work_joule_ = 0.0;
  double blade_joule_ = 0.0;
  double swept_m2_ = 0.0;
  double deepest_m_ = 0.0;
  std::optional<Contact> contact_;
  std::optional<Vector3> reported_slip_m_;
  bool is_felt_elsewhere_ = false;
};

std::shared_ptr<const ElasticBody> body_of(const SceneConfig& scene) {
  return elastic_bodies_of(scene).front();
}

// The block is 20 mm high, the edge from 8 mm below its top up to 12 mm above it.
TEST_F(BladeScene, TheEdgeInTissueIsWhatGeometrySays) {
  pierced().parts.push_back({.where = HalfSpaceGeometry{.point_m = {0, 0, -0.003}},
                             .toughness_joule_per_m2 = 3.0 * kCutToughness_joule_per_m2});
  // between planes of the mesh, in one, and along an edge of many elements
  for (const Vector3& from_m : {Vector3(0.0013, 0.0011, -0.008), Vector3(0.002, 0.0011, -0.008),
                                Vector3(-0.002, 0.015 - 0.03 / 7.0, -0.008)}) {
    const auto body = body_of(scene_);
    const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(body));
    const EdgeInTissue edge = edge_in_tissue(*body, whole.elements, *body->pierced, from_m,
                                             from_m + Vector3(0, 0, kBladeEdge_m));
    EXPECT_NEAR(edge.length_m, kCutDepth_m, 1e-6);
    // 5 mm of the tougher part below, in pieces that elements make
    EXPECT_NEAR(edge.newton, kCutToughness_joule_per_m2 * (0.003 + 3.0 * 0.005),
                kCutToughness_joule_per_m2 * 2.0 * 0.002);
    const Vector3 aside_m(0, 0.04, 0);
    EXPECT_EQ(edge_in_tissue(*body, whole.elements, *body->pierced, from_m + aside_m,
                             from_m + aside_m + Vector3(0, 0, kBladeEdge_m))
                  .length_m,
              0.0);
  }
}

// What the plane of the blade passes is all that its edge can be in.
TEST_F(BladeScene, OnItsWayTheEdgeIsInWhatItIsInOfAll) {
  const auto body = body_of(scene_);
  AblatedBody present = whole_body(std::make_shared<BodyCompliance>(body));
  // what has vanished is not cut
  std::erase_if(present.elements, [](std::uint32_t e) { return e % 7 == 0; });
  const BladePlace place{.from_m = {-0.03, 0.001, -0.008},
                         .facing = Vector3(0.9, 0.2, 0.1).normalized(),
                         .along = Vector3(-0.1, 0.0, 0.9).normalized(),
                         .length_m = kBladeEdge_m};
  BladeSweep sweep;
  sweep.begin(1, place, *body, elastic::opposite_sides(body->body->mesh()), 0.0);
  for (double way_m = 0.0; way_m < 0.05; way_m += 0.0011) {
    const auto step =
        sweep.advance(way_m * place.facing + 0.1 * way_m * place.along + 1e-3 * place.normal(),
                      *body, present, *body->pierced);
    const Vector3 ahead_m = sweep.from_m() + 2e-4 * place.facing;
    const EdgeInTissue all = edge_in_tissue(*body, present.elements, *body->pierced, ahead_m,
                                            ahead_m + kBladeEdge_m * place.along);
    EXPECT_EQ(step.ahead.length_m, all.length_m);
    EXPECT_EQ(step.ahead.newton, all.newton);
  }
}

struct CutOf40mm {
  double closed_joule = 0.0;     // work of the hand when it is out again
  double cut_joule = 0.0;        // as the tissue says, meanwhile
  double work_joule = 0.0;       // of the hand from 5 to 40 mm
  double blade_joule = 0.0;      // of that, along the way past the tissue
  double toughness_joule = 0.0;  // × the area that geometry says the edge has swept
  double mean_newton = 0.0;
  double least_newton = 0.0;  // from 8 mm on
  double swept_m2 = 0.0;
  double separated_m2 = 0.0;  // projected
  std::uint64_t bodies = 0;
};

/// Of all points, along the way, so that it does not hang on those that are held at the end.
CutOf40mm cut_40_mm(const SceneConfig& scene, double y_m = 0.001) {
  BladeHand hand(scene, y_m);
  double x_m = -0.034;
  double least_newton = std::numeric_limits<double>::infinity();
  const auto go_until = [&](double depth_m) {
    while (hand.depth_m() < depth_m && x_m < 0.025) {
      hand.go_to(x_m += 2e-4);
      if (hand.depth_m() > 0.008) least_newton = std::min(least_newton, -hand.newton().x());
    }
  };
  go_until(0.005);
  const double work_0 = hand.work_joule();
  const double swept_0 = hand.swept_m2();
  const double blade_0 = hand.blade_joule();
  const double x_0 = x_m;
  go_until(0.040);
  const double work_joule = hand.work_joule() - work_0;
  const double blade_joule = hand.blade_joule() - blade_0;
  const double swept_m2 = hand.swept_m2() - swept_0;
  hand.wait(0.3);
  const AblationFigures cut = hand.tissue().ablation().figures();
  hand.go_to(-0.040);
  hand.wait(0.3);
  const AblationFigures& figures = hand.tissue().ablation().figures();
  EXPECT_GE(hand.least_work_joule(), -1e-9);
  EXPECT_EQ(figures.refused, 0U);
  EXPECT_EQ(hand.tissue().figures().failed, 0U);
  return {.closed_joule = hand.work_joule(),
          .cut_joule = figures.cut_joule,
          .work_joule = work_joule,
          .blade_joule = blade_joule,
          .toughness_joule = kCutToughness_joule_per_m2 * swept_m2,
          .mean_newton = work_joule / (x_m - x_0),
          .least_newton = least_newton,
          .swept_m2 = cut.swept_m2,
          .separated_m2 = cut.separated_m2,
          .bodies = figures.remade};
}

TEST_F(BladeScene, TheWorkIsToughnessTimesAreaWhateverTheMesh) {
  if (test::kIsSanitized) GTEST_SKIP() << "too slow";
  const CutOf40mm coarse = cut_40_mm(scene_);
  set(30, 15, 10);
  const CutOf40mm fine = cut_40_mm(scene_);
  for (const CutOf40mm& one : {coarse, fine}) {
    EXPECT_GE(one.blade_joule, 0.98 * one.toughness_joule);
    EXPECT_LT(one.blade_joule, 1.10 * one.toughness_joule);
    // by each next body it may lose energy, and gives none
    EXPECT_GE(one.closed_joule, one.cut_joule);
    EXPECT_LT(one.closed_joule, 1.10 * one.cut_joule);
    EXPECT_GT(one.least_newton, 0.8 * one.mean_newton);
    EXPECT_NEAR(one.separated_m2, one.swept_m2, 0.15 * one.swept_m2);
  }
  EXPECT_GT(coarse.bodies, 8U);
  EXPECT_NEAR(fine.mean_newton, coarse.mean_newton, 0.05 * coarse.mean_newton);
  for (const CutOf40mm& one : {coarse, fine}) {
    std::printf(
        "closed %.2f mJ, cut %.2f, work %.2f mJ, J A %.2f, mean %.3f N, least %.3f N, swept %.1f "
        "mm2, separated "
        "%.1f "
        "mm2, bodies %zu\n",
        1e3 * one.closed_joule, 1e3 * one.cut_joule, 1e3 * one.work_joule,
        1e3 * one.toughness_joule, one.mean_newton, one.least_newton, 1e6 * one.swept_m2,
        1e6 * one.separated_m2, static_cast<std::size_t>(one.bodies));
  }
}

struct ClosedCut {
  const char* name;
  bool is_linear = true;
  ElasticMaterial::Law law = ElasticMaterial::Law::kNeoHookean;
  double m_per_s = kCutSpeed_m_per_s;
  double viscosity_s = 0.002;
  std::uint32_t most_points = 64;
  double most_ratio = 1.1;
};

void PrintTo(const ClosedCut& one, std::ostream* out) { *out << one.name; }

class ClosedCuts : public BladeScene, public testing::WithParamInterface<ClosedCut> {};
INSTANTIATE_TEST_SUITE_P(
    OfElementsAndLaws, ClosedCuts,
    testing::Values(ClosedCut{.name = "Linear"}, ClosedCut{.name = "Quadratic", .is_linear = false},
                    ClosedCut{.name = "Corotational", .law = ElasticMaterial::Law::kCorotational},
                    ClosedCut{.name = "StVenantKirchhoff",
                              .law = ElasticMaterial::Law::kStVenantKirchhoff,
                              .most_ratio = 1.15},
                    ClosedCut{.name = "FewPoints", .most_points = 8, .most_ratio = 1.3},
                    ClosedCut{.name = "Fast", .m_per_s = 0.1},
                    ClosedCut{.name = "VeryFast", .m_per_s = 0.4},
                    ClosedCut{.name = "Viscous", .viscosity_s = 1.0, .most_ratio = 1.25}),
    [](const auto& one) { return std::string(one.param.name); });

// In, 40 mm on and out again: nothing is stored at the end, and nothing rubs.
TEST_P(ClosedCuts, TakeNoLessThanToughnessTimesAreaAndLittleMore) {
  if (test::kIsSanitized) GTEST_SKIP() << "too slow";
  const ClosedCut& one = GetParam();
  if (!one.is_linear) set(10, 5, 4);  // in seconds
  auto& material = std::get<ElasticMaterial>(scene_.tissues[0].material);
  material.is_linear = one.is_linear;
  material.law = one.law;
  material.viscosity_s = one.viscosity_s;
  scene_.blade->most_points = one.most_points;
  BladeHand hand(scene_);
  hand.go_to(Vector3(0.006, 0.001, -kCutDepth_m), one.m_per_s);
  hand.wait(0.3);
  hand.go_to(Vector3(-0.040, 0.001, -kCutDepth_m), one.m_per_s);
  hand.wait(0.3);
  const AblationFigures& figures = hand.tissue().ablation().figures();
  std::printf("work %.2f mJ, toughness x area %.2f mJ, %.0f mm2\n", 1e3 * hand.work_joule(),
              1e3 * figures.cut_joule, 1e6 * figures.swept_m2);
  EXPECT_FALSE(hand.is_in());
  // 1.5 %: what a fast hand feels is that of a solution before
  EXPECT_GE(hand.work_joule(), 0.985 * figures.cut_joule);
  EXPECT_LE(hand.work_joule(), one.most_ratio * figures.cut_joule);
  // 38 mm at most, less what the tissue gives way; the edge slides along itself, too
  EXPECT_LT(figures.swept_m2, 1.15 * 0.038 * kCutDepth_m);
  EXPECT_GT(figures.swept_m2, 0.5 * 0.038 * kCutDepth_m);
  EXPECT_EQ(hand.tissue().figures().failed, 0U);
}

// The part of the surface that a blade holds is that within its reach, however many points the mesh
// has there: so the tissue gives way as far, and as much is cut.
TEST_F(BladeScene, OnTheSameWayAsMuchIsCutWhateverTheElements) {
  if (test::kIsSanitized) GTEST_SKIP() << "too slow";
  struct Elements {
    std::array<int, 3> cells;
    bool is_linear;
    std::uint32_t most_points;
  };
  std::vector<double> swept_m2;
  for (const Elements& one : {Elements{{15, 7, 5}, true, 64}, Elements{{20, 10, 7}, true, 64},
                              Elements{{10, 5, 4}, false, 64}, Elements{{15, 7, 5}, true, 16}}) {
    set(one.cells[0], one.cells[1], one.cells[2]);
    std::get<ElasticMaterial>(scene_.tissues[0].material).is_linear = one.is_linear;
    scene_.blade->most_points = one.most_points;
    BladeHand hand(scene_);
    hand.go_to(0.006);
    hand.wait(0.3);
    swept_m2.push_back(hand.tissue().ablation().figures().swept_m2);
    std::printf("swept %.0f mm2\n", 1e6 * swept_m2.back());
    // of 38 mm, less what the tissue gives way
    EXPECT_GT(swept_m2.back(), 0.85 * 0.038 * kCutDepth_m);
    EXPECT_LT(swept_m2.back(), 0.038 * kCutDepth_m);
    EXPECT_NEAR(swept_m2.back(), swept_m2.front(), 0.05 * swept_m2.front());
  }
}

// Tissue so soft that the full solution cannot follow the tip until the membrane gives way: the
// sphere waits, and the tip pushes the more.
TEST_F(BladeScene, GoesInWhereTheSolutionCannotFollowItsTip) {
  std::get<ElasticMaterial>(scene_.tissues[0].material).young_pa = 5e3;
  pierced().membrane_newton = 1.0;
  BladeHand hand(scene_);
  hand.go_to(-0.020);
  EXPECT_FALSE(hand.is_in());
  EXPECT_GT(hand.newton().x(), -1.0);
  hand.go_to(0.0);
  EXPECT_TRUE(hand.is_in());
}

// A hand that has felt nothing of the blade has paid for nothing that it would have cut.
TEST_F(BladeScene, CutsNothingThatTheHandHasNotPaidFor) {
  BladeHand hand(scene_);
  hand.be_far_away();
  hand.go_to(Vector3(0.006, 0.001, -kCutDepth_m), 0.2);
  ASSERT_TRUE(hand.is_in());
  EXPECT_GT(hand.depth_m(), 0.025);
  EXPECT_EQ(hand.cut_joule(), 0.0);
  // mofc_node knows of it now, and holds it there
  for (int i = 0; i < 30; ++i) {
    hand.report_slip(hand.slip_m());
    hand.wait(0.01);
    ASSERT_TRUE(hand.is_in());
    ASSERT_LT(hand.newton().norm(), 2.0 * kCutForce_newton);
  }
  // what the tip has pressed before it went in, at most
  EXPECT_LT(hand.cut_joule(), 1.5e-3);
  // out against no force: the tissue may give back that, but not what nobody has cut
  hand.go_to(Vector3(-0.040, 0.001, -kCutDepth_m), 0.2);
  EXPECT_LT(hand.cut_joule(), 1.5e-3);
}

// As geometry says, whether it takes many steps or one that ends beyond the body.
TEST_F(BladeScene, WhatIsSweptInOneStepIsWhatLiesInTheBody) {
  const auto body = body_of(scene_);
  const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(body));
  for (const double step_m : {0.001, 0.008, 0.035, 0.070}) {
    BladeSweep sweep;
    sweep.begin(1,
                {.from_m = {-0.034, 0.001, -0.008},
                 .facing = Vector3::UnitX(),
                 .along = Vector3::UnitZ(),
                 .length_m = kBladeEdge_m},
                *body, elastic::opposite_sides(body->body->mesh()), 0.0);
    double swept_m2 = 0.0;
    for (double x_m = step_m; x_m < 0.0701; x_m += step_m) {
      const auto step = sweep.advance({x_m, 0, 0}, *body, whole, *body->pierced);
      swept_m2 += step.sweep.swept_m2;
    }
    EXPECT_NEAR(swept_m2, 0.06 * kCutDepth_m, 0.02 * 0.06 * kCutDepth_m) << step_m;
  }
}

// A slip that no force explains, of a tool that stands still: the edge stays where it is.
TEST_F(BladeScene, DoesNotFollowASlipThatItsForceDoesNotExplain) {
  BladeHand hand(scene_);
  hand.go_to(-0.015);
  ASSERT_TRUE(hand.is_in());
  hand.wait(0.3);
  const double cut_joule = hand.cut_joule();
  const double newton = hand.newton().x();
  for (int i = 0; i < 40; ++i) {
    hand.report_slip(hand.slip_m() + Vector3(5e-4, 0, 0));
    hand.wait(0.02);
    ASSERT_TRUE(hand.is_in());
    ASSERT_LT(hand.newton().norm(), 3.0);
  }
  hand.wait(0.2);
  EXPECT_LT(hand.cut_joule() - cut_joule, 0.1 * kCutForce_newton * 0.020);  // of 20 mm
  EXPECT_NEAR(hand.newton().x(), newton, 0.2 * kCutForce_newton);
}

/// How far the place moves that is pushed aside with a force, in the body as it is now.
double give_m_per_newton(const ElasticBody& body, BodyCompliance& shared, const Vector3& at_m) {
  std::size_t nearest = 0;
  const auto distance_m = [&](std::size_t i) {
    return (body.points[i].position_m(body.start_m.data()) - at_m).norm();
  };
  for (std::size_t i = 1; i < body.points.size(); ++i) {
    if (distance_m(i) < distance_m(nearest)) nearest = i;
  }
  std::vector<elastic::Vector3d> forces(body.points.size(), elastic::Vector3d::Zero());
  forces[nearest].y() = 1.0;
  return shared.compliance().moved_m(body.points[nearest], body.points, forces).y();
}

// The block with a slit from one end through its middle to the other, 8 mm deep, by its own rule:
// the nodes of the slit twice, for the elements on either side.
TEST_F(BladeScene, WhatIsCutIsTheBodyThatIsBuiltWithASlit) {
  set(15, 8, 5);  // y = 0 is a plane of the mesh, z = −8 mm another
  const auto body = body_of(scene_);
  const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(body));
  Ablation ablation(whole.shared, {}, kBladeTip_m, 1, false, true);
  BladeSweep sweep;
  sweep.begin(1,
              {.from_m = {-0.03, 0, -0.008},
               .facing = Vector3::UnitX(),
               .along = Vector3::UnitZ(),
               .length_m = kBladeEdge_m},
              *body, ablation.opposite_sides(), 0.0);
  for (double x_m = 0.0; x_m < 0.0701; x_m += 0.001) {
    ablation.cut(0, sweep.advance({x_m, 0, 0}, *body, ablation.present(), *body->pierced).sweep,
                 0.005);
  }
  EXPECT_NEAR(ablation.figures().swept_m2, 0.06 * 0.008, 0.02 * 0.06 * 0.008);
  EXPECT_NEAR(ablation.figures().cut_joule,
              kCutToughness_joule_per_m2 * ablation.figures().swept_m2, 1e-12);
  EXPECT_NEAR(ablation.figures().separated_m2, 0.06 * 0.008, 1e-9);
  EXPECT_EQ(ablation.figures().faces_cut, 2U * 15U * 2U);
  std::shared_ptr<const AblatedBody> cut;
  for (int i = 0; i < 20 && cut == nullptr; ++i) cut = ablation.advance(0.02, body->start_m);
  ASSERT_NE(cut, nullptr);
  EXPECT_NEAR(cut->cut.area_m2, 0.06 * 0.008, 1e-9);
  EXPECT_EQ(cut->elements.size(), whole.elements.size());

  elastic::BodyDescription slit = body->body->description();
  std::map<std::uint32_t, std::uint32_t> copy_of;
  const auto nodes = static_cast<std::uint32_t>(slit.mesh.nodes_m.size());
  for (std::uint32_t node = 0; node < nodes; ++node) {
    const Vector3 at_m = slit.mesh.nodes_m[node];
    if (std::abs(at_m.y()) > 1e-9 || at_m.z() < -0.0079) continue;
    copy_of[node] = static_cast<std::uint32_t>(slit.mesh.nodes_m.size());
    slit.mesh.nodes_m.push_back(at_m);
  }
  for (std::size_t e = 0; e < slit.mesh.element_count(); ++e) {
    double y_m = 0.0;
    for (const std::uint32_t node : slit.mesh.element(e)) y_m += slit.mesh.nodes_m[node].y();
    if (y_m < 0.0) continue;
    for (std::size_t k = 0; k < 4; ++k) {
      const auto copy = copy_of.find(slit.mesh.elements[4 * e + k]);
      if (copy != copy_of.end()) slit.mesh.elements[4 * e + k] = copy->second;
    }
  }
  const auto built = remade_elastic_body(*body, std::move(slit), {}).body;
  EXPECT_EQ(cut->nodes.size(), built->body->node_count());
  BodyCompliance built_shared(built);
  BodyCompliance whole_shared(body);
  for (const Vector3& at_m :
       {Vector3(0, 0.004, 0), Vector3(0.01, -0.004, 0), Vector3(-0.02, 0.012, 0)}) {
    const double expected = give_m_per_newton(*built, built_shared, at_m);
    const double found = give_m_per_newton(*cut->body(), *cut->shared, at_m);
    EXPECT_NEAR(found, expected, 0.01 * expected);
    EXPECT_GT(found, 1.1 * give_m_per_newton(*body, whole_shared, at_m));
  }
}

// What the next body takes over from the one before is the order of its work, not its result.
TEST_F(BladeScene, TheNextBodyGivesWayAsOneThatIsMadeAnew) {
  const auto body = body_of(scene_);
  const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(body));
  Ablation ablation(whole.shared, {}, kBladeTip_m, 1, false, true);
  BladeSweep sweep;
  sweep.begin(1,
              {.from_m = {-0.03, 0.001, -0.012},
               .facing = Vector3::UnitX(),
               .along = Vector3::UnitZ(),
               .length_m = kBladeEdge_m},
              *body, ablation.opposite_sides(), 0.0);
  auto places_m = body->start_m;
  for (const double x_m : {0.01, 0.02, 0.03, 0.04}) {
    ablation.cut(0, sweep.advance({x_m, 0, 0}, *body, ablation.present(), *body->pierced).sweep,
                 0.005);
    std::shared_ptr<const AblatedBody> cut;
    for (int i = 0; i < 20 && cut == nullptr; ++i) cut = ablation.advance(0.02, places_m);
    ASSERT_NE(cut, nullptr);
    places_m = cut->body()->start_m;
    const RemadeBody anew = remade_elastic_body(*body, cut->body()->body->description(), {});
    BodyCompliance anew_shared(anew);
    ASSERT_EQ(anew.body->surface_nodes, cut->body()->surface_nodes);
    const std::vector<std::uint32_t> nodes = {anew.body->surface_nodes[40],
                                              anew.body->surface_nodes.back()};
    const auto found = cut->shared->compliance().require(nodes);
    const auto expected = anew_shared.compliance().require(nodes);
    for (const std::uint32_t node : nodes) {
      const Eigen::Map<const Eigen::VectorXf> one(
          found.of(node), 9 * static_cast<Eigen::Index>(anew.body->surface_nodes.size()));
      const Eigen::Map<const Eigen::VectorXf> other(expected.of(node), one.size());
      EXPECT_LE((one - other).norm(), 1e-5F * other.norm());
    }
    // the slowest motions are as slow; 1/ω² = φᵀ M φ, for φᵀ K φ = 1
    const auto inertia = [](const ElasticBody& of, Eigen::Index from_last) {
      const Eigen::MatrixXd& slowest = of.slow_modes.slowest;
      const Eigen::VectorXd shape = slowest.col(slowest.cols() - 1 - from_last);
      double sum = 0.0;
      for (Eigen::Index node = 0; node < of.body->mass_kg().size(); ++node) {
        sum += of.body->mass_kg()[node] * shape.segment<3>(3 * node).squaredNorm();
      }
      return sum;
    };
    for (Eigen::Index k = 0; k < 6; ++k) {
      EXPECT_NEAR(inertia(*cut->body(), k), inertia(*anew.body, k), 0.01 * inertia(*anew.body, k));
    }
  }
}

// The state goes on: nodes and their copies are where they were, and the elements have the energy
// that they had. What is released moves the body afterwards.
TEST_F(BladeScene, TheBodyGoesOnWhereItWas) {
  const auto body = body_of(scene_);
  const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(body));
  ElasticSimulation before(*body, 1, kBladeTip_m, 0.02);
  std::vector<std::optional<TipState>> tips(1);
  ASSERT_GT(before.hold(0, {0, 0.004, 0}, 0.004, 16, 2000.0), 0U);
  tips[0] = {.tip_m = {0, 0.010, 0.002}, .place_m = {0, 0.004, 0}};
  for (int i = 0; i < 20; ++i) before.step(tips);
  Ablation ablation(whole.shared, {}, kBladeTip_m, 1, false, true);
  BladeSweep sweep;
  sweep.begin(1,
              {.from_m = {-0.03, 0.001, -0.008},
               .facing = Vector3::UnitX(),
               .along = Vector3::UnitZ(),
               .length_m = kBladeEdge_m},
              *body, ablation.opposite_sides(), 0.0);
  ablation.cut(0, sweep.advance({0.04, 0, 0}, *body, whole, *body->pierced).sweep, 0.005);
  std::shared_ptr<const AblatedBody> cut;
  for (int i = 0; i < 20 && cut == nullptr; ++i) cut = ablation.advance(0.02, before.x_m());
  ASSERT_NE(cut, nullptr);
  ASSERT_GT(cut->nodes.size(), whole.nodes.size());
  ElasticSimulation after(*cut->body(), before, cut->change, false);
  for (std::size_t e = 0; e < cut->elements.size(); ++e) {
    for (std::size_t k = 0; k < 4; ++k) {
      const auto now = 3 * Eigen::Index{cut->body()->body->mesh().element(e)[k]};
      const auto then = 3 * Eigen::Index{body->body->mesh().element(cut->elements[e])[k]};
      ASSERT_EQ(after.x_m().segment<3>(now), before.x_m().segment<3>(then));
    }
  }
  const double newton = before.touch(0).force_on_tool_newton.norm();
  for (int i = 0; i < 40; ++i) after.step(tips);
  EXPECT_LT(after.touch(0).force_on_tool_newton.norm(), 0.95 * newton);
  EXPECT_LT(after.stored_joule(), before.stored_joule());
  EXPECT_EQ(after.failed_steps(), 0U);
}

TEST_F(BladeScene, ComesBackThroughItsCutAgainstFrictionAndIsOut) {
  pierced().friction_newton_per_m = 5.0;  // 0.04 N
  BladeHand hand(scene_);
  hand.go_to(-0.010);
  ASSERT_TRUE(hand.is_in());
  const std::uint64_t faces = hand.tissue().figures().ablation.faces_cut;
  hand.go_to(-0.022);
  ASSERT_TRUE(hand.is_in());
  EXPECT_NEAR(hand.newton().x(), 0.04, 0.02);
  EXPECT_EQ(hand.tissue().figures().ablation.faces_cut, faces);
  hand.go_to(-0.040);
  EXPECT_FALSE(hand.is_in());
  EXPECT_EQ(hand.newton(), Vector3::Zero());
  EXPECT_GE(hand.least_work_joule(), -1e-9);
}

TEST_F(BladeScene, GoesThroughAndIsOutOnTheOtherSide) {
  BladeHand hand(scene_);
  hand.go_to(0.045);
  EXPECT_FALSE(hand.is_in());
  EXPECT_EQ(hand.newton(), Vector3::Zero());
  EXPECT_NEAR(hand.tissue().ablation().figures().swept_m2, 0.06 * kCutDepth_m,
              0.15 * 0.06 * kCutDepth_m);
  EXPECT_EQ(hand.tissue().figures().failed, 0U);
}

// Its edge is in front of its tip, which is still in the body when that is out.
TEST_F(BladeScene, WhereTheEdgeHasLeftTheTipIsNotThrownAside) {
  BladeHand hand(scene_);
  hand.go_to(0.020);
  ASSERT_TRUE(hand.is_in());
  bool has_left = false;
  for (double x_m = 0.020; x_m < 0.040; x_m += 5e-4) {
    hand.go_to(x_m);
    has_left = has_left || !hand.is_in();
    if (has_left) {
      EXPECT_EQ(hand.newton(), Vector3::Zero()) << x_m;
    }
  }
  EXPECT_TRUE(has_left);
  // from there it touches as ever
  hand.go_to(0.029);
  EXPECT_GT(hand.newton().x(), 0.0);
}

TEST_F(BladeScene, RestoreMakesItWhole) {
  BladeHand hand(scene_);
  hand.go_to(-0.010);
  ASSERT_TRUE(hand.is_in());
  const PhysicsCounters before = [&] {
    PhysicsCounters counters;
    hand.tissues().count_into(counters);
    return counters;
  }();
  EXPECT_GT(before.elastic_faces_cut, 4U);
  EXPECT_GT(before.elastic_cut_joule, 0.005);
  ASSERT_GT(hand.tissue().ablation().present().cut.faces, 0U);
  hand.tissues().restore(0);
  hand.wait(0.3);
  EXPECT_FALSE(hand.is_in());
  EXPECT_EQ(hand.tissue().ablation().present().cut.faces, 0U);
  EXPECT_EQ(hand.tissue().ablation().present().nodes.size(),
            hand.tissue().body().body->node_count());
}

TEST_F(BladeScene, NothingIsCutThatIsNotSaidToBe) {
  std::get<ElasticMaterial>(scene_.tissues[0].material).pierced.reset();
  BladeHand hand(scene_);
  hand.go_to(-0.025);
  EXPECT_FALSE(hand.is_in());
  EXPECT_LT(hand.newton().x(), -0.4);
}

// A piece that is cut off by a second blade position falls to nobody: it goes.
TEST_F(BladeScene, AnIslandIsRemoved) {
  set(15, 8, 5);
  const auto body = body_of(scene_);
  const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(body));
  Ablation ablation(whole.shared, {}, kBladeTip_m, 1, false, true);
  BladeSweep sweep;  // lying, above the lower half
  sweep.begin(1,
              {.from_m = {-0.03, -0.02, -0.008},
               .facing = Vector3::UnitX(),
               .along = Vector3::UnitY(),
               .length_m = 0.04},
              *body, ablation.opposite_sides(), 0.0);
  ablation.cut(0, sweep.advance({0.07, 0, 0}, *body, whole, *body->pierced).sweep, 0.005);
  std::shared_ptr<const AblatedBody> cut;
  for (int i = 0; i < 20 && cut == nullptr; ++i) cut = ablation.advance(0.02, body->start_m);
  ASSERT_NE(cut, nullptr);
  EXPECT_EQ(cut->loose, 15U * 8U * 2U * 5U);  // the two upper layers of cells
  EXPECT_EQ(cut->elements.size(), 15U * 8U * 3U * 5U);
}

// Whatever way the hand goes, the body stays finite and gives back no more than it was given.
TEST_F(BladeScene, RandomWaysGiveTheHandNothing) {
  for (const std::uint64_t seed : test::seeds(2)) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> between(-1.0, 1.0);
    BladeHand hand(scene_, 0.005 * between(random));
    Vector3 at_m(-0.034, 0.001, -kCutDepth_m);
    for (int part = 0; part < 12; ++part) {
      at_m += Vector3(0.006 * (1.0 + 2.0 * between(random)), 0.002 * between(random),
                      0.004 * between(random));
      hand.go_to(at_m);
      ASSERT_TRUE(hand.newton().allFinite());
      ASSERT_LT(hand.newton().norm(), 10.0);
    }
    EXPECT_GE(hand.least_work_joule(), -2e-4) << seed;  // open loop, without the clamp
  }
}

}  // namespace
}  // namespace palpate::physics
