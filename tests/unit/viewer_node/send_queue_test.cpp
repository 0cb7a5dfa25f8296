// SPDX-License-Identifier: Apache-2.0
// Messages for a client that reads too slowly.
#include "viewer_node/server/send_queue.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

namespace palpate::viewer {
namespace {

constexpr std::size_t kMegabyte = std::size_t{1} << 20;

OutgoingMessage message(char name, std::size_t bytes, bool may_drop = true) {
  return {.header = {name},
          .payload = make_payload(std::string(bytes, name)),
          .is_binary = true,
          .may_drop = may_drop};
}

std::string sent(SendQueue& queue) {
  std::string names;
  while (const OutgoingMessage* next = queue.start()) {
    names += next->header[0];
    queue.finish();
  }
  return names;
}

TEST(SendQueue, SendsOneMessageAtATimeInOrder) {
  SendQueue queue;
  EXPECT_EQ(queue.start(), nullptr);
  for (const char name : {'a', 'b', 'c'}) EXPECT_EQ(queue.push(message(name, 1)).dropped, 0u);
  ASSERT_NE(queue.start(), nullptr);
  EXPECT_EQ(queue.start(), nullptr);  // one is in flight
  queue.finish();
  EXPECT_EQ(sent(queue), "bc");
}

// Asynchronous writes read header and payload of the message in flight until they complete.
TEST(SendQueue, KeepsTheMessageInFlightInPlaceWhileOlderOnesAreDropped) {
  SendQueue queue;
  queue.push(message('a', kMegabyte));
  const OutgoingMessage* const in_flight = queue.start();
  ASSERT_NE(in_flight, nullptr);
  const char* const header = in_flight->header.data();
  const std::string* const payload = in_flight->payload.get();

  std::uint64_t dropped = 0;
  for (int i = 0; i < 100; ++i) dropped += queue.push(message('b', kMegabyte)).dropped;

  EXPECT_GT(dropped, 90u);
  EXPECT_EQ(header, in_flight->header.data());
  EXPECT_EQ(header[0], 'a');
  EXPECT_EQ(in_flight->payload.get(), payload);
  EXPECT_EQ(payload->front(), 'a');
  queue.finish();
  EXPECT_EQ(sent(queue).front(), 'b');
}

// 8 MiB may wait: the ninth of 1 MiB leaves the newest four.
TEST(SendQueue, DropsTheOldestDownToHalf) {
  SendQueue queue;
  for (char name = 'a'; name < 'i'; ++name)
    EXPECT_EQ(queue.push(message(name, kMegabyte)).dropped, 0u);
  EXPECT_EQ(queue.push(message('i', kMegabyte)).dropped, 5u);
  EXPECT_FALSE(queue.is_overfull());
  EXPECT_EQ(sent(queue), "fghi");
}

TEST(SendQueue, NeverDropsWhatWasRequested) {
  SendQueue queue;
  queue.push(message('r', 6 * kMegabyte, false));
  queue.push(message('a', kMegabyte));
  EXPECT_EQ(queue.push(message('b', 2 * kMegabyte)).dropped, 2u);
  EXPECT_EQ(sent(queue), "r");
}

TEST(SendQueue, IsOverfullByBytesOrByMessagesThatMayNotBeDropped) {
  SendQueue bytes;
  bytes.push(message('r', SendQueue::kMaxUnreadBytes, false));
  EXPECT_FALSE(bytes.is_overfull());
  bytes.push(message('r', 1, false));
  EXPECT_TRUE(bytes.is_overfull());

  SendQueue messages;
  for (std::size_t i = 0; i < SendQueue::kMaxWaitingMessages; ++i) {
    messages.push(message('r', 1, false));
  }
  ASSERT_NE(messages.start(), nullptr);
  EXPECT_FALSE(messages.is_overfull());  // one in flight counts too
  messages.push(message('r', 1, false));
  EXPECT_TRUE(messages.is_overfull());
}

// An audience: however slowly a client reads, what it gets next is the newest, and it holds two
// messages of a subject at most.
TEST(SendQueue, KeepsTheNewestOfASubjectOnly) {
  SendQueue queue;
  const auto push = [&](char name, std::size_t subject) {
    OutgoingMessage next = message(name, 10);
    next.subject = subject;
    return queue.push(std::move(next));
  };
  push('a', 1);
  EXPECT_TRUE(queue.has(1));
  ASSERT_NE(queue.start(), nullptr);  // in flight: stays
  EXPECT_EQ(push('b', 1).replaced, 0u);
  EXPECT_EQ(push('m', 2).replaced, 0u);
  queue.push(message('l', 10));          // of no subject: a line of the log
  EXPECT_EQ(push('c', 1).replaced, 1u);  // in place of b
  EXPECT_EQ(queue.bytes(), 40u);
  queue.finish();
  EXPECT_EQ(sent(queue), "mlc");
  EXPECT_FALSE(queue.has(1));
}

}  // namespace
}  // namespace palpate::viewer
