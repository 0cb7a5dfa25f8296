// SPDX-License-Identifier: Apache-2.0
// Where a straight shaft is deepest, and what a search for it remembers.
#include "common/contact/shaft.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>

#include "common/contact/analytic_surfaces.h"
#include "common/contact/tissue_step.h"
#include "common/core/random.h"
#include "tests/support/alloc_guard.h"

namespace palpate {
namespace {

constexpr ToolShape kTool{.tip_radius_m = 0.003, .shaft_length_m = 0.1, .shaft_radius_m = 0.002};
constexpr double kBar_m = 0.02;

AnalyticSurface bar() {
  return AnalyticSurface(
      CapsuleGeometry{.from_m = {0.0, -0.05, 0.0}, .to_m = {0.0, 0.05, 0.0}, .radius_m = kBar_m});
}

/// A shaft, led step by step.
class LedShaft {
 public:
  explicit LedShaft(const Surface& surface) : surface_(surface) {}

  /// Its touch; none: it is not near.
  const std::optional<Touch>& step_to(const Vector3& tip_m, const Vector3& direction) {
    const ToolPose now{.tip_m = tip_m, .shaft = direction, .time_s = time_s_ += 1e-3};
    const TissueStep step(surface_, {}, kTool, now, last_);
    Touch next;
    Vector3 moved_m = Vector3::Zero();
    const bool is_near =
        step.follow_shaft(0, touch_ ? &*touch_ : nullptr, 0.0, search_, next, moved_m);
    views_ += next.proxy.hint.views;
    uncovered_views_ = next.proxy.hint.uncovered_views;
    touch_ = is_near ? std::optional(next) : std::nullopt;
    last_ = now;
    return touch_;
  }
  void forget_search() { search_ = {}; }
  [[nodiscard]] std::uint32_t views() const { return views_; }
  [[nodiscard]] std::uint32_t uncovered_views() const { return uncovered_views_; }

 private:
  const Surface& surface_;
  ShaftSearch search_;
  std::optional<Touch> touch_;
  std::optional<ToolPose> last_;
  double time_s_ = 0.0;
  std::uint32_t views_ = 0;
  std::uint32_t uncovered_views_ = 0;
};

// its proxy is then exactly as far off the surface as the shaft has moved, but for rounding
TEST(ShaftTouch, IsKeptWhileTheShaftMovesStraightAway) {
  const AnalyticSurface surface = bar();
  Random random(2);
  for (int i = 0; i < 300; ++i) {
    const double angle = random.uniform(0.0, 6.28);
    const Vector3 outwards(std::cos(angle), 0.0, std::sin(angle));
    const Vector3 direction(-std::sin(angle), 0.0, std::cos(angle));
    const double pressed_m = random.uniform(0.016, 0.02);
    const double retreat_m = std::pow(10.0, random.uniform(-9.0, -5.0));
    const auto tip_m = [&](double r_m) { return Vector3(r_m * outwards - 0.04 * direction); };
    LedShaft shaft(surface);
    for (double r_m = 0.0225; r_m > pressed_m; r_m -= 5e-4) shaft.step_to(tip_m(r_m), direction);
    shaft.step_to(tip_m(pressed_m), direction);
    for (int k = 1; k <= 4; ++k) {
      const double r_m = pressed_m + k * retreat_m;
      const std::optional<Touch>& touch = shaft.step_to(tip_m(r_m), direction);
      ASSERT_TRUE(touch) << i << ", " << retreat_m;
      ASSERT_NEAR(touch->penetration_m(), kBar_m + kTool.shaft_radius_m - r_m, 1e-6) << i;
    }
  }
}

// with what it remembers the search sees the same, with fewer views
TEST(ShaftSearch, NeverChangesAResult) {
  const AnalyticSurface surface = bar();
  LedShaft with(surface);
  LedShaft without(surface);
  int touched = 0;
  constexpr int kSteps = 4000;
  for (int i = 0; i < kSteps; ++i) {
    const double t = 1e-3 * i;
    const Vector3 tip_m(0.024 + 0.008 * std::cos(4.0 * t), 0.01 * std::sin(t),
                        -0.05 + 0.02 * std::sin(2.0 * t));
    const Vector3 direction = Vector3(0.1 * std::sin(3.0 * t), 0.2 * std::sin(t), 1.0).normalized();
    without.forget_search();
    const std::optional<Touch>& a = with.step_to(tip_m, direction);
    const std::optional<Touch>& b = without.step_to(tip_m, direction);
    ASSERT_EQ(a.has_value(), b.has_value()) << i;
    if (!a) continue;
    touched += a->penetration_m() > 0.0 ? 1 : 0;
    ASSERT_NEAR(a->penetration_m(), b->penetration_m(), 1e-9) << i;
    ASSERT_LT((a->proxy.surface.normal - b->proxy.surface.normal).norm(), 1e-4) << i;
  }
  EXPECT_GT(touched, kSteps / 4);
  EXPECT_LT(with.views(), 8u * kSteps);
  EXPECT_GT(without.views(), 10u * kSteps);
}

/// A bar of which nothing is known on one side of a plane across the shaft.
class HalfKnownBar final : public Surface {
 public:
  explicit HalfKnownBar(double known_below_m) : known_below_m_(known_below_m) {}
  [[nodiscard]] SurfaceView view(const Vector3& point_m,
                                 SurfaceHint& hint) const noexcept override {
    SurfaceView seen = bar_.view(point_m, hint);
    if (!(std::abs(seen.distance_m) <= unknown_m(point_m))) ++hint.uncovered_views;
    return seen;
  }
  [[nodiscard]] double unknown_m(const Vector3& point_m) const noexcept override {
    return known_below_m_ - point_m.z();
  }

 private:
  AnalyticSurface bar_ = bar();
  double known_below_m_;
};

// what is unknown beside the shaft matters only where it may be nearer than what the shaft touches
TEST(ShaftSearch, DoubtsOnlyWhatMayBeNearest) {
  const auto uncovered = [](double known_below_m) {
    const HalfKnownBar surface(known_below_m);
    LedShaft shaft(surface);
    for (double x_m = 0.0225; x_m > 0.02; x_m -= 1e-4) {
      shaft.step_to({x_m, 0.0, -0.09}, Vector3::UnitZ());  // its middle is at z = −0.04
    }
    return shaft.uncovered_views();
  };
  EXPECT_EQ(uncovered(0.02), 0u);  // the shaft ends at z = 0.01
  EXPECT_GT(uncovered(0.011), 0u);
}

TEST(ShaftSearch, DoesNotAllocate) {
  const AnalyticSurface surface = bar();
  LedShaft shaft(surface);
  const test::AllocGuard guard;
  for (double x_m = 0.03; x_m > 0.01; x_m -= 1e-4) {
    shaft.step_to({x_m, 0.0, -0.05}, Vector3::UnitZ());
  }
  EXPECT_EQ(guard.count(), 0u);
}

// whatever the tool's pose
TEST(ShaftSearch, TakesAtMostThirtyViews) {
  const AnalyticSurface surface = bar();
  Random random(1);
  ShaftSearch search;
  for (int i = 0; i < 2000; ++i) {
    SurfaceHint hint;
    const Vector3 tip_m = 0.06 * random.direction();
    static_cast<void>(nearest_along(surface, shaft_segment(kTool, tip_m, random.direction()),
                                    SheetSide::kFront, 0.05, random.uniform(-0.05, 0.1), search,
                                    hint));
    ASSERT_LE(hint.views, 30u) << i;
  }
}

}  // namespace
}  // namespace palpate
