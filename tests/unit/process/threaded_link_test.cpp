// SPDX-License-Identifier: Apache-2.0
#include "common/process/threaded_link.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

#include "tests/support/machine/machine.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

const RealtimeConfig kOrdinary{.priority = 0, .cpu = -1, .wait = WaitStrategy::kBlock};

template <class IsSo>
bool await(const IsSo& is_so) {
  const auto until = std::chrono::steady_clock::now() + test::patience(10s);
  while (!is_so()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::yield();
  }
  return true;
}

struct Collecting final : Sender<ToolMotion> {
  SendResult send(const ToolMotion& motion) noexcept override {
    const SendResult now = result;  // before the test knows that it was sent
    is_in_order = is_in_order && motion.header.sequence == sent;
    ++sent;
    return now;
  }
  std::atomic<std::uint64_t> sent{0};
  std::atomic<bool> is_in_order{true};
  std::atomic<SendResult> result{SendResult::kSent};
};

TEST(ThreadedSender, SendsInOrderAndSaysWhatBecameOfTheLastOne) {
  Collecting out;
  ThreadedSender<ToolMotion> sender(out, kOrdinary);
  ToolMotion motion;
  for (std::uint64_t n = 0; n < 100; ++n) {
    motion.header.sequence = n;
    if (n == 99) out.result = SendResult::kNoPeer;
    // the thread may have sent the last one before send() looks
    const SendResult result = sender.send(motion);
    EXPECT_TRUE(result == SendResult::kSent || n == 99);
    ASSERT_TRUE(await([&] { return out.sent == n + 1; }));
  }
  EXPECT_TRUE(out.is_in_order);
  EXPECT_TRUE(await([&] { return sender.send(motion) == SendResult::kNoPeer; }));
}

/// Has so many messages as it was told, in order.
struct Arriving final : Source<Interaction> {
  bool receive(Interaction& interaction, TimePoint& received_at) noexcept override {
    if (given == arrived) return false;
    interaction = {};
    interaction.header.sequence = given++;
    received_at = TimePoint(1ms * static_cast<int>(interaction.header.sequence));
    return true;
  }
  void wait_until(TimePoint /*deadline*/) noexcept override { std::this_thread::yield(); }
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return 7; }
  [[nodiscard]] bool has_lost_peer() const noexcept override { return true; }
  std::atomic<std::uint64_t> arrived{0};
  std::atomic<std::uint64_t> given{0};
};

TEST(ThreadedSource, GivesWhatArrivedWithItsTimeAndWakesWhoWaits) {
  const SteadyClock clock;
  Arriving in;
  ThreadedSource<Interaction> source(in, clock, kOrdinary);
  Interaction interaction;
  TimePoint received_at;
  EXPECT_FALSE(source.receive(interaction, received_at));
  for (std::uint64_t n = 0; n < 100; ++n) {
    ++in.arrived;
    while (!source.receive(interaction, received_at)) {
      const TimePoint deadline = clock.now() + test::patience(10s);
      source.wait_until(deadline);
      ASSERT_LT(clock.now(), deadline);
    }
    EXPECT_EQ(interaction.header.sequence, n);
    EXPECT_EQ(received_at, TimePoint(1ms * static_cast<int>(n)));
  }
  EXPECT_TRUE(await([&] { return source.rejected() == 7U && source.has_lost_peer(); }));
}

TEST(ThreadedSource, KeepsTheOldestOfTooMany) {
  const SteadyClock clock;
  Arriving in;
  in.arrived = 100;
  ThreadedSource<Interaction> source(in, clock, kOrdinary);
  ASSERT_TRUE(await([&] { return source.rejected() == 7U; }));  // after the last one
  Interaction interaction;
  TimePoint received_at;
  std::uint64_t kept = 0;
  while (source.receive(interaction, received_at)) EXPECT_EQ(interaction.header.sequence, kept++);
  EXPECT_EQ(kept, 8U) << "the gap in the sequence numbers shows the rest";
}

}  // namespace
}  // namespace palpate
