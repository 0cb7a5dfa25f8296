// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "common/core/random.h"
#include "common/telemetry/quantile.h"
#include "common/telemetry/telemetry.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

TEST(LimitedToNorm, ShortensAndKeepsTheDirection) {
  EXPECT_TRUE(limited_to_norm({3, 4, 0}, 1.0).isApprox(Vector3(0.6, 0.8, 0)));
  EXPECT_EQ(limited_to_norm({3, 4, 0}, 5.0), Vector3(3, 4, 0));
  EXPECT_EQ(limited_to_norm({3, 4, 0}, 0.0), Vector3(0, 0, 0));
  EXPECT_EQ(limited_to_norm({0, 0, 0}, 0.0), Vector3(0, 0, 0));
}

// Per axis, only where |asked| > 0.05 N: x has 1/1 for 1 ms and 1/2 for 3 ms, y has 0.2/0.4, z
// never.
TEST(PaperTransparency, IsTheMeanRatioPerAxisOverTheTimeAboveTheFloor) {
  PaperTransparency t;
  t.add(1e-3, {1.0, 0.4, 0.05}, {1.0, 0.2, 0.05});
  t.add(3e-3, {-2.0, 0.01, 0.0}, {-1.0, 0.01, 3.0});
  EXPECT_DOUBLE_EQ(t.mean().x(), (1.0 + 3.0 * 0.5) / 4.0);
  EXPECT_DOUBLE_EQ(t.mean().y(), 0.5);
  EXPECT_TRUE(std::isnan(t.mean().z()));
}

// F·R/|R|²: 2/4 = 0.5 for 4 s; 8/4 capped to 1 for 1 s; −4/4 raised to 0 for 2 s; without a
// reference 0 for 1 s. T = (2 + 1)/8. ∫F·R = 8 + 8 − 8 = 8 and ∫|R|² = 28; errors² 4·1 + 4 + 2·16 +
// 1 = 41; |errors| 4 + 2 + 8 + 1 = 15, all of them beyond the JND.
TEST(ForceComparison, WeighsEachForceWithTheTimeForWhichItActed) {
  ForceComparison c;
  c.add(4.0, {0, 0, 2}, {0, 0, 1});
  c.add(1.0, {0, 0, 2}, {0, 0, 4});
  c.add(2.0, {0, 0, 2}, {0, 0, -2});
  c.add(1.0, {0, 0, 0}, {0, 1, 0});
  c.add(9.0, {0, 0, 0.04}, {0, 0.04, 0});  // below the floor: does not count
  EXPECT_DOUBLE_EQ(c.integrals().judged_s, 8.0);
  EXPECT_DOUBLE_EQ(c.transparency(), 3.0 / 8.0);
  EXPECT_DOUBLE_EQ(c.gain(), 8.0 / 28.0);
  EXPECT_DOUBLE_EQ(c.rms_error_ratio(), std::sqrt(41.0 / 28.0));
  EXPECT_DOUBLE_EQ(c.integrals().error_ns, 15.0);
  EXPECT_DOUBLE_EQ(c.beyond_jnd_ratio(), 1.0);
}

TEST(ForceComparison, ShowsAnOvershootInTheGainAlone) {
  ForceComparison c;
  c.add(1.0, {0, 0, 1}, {0, 0, 2});
  EXPECT_DOUBLE_EQ(c.transparency(), 1.0);
  EXPECT_DOUBLE_EQ(c.gain(), 2.0);
  EXPECT_DOUBLE_EQ(c.rms_error_ratio(), 1.0);
}

// 1 N held for 10 ms while the reference grows from 1 N to 2 N, with s = t/10 ms:
// T = ∫ 1/(1 + s) ds = ln 2, gain ∫ (1 + s) / ∫ (1 + s)² = (3/2)/(7/3), rms² = (1/3)/(7/3).
// At the beginning alone all would be right. Pieces of 0.25 ms: their middles are within 1e-4.
TEST(ForceComparison, ComparesAHeldForceWithTheReferenceThatGoesOn) {
  ForceComparison c;
  c.add(10e-3, {0, 0, 1}, {0, 0, 2}, {0, 0, 1});
  EXPECT_NEAR(c.integrals().judged_s, 10e-3, 1e-15);
  EXPECT_NEAR(c.transparency(), std::log(2.0), 1e-4);
  EXPECT_NEAR(c.gain(), 1.5 / (7.0 / 3.0), 1e-4);
  EXPECT_NEAR(c.rms_error_ratio(), std::sqrt(1.0 / 7.0), 1e-4);
}

TEST(ForceComparison, OfTwoTimesIsTheirSum) {
  ForceComparison first;
  first.add(1.0, {0, 0, 2}, {0, 0, 1});
  ForceComparison second;
  second.add(3.0, {0, 0, 2}, {0, 0, 2});
  ForceComparison sum(first.integrals());
  sum.add(second);
  EXPECT_DOUBLE_EQ(sum.transparency(), 0.875);
  EXPECT_DOUBLE_EQ(sum.gain(), 14.0 / 16.0);
}

TEST(ForceComparison, IsUnknownBeforeAnyTimeCounts) {
  const ForceComparison none;
  EXPECT_TRUE(std::isnan(none.transparency()));
  EXPECT_TRUE(std::isnan(none.gain()));
  EXPECT_TRUE(std::isnan(none.rms_error_ratio()));
  EXPECT_TRUE(std::isnan(none.beyond_jnd_ratio()));
}

// 1 N off for 10 ms within 60 ms: half of the best placed 20 ms.
TEST(LargestMean, IsOverTwentyMilliseconds) {
  LargestMean mean;
  for (int ms = 0; ms < 60; ++ms) {
    mean.add(1e-3, ms >= 30 && ms < 40 ? 1e-3 : 0.0);
    EXPECT_EQ(std::isnan(mean.value()), ms < 19);
  }
  EXPECT_NEAR(mean.value(), 0.5, 1e-9);
}

TEST(ReversalCounter, CountsTurnsLargerThanHalfAMillimetre) {
  ReversalCounter counter;
  for (const double x_mm : {0.0, 1.0, 0.6, 1.2, 0.69, 0.0, 0.4, -0.2, 0.31}) {
    counter.add({x_mm * 1e-3, 0, 0});
  }
  // 0.6 is 0.4 back: no turn; 0.69 is 0.51 back from 1.2: one; 0.31 is 0.51 up from −0.2: two
  EXPECT_EQ(counter.reversals()[0], 2u);
  EXPECT_EQ(counter.total(), 2u);
}

TEST(ReversalCounter, CountsEachAxisForItself) {
  ReversalCounter counter;
  // sin over 5 periods turns 10 times; the cosine starts at an extreme, so 9 turns and the end
  for (int i = 0; i <= 5000; ++i) {
    const double phase = 2.0 * std::numbers::pi * i / 1000.0;
    counter.add({0.01 * std::sin(phase), 0.01 * std::cos(phase), 0.0004 * std::sin(phase)});
  }
  EXPECT_EQ(counter.reversals(), (std::array<std::uint64_t, 3>{10, 9, 0}));
}

// Nearest rank: of 1 … 10 the smallest value that at least the share q does not exceed.
TEST(Quantile, IsTheNearestRank) {
  std::vector<int> values = {7, 2, 9, 4, 1, 10, 3, 8, 6, 5};
  EXPECT_EQ(quantile(values, 0.0), 1);
  EXPECT_EQ(quantile(values, 0.1), 1);
  EXPECT_EQ(quantile(values, 0.11), 2);
  EXPECT_EQ(quantile(values, 0.5), 5);
  EXPECT_EQ(quantile(values, 0.99), 10);
  EXPECT_EQ(quantile(values, 1.0), 10);
  EXPECT_EQ(quantile(values, 7.0), 10);
}

TEST(DurationHistogram, IsAtMostNinePercentAboveTheTrueQuantile) {
  DurationHistogram histogram;
  std::vector<Duration> all;
  Random random(3);
  for (int i = 0; i < 20'000; ++i) {
    const Duration d = from_seconds(1e-7 * std::exp2(random.uniform(0.0, 20.0)));
    histogram.add(d);
    all.push_back(d);
  }
  for (const double q : {0.01, 0.5, 0.9, 0.99, 0.999}) {
    const double ratio = to_seconds(histogram.quantile(q)) / to_seconds(quantile(all, q));
    EXPECT_GE(ratio, 0.999) << q;  // an edge is rounded down to a nanosecond
    EXPECT_LE(ratio, 1.0906) << q;
  }
  EXPECT_EQ(histogram.quantile(1.0), quantile(all, 1.0));
  EXPECT_EQ(histogram.maximum(), quantile(all, 1.0));
  EXPECT_EQ(histogram.count(), 20'000u);
}

TEST(DurationHistogram, TakesWhatIsTooShortOrTooLong) {
  DurationHistogram histogram;
  EXPECT_EQ(histogram.quantile(0.5), 0ns);
  histogram.add(-1ms);
  histogram.add(0ns);
  histogram.add(1h);
  EXPECT_EQ(histogram.count(), 3u);
  EXPECT_LE(histogram.quantile(0.5), 70ns);  // the lowest bucket ends at 64·2^⅛ = 69.8 ns
  EXPECT_EQ(histogram.maximum(), 1h);
  EXPECT_GE(histogram.quantile(1.0), 17s);
}

TEST(States, HaveNames) {
  EXPECT_STREQ(name(GuardState::kFallback), "fallback");
  EXPECT_STREQ(name(GuardState::kFault), "fault");
  EXPECT_STREQ(name(FaultReason::kPositionJumped), "position jumped");
  EXPECT_STREQ(name(MofcState::kNoPhysics), "no physics");
}

// 7 % of 2 N is 0.14 N; of 0.3 N 0.021 N, so 0.05 N counts.
TEST(ForceJnd, IsSevenPercentButAtLeastTheForceFloor) {
  EXPECT_FALSE(is_beyond_force_jnd({0, 0, 2}, {0, 0, 2.139}));
  EXPECT_TRUE(is_beyond_force_jnd({0, 0, 2}, {0, 0, 2.141}));
  EXPECT_TRUE(is_beyond_force_jnd({0, 0, 2}, {0.141, 0, 2}));
  EXPECT_FALSE(is_beyond_force_jnd({0, 0, 0.3}, {0, 0, 0.349}));
  EXPECT_TRUE(is_beyond_force_jnd({0, 0, 0.3}, {0, 0, 0.351}));
}

}  // namespace
}  // namespace palpate
