// SPDX-License-Identifier: Apache-2.0
// Links over inproc in one thread, as lockstep uses them, and their equivalence to memory links.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/core/inbox.h"
#include "common/core/memory_link.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "tests/loopback/links/link_fixture.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

using InprocLink = LinksTest;

TEST_F(InprocLink, DeliversEachMessageAtOnceAndLosesNone) {
  ExchangeServer mofc_exchange(context_, manual_clock_, bind_to("inproc://exchange", "exchange"));
  ExchangeClient device(context_, manual_clock_, connect_to("inproc://exchange", "exchange"));
  ZmqSource<ToolMotion> physics_in(context_, manual_clock_, bind_to("inproc://motion", "motion"));
  ZmqSender<ToolMotion> mofc_out(context_, connect_to("inproc://motion", "motion"));
  ZmqSender<Interaction> physics_out(context_, bind_to("inproc://interaction", "interaction"));
  ZmqSource<Interaction> mofc_in(context_, manual_clock_,
                                 connect_to("inproc://interaction", "interaction"));
  physics_in.wait_until(manual_clock_.now());
  ASSERT_TRUE(mofc_out.wait_for_peer(kPatience));
  mofc_in.wait_until(manual_clock_.now());
  ASSERT_TRUE(physics_out.wait_for_peer(kPatience));

  auto state_message = state(9, 0);
  auto command = random_message<ForceCommand>(random_);
  auto motion = random_message<ToolMotion>(random_);
  auto interaction = random_message<Interaction>(random_);
  TimePoint at;
  for (std::uint64_t i = 0; i < std::uint64_t{5} * kInprocQueue; ++i) {
    manual_clock_.advance(1ms);
    state_message.header.sequence = command.header.sequence = i;
    motion.header.sequence = interaction.header.sequence = i;
    DeviceState s;
    ForceCommand c;
    ToolMotion m;
    Interaction n;
    ASSERT_EQ(device.send(state_message), SendResult::kSent);
    ASSERT_TRUE(mofc_exchange.receive(s, at) && s.header.sequence == i);
    ASSERT_EQ(at, manual_clock_.now());
    ASSERT_EQ(mofc_out.send(motion), SendResult::kSent);
    ASSERT_TRUE(physics_in.receive(m, at) && m.header.sequence == i);
    ASSERT_EQ(physics_out.send(interaction), SendResult::kSent);
    ASSERT_TRUE(mofc_in.receive(n, at) && n.header.sequence == i);
    ASSERT_EQ(mofc_exchange.send(command), SendResult::kSent);
    ASSERT_TRUE(device.receive(c, at) && c.header.sequence == i);
  }
}

TEST_F(InprocLink, QueuesManyMessages) {
  ZmqSource<ToolMotion> source(context_, manual_clock_, bind_to("inproc://motion", "motion"));
  ZmqSender<ToolMotion> sender(context_, connect_to("inproc://motion", "motion"));
  source.wait_until(manual_clock_.now());
  ASSERT_TRUE(sender.wait_for_peer(kPatience));
  auto message = random_message<ToolMotion>(random_);
  TimePoint at;
  for (int round = 0; round < 20; ++round) {
    for (std::uint64_t i = 0; i < 500; ++i) {
      message.header.sequence = i;
      ASSERT_EQ(sender.send(message), SendResult::kSent);
    }
    for (std::uint64_t i = 0; i < 500; ++i) {
      ASSERT_TRUE(source.receive(message, at));
      ASSERT_EQ(message.header.sequence, i);
    }
  }
}

TEST_F(InprocLink, MayConnectBeforeTheOtherEndBinds) {
  ZmqSender<ToolMotion> sender(context_, connect_to("inproc://late", "motion"));
  ZmqSource<ToolMotion> source(context_, manual_clock_, bind_to("inproc://late", "motion"));
  source.wait_until(manual_clock_.now());
  ASSERT_TRUE(sender.wait_for_peer(kPatience));
  const auto sent = random_message<ToolMotion>(random_);
  ASSERT_EQ(sender.send(sent), SendResult::kSent);
  ToolMotion received;
  TimePoint at;
  ASSERT_TRUE(source.receive(received, at));
  EXPECT_TRUE(same(sent, received));
}

TEST_F(InprocLink, HooksReplaceBlockingAndWakingInVirtualTime) {
  ExchangeServer mofc(context_, manual_clock_, bind_to("inproc://exchange", "exchange"));
  ExchangeClient device(context_, manual_clock_, connect_to("inproc://exchange", "exchange"));
  int woken = 0;
  mofc.on_send = [&] { ++woken; };
  device.on_send = [&] { woken += 10; };
  device.on_wait = [&](TimePoint deadline) { manual_clock_.sleep_until(deadline); };

  ASSERT_EQ(device.send(state(3, 0)), SendResult::kSent);
  EXPECT_EQ(woken, 10);
  device.wait_until(manual_clock_.now() + 5ms);
  EXPECT_EQ(manual_clock_.now(), TimePoint{} + 5ms);

  DeviceState received;
  TimePoint at;
  ASSERT_TRUE(mofc.receive(received, at));
  ASSERT_EQ(mofc.send(random_message<ForceCommand>(random_)), SendResult::kSent);
  EXPECT_EQ(woken, 11);
  device.wait_until(manual_clock_.now() + 5ms);  // a message is present: no waiting
  EXPECT_EQ(manual_clock_.now(), TimePoint{} + 5ms);
}

TEST_F(InprocLink, AFaultLineDeliversTheSameAsOverAMemoryLink) {
  LinkFaults faults;
  faults.delay = 7ms;
  faults.jitter = 3ms;
  faults.loss_ratio = 0.1;
  faults.burst_ratio = 0.01;
  faults.burst_length = 5;
  faults.duplicate_ratio = 0.05;
  faults.reorder_ratio = 0.05;
  faults.reorder_delay = 4ms;
  faults.windows = {
      {.kind = FaultWindow::Kind::kOutage, .from = 100ms, .until = 150ms, .every = 1s},
      {.kind = FaultWindow::Kind::kStall, .from = 300ms, .until = 350ms, .every = 1s},
      {.kind = FaultWindow::Kind::kFreeze, .from = 500ms, .until = 550ms, .every = 1s}};
  MemoryLink<Interaction> memory(manual_clock_);
  ZmqSender<Interaction> sender(context_, bind_to("inproc://interaction", "interaction"));
  ZmqSource<Interaction> source(context_, manual_clock_,
                                connect_to("inproc://interaction", "interaction"));
  ASSERT_TRUE(sender.wait_for_peer(kPatience));
  Inbox<Interaction> by_memory(memory, manual_clock_, faults, 11);
  Inbox<Interaction> by_socket(source, manual_clock_, faults, 11);

  std::uint64_t session = random_.bits() | 1;
  int delivered = 0;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    auto message = random_message<Interaction>(random_);
    message.header = {.session_id = session, .sequence = i, .sampled_at = manual_clock_.now()};
    ASSERT_EQ(memory.send(message), SendResult::kSent);
    ASSERT_EQ(sender.send(message), SendResult::kSent);
    for (;;) {
      const auto* a = by_memory.next();
      const auto* b = by_socket.next();
      ASSERT_EQ(a == nullptr, b == nullptr);
      if (a == nullptr) break;
      ++delivered;
      ASSERT_TRUE(same(a->value, b->value));
      ASSERT_EQ(a->received_at, b->received_at);
      ASSERT_EQ(a->skipped_before, b->skipped_before);
    }
    manual_clock_.advance(1ms);
  }
  EXPECT_GT(delivered, 1500);
  EXPECT_GT(by_memory.counters().skipped, 100u);
  EXPECT_TRUE(same(by_memory.counters(), by_socket.counters()));
}

}  // namespace
}  // namespace palpate::test
