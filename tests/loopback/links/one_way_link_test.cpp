// SPDX-License-Identifier: Apache-2.0
// One-way links (hops 2, 3 and 6) over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "common/core/inbox.h"
#include "common/link/exchange_client.h"
#include "common/link/subscribers.h"
#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "tests/loopback/links/link_fixture.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

using OneWayLink = LinksTest;

class OneWayLinkTransport : public EveryTransport {
 protected:
  /// A hundred random messages, one after another, each as it was sent.
  template <class T>
  void expect_all_arrive(ZmqSender<T>& sender, ZmqSource<T>& source) {
    for (int i = 0; i < 100; ++i) {
      const auto sent = random_message<T>(random_);
      ASSERT_EQ(sender.send(sent), SendResult::kSent);
      T received;
      ASSERT_TRUE(receive(source, received));
      ASSERT_TRUE(same(sent, received));
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Links, OneWayLinkTransport, kEveryTransport, transport_name);

class OneWayLinkSocket : public EveryTransport {};
INSTANTIATE_TEST_SUITE_P(Links, OneWayLinkSocket, kEverySocket, transport_name);

TEST_P(OneWayLinkTransport, ToolMotionReachesTheReceiverThatBinds) {
  ZmqSource<ToolMotion> physics(context_, clock_,
                                bind_to(fresh_endpoint(GetParam()), "links.tool_motion"));
  ZmqSender<ToolMotion> mofc(context_, connect_to(physics.endpoint(), "links.tool_motion"));
  ASSERT_TRUE(meet(mofc, physics));

  expect_all_arrive(mofc, physics);
}

TEST_P(OneWayLinkTransport, InteractionReachesTheReceiverThatConnects) {
  ZmqSender<Interaction> physics(context_,
                                 bind_to(fresh_endpoint(GetParam()), "links.interaction"));
  ZmqSource<Interaction> mofc(context_, clock_,
                              connect_to(physics.endpoint(), "links.interaction"));
  ASSERT_TRUE(meet(physics, mofc));

  expect_all_arrive(physics, mofc);
}

TEST_P(OneWayLinkTransport, HandTargetsOfAllViewersReachTheDevice) {
  ZmqSource<HandTarget> device(context_, clock_,
                               bind_to(fresh_endpoint(GetParam()), "hand_target"));
  ZmqSender<HandTarget> first(context_, connect_to(device.endpoint(), "hand_target"));
  ZmqSender<HandTarget> second(context_, connect_to(device.endpoint(), "hand_target"));
  ASSERT_TRUE(meet(first, device));
  ASSERT_TRUE(meet(second, device));
  const auto sent = random_message<HandTarget>(random_);
  HandTarget received;

  ASSERT_EQ(first.send(sent), SendResult::kSent);
  ASSERT_TRUE(receive(device, received));
  EXPECT_TRUE(same(received, sent));
  ASSERT_EQ(second.send(sent), SendResult::kSent);
  EXPECT_TRUE(receive(device, received));
}

TEST_F(OneWayLink, WaitingForAMissingPeerEnds) {
  ZmqSender<Interaction> sender(context_, bind_to(fresh_endpoint(Transport::kIpc), "x"));
  ExchangeClient device(context_, clock_, connect_to(fresh_endpoint(Transport::kIpc), "y"));
  EXPECT_FALSE(sender.wait_for_peer(2ms));
  EXPECT_FALSE(device.wait_for_peer(2ms));
  EXPECT_EQ(device.send(state(1, 0)), SendResult::kDropped);
}

TEST_P(OneWayLinkSocket, AReceiverQueuesWhatItHasNotRead) {
  ZmqSource<ToolMotion> source(context_, clock_, bind_to(fresh_endpoint(GetParam()), "x"));
  ZmqSender<ToolMotion> sender(context_, connect_to(source.endpoint(), "links.tool_motion"));
  ASSERT_TRUE(meet(sender, source));
  auto message = random_message<ToolMotion>(random_);
  for (message.header.sequence = 0; message.header.sequence < 100; ++message.header.sequence) {
    ASSERT_TRUE(eventually([&] { return sender.send(message) == SendResult::kSent; }));
  }
  for (std::uint64_t i = 0; i < 100; ++i) {
    ASSERT_TRUE(receive(source, message));
    ASSERT_EQ(message.header.sequence, i);
  }
}

// Receivers that stall with full queues for longer than the time-outs of their connections, like a
// suspended process. If heartbeats replaced the connections then, libzmq 4.3 would abort the
// process when such a queue is read (libzmq issue 3937).
TEST_F(OneWayLink, ReceiversThatStallWithFullQueuesResume) {
  constexpr int kMoreThanFits = 1000;
  constexpr Duration kStall = Subscribers::kSilence + 200ms;
  struct Pair {
    std::unique_ptr<ZmqSender<DeviceBatch>> node;
    std::unique_ptr<TelemetrySubscriber> viewer;
    std::unique_ptr<ZmqSender<Interaction>> sender;
    std::unique_ptr<ZmqSource<Interaction>> source;
  };
  std::vector<Pair> pairs;
  DeviceBatch batch;
  batch.header.session_id = 1;
  auto interaction = random_message<Interaction>(random_);
  interaction.header.sequence = 0;
  TelemetryMessage telemetry;
  Interaction received;
  TimePoint received_at;
  const auto send = [&] {
    ++batch.header.sequence;
    ++interaction.header.sequence;
    for (Pair& pair : pairs) {
      static_cast<void>(pair.node->send(batch));
      static_cast<void>(pair.sender->send(interaction));
    }
  };
  for (const Transport transport : {Transport::kIpc, Transport::kTcp}) {
    Pair& pair = pairs.emplace_back();
    pair.node = std::make_unique<ZmqSender<DeviceBatch>>(
        context_, bind_to(fresh_endpoint(transport), "device"));
    pair.viewer = std::make_unique<TelemetrySubscriber>(
        context_, clock_, std::vector{connect_to(pair.node->endpoint(), "device")});
    pair.sender = std::make_unique<ZmqSender<Interaction>>(
        context_, bind_to(fresh_endpoint(transport), "interaction"));
    pair.source = std::make_unique<ZmqSource<Interaction>>(
        context_, clock_, connect_to(pair.sender->endpoint(), "interaction"));
    ASSERT_TRUE(meet(*pair.sender, *pair.source));
    ASSERT_TRUE(eventually([&] {
      send();
      return pair.viewer->receive(telemetry, received_at);
    }));
  }

  for (int i = 0; i < kMoreThanFits; ++i) {
    send();
    clock_.sleep_until(clock_.now() + 200us);
  }
  clock_.sleep_until(clock_.now() + kStall);

  for (Pair& pair : pairs) {
    while (pair.viewer->receive(telemetry, received_at)) {
    }
    while (pair.source->receive(received, received_at)) {
    }
  }
  const std::uint64_t batches = batch.header.sequence;
  const std::uint64_t interactions = interaction.header.sequence;
  for (Pair& pair : pairs) {
    EXPECT_TRUE(eventually([&] {
      send();
      return pair.viewer->receive(telemetry, received_at) &&
             std::get<DeviceBatch>(telemetry).header.sequence > batches;
    }));
    EXPECT_TRUE(eventually([&] {
      send();
      return pair.source->receive(received, received_at) && received.header.sequence > interactions;
    }));
  }
}

TEST_P(OneWayLinkSocket, ResumesAfterTheRestartOfEitherEnd) {
  using Role = Attachment::Role;
  for (const Role sender_role : {Role::kBind, Role::kConnect}) {
    SCOPED_TRACE(sender_role == Role::kBind ? "sender binds" : "receiver binds");
    std::unique_ptr<ZmqSender<ToolMotion>> sender;
    std::unique_ptr<ZmqSource<ToolMotion>> source;
    std::string endpoint = fresh_endpoint(GetParam());
    auto start_sender = [&] {
      sender = std::make_unique<ZmqSender<ToolMotion>>(
          context_, Attachment{sender_role, endpoint, "links.tool_motion"});
      if (sender_role == Role::kBind) endpoint = sender->endpoint();
    };
    auto start_source = [&] {
      const Role role = sender_role == Role::kBind ? Role::kConnect : Role::kBind;
      source = std::make_unique<ZmqSource<ToolMotion>>(
          context_, clock_, Attachment{role, endpoint, "links.tool_motion"});
      if (role == Role::kBind) endpoint = source->endpoint();
    };
    auto again = [&](const std::function<void()>& start) {
      return eventually([&] {
        try {
          start();
          return true;
        } catch (const SetupError&) {  // libzmq releases a port shortly after closing
          return false;
        }
      });
    };
    auto passes = [&] {
      static_cast<void>(sender->send(random_message<ToolMotion>(random_)));
      ToolMotion message;
      TimePoint at;
      return source->receive(message, at);
    };
    if (sender_role == Role::kBind) {
      start_sender();
      start_source();
    } else {
      start_source();
      start_sender();
    }
    ASSERT_TRUE(eventually(passes));

    sender.reset();
    ASSERT_TRUE(again(start_sender));
    EXPECT_TRUE(eventually(passes));

    source.reset();
    ASSERT_TRUE(again(start_source));
    EXPECT_TRUE(eventually(passes));
  }
}

TEST_P(OneWayLinkSocket, AConnectingSenderDetectsTheEndOfItsReceiver) {
  auto source = std::make_unique<ZmqSource<ToolMotion>>(
      context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.tool_motion"));
  ZmqSender<ToolMotion> sender(context_, connect_to(source->endpoint(), "links.tool_motion"));
  ASSERT_TRUE(meet(sender, *source));

  source.reset();

  // so that no old messages are queued for a restarted receiver
  EXPECT_TRUE(eventually([&] { return !sender.has_subscriber(); }));
}

TEST_F(OneWayLink, WaitingEndsWithinAFractionOfAMillisecondAndNeverEarly) {
  ZmqSource<ToolMotion> source(context_, clock_,
                               bind_to(fresh_endpoint(Transport::kIpc), "links.tool_motion"));
  const QuietMachine machine;
  std::vector<Duration> lateness;
  for (int i = 0; i < 300; ++i) {
    const TimePoint deadline = clock_.now() + 250us;
    source.wait_until(deadline);
    lateness.push_back(clock_.now() - deadline);
  }
  std::sort(lateness.begin(), lateness.end());
  EXPECT_GE(lateness.front(), 0ns);
  // whole milliseconds would be 750 µs late; timer slack is 50 µs
  if (machine.may_check("lateness of a wait")) {
    EXPECT_LT(lateness[150], 400us);
  }
}

TEST_F(OneWayLink, MixedUpEndpointsRefuseEachOther) {
  ZmqSource<ToolMotion> source(context_, manual_clock_, bind_to("inproc://mixed_up", "motion"));
  ZmqSender<HandTarget> pointer(context_, connect_to("inproc://mixed_up", "links.hand_target"));
  ASSERT_TRUE(pointer.wait_for_peer(kPatience));
  Inbox<ToolMotion> inbox(source, manual_clock_);

  ASSERT_EQ(pointer.send(random_message<HandTarget>(random_)), SendResult::kSent);

  EXPECT_EQ(inbox.next(), nullptr);
  EXPECT_EQ(source.rejections().latest(), DecodeError::kWrongKind);
  EXPECT_EQ(inbox.counters().rejected, 1u);
}

TEST_F(OneWayLink, ASenderSendsNothingToAReceiverOfAnotherKind) {
  ZmqSender<Interaction> physics(context_, bind_to("inproc://mixed_up", "links.interaction"));
  ZmqSource<ToolMotion> source(context_, manual_clock_,
                               connect_to("inproc://mixed_up", "links.tool_motion"));
  EXPECT_FALSE(physics.has_subscriber());
  EXPECT_EQ(physics.send(random_message<Interaction>(random_)), SendResult::kNoPeer);
}

TEST_F(OneWayLink, AFloodOfInvalidFramesDoesNotBlockTheReceiver) {
  ZmqSource<ToolMotion> source(context_, manual_clock_, bind_to("inproc://flood", "motion"));
  zmq::socket_t peer(context_.get(), zmq::socket_type::push);
  peer.connect("inproc://flood");
  for (int i = 0; i < 500; ++i) peer.send(zmq::str_buffer("x"));

  ToolMotion message;
  TimePoint at;
  EXPECT_FALSE(source.receive(message, at));
  EXPECT_EQ(source.rejected(), 16u);
}

TEST_F(OneWayLink, ASourceOfOneWriterRefusesASecondUntilTheFirstIsSilent) {
  ZmqSource<ToolMotion> source(context_, manual_clock_, bind_to("inproc://one", "motion"));
  source.keep_to_one_writer();
  ZmqSender<ToolMotion> sender(context_, connect_to("inproc://one", "motion"));
  ASSERT_TRUE(eventually([&] {
    source.wait_until(manual_clock_.now());
    return sender.has_subscriber();
  }));
  auto message = random_message<ToolMotion>(random_);
  const auto is_accepted = [&](std::uint64_t session_id) {
    message.header.session_id = session_id;
    EXPECT_EQ(sender.send(message), SendResult::kSent);
    ToolMotion received;
    TimePoint at;
    return source.receive(received, at);
  };
  EXPECT_TRUE(is_accepted(1));
  manual_clock_.advance(OneWriter::kSilence - 1ns);
  EXPECT_FALSE(is_accepted(2));
  EXPECT_TRUE(is_accepted(1));
  EXPECT_EQ(source.rejections().second_writer(), 1u);

  manual_clock_.advance(OneWriter::kSilence);
  EXPECT_TRUE(is_accepted(2));
  EXPECT_FALSE(is_accepted(1));
  EXPECT_EQ(source.rejections().second_writer(), 2u);
  EXPECT_EQ(source.rejected(), 2u);
}

}  // namespace
}  // namespace palpate::test
