// SPDX-License-Identifier: Apache-2.0
// Figures of hands whose coverage, path, forces and overshoot follow from geometry.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <numbers>
#include <string>
#include <utility>

#include "common/core/random.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/task/task_support.h"

namespace palpate::test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kRadius_m = 0.005;  // of a press

// A slide of length L searches a strip with round ends: 2 r L + π r², of 100 cm².
TEST(KnownAnswers, TheCoverageOfASlideIsItsStrip) {
  for (const double turn_rad : {0.0, 0.3, kPi / 4}) {
    constexpr double kLength_m = 0.05;
    const TaskScore score = score_of(search(), 2.0, [&](double t_s) {
      const double along_m = kLength_m * (0.5 * t_s - 0.5);
      return pressed(along_m * std::cos(turn_rad), along_m * std::sin(turn_rad), 0.002, 1.0);
    });
    const double strip_m2 = 2.0 * kRadius_m * kLength_m + kPi * kRadius_m * kRadius_m;
    EXPECT_NEAR(score.area_m2, 0.01, 1e-6);
    EXPECT_NEAR(score.coverage_ratio * score.area_m2 / strip_m2, 1.0, 0.01) << turn_rad;
  }
}

TEST(KnownAnswers, APressBelowTheLeastForceSearchesNothing) {
  EXPECT_EQ(
      score_of(search(), 1.0, [](double) { return pressed(0, 0, 0.002, 0.49); }).coverage_ratio,
      0.0);
  EXPECT_NEAR(
      score_of(search(), 1.0, [](double) { return pressed(0, 0, 0.002, 0.51); }).coverage_ratio *
          0.01 / (kPi * kRadius_m * kRadius_m),
      1.0, 0.01);
}

/// The twelve triangles of a box, its top at z = 0.
SurfaceMesh box_mesh(const Vector3& size_m) {
  SurfaceMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    mesh.vertices_m.push_back(static_cast<float>((corner & 1 ? 0.5 : -0.5) * size_m.x()));
    mesh.vertices_m.push_back(static_cast<float>((corner & 2 ? 0.5 : -0.5) * size_m.y()));
    mesh.vertices_m.push_back(static_cast<float>(corner & 4 ? 0.0 : -size_m.z()));
  }
  mesh.triangles = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                    2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  return mesh;
}

SurfaceMesh pad_mesh(double side_m, double high_m) { return box_mesh({side_m, side_m, high_m}); }

// A press at one place of a pad searches a disc, or half of one at the edge of the area: whatever
// the sizes of pad and area are.
TEST(KnownAnswers, TheCoverageOfAPressIsADisc) {
  struct Case {
    double side_m, area_m, radius_m;
    Vector3 at_m;
    double share;  // of the disc
  };
  for (const Case& one :
       {Case{0.2, 0.04, 0.005, {0, 0, 0}, 1.0}, Case{0.2, 0.04, 0.005, {0.001, 0, 0}, 1.0},
        Case{0.2, 0.04, 0.003, {0, 0, 0}, 1.0}, Case{0.2, 0.04, 0.003, {0.001, 0.0005, 0}, 1.0},
        Case{0.2, 0.1, 0.005, {0.05, 0.01, 0}, 0.5}, Case{0.1, 0.03, 0.005, {0, 0, 0}, 1.0},
        Case{0.1, 0.03, 0.006, {0.001, 0.002, 0}, 1.0}, Case{0.1, 0.0, 0.006, {0.01, 0, 0}, 1.0}}) {
    std::optional<RegionGeometry> area;
    if (one.area_m > 0.0) {
      area = BoxGeometry{.center_m = {0, 0, 0}, .size_m = {one.area_m, one.area_m, 0.01}};
    }
    SearchedSurface surface(pad_mesh(one.side_m, 0.05), area, one.radius_m);
    const double area_m2 = one.area_m > 0.0 ? one.area_m * one.area_m : 0.04;
    EXPECT_NEAR(surface.area_m2(), area_m2, 0.002 * area_m2);
    surface.search(one.at_m, Vector3::UnitZ());
    const double disc_m2 = one.share * kPi * one.radius_m * one.radius_m;
    EXPECT_NEAR(surface.searched_ratio() * surface.area_m2() / disc_m2, 1.0, 0.01)
        << one.side_m << " " << one.area_m << " " << one.radius_m << " " << one.at_m.x();
  }
}

// An area that is small against a press.
TEST(KnownAnswers, TheCoverageOfAnAreaThatIsSmallAgainstAPress) {
  struct Case {
    double area_m, radius_m;
    Vector3 at_m;
    double searched_m2;
  };
  // half a disc at the middle of an edge, all, a quarter of a disc at a corner, all
  for (const Case& one :
       {Case{0.01, 0.005, {0.005, 0, 0}, kPi * 25e-6 / 2}, Case{0.01, 0.02, {0, 0, 0}, 1e-4},
        Case{0.01, 0.01, {0.005, 0.005, 0}, kPi * 1e-4 / 4}, Case{0.02, 0.1, {0, 0, 0}, 4e-4}}) {
    SearchedSurface surface(
        pad_mesh(0.1, 0.05),
        BoxGeometry{.center_m = {0, 0, 0}, .size_m = {one.area_m, one.area_m, 0.01}}, one.radius_m);
    EXPECT_NEAR(surface.area_m2() / (one.area_m * one.area_m), 1.0, 0.005);
    surface.search(one.at_m, Vector3::UnitZ());
    EXPECT_NEAR(surface.searched_ratio() * one.area_m * one.area_m / one.searched_m2, 1.0, 0.01)
        << one.area_m << " " << one.radius_m;
  }
}

// A press 25 mm beside the middle of an area of 10 × 10 mm with a radius of 25 mm: the arc covers
// ∫ √(r² − y²) − (r − a/2) dy over the height a,
// r² asin(a/2r) + (a/2)√(r² − a²/4) − a (r − a/2).
TEST(KnownAnswers, TheCoverageOfTheRimOfALargePress) {
  constexpr double kSide_m = 0.01;
  constexpr double kPress_m = 0.025;
  constexpr double kHalf_m = kSide_m / 2;
  SearchedSurface surface(pad_mesh(0.1, 0.05),
                          BoxGeometry{.center_m = {0, 0, 0}, .size_m = {kSide_m, kSide_m, 0.01}},
                          kPress_m);
  surface.search({-kPress_m, 0, 0}, Vector3::UnitZ());
  const double exact_m2 = kPress_m * kPress_m * std::asin(kHalf_m / kPress_m) +
                          kHalf_m * std::sqrt(kPress_m * kPress_m - kHalf_m * kHalf_m) -
                          kSide_m * (kPress_m - kHalf_m);
  EXPECT_NEAR(surface.searched_ratio() * kSide_m * kSide_m / exact_m2, 1.0, 0.01);
}

// Areas that are narrow or small against the press and the tissue. The circle of a press crosses a
// thin strip at right angles: 20 of its 50 mm. Two circles r and R, their centres d apart, have in
// common r² acos((d² + r² − R²)/2dr) + R² acos((d² + R² − r²)/2dR) − ½ √((−d + r + R)(d + r − R)(d
// − r + R)(d + r + R)).
TEST(KnownAnswers, TheCoverageOfNarrowAndSmallAreas) {
  constexpr double kPress_m = 0.01;
  for (const double tissue_m : {0.12, 0.6}) {
    for (const double wide_m : {0.002, 0.0005, 0.0002, 0.0001}) {
      SearchedSurface surface(
          pad_mesh(tissue_m, 0.04),
          BoxGeometry{.center_m = {0.01, 0.00003, 0}, .size_m = {0.05, wide_m, 0.01}}, kPress_m);
      surface.search({0, 0.00003, 0}, Vector3::UnitZ());
      EXPECT_NEAR(surface.area_m2() / (0.05 * wide_m), 1.0, 0.01) << tissue_m << " " << wide_m;
      EXPECT_NEAR(surface.searched_ratio(), 0.4, 0.004) << tissue_m << " " << wide_m;
    }
    for (const auto& [r, d] :
         {std::pair(0.002, 0.01), std::pair(0.001, 0.01), std::pair(0.0003, 0.0099)}) {
      SearchedSurface surface(pad_mesh(tissue_m, 0.04),
                              SphereGeometry{.center_m = {d, 0, 0}, .radius_m = r}, kPress_m);
      surface.search({0, 0, 0}, Vector3::UnitZ());
      const double lens_m2 =
          r * r * std::acos((d * d + r * r - kPress_m * kPress_m) / (2 * d * r)) +
          kPress_m * kPress_m *
              std::acos((d * d + kPress_m * kPress_m - r * r) / (2 * d * kPress_m)) -
          0.5 * std::sqrt((-d + r + kPress_m) * (d + r - kPress_m) * (d - r + kPress_m) *
                          (d + r + kPress_m));
      EXPECT_NEAR(surface.area_m2() / (kPi * r * r), 1.0, 0.01) << tissue_m << " " << r;
      EXPECT_NEAR(surface.searched_ratio() * kPi * r * r / lens_m2, 1.0, 0.01)
          << tissue_m << " " << r;
    }
  }
  // an area that only touches the surface
  const SearchedSurface touched(
      pad_mesh(0.1, 0.04), SphereGeometry{.center_m = {0, 0, 0.01}, .radius_m = 0.01}, kPress_m);
  EXPECT_LT(touched.area_m2(), 1e-9);
}

// A press on one side of a wall of 2 mm reaches 5 mm: the other side is nearer than that, and was
// never touched.
TEST(KnownAnswers, APressOnThinTissueSearchesOneSide) {
  constexpr double kWall_m = 0.002;
  SearchedSurface surface(box_mesh({kWall_m, 0.06, 0.06}), std::nullopt, kRadius_m);
  const double disc_m2 = kPi * kRadius_m * kRadius_m;
  surface.search({0.5 * kWall_m, 0, -0.03}, Vector3::UnitX());
  EXPECT_NEAR(surface.searched_ratio() * surface.area_m2() / disc_m2, 1.0, 0.01);
  surface.search({-0.5 * kWall_m, 0, -0.03}, -Vector3::UnitX());
  EXPECT_NEAR(surface.searched_ratio() * surface.area_m2() / disc_m2, 2.0, 0.02);
}

// A tip that comes down beside a box, its centre outside: as deep as its radius less its distance
// to the box, max(|p| − half, 0). Only the top is to be searched, or all of it.
TEST(KnownAnswers, TheDepthBesideARimIsThatOfTheWall) {
  struct Case {
    Vector3 size_m;
    double tip_m, beside_m;
  };
  for (const Case& one :
       {Case{{0.1, 0.1, 0.04}, 0.005, 0.00098}, Case{{0.1, 0.1, 0.04}, 0.005, 0.0035},
        Case{{0.1, 0.1, 0.04}, 0.006, 0.0002}, Case{{0.002, 0.04, 0.01}, 0.003, 0.00165}}) {
    for (const bool is_top : {true, false}) {
      SceneState scene;
      scene.tissues.emplace_back().mesh = box_mesh(one.size_m);
      TaskConfig task = search();
      PalpationTask& palpation = std::get<PalpationTask>(task.kind);
      if (is_top) {
        palpation.area =
            BoxGeometry{.center_m = {0, 0, 0}, .size_m = {one.size_m.x(), one.size_m.y(), 0.0002}};
      }
      TaskEvaluator evaluator(task, ToolShape{.tip_radius_m = one.tip_m});
      evaluator.take(scene);
      double most_m = 0.0;
      run(evaluator, 2.0, [&](double t_s) {
        // 8 mm down from above the top, in steps that are not those of the points
        const Vector3 at_m(0.5 * one.size_m.x() + one.beside_m, 0.0013, 0.003 - 0.004 * t_s);
        const Vector3 middle_m(0, 0, -0.5 * one.size_m.z());
        const double to_box_m =
            ((at_m - middle_m).cwiseAbs() - 0.5 * one.size_m).cwiseMax(0.0).norm();
        const double deep_m = std::max(0.0, one.tip_m - to_box_m);
        most_m = std::max(most_m, deep_m);
        return Tip{.at_m = at_m, .newton = deep_m > 1e-5 ? 1.0 : 0.0};
      });
      evaluator.finish();
      EXPECT_NEAR(evaluator.score().depth_most_m, most_m, 3e-5)
          << one.size_m.x() << " " << one.beside_m << " " << is_top;
    }
  }
}

/// Pressed down to a depth within 1 s and held there; it begins just above the surface.
/// @param from_s  no force acts before: a dead-man button that is pressed late
TaskScore pressed_into(double side_m, double high_m, double x_m, double depth_m, double tip_m,
                       double from_s = 0.0) {
  SceneState scene;
  scene.tissues.emplace_back().mesh = pad_mesh(side_m, high_m);
  TaskConfig task = search({lump()});
  PalpationTask& palpation = std::get<PalpationTask>(task.kind);
  palpation.targets[0].center_m = {x_m, 0.0, -0.003};
  palpation.targets[0].radius_m = 0.002;
  palpation.area = BoxGeometry{.center_m = {0, 0, 0}, .size_m = {side_m, side_m, 0.001}};
  TaskEvaluator evaluator(task, ToolShape{.tip_radius_m = tip_m});
  evaluator.take(scene);
  run(evaluator, 2.0, [&](double t_s) {
    const double now_m = depth_m * std::min(t_s, 1.0);
    const bool is_pressed = now_m > 1e-4 && t_s >= from_s;
    return Tip{.at_m = {x_m, 0.0, tip_m - now_m}, .newton = is_pressed ? 2.5 : 0.0};
  });
  evaluator.take({marker(1, 1990)});
  evaluator.finish();
  return evaluator.score();
}

// Nearer to another side than to the one that is pressed: the back of a thin sheet, the wall at a
// rim.
TEST(KnownAnswers, APressStaysOnTheSideOnWhichItBegan) {
  struct Case {
    double side_m, high_m, from_rim_m, depth_m, tip_m;
  };
  for (const Case& one :
       {Case{0.1, 0.008, 0.05, 0.0095, 0.003}, Case{0.1, 0.01, 0.05, 0.012, 0.003},
        Case{0.1, 0.008, 0.05, 0.0125, 0.003}, Case{0.1, 0.05, 0.006, 0.018, 0.003},
        Case{0.1, 0.05, 0.006, 0.018, 0.006}, Case{0.1, 0.05, 0.002, 0.01, 0.003}}) {
    const TaskScore score = pressed_into(one.side_m, one.high_m, one.side_m / 2 - one.from_rim_m,
                                         one.depth_m, one.tip_m);
    SCOPED_TRACE(testing::Message() << one.high_m << " high, " << one.from_rim_m
                                    << " from the rim, " << one.depth_m << " deep");
    EXPECT_NEAR(score.depth_most_m / one.depth_m, 1.0, 0.01);
    // the disc less its cap beyond the rim
    const double in_m = std::min(one.from_rim_m, kRadius_m);
    const double angle = std::acos(in_m / kRadius_m);
    const double disc_m2 = kRadius_m * kRadius_m * (kPi - angle) +
                           in_m * std::sqrt(kRadius_m * kRadius_m - in_m * in_m);
    EXPECT_NEAR(score.coverage_ratio * score.area_m2 / disc_m2, 1.0, 0.01);
    EXPECT_EQ(score.targets[0].outcome, TargetScore::Outcome::kFound);
    EXPECT_NEAR(score.targets[0].force.touch_s, 2.0, 0.03);
    EXPECT_NEAR(score.targets[0].force.median_newton, 2.5, 0.01);
  }
}

// A dead-man button pressed late, answers that are missing, a device that is not enabled yet.
TEST(KnownAnswers, ATipThatGoesInWithoutAForceIsOnTheSideOnWhichItWentIn) {
  struct Case {
    double high_m, from_rim_m, depth_m, tip_m;
  };
  for (const Case& one : {Case{0.008, 0.05, 0.0095, 0.003}, Case{0.02, 0.05, 0.0155, 0.003},
                          Case{0.0065, 0.05, 0.008, 0.003}, Case{0.05, 0.006, 0.018, 0.003},
                          Case{0.05, 0.002, 0.01, 0.006}}) {
    const TaskScore score =
        pressed_into(0.1, one.high_m, 0.05 - one.from_rim_m, one.depth_m, one.tip_m, 1.5);
    SCOPED_TRACE(testing::Message() << one.high_m << " high, " << one.depth_m << " deep");
    EXPECT_NEAR(score.depth_most_m / one.depth_m, 1.0, 0.01);
    EXPECT_EQ(score.targets[0].outcome, TargetScore::Outcome::kFound);
    EXPECT_NEAR(score.targets[0].force.touch_s, 0.5, 0.003);
  }
}

/// Straight through a slab of 4 mm, 0.2 s at each of these heights of the centre of a tip of 3 mm.
double deepest_m(const std::vector<std::pair<double, double>>& height_m_and_newton) {
  SceneState scene;
  scene.tissues.emplace_back().mesh = pad_mesh(0.06, 0.004);
  TaskEvaluator evaluator(search(), ToolShape{.tip_radius_m = 0.003});
  evaluator.take(scene);
  constexpr double kEach_s = 0.2;
  run(evaluator, kEach_s * static_cast<double>(height_m_and_newton.size() - 1), [&](double t_s) {
    const auto i = static_cast<std::size_t>(t_s / kEach_s);
    const auto& [from_m, newton] = height_m_and_newton[i];
    const double share = t_s / kEach_s - static_cast<double>(i);
    return Tip{.at_m = {0.001, 0, from_m + share * (height_m_and_newton[i + 1].first - from_m)},
               .newton = newton};
  });
  evaluator.finish();
  return evaluator.score().depth_most_m;
}

TEST(KnownAnswers, ATipThatIsThroughWithoutAForceIsFree) {
  // down through it, and up against its underside: 1 mm
  EXPECT_NEAR(deepest_m({{0.006, 0}, {-0.012, 0}, {-0.006, 1}, {-0.006, 1}}), 0.001, 3e-5);
  // pressed on, then without a force: through, and again from below
  EXPECT_NEAR(
      deepest_m({{0.006, 0}, {0.001, 1}, {0.001, 0}, {-0.012, 0}, {-0.006, 1}, {-0.006, 1}}), 0.002,
      3e-5);
  // pressed beyond its place at rest, where the force is missing for a moment
  EXPECT_NEAR(deepest_m({{0.001, 1}, {-0.005, 0}, {-0.006, 1}, {-0.006, 1}}), 0.009, 3e-5);
}

// Two millimetres under the top of a slab of 8 mm: who feels its underside has not found it.
TEST(KnownAnswers, ALesionIsNotFoundFromTheOtherSideOfThinTissue) {
  SceneState scene;
  scene.tissues.emplace_back().mesh = pad_mesh(0.06, 0.008);
  for (const bool is_below : {true, false}) {
    TaskConfig task = search({lump(0.0)});
    PalpationTask& palpation = std::get<PalpationTask>(task.kind);
    palpation.targets[0].center_m = {0, 0, -0.002};
    palpation.targets[0].radius_m = 0.001;
    TaskEvaluator evaluator(task, ToolShape{.tip_radius_m = 0.003});
    evaluator.take(scene);
    run(evaluator, 1.0, [&](double) {
      return Tip{.at_m = {0, 0, is_below ? -0.010 : 0.002}, .newton = 2.5};
    });
    evaluator.take({marker(1, 990)});
    evaluator.finish();
    const TaskScore& score = evaluator.score();
    EXPECT_EQ(score.targets[0].outcome,
              is_below ? TargetScore::Outcome::kMissed : TargetScore::Outcome::kFound);
    EXPECT_EQ(score.count(MarkScore::Outcome::kFalseAlarm), is_below ? 1U : 0U);
    EXPECT_NEAR(score.targets[0].force.touch_s, is_below ? 0.0 : 1.0, 0.002);
    EXPECT_NEAR(score.elsewhere.touch_s, is_below ? 1.0 : 0.0, 0.002);
  }
}

// From the top over the rim and down along the wall, 1 mm deep all the time: both are searched.
// Then back again through the air.
TEST(KnownAnswers, ATipThatGoesAroundARimIsOnTheOtherSide) {
  SceneState scene;
  scene.tissues.emplace_back().mesh = pad_mesh(0.04, 0.03);
  TaskEvaluator evaluator(search(), ToolShape{.tip_radius_m = 0.003});
  evaluator.take(scene);
  constexpr double kPress_m = 0.001;
  constexpr double kCentre_m = 0.003 - kPress_m;  // above the surface
  run(evaluator, 3.0, [&](double t_s) {
    if (t_s < 1.0) return Tip{.at_m = {0.02 * t_s, 0, kCentre_m}, .newton = 1.0};
    if (t_s < 2.0) {  // around the edge
      const double angle = 0.5 * kPi * (t_s - 1.0);
      return Tip{.at_m = {0.02 + kCentre_m * std::sin(angle), 0, kCentre_m * std::cos(angle)},
                 .newton = 1.0};
    }
    return Tip{.at_m = {0.02 + kCentre_m, 0, -0.02 * (t_s - 2.0)}, .newton = 1.0};
  });
  evaluator.finish();
  const TaskScore& score = evaluator.score();
  // 20 mm on the top and 20 mm on the wall, a half disc at each end
  const double strip_m2 = 2.0 * kRadius_m * 0.04 + kPi * kRadius_m * kRadius_m;
  EXPECT_NEAR(score.coverage_ratio * score.area_m2 / strip_m2, 1.0, 0.01);
  EXPECT_NEAR(score.depth_most_m, kPress_m, 3e-5);  // a bin of the depths
}

TEST(KnownAnswers, OnlyTheAreaIsToBeSearched) {
  TaskConfig task = search();
  // half of the strip of 2 cm around y = 0
  std::get<PalpationTask>(task.kind).area =
      BoxGeometry{.center_m = {0.025, 0.0, 0.0}, .size_m = {0.05, 0.02, 0.01}};
  const TaskScore score = score_of(
      task, 2.0, [](double t_s) { return pressed(0.1 * (0.5 * t_s - 0.5), 0.0, 0.002, 1.0); });
  EXPECT_NEAR(score.area_m2, 0.001, 1e-5);
  EXPECT_NEAR(score.coverage_ratio, 0.5, 0.005);
}

// What a page draws: places of the area alone, searched where the slide was.
TEST(KnownAnswers, TheMapShowsTheStripThatWasSearched) {
  TaskConfig task = search({lump()});
  std::get<PalpationTask>(task.kind).area =
      BoxGeometry{.center_m = {0.025, 0.0, 0.0}, .size_m = {0.05, 0.04, 0.01}};
  TaskEvaluator evaluator(task, kTool);
  evaluator.take(plane_scene());
  run(evaluator, 2.0, [](double t_s) { return pressed(0.1 * (0.5 * t_s - 0.5), 0.0, 0.002, 1.0); });
  ASSERT_TRUE(evaluator.knows_area());
  const TaskMap before = evaluator.map();
  evaluator.finish();

  const TaskMap map = evaluator.map();

  EXPECT_EQ(before.places_m, map.places_m);
  EXPECT_TRUE(before.is_searched.empty() && before.lesions.empty() && before.most_newton.empty());
  EXPECT_EQ(map.lesions.size(), 1U);
  ASSERT_EQ(map.places_m.size(), map.is_searched.size());
  EXPECT_LE(map.places_m.size(), TaskMap::kMostPlaces);
  EXPECT_GT(map.places_m.size(), TaskMap::kMostPlaces / 2);
  std::size_t searched = 0;
  for (std::size_t i = 0; i < map.places_m.size(); ++i) {
    const auto& [x, y, z] = map.places_m[i];
    EXPECT_TRUE(x >= 0.0F && x <= 0.05F && std::abs(y) <= 0.02F && z == 0.0F);
    EXPECT_EQ(map.is_searched[i] == 1, std::abs(y) <= kRadius_m) << x << ", " << y;
    searched += map.is_searched[i];
  }
  // the strip is a quarter of the area, and so of the places
  EXPECT_NEAR(static_cast<double>(searched) / static_cast<double>(map.places_m.size()), 0.25, 0.02);
}

TEST(KnownAnswers, TheMeansOfPathAndSmoothnessAreThoseOfTheDocuments) {
  const std::string told = text_of(std::filesystem::path(source_dir()) / "docs/tasks.md");
  const auto means_ms = [](double slot_s) {
    return fmt::format("means over {:g} ms", 1e3 * slot_s);
  };
  EXPECT_THAT(told, testing::HasSubstr("pulls after " + means_ms(HandMotion::kPathSlot_s)));
  EXPECT_THAT(told, testing::HasSubstr("jerk of " + means_ms(HandMotion::kSlot_s)));
}

// A circle of radius 20 mm at 0.5 Hz, seen by an encoder with steps of 0.055 mm.
TEST(KnownAnswers, ThePathOfACircleIsItsCircumference) {
  const TaskScore score = score_of({}, 10.0, [](double t_s) {
    const Vector3 at_m(0.02 * std::cos(kPi * t_s), 0.02 * std::sin(kPi * t_s), 0.05);
    constexpr double kStep_m = 55e-6;
    return Tip{.at_m = {kStep_m * std::round(at_m.x() / kStep_m),
                        kStep_m * std::round(at_m.y() / kStep_m), at_m.z()}};
  });
  EXPECT_NEAR(score.path_m / (5.0 * 2.0 * kPi * 0.02), 1.0, 0.01);
  EXPECT_FALSE(score.is_search());
  EXPECT_TRUE(std::isnan(score.coverage_ratio));
}

// Taps of 20 mm, and a tool at rest whose reading changes by a step all the time.
TEST(KnownAnswers, ThePathOfTapsIsTheirStroke) {
  constexpr double kStep_m = 55e-6;
  for (const double frequency_hz : {1.0, 2.0, 3.0}) {
    const TaskScore score = score_of({}, 6.0, [&](double t_s) {
      const double z_m = 0.05 + 0.01 * std::cos(2.0 * kPi * frequency_hz * t_s);
      return Tip{.at_m = {0.0, 0.0, kStep_m * std::round(z_m / kStep_m)}};
    });
    EXPECT_NEAR(score.path_m / (6.0 * frequency_hz * 0.04), 1.0, 0.01) << frequency_hz;
  }
  Random random(5);
  const TaskScore resting = score_of({}, 10.0, [&](double) {
    return Tip{.at_m = {0.0, 0.0, 0.05 + (random.below(2) == 0 ? kStep_m : 0.0)}};
  });
  EXPECT_LT(resting.path_m, 1e-4);
  EXPECT_TRUE(std::isnan(resting.smoothness)) << "the steps of an encoder are no motion";
}

// x = A sin ωt: v_peak = Aω, ∫|x'''|² = A²ω⁶T/2 over whole periods, so −ln((ωT)⁴/2).
TEST(KnownAnswers, TheSmoothnessOfASinusoid) {
  constexpr double kOmega = 2.0 * kPi * 0.5;
  const TaskScore score = score_of({}, 10.0, [](double t_s) {
    return Tip{.at_m = {0.02 * std::sin(kOmega * t_s), 0.0, 0.05}};
  });
  const double exact = -std::log(std::pow(kOmega * 10.0, 4) / 2.0);
  EXPECT_NEAR(score.smoothness / exact, 1.0, 0.01);
}

// From rest to rest with least jerk: −ln(720/1.875²) [Flash85]; a hand that trembles is less
// smooth.
TEST(KnownAnswers, TheSmoothestReachAndATremor) {
  const auto reach = [](double t_s, double tremor_m) {
    const double s = t_s / 20.0;
    return Tip{.at_m = {0.1 * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
                        tremor_m * std::sin(2.0 * kPi * 5.0 * t_s), 0.05}};
  };
  const double smooth = score_of({}, 20.0, [&](double t_s) { return reach(t_s, 0.0); }).smoothness;
  EXPECT_NEAR(smooth, -std::log(720.0 / (1.875 * 1.875)), 0.01 * 5.32);
  EXPECT_LT(score_of({}, 20.0, [&](double t_s) { return reach(t_s, 1e-3); }).smoothness,
            smooth - 3.0);
}

// F = 2 + sin: the quantile q is 2 − cos πq.
TEST(KnownAnswers, PercentilesOfTheForce) {
  const TaskScore score = score_of(search({lump()}), 20.0, [](double t_s) {
    return pressed(-0.03, 0.0, 0.002, 2.0 + std::sin(2.0 * kPi * t_s));
  });
  for (const ForceFigures& force : {score.force, score.elsewhere}) {
    EXPECT_NEAR(force.median_newton, 2.0, 0.02);
    EXPECT_NEAR(force.p95_newton, 2.0 - std::cos(0.95 * kPi), 0.03);
    EXPECT_NEAR(force.most_newton, 3.0, 1e-9);
    EXPECT_NEAR(force.touch_s, 20.0, 0.01);
  }
  EXPECT_TRUE(std::isnan(score.targets[0].force.most_newton));
}

// Half of the time over the lump with 3 N, half beside it with 1 N.
TEST(KnownAnswers, EachRegionHasItsOwnForces) {
  const TaskScore score = score_of(search({lump()}), 4.0, [](double t_s) {
    return t_s < 2.0 ? pressed(0.02, 0.004, 0.004, 3.0) : pressed(-0.02, 0.0, 0.001, 1.0);
  });
  EXPECT_NEAR(score.targets[0].force.median_newton, 3.0, 0.01);
  EXPECT_NEAR(score.targets[0].force.touch_s, 2.0, 0.01);
  EXPECT_NEAR(score.elsewhere.most_newton, 1.0, 1e-9);
  EXPECT_NEAR(score.elsewhere.touch_s, 2.0, 0.01);
  EXPECT_NEAR(score.depth_most_m, 0.004, 1e-5);
}

TEST(KnownAnswers, TheDepthOfThePress) {
  const TaskScore score =
      score_of(search(), 10.0, [](double t_s) { return pressed(0.0, 0.0, 0.001 * t_s, 1.0); });
  EXPECT_NEAR(score.depth_p95_m / 0.0095, 1.0, 0.01);
  EXPECT_NEAR(score.depth_most_m / 0.01, 1.0, 0.01);
}

// F = 2 + sin ωt with a limit of 2.5 N: beyond it a third of the time, by up to 0.5 N, and
// ∫ (sin − ½) = (√3 − π/3)/(2π) in each second.
TEST(KnownAnswers, OvershootTimeAndDamage) {
  TaskConfig task = search();
  task.most_force_newton = 2.5;
  const TaskScore score = score_of(task, 12.0, [](double t_s) {
    return pressed(0.0, 0.0, 0.002, 2.0 + std::sin(2.0 * kPi * t_s));
  });
  EXPECT_NEAR(score.overshoot_newton / 0.5, 1.0, 0.01);
  EXPECT_NEAR(score.beyond_s / 4.0, 1.0, 0.01);
  EXPECT_NEAR(score.damage_newton_s / (12.0 * (std::sqrt(3.0) - kPi / 3.0) / (2.0 * kPi)), 1.0,
              0.01);
  task.most_force_newton = 3.5;
  EXPECT_EQ(score_of(task, 1.0, [](double) { return pressed(0, 0, 0, 2.0); }).overshoot_newton,
            0.0);
}

// 0.1 s a slot up to a minute; then slots double until the task fits.
TEST(KnownAnswers, TheForceOverATaskHasItsLargestInEachSlot) {
  for (const auto& [length_s, slot_s] : {std::pair{10.0, 0.1}, {90.0, 0.2}, {200.0, 0.4}}) {
    ForceTrace trace;
    for (int i = 0; i < static_cast<int>(1000 * length_s); ++i) {
      const double t_s = 1e-3 * i;
      if (t_s < 2.0 || t_s >= 4.0) trace.add(t_s, t_s / length_s);
    }
    EXPECT_DOUBLE_EQ(trace.slot_s, slot_s);
    ASSERT_EQ(trace.most_newton.size(), static_cast<std::size_t>(std::lround(length_s / slot_s)));
    for (std::size_t i = 0; i < trace.most_newton.size(); ++i) {
      const double end_s = static_cast<double>(i + 1) * slot_s;
      if (end_s > 2.0 + 1e-9 && end_s < 4.0 + 1e-9) {
        EXPECT_TRUE(std::isnan(trace.most_newton[i])) << i;
      } else {
        EXPECT_NEAR(trace.most_newton[i], (end_s - 1e-3) / length_s, 1.1e-3 / length_s) << i;
      }
    }
  }
}

}  // namespace
}  // namespace palpate::test
