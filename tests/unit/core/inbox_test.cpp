// SPDX-License-Identifier: Apache-2.0
// The inbox and the memory link in front of it.
#include "common/core/inbox.h"

#include <gtest/gtest.h>

#include "common/core/memory_link.h"
#include "tests/support/random_messages.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

class InboxTest : public testing::Test {
 protected:
  void send(std::uint64_t session_id, std::uint64_t sequence) {
    ToolMotion message;
    message.header = {.session_id = session_id, .sequence = sequence, .sampled_at = clock_.now()};
    ASSERT_EQ(link_.send(message), SendResult::kSent);
  }
  /// Sequence of the next accepted message; −1 if none.
  std::int64_t next() {
    const auto* received = inbox_.next();
    return received == nullptr ? -1 : static_cast<std::int64_t>(received->value.header.sequence);
  }
  const LinkCounters& counters() { return inbox_.counters(); }

  ManualClock clock_;
  MemoryLink<ToolMotion> link_{clock_};
  Inbox<ToolMotion> inbox_{link_, clock_};
};

TEST_F(InboxTest, IsEmptyBeforeTheFirstMessage) {
  EXPECT_EQ(inbox_.next(), nullptr);
  EXPECT_EQ(inbox_.newest(), nullptr);
  EXPECT_EQ(counters().accepted, 0u);
}

TEST_F(InboxTest, DeliversMessagesInOrderOnceEach) {
  send(1, 0);
  send(1, 1);
  EXPECT_EQ(next(), 0);
  EXPECT_EQ(next(), 1);
  EXPECT_EQ(next(), -1);
  EXPECT_EQ(counters().accepted, 2u);
}

TEST_F(InboxTest, NewestReadsAllAndStaysWhenNothingNewArrives) {
  send(1, 0);
  send(1, 1);
  send(1, 2);
  ASSERT_NE(inbox_.newest(), nullptr);
  EXPECT_EQ(inbox_.newest()->value.header.sequence, 2u);
  EXPECT_EQ(counters().accepted, 3u);
}

TEST_F(InboxTest, StampsTheTimeOfArrivalNotOfReading) {
  clock_.advance(5ms);
  send(1, 0);
  clock_.advance(5ms);
  EXPECT_EQ(inbox_.newest()->received_at, TimePoint{} + 5ms);
}

TEST_F(InboxTest, DropsDuplicates) {
  send(1, 4);
  send(1, 4);
  EXPECT_EQ(next(), 4);
  EXPECT_EQ(next(), -1);
  EXPECT_EQ(counters().duplicates, 1u);
}

TEST_F(InboxTest, DropsMessagesOlderThanTheLastAccepted) {
  send(1, 4);
  send(1, 3);
  send(1, 5);
  EXPECT_EQ(next(), 4);
  EXPECT_EQ(next(), 5);
  EXPECT_EQ(counters().out_of_order, 1u);
}

TEST_F(InboxTest, CountsMissingSequenceNumbers) {
  send(1, 7);  // the first may have any sequence number: the receiver started late
  send(1, 8);
  send(1, 12);
  EXPECT_EQ(inbox_.next()->skipped_before, 0u);
  EXPECT_EQ(inbox_.next()->skipped_before, 0u);
  EXPECT_EQ(inbox_.next()->skipped_before, 3u);  // 9, 10, 11
  EXPECT_EQ(counters().skipped, 3u);
}

TEST_F(InboxTest, AcceptsARestartedSenderAtOnceAndDropsTheOldSession) {
  send(1, 1000);
  send(2, 0);
  send(1, 1001);  // still in transit when its sender ended
  send(2, 1);
  EXPECT_EQ(next(), 1000);
  EXPECT_EQ(next(), 0);
  EXPECT_EQ(next(), 1);
  EXPECT_EQ(counters().sessions, 2u);
  EXPECT_EQ(counters().out_of_order, 1u);
  EXPECT_EQ(counters().skipped, 0u);
}

TEST_F(InboxTest, ReportsTheRejectionsOfTheSource) {
  class Refusing final : public Source<ToolMotion> {
   public:
    bool receive(ToolMotion&, TimePoint&) noexcept override { return false; }
    void wait_until(TimePoint) noexcept override {}
    [[nodiscard]] std::uint64_t rejected() const noexcept override { return 3; }
  };
  Refusing source;
  Inbox<ToolMotion> inbox(source, clock_);
  EXPECT_EQ(inbox.newest(), nullptr);
  EXPECT_EQ(inbox.counters().rejected, 3u);
}

TEST_F(InboxTest, BehindAFaultLineStampsTheTimeAtWhichADelayedMessageWasDue) {
  Inbox<ToolMotion> delayed(link_, clock_, LinkFaults{.delay = 5ms}, 1);
  send(1, 0);
  EXPECT_EQ(delayed.next(), nullptr);
  EXPECT_EQ(delayed.next_due(), TimePoint{} + 5ms);
  clock_.advance(7ms);
  const auto* received = delayed.next();
  ASSERT_NE(received, nullptr);
  EXPECT_EQ(received->received_at, TimePoint{} + 5ms);
  EXPECT_EQ(delayed.next_due(), TimePoint::max());
}

TEST_F(InboxTest, WaitsNoLongerThanUntilTheFaultLineReleasesAMessage) {
  Inbox<ToolMotion> delayed(link_, clock_, LinkFaults{.delay = 5ms}, 1);
  link_.on_wait = [&](TimePoint deadline) { clock_.sleep_until(deadline); };
  send(1, 0);
  EXPECT_EQ(delayed.next(), nullptr);

  delayed.wait_until(TimePoint{} + 1s);

  EXPECT_EQ(clock_.now(), TimePoint{} + 5ms);
  EXPECT_NE(delayed.next(), nullptr);
  delayed.wait_until(TimePoint{} + 1s);
  EXPECT_EQ(clock_.now(), TimePoint{} + 1s);
}

TEST_F(InboxTest, DoesNotWaitForAPastDeadline) {
  bool waited = false;
  link_.on_wait = [&](TimePoint) { waited = true; };
  clock_.advance(1s);
  inbox_.wait_until(TimePoint{} + 1s);
  EXPECT_FALSE(waited);
}

TEST(MemoryLink, DropsNewMessagesWhenItIsFull) {
  ManualClock clock;
  MemoryLink<ToolMotion> link(clock, 2);
  ToolMotion message;
  for (std::uint64_t i = 0; i < 2; ++i) {
    message.header.sequence = i;
    EXPECT_EQ(link.send(message), SendResult::kSent);
  }
  EXPECT_EQ(link.send(message), SendResult::kDropped);

  TimePoint at;
  ASSERT_TRUE(link.receive(message, at));
  EXPECT_EQ(message.header.sequence, 0u);
  message.header.sequence = 2;
  EXPECT_EQ(link.send(message), SendResult::kSent);  // past the end of the ring
  ASSERT_TRUE(link.receive(message, at));
  EXPECT_EQ(message.header.sequence, 1u);
  ASSERT_TRUE(link.receive(message, at));
  EXPECT_EQ(message.header.sequence, 2u);
  EXPECT_FALSE(link.receive(message, at));
}

TEST(MemoryLink, KeepsTheOrderOfMessagesWhileItGrows) {
  ManualClock clock;
  MemoryLink<ToolMotion> link(clock, 50);
  ToolMotion message;
  TimePoint at;
  std::uint64_t sent = 0;
  const auto send = [&] {
    message.header.sequence = sent++;
    return link.send(message);
  };
  for (int i = 0; i < 5; ++i) ASSERT_EQ(send(), SendResult::kSent);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(link.receive(message, at));  // the ring begins within
  for (int i = 0; i < 48; ++i) ASSERT_EQ(send(), SendResult::kSent);
  EXPECT_EQ(send(), SendResult::kDropped);

  for (std::uint64_t i = 3; i < 53; ++i) {
    ASSERT_TRUE(link.receive(message, at));
    EXPECT_EQ(message.header.sequence, i);
  }
  EXPECT_FALSE(link.receive(message, at));
}

// A field that copy_message forgets differs: every field of a random message is random.
TEST(CopyMessage, CopiesEveryFieldOverAnotherMessage) {
  const auto check = [](auto from, auto to, Random& random) {
    for (int i = 0; i < 50; ++i) {
      test::randomise(from, random);
      copy_message(from, to);
      ASSERT_TRUE(test::same(from, to)) << i;
    }
  };
  Random random(1);
  check(DeviceState{}, DeviceState{}, random);
  check(Interaction{}, Interaction{}, random);
  check(ForceCommand{}, ForceCommand{}, random);
}

TEST(MemoryLink, CallsItsHooks) {
  ManualClock clock;
  MemoryLink<ToolMotion> link(clock, 1);
  int sends = 0;
  int waits = 0;
  link.on_send = [&] { ++sends; };
  link.on_wait = [&](TimePoint) { ++waits; };

  link.wait_until(TimePoint{} + 1s);
  static_cast<void>(link.send({}));
  static_cast<void>(link.send({}));   // dropped: no wake-up
  link.wait_until(TimePoint{} + 1s);  // a message is present: no waiting

  EXPECT_EQ(sends, 1);
  EXPECT_EQ(waits, 1);
}

// --- answers ----------------------------------------------------------------------------------

class AnswersTest : public testing::Test {
 protected:
  /// Whether an answer to this state is accepted.
  bool is_accepted(std::uint64_t session_id, std::uint64_t sequence, Duration sampled_at) {
    ForceCommand command;
    command.header = {.session_id = 9, .sequence = next_++, .sampled_at = clock_.now()};
    command.answers_session_id = session_id;
    command.answers_sequence = sequence;
    command.answers_sampled_at = TimePoint(sampled_at);
    EXPECT_EQ(link_.send(command), SendResult::kSent);
    return inbox_.next() != nullptr;
  }

  ManualClock clock_;
  MemoryLink<ForceCommand> link_{clock_};
  Inbox<ForceCommand> inbox_{link_, clock_};
  std::uint64_t next_ = 0;
};

TEST_F(AnswersTest, AnAnswerToAStateThatWasNeverSentIsDroppedAndCounted) {
  EXPECT_TRUE(is_accepted(1, 8, 8ms)) << "nothing is expected yet";
  inbox_.reject_answers_newer_than({.session_id = 1, .sequence = 5, .sampled_at = TimePoint(5ms)});

  EXPECT_TRUE(is_accepted(1, 5, 5ms));
  EXPECT_TRUE(is_accepted(1, 4, 4ms));
  EXPECT_TRUE(is_accepted(2, 9, 9ms)) << "another session: the node decides";
  EXPECT_FALSE(is_accepted(1, 6, 5ms));
  EXPECT_FALSE(is_accepted(1, 4, 6ms));
  EXPECT_FALSE(is_accepted(1, 5, 4ms)) << "not its stamp";
  EXPECT_EQ(inbox_.counters().ahead, 3u);
  EXPECT_EQ(inbox_.counters().accepted, 4u);
  EXPECT_EQ(inbox_.newest()->value.answers_sequence, 9u);
}

}  // namespace
}  // namespace palpate
