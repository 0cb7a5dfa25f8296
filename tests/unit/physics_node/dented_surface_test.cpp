// SPDX-License-Identifier: Apache-2.0
// A dent: as deep as the tip, not through it, local, and gone as the material relaxes.
#include "physics_node/display/dented_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/contact/analytic_surfaces.h"
#include "physics_node/display/display_mesh.h"

namespace palpate::physics {
namespace {

constexpr double kTip_m = 0.003;
const HalfSpaceGeometry kPlane;  // z = 0, a square of ±0.1 m with a vertex at the origin

class Dent : public testing::Test {
 protected:
  explicit Dent(double relaxation_s = 0.1)
      : rest_(display_mesh(kPlane, DisplayArea{})),
        surface_(
            rest_, [](const Vector3& p) { return view(kPlane, p); }, kTip_m, relaxation_s) {}

  /// The tip `depth_m` below the plane above the origin.
  void press(double depth_m, double elapsed_s = 0.0) {
    surface_.advance(Vector3(0, 0, kTip_m - depth_m), elapsed_s);
  }
  void let_go(double elapsed_s) { surface_.advance(Vector3(0, 0, 1.0), elapsed_s); }

  [[nodiscard]] std::vector<float> all() const {
    return surface_.vertices_m({0, rest_.vertex_count()});
  }
  [[nodiscard]] double lowest_m() const {
    const std::vector<float> vertices = all();
    double lowest = 0.0;
    for (std::size_t i = 2; i < vertices.size(); i += 3) {
      lowest = std::min(lowest, static_cast<double>(vertices[i]));
    }
    return lowest;
  }

  SurfaceMesh rest_;
  DentedSurface surface_;
};

TEST_F(Dent, IsAsDeepAsTheTip) {
  for (const double depth_m : {1e-4, 1e-3, 3e-3, 10e-3}) {
    surface_.reset();
    press(depth_m);
    EXPECT_NEAR(lowest_m(), -depth_m, 1e-8) << depth_m;
  }
}

TEST_F(Dent, LeavesNothingOfTheSurfaceInsideTheTip) {
  for (const double depth_m : {1e-3, 3e-3, 8e-3}) {
    surface_.reset();
    press(depth_m);
    const Vector3 tip_m(0, 0, kTip_m - depth_m);
    const std::vector<float> vertices = all();
    for (std::size_t i = 0; i < vertices.size(); i += 3) {
      const Vector3 vertex_m(vertices[i], vertices[i + 1], vertices[i + 2]);
      const bool is_under = vertex_m.z() < tip_m.z();
      if (!is_under) continue;
      ASSERT_GE((vertex_m - tip_m).norm(), kTip_m - 1e-8) << vertex_m.transpose();
    }
  }
}

TEST_F(Dent, IsLocal) {
  press(3e-3);
  // a = min(√(3·3), 3/√2) = 2.1 mm, R = 2.1 + 4·3 = 14.1 mm
  const std::vector<float> vertices = all();
  for (std::size_t i = 0; i < vertices.size(); i += 3) {
    const double from_axis_m = std::hypot(vertices[i], vertices[i + 1]);
    ASSERT_TRUE(from_axis_m < 14.2e-3 || vertices[i + 2] == 0.0F) << from_axis_m;
    ASSERT_TRUE(from_axis_m > 14.0e-3 || vertices[i + 2] < 0.0F) << from_axis_m;
  }
  const auto range = surface_.take_moved();
  ASSERT_TRUE(range.has_value());
  EXPECT_LT(range->count, rest_.vertex_count() / 3);
}

TEST_F(Dent, OfATipThatDoesNotTouchIsNone) {
  press(-1e-6);
  EXPECT_EQ(all(), rest_.vertices_m);
  EXPECT_FALSE(surface_.take_moved().has_value());
}

TEST_F(Dent, ThatIsHeldIsReportedOnce) {
  press(2e-3);
  EXPECT_TRUE(surface_.take_moved().has_value());
  for (int i = 0; i < 5; ++i) {
    press(2e-3, 0.03);
    EXPECT_FALSE(surface_.take_moved().has_value());
  }
  press(3e-3, 0.03);
  EXPECT_TRUE(surface_.take_moved().has_value());
}

TEST_F(Dent, RelaxesWithTheTimeConstantOfTheMaterial) {
  press(2e-3);
  let_go(0.1);  // one time constant
  EXPECT_NEAR(lowest_m(), -2e-3 * std::exp(-1.0), 1e-8);
  let_go(0.1);
  EXPECT_NEAR(lowest_m(), -2e-3 * std::exp(-2.0), 1e-8);
}

TEST_F(Dent, ThatIsOverIsReportedAtRestOnceAndThenNoMore) {
  press(2e-3);
  EXPECT_TRUE(surface_.take_moved().has_value());
  let_go(10.0);

  const auto back = surface_.take_moved();

  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(all(), rest_.vertices_m);
  let_go(1.0);
  EXPECT_FALSE(surface_.take_moved().has_value());
  EXPECT_FALSE(surface_.take_dented().has_value());
}

TEST_F(Dent, IsReportedWholeToALaterViewer) {
  press(2e-3);
  const auto moved = surface_.take_moved();
  press(2e-3, 0.03);

  const auto whole = surface_.take_dented();

  ASSERT_TRUE(moved.has_value() && whole.has_value());
  EXPECT_LE(whole->first, moved->first);
  EXPECT_GE(whole->first + whole->count, moved->first + moved->count);
}

class ElasticDent : public Dent {
 protected:
  ElasticDent() : Dent(0.0) {}
};
TEST_F(ElasticDent, SpringsBackAtOnce) {
  press(2e-3);
  let_go(0.0);
  EXPECT_EQ(all(), rest_.vertices_m);
}

class DamperDent : public Dent {
 protected:
  DamperDent() : Dent(std::numeric_limits<double>::infinity()) {}
};
TEST_F(DamperDent, Stays) {
  press(2e-3);
  let_go(1e6);
  EXPECT_NEAR(lowest_m(), -2e-3, 1e-8);
}

}  // namespace
}  // namespace palpate::physics
