// SPDX-License-Identifier: Apache-2.0
// Data exchange between threads: ring and snapshot.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>

#include "common/core/snapshot.h"
#include "common/core/spsc_ring.h"

namespace palpate {
namespace {

TEST(SpscRing, HoldsItsCapacityInOrderAndCountsTheRest) {
  SpscRing<int> ring(3);
  int value = 0;
  EXPECT_FALSE(ring.pop(value));
  for (int round = 0; round < 5; ++round) {  // several times past the end
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(ring.push(i));
    EXPECT_FALSE(ring.push(3));
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE(ring.pop(value));
      EXPECT_EQ(value, i);
    }
    EXPECT_FALSE(ring.pop(value));
  }
  EXPECT_EQ(ring.lost(), 5u);
}

TEST(SpscRing, BetweenTwoThreadsCountsEveryLoss) {
  SpscRing<std::uint64_t> ring(64);
  constexpr std::uint64_t kMany = 500'000;
  std::atomic<bool> is_done{false};
  std::thread producer([&] {
    for (std::uint64_t i = 1; i <= kMany; ++i) ring.push(i);
    is_done = true;
  });
  std::uint64_t taken = 0;
  std::uint64_t last = 0;
  bool is_ordered = true;
  for (;;) {
    const bool was_done = is_done;
    std::uint64_t value = 0;
    while (ring.pop(value)) {
      is_ordered &= value > last;
      last = value;
      ++taken;
    }
    if (was_done) break;
  }
  producer.join();
  EXPECT_TRUE(is_ordered);
  EXPECT_EQ(taken + ring.lost(), kMany);
}

struct Record {
  std::array<std::uint64_t, 9> words{};
  std::uint8_t last = 0;  // makes the size no multiple of a word
};

TEST(Snapshot, HoldsTheDefaultBeforeTheFirstStoreAndTheLatestValueAfter) {
  Snapshot<Record> snapshot;
  EXPECT_EQ(snapshot.load().words[0], 0u);
  Record record;
  record.words.fill(7);
  record.last = 9;
  snapshot.store(record);
  EXPECT_EQ(snapshot.load().words[8], 7u);
  EXPECT_EQ(snapshot.load().last, 9u);
}

TEST(Snapshot, IsNeverTornBetweenThreads) {
  Snapshot<Record> snapshot;
  std::atomic<bool> is_done{false};
  std::thread writer([&] {
    Record record;
    for (std::uint64_t i = 1; i <= 300'000; ++i) {
      record.words.fill(i);
      record.last = static_cast<std::uint8_t>(i);
      snapshot.store(record);
    }
    is_done = true;
  });
  bool is_torn = false;
  std::uint64_t before = 0;
  bool goes_back = false;
  while (!is_done) {
    const Record seen = snapshot.load();
    for (const std::uint64_t word : seen.words) is_torn |= word != seen.words[0];
    is_torn |= seen.last != static_cast<std::uint8_t>(seen.words[0]);
    goes_back |= seen.words[0] < before;
    before = seen.words[0];
  }
  writer.join();
  EXPECT_FALSE(is_torn);
  EXPECT_FALSE(goes_back);
  EXPECT_EQ(snapshot.load().words[0], 300'000u);
}

}  // namespace
}  // namespace palpate
