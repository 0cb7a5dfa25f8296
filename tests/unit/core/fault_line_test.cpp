// SPDX-License-Identifier: Apache-2.0
// The fault line produces exactly the configured faults.
#include "common/core/fault_line.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/core/messages.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

constexpr TimePoint kStart{100s};
constexpr int kMany = 100'000;

struct Delivery {
  std::uint64_t sequence;
  Duration delay;         // from push to due
  std::uint32_t content;  // content of the message without its header
  TimePoint due;
  bool operator==(const Delivery&) const = default;
};

/// Pushes one message per `period` and takes each when it is due; then takes the rest.
std::vector<Delivery> run(const LinkFaults& faults, int count = kMany, std::uint64_t seed = 1,
                          Duration period = 1ms) {
  FaultLine<ToolMotion> line(faults, seed, kStart);
  std::vector<Delivery> deliveries;
  ToolMotion message;
  TimePoint due;
  auto take = [&](TimePoint now) {
    while (line.pop(now, message, due)) {
      EXPECT_LE(due, now);
      const auto sent = kStart + static_cast<std::int64_t>(message.header.sequence) * period;
      deliveries.push_back({message.header.sequence, due - sent, message.buttons, due});
    }
  };
  for (int i = 0; i < count; ++i) {
    const TimePoint now = kStart + i * period;
    take(now);
    message.header.sequence = static_cast<std::uint64_t>(i);
    message.buttons = static_cast<std::uint32_t>(i);
    line.push(message, now);
  }
  take(kStart + count * period + 3600s);
  EXPECT_EQ(line.next_due(), TimePoint::max());
  return deliveries;
}

/// Five standard deviations of a binomial count: a correct fault line fails for one seed in two
/// million.
double five_sigma(double n, double p) { return 5.0 * std::sqrt(n * p * (1.0 - p)); }

int out_of_order(const std::vector<Delivery>& deliveries) {
  int n = 0;
  for (std::size_t i = 1; i < deliveries.size(); ++i) {
    if (deliveries[i].sequence < deliveries[i - 1].sequence) ++n;
  }
  return n;
}

TEST(FaultLine, WithoutFaultsIsTransparent) {
  const auto deliveries = run({}, 1000);
  ASSERT_EQ(deliveries.size(), 1000u);
  for (std::size_t i = 0; i < deliveries.size(); ++i) {
    ASSERT_EQ(deliveries[i].sequence, i);
    ASSERT_EQ(deliveries[i].delay, 0ns);
  }
  EXPECT_FALSE(LinkFaults{}.any());
}

TEST(FaultLine, DelaysEachMessageEqually) {
  const auto deliveries = run({.delay = 42ms}, 1000);
  ASSERT_EQ(deliveries.size(), 1000u);
  for (const Delivery& d : deliveries) ASSERT_EQ(d.delay, 42ms);
}

TEST(FaultLine, HoldsAMessageUntilItIsDueAndNotLonger) {
  FaultLine<ToolMotion> line({.delay = 5ms}, 1, kStart);
  ToolMotion message;
  TimePoint due;
  line.push(message, kStart);
  EXPECT_EQ(line.next_due(), kStart + 5ms);
  EXPECT_FALSE(line.pop(kStart + 5ms - 1ns, message, due));
  EXPECT_TRUE(line.pop(kStart + 5ms, message, due));
  EXPECT_EQ(due, kStart + 5ms);
}

// The period exceeds the jitter, so that keeping the order changes nothing: delays are uniform in
// 0 … J. Mean J/2, variance J²/12; the mean of n has a standard deviation of J/√(12 n).
TEST(FaultLine, JitterIsUniform) {
  const double jitter = 10e-3;
  const auto deliveries = run({.delay = 20ms, .jitter = 10ms}, kMany, 1, 11ms);
  ASSERT_EQ(deliveries.size(), static_cast<std::size_t>(kMany));
  std::array<int, 10> tenths{};
  double sum = 0.0;
  for (const Delivery& d : deliveries) {
    ASSERT_GE(d.delay, 20ms);
    ASSERT_LE(d.delay, 30ms);
    const double extra = to_seconds(d.delay - 20ms);
    sum += extra;
    ++tenths[std::min<std::size_t>(9, static_cast<std::size_t>(extra / jitter * 10.0))];
  }
  EXPECT_NEAR(sum / kMany, jitter / 2, 5.0 * jitter / std::sqrt(12.0 * kMany));
  for (const int n : tenths) EXPECT_NEAR(n, 0.1 * kMany, five_sigma(kMany, 0.1));
}

TEST(FaultLine, JitterKeepsTheOrderUnlessConfiguredOtherwise) {
  LinkFaults faults{.jitter = 10ms};
  EXPECT_EQ(out_of_order(run(faults)), 0);
  faults.jitter_reorders = true;
  // two neighbours 1 ms apart swap if the later draws at least 1 ms less: P = ½ (1 − 1/10)² = 0.405
  // for the pair; adjacent deliveries out of order are fewer or more, but of that size
  const int swapped = out_of_order(run(faults));
  EXPECT_GT(swapped, kMany / 5);
  EXPECT_LT(swapped, kMany * 3 / 5);
}

TEST(FaultLine, LosesTheConfiguredFraction) {
  for (const double ratio : {0.001, 0.05, 0.5}) {
    const auto deliveries = run({.loss_ratio = ratio});
    EXPECT_NEAR(kMany - static_cast<double>(deliveries.size()), ratio * kMany,
                five_sigma(kMany, ratio));
  }
  EXPECT_TRUE(run({.loss_ratio = 1.0}, 1000).empty());
}

// Independent losses: runs of losses are geometric, so the mean run is 1/(1 − p) = 1.25 at p = 0.2.
TEST(FaultLine, LossesAreIndependent) {
  const auto deliveries = run({.loss_ratio = 0.2});
  int runs = 0;
  int lost = 0;
  for (std::size_t i = 1; i < deliveries.size(); ++i) {
    const auto gap = static_cast<int>(deliveries[i].sequence - deliveries[i - 1].sequence) - 1;
    runs += gap > 0 ? 1 : 0;
    lost += gap;
  }
  EXPECT_NEAR(static_cast<double>(lost) / runs, 1.25, 0.03);
}

// A burst takes L messages, and one in 1/p of those outside a burst begins one: the share lost is
// pL/(1 − p + pL). With p = 0.01 and L = 10: 0.1/1.09.
TEST(FaultLine, BurstsHaveTheConfiguredLength) {
  const auto deliveries = run({.burst_ratio = 0.01, .burst_length = 10});
  int lost = 0;
  for (std::size_t i = 1; i < deliveries.size(); ++i) {
    const auto gap = deliveries[i].sequence - deliveries[i - 1].sequence - 1;
    ASSERT_EQ(gap % 10, 0u);  // one burst, or several without a message between
    lost += static_cast<int>(gap);
  }
  // ten times fewer independent events than messages, so √10 times the spread
  EXPECT_NEAR(lost, kMany * 0.1 / 1.09, std::sqrt(10.0) * five_sigma(kMany, 0.1 / 1.09));
}

TEST(FaultLine, DuplicatesTheConfiguredFractionDirectlyAfterTheOriginal) {
  const auto deliveries = run({.duplicate_ratio = 0.1});
  int duplicates = 0;
  for (std::size_t i = 1; i < deliveries.size(); ++i) {
    if (deliveries[i].sequence == deliveries[i - 1].sequence) ++duplicates;
  }
  EXPECT_EQ(deliveries.size(), static_cast<std::size_t>(kMany + duplicates));
  EXPECT_NEAR(duplicates, 0.1 * kMany, five_sigma(kMany, 0.1));
}

TEST(FaultLine, DelaysTheConfiguredFractionAndLetsOthersPass) {
  const auto deliveries = run({.delay = 5ms, .reorder_ratio = 0.1, .reorder_delay = 3500us});
  int held_back = 0;
  for (const Delivery& d : deliveries) {
    ASSERT_TRUE(d.delay == 5ms || d.delay == 8500us);
    held_back += d.delay == 8500us ? 1 : 0;
  }
  EXPECT_NEAR(held_back, 0.1 * kMany, five_sigma(kMany, 0.1));
  // overtaken by three later ones, unless all of those are delayed too (1 in 1000)
  EXPECT_NEAR(out_of_order(deliveries), held_back, 0.15 * held_back);
}

TEST(FaultLine, AnOutageLosesAllMessagesThatArriveDuringIt) {
  LinkFaults faults;
  faults.windows = {{.kind = FaultWindow::Kind::kOutage, .from = 100ms, .until = 200ms}};
  const auto deliveries = run(faults, 300);
  ASSERT_EQ(deliveries.size(), 200u);
  EXPECT_EQ(deliveries[99].sequence, 99u);
  EXPECT_EQ(deliveries[100].sequence, 200u);
}

TEST(FaultLine, AStallDeliversEverythingTogetherAtItsEnd) {
  LinkFaults faults{.delay = 10ms};
  faults.windows = {{.kind = FaultWindow::Kind::kStall, .from = 100ms, .until = 200ms}};
  const auto deliveries = run(faults, 300);
  ASSERT_EQ(deliveries.size(), 300u);
  EXPECT_EQ(out_of_order(deliveries), 0);
  for (const Delivery& d : deliveries) {
    const Duration sent = Duration(1ms) * static_cast<std::int64_t>(d.sequence);
    // held if it arrives earlier than the delay before the end of the stall; else only delayed
    const bool is_held = sent >= 100ms && sent < 190ms;
    ASSERT_EQ(d.due, kStart + (is_held ? Duration(200ms) : sent + 10ms)) << d.sequence;
  }
}

TEST(FaultLine, AFreezeRepeatsItsFirstContentUnderFreshHeaders) {
  LinkFaults faults;
  faults.windows = {{.kind = FaultWindow::Kind::kFreeze, .from = 100ms, .until = 200ms}};
  const auto deliveries = run(faults, 300);
  ASSERT_EQ(deliveries.size(), 300u);
  for (std::size_t i = 0; i < deliveries.size(); ++i) {
    ASSERT_EQ(deliveries[i].sequence, i);
    ASSERT_EQ(deliveries[i].content, i >= 100 && i < 200 ? 100u : i);
  }
}

TEST(FaultLine, AWindowRepeatsWithItsPeriod) {
  LinkFaults faults;
  faults.windows = {
      {.kind = FaultWindow::Kind::kOutage, .from = 100ms, .until = 200ms, .every = 500ms},
      {.kind = FaultWindow::Kind::kFreeze, .from = 300ms, .until = 400ms, .every = 500ms}};
  const auto deliveries = run(faults, 2000);
  EXPECT_EQ(deliveries.size(), 1600u);
  for (const Delivery& d : deliveries) {
    const std::uint64_t phase = d.sequence % 500;
    ASSERT_FALSE(phase >= 100 && phase < 200);
    // each repetition freezes its own first message, not that of the previous one
    ASSERT_EQ(d.content, phase >= 300 && phase < 400 ? d.sequence - phase + 300 : d.sequence);
  }
}

TEST(FaultLine, DependsOnlyOnTheSeed) {
  LinkFaults faults{.delay = 5ms,
                    .jitter = 4ms,
                    .loss_ratio = 0.1,
                    .burst_ratio = 0.01,
                    .burst_length = 3,
                    .duplicate_ratio = 0.1,
                    .reorder_ratio = 0.1,
                    .reorder_delay = 3ms,
                    .jitter_reorders = true};
  EXPECT_EQ(run(faults, 5000, 7), run(faults, 5000, 7));
  EXPECT_NE(run(faults, 5000, 7), run(faults, 5000, 8));
}

TEST(FaultLine, AnyIsTrueForEachFaultAlone) {
  EXPECT_TRUE(LinkFaults{.delay = 1ns}.any());
  EXPECT_TRUE(LinkFaults{.jitter = 1ns}.any());
  EXPECT_TRUE(LinkFaults{.loss_ratio = 0.1}.any());
  EXPECT_TRUE(LinkFaults{.burst_ratio = 0.1}.any());
  EXPECT_TRUE(LinkFaults{.duplicate_ratio = 0.1}.any());
  EXPECT_TRUE(LinkFaults{.reorder_ratio = 0.1}.any());
  EXPECT_TRUE(LinkFaults{.windows = {FaultWindow{}}}.any());
}

}  // namespace
}  // namespace palpate
