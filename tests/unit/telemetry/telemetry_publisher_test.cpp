// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/telemetry_publisher.h"

#include <gtest/gtest.h>
#include <spdlog/sinks/null_sink.h>

#include <condition_variable>
#include <mutex>
#include <vector>

#include "tests/support/machine/machine.h"

namespace palpate {
namespace {

/// Keeps what was sent; a test may wait for it.
class Kept final : public Sender<PhysicsBatch> {
 public:
  SendResult send(const PhysicsBatch& batch) noexcept override {
    const std::lock_guard lock(mutex_);
    batches_.push_back(batch);
    sent_.notify_all();
    return SendResult::kSent;
  }
  bool wait_for_batches(std::size_t count) {
    std::unique_lock lock(mutex_);
    return sent_.wait_for(lock, test::patience(std::chrono::seconds(20)),
                          [&] { return batches_.size() >= count; });
  }
  std::vector<PhysicsBatch> batches() {
    const std::lock_guard lock(mutex_);
    return batches_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable sent_;
  std::vector<PhysicsBatch> batches_;
};

class TelemetryPublisherTest : public testing::Test {
 protected:
  TelemetryPublisher<PhysicsTick, PhysicsCounters> publisher(std::uint64_t session_id = 7) {
    return {session_id, clock_, ticks_, counters_, kept_, log_};
  }
  void keep(std::uint64_t from, std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) ticks_.keep({.sequence = from + i});
  }
  void store_contact_steps(std::uint64_t count) {
    PhysicsCounters counters;
    counters.contact_steps = count;
    counters_.store(counters);
  }

  ManualClock clock_;
  RingSink<PhysicsTick> ticks_{600};
  Snapshot<PhysicsCounters> counters_;
  Kept kept_;
  spdlog::logger log_{"node", std::make_shared<spdlog::sinks::null_sink_mt>()};
};

TEST_F(TelemetryPublisherTest, ABatchHasTheTicksSinceTheLastOneAndTheCountersOfNow) {
  auto publisher = this->publisher();
  keep(0, 3);
  store_contact_steps(2);
  clock_.advance(std::chrono::milliseconds(20));
  publisher.pump();
  keep(3, 1);
  store_contact_steps(5);
  publisher.pump();

  const auto batches = kept_.batches();
  ASSERT_EQ(batches.size(), 2u);
  ASSERT_EQ(batches[0].records.size(), 3u);
  EXPECT_EQ(batches[0].records[2].sequence, 2u);
  EXPECT_EQ(batches[0].counters.contact_steps, 2u);
  EXPECT_EQ(batches[0].header.session_id, 7u);
  EXPECT_EQ(batches[0].header.sequence, 0u);
  EXPECT_EQ(batches[0].header.sampled_at, clock_.now());
  ASSERT_EQ(batches[1].records.size(), 1u);
  EXPECT_EQ(batches[1].records[0].sequence, 3u);
  EXPECT_EQ(batches[1].counters.contact_steps, 5u);
  EXPECT_EQ(batches[1].header.sequence, 1u);
}

TEST_F(TelemetryPublisherTest, CountersOfItsOwnThreadGoWithThoseOfTheTicks) {
  auto publisher = this->publisher();
  publisher.add_counts = [](PhysicsCounters& counters) { counters.mesh_frames += 3; };
  store_contact_steps(2);
  publisher.pump();
  publisher.pump();

  for (const PhysicsBatch& batch : kept_.batches()) {
    EXPECT_EQ(batch.counters.contact_steps, 2u);
    EXPECT_EQ(batch.counters.mesh_frames, 3u);
  }
}

TEST_F(TelemetryPublisherTest, PublishesCountersAlsoWithoutTicks) {
  auto publisher = this->publisher();
  publisher.pump();
  ASSERT_EQ(kept_.batches().size(), 1u);
  EXPECT_TRUE(kept_.batches()[0].records.empty());
}

// The ring of this test holds 600: of 700 ticks the last 100 are lost; 600 = 256 + 256 + 88.
TEST_F(TelemetryPublisherTest, ABacklogIsSplitAndLossesAreCounted) {
  auto publisher = this->publisher();
  keep(0, 700);

  publisher.pump();

  const auto batches = kept_.batches();
  ASSERT_EQ(batches.size(), 3u);
  EXPECT_EQ(batches[0].records.size(), 256u);
  EXPECT_EQ(batches[1].records.size(), 256u);
  EXPECT_EQ(batches[2].records.size(), 88u);
  EXPECT_EQ(batches[2].records.back().sequence, 599u);
  EXPECT_EQ(batches[2].header.sequence, 2u);
  EXPECT_EQ(batches[2].records_lost, 100u);
}

TEST_F(TelemetryPublisherTest, TheThreadPublishesByItselfAndEndsWithTheLastTicks) {
  {
    auto publisher = this->publisher();
    publisher.start();
    ASSERT_TRUE(kept_.wait_for_batches(2));
    keep(0, 10);
  }

  std::size_t records = 0;
  for (const PhysicsBatch& batch : kept_.batches()) records += batch.records.size();
  EXPECT_EQ(records, 10u);
}

}  // namespace
}  // namespace palpate
