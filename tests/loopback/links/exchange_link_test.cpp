// SPDX-License-Identifier: Apache-2.0
// The exchange between device_node and mofc_node (hops 1 and 4) over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/socket/connection_monitor.h"
#include "tests/loopback/links/link_fixture.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

using ExchangeLink = LinksTest;

class ExchangeLinkTransport : public EveryTransport {};
INSTANTIATE_TEST_SUITE_P(Links, ExchangeLinkTransport, kEveryTransport, transport_name);

class ExchangeLinkSocket : public EveryTransport {};
INSTANTIATE_TEST_SUITE_P(Links, ExchangeLinkSocket, kEverySocket, transport_name);

TEST_P(ExchangeLinkTransport, ExchangeCarriesTheStateAndItsAnswer) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));

  for (int i = 0; i < 100; ++i) {
    const auto sent = state(5, static_cast<std::uint64_t>(i));
    ASSERT_EQ(device.send(sent), SendResult::kSent);
    DeviceState received;
    ASSERT_TRUE(receive(mofc, received));
    ASSERT_TRUE(same(sent, received));

    const auto answer = random_message<ForceCommand>(random_);
    ASSERT_EQ(mofc.send(answer), SendResult::kSent);
    ForceCommand command;
    ASSERT_TRUE(receive(device, command));
    ASSERT_TRUE(same(answer, command));
  }
  EXPECT_EQ(mofc.rejected() + device.rejected(), 0u);
}

// kMaxUnanswered = 256, then one of kSendOneIn = 16 of the remaining 768: 48.
TEST_P(ExchangeLinkSocket, SendingIsThrottledWhileNothingIsAnswered) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));

  int sent = 0;
  for (std::uint64_t i = 0; i < 1024; ++i) {
    if (device.send(state(1, i)) == SendResult::kSent) ++sent;
  }
  EXPECT_EQ(sent, 304);

  DeviceState received;
  for (int i = 0; i < sent; ++i) ASSERT_TRUE(receive(mofc, received));
  ASSERT_EQ(mofc.send(random_message<ForceCommand>(random_)), SendResult::kSent);
  ForceCommand command;
  ASSERT_TRUE(receive(device, command));
  for (std::uint64_t i = 1024; i < 1032; ++i) {
    EXPECT_EQ(device.send(state(1, i)), SendResult::kSent);
  }
}

// What comes just after the socket was read empty, and waits until the reader has time, is no
// flood.
TEST_F(ExchangeLink, ABacklogThatComesAtOnceEndsNoConnection) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(Transport::kTcp), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));
  DeviceState received;
  TimePoint at;
  for (std::uint64_t round = 0; round < 10; ++round) {
    EXPECT_FALSE(mofc.receive(received, at));
    for (std::uint64_t i = 0; i < 200; ++i) {  // of 2 kB
      ASSERT_EQ(device.send(state(1, 200 * round + i)), SendResult::kSent);
    }
    std::this_thread::sleep_for(3 * kTrafficInterval);
    for (int i = 0; i < 200; ++i) ASSERT_TRUE(receive(mofc, received)) << round << ", " << i;
    const auto answer = random_message<ForceCommand>(random_);
    ASSERT_EQ(mofc.send(answer), SendResult::kSent) << round;
    ForceCommand command;
    ASSERT_TRUE(receive(device, command)) << round;
  }
}

// The alarm ends the wait for which it was set; a later wait and one without an alarm also end in
// time.
TEST_F(ExchangeLink, APreparedWaitEndsInTime) {
  ExchangeServer mofc(context_, clock_, bind_to(ipc("x"), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));
  ForceCommand command;
  TimePoint at;
  const TimePoint prepared = clock_.now() + 2ms;
  device.prepare_wait(prepared);
  for (const TimePoint deadline : {prepared + 1ms, prepared + 2ms}) {
    while (clock_.now() < deadline) {
      EXPECT_FALSE(device.receive(command, at));
      device.wait_until(deadline);
    }
    EXPECT_LT(clock_.now(), deadline + kPatience);
  }

  // an earlier answer ends the wait at once
  device.prepare_wait(clock_.now() + 2 * kPatience);
  ASSERT_EQ(device.send(state(1, 0)), SendResult::kSent);
  DeviceState received;
  ASSERT_TRUE(receive(mofc, received));
  ASSERT_EQ(mofc.send(random_message<ForceCommand>(random_)), SendResult::kSent);
  const TimePoint begin = clock_.now();
  while (!device.receive(command, at)) device.wait_until(begin + 3 * kPatience);
  EXPECT_LT(clock_.now(), begin + kPatience);
}

TEST_F(ExchangeLink, WaitingDoesNotSpin) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(Transport::kIpc), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));
  auto cpu_time = [] {
    rusage usage{};
    getrusage(RUSAGE_THREAD, &usage);
    return std::chrono::seconds(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           std::chrono::microseconds(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
  };

  const auto before = cpu_time();
  const TimePoint deadline = clock_.now() + 200ms;
  while (clock_.now() < deadline) mofc.wait_until(deadline);

  EXPECT_LT(cpu_time() - before, 40ms);
}

TEST_P(ExchangeLinkTransport, EveryMessageWakesTheOtherThread) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  std::atomic<int> answered{0};
  std::thread other([&, endpoint = mofc.endpoint()] {
    ExchangeClient device(context_, clock_, connect_to(endpoint, "links.exchange"));
    if (!device.wait_for_peer(kPatience)) return;
    Random random(2);
    auto message = random_message<DeviceState>(random);
    for (int i = 0; i < 2000; ++i) {
      message.header.sequence = static_cast<std::uint64_t>(i);
      static_cast<void>(device.send(message));
      ForceCommand command;
      if (!receive(device, command)) return;
      ++answered;
    }
  });

  const test::QuietMachine machine;
  const TimePoint start = clock_.now();
  const auto answer = random_message<ForceCommand>(random_);
  for (int i = 0; i < 2000; ++i) {
    DeviceState received;
    if (!receive(mofc, received)) break;
    EXPECT_EQ(mofc.send(answer), SendResult::kSent);
  }
  other.join();

  EXPECT_EQ(answered, 2000);
  // a missed wake-up would cost a whole deadline of 20 s
  if (machine.may_check("4000 messages within 5 s")) {
    EXPECT_LT(clock_.now() - start, 5s);
  }
}

TEST_P(ExchangeLinkTransport, InvalidFramesAreCountedByReasonAndValidOnesPass) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  zmq::socket_t peer(context_.get(), zmq::socket_type::dealer);
  peer.set(zmq::sockopt::linger, 0);
  peer.connect(mofc.endpoint());
  auto frame = [](const auto& message) {
    Codec<std::decay_t<decltype(message)>> codec;
    std::vector<std::byte> bytes(codec.encode(message));
    codec.write(bytes.data());
    return bytes;
  };
  auto send = [&](const std::vector<std::byte>& bytes, zmq::send_flags flags = {}) {
    ASSERT_TRUE(peer.send(zmq::buffer(bytes), flags));
  };
  const auto good = state(4, 0);
  auto not_a_number = good;
  not_a_number.hand_position_m.x() = kNaN;
  auto too_strong = good;
  too_strong.hand_position_m.x() = 1e9;
  const auto version_2 = [] {  // field 1 (header) of 5 bytes: field 1, fixed32, 2
    std::vector<std::byte> bytes;
    for (const int b : {1, 0x0a, 5, 0x0d, 2, 0, 0, 0}) bytes.push_back(static_cast<std::byte>(b));
    return bytes;
  }();

  send(frame(random_message<ToolMotion>(random_)));
  send({std::byte{1}, std::byte{0xff}});
  send(frame(not_a_number));
  send(frame(too_strong));
  send({std::byte{1}});
  send(std::vector<std::byte>(kMaxFrameBytes<DeviceState> + 1, std::byte{1}));
  send(version_2);
  send(frame(good), zmq::send_flags::sndmore);  // two parts: refused
  send(frame(good));
  send(frame(good));

  DeviceState received;
  ASSERT_TRUE(receive(mofc, received));
  EXPECT_TRUE(same(good, received));
  const Rejections& rejections = mofc.rejections();
  EXPECT_EQ(rejections.of(DecodeError::kWrongKind), 1u);
  EXPECT_EQ(rejections.of(DecodeError::kMalformed), 2u);  // not protobuf; two parts
  EXPECT_EQ(rejections.of(DecodeError::kNotFinite), 1u);
  EXPECT_EQ(rejections.of(DecodeError::kOutOfRange), 1u);
  EXPECT_EQ(rejections.of(DecodeError::kMissingField), 1u);
  EXPECT_EQ(rejections.of(DecodeError::kTooLarge), 1u);
  EXPECT_EQ(rejections.of(DecodeError::kWrongVersion), 1u);
  EXPECT_EQ(rejections.peer_major(), 2u);
  EXPECT_EQ(rejections.total(), 8u);
  EXPECT_EQ(mofc.rejected(), 8u);
}

class SecondDevice : public LinksTest {
 protected:
  [[nodiscard]] bool is_accepted(std::uint64_t session_id) {
    DeviceState message;
    TimePoint at;
    return mofc_.receive(message, at) && message.header.session_id == session_id;
  }
  [[nodiscard]] bool is_answered(ExchangeClient& device) {
    ForceCommand message;
    TimePoint at;
    return mofc_.send(random_message<ForceCommand>(random_)) == SendResult::kSent &&
           device.receive(message, at);
  }
  ExchangeServer mofc_{context_, manual_clock_, bind_to("inproc://exchange", "links.exchange")};
  ExchangeClient first_{context_, manual_clock_, connect_to("inproc://exchange", "links.exchange")};
  ExchangeClient second_{context_, manual_clock_,
                         connect_to("inproc://exchange", "links.exchange")};
};

TEST_F(SecondDevice, IsRefusedWhileTheFirstIsServed) {
  ASSERT_EQ(first_.send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_accepted(1));
  for (std::uint64_t i = 0; i < 5; ++i) {
    ASSERT_EQ(second_.send(state(2, i)), SendResult::kSent);
    EXPECT_FALSE(is_accepted(2));
  }

  EXPECT_EQ(mofc_.rejections().second_writer(), 5u);
  EXPECT_EQ(mofc_.rejected(), 5u);
  EXPECT_TRUE(is_answered(first_));
  EXPECT_FALSE(is_answered(second_));
}

TEST_F(SecondDevice, IsAcceptedOnceTheFirstWasSilentForASecond) {
  ASSERT_EQ(first_.send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_accepted(1));

  manual_clock_.advance(1s - 1ns);
  ASSERT_EQ(second_.send(state(2, 0)), SendResult::kSent);
  EXPECT_FALSE(is_accepted(2));
  manual_clock_.advance(1ns);
  ASSERT_EQ(second_.send(state(2, 1)), SendResult::kSent);
  EXPECT_TRUE(is_accepted(2));
  EXPECT_TRUE(is_answered(second_));

  // now the first one is the second device
  ASSERT_EQ(first_.send(state(1, 1)), SendResult::kSent);
  EXPECT_FALSE(is_accepted(1));
}

// A device that has been answered is tested every 10 ms.
TEST_F(SecondDevice, IsAcceptedAtOnceWhenTheFirstHasDisconnected) {
  auto leaves = std::make_unique<ExchangeClient>(context_, manual_clock_,
                                                 connect_to("inproc://exchange", "links.exchange"));
  ASSERT_EQ(leaves->send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_accepted(1));
  ASSERT_TRUE(is_answered(*leaves));
  std::uint64_t sequence = 0;
  ASSERT_EQ(second_.send(state(2, sequence++)), SendResult::kSent);
  ASSERT_FALSE(is_accepted(2));  // the first is still connected and receives its last answer again
  ForceCommand again;
  TimePoint at;
  EXPECT_TRUE(leaves->receive(again, at));

  leaves.reset();
  const TimePoint last_state = manual_clock_.now();
  EXPECT_TRUE(eventually([&] {  // libzmq closes connections in its own thread
    clock_.sleep_until(clock_.now() + patience(2ms));
    if (manual_clock_.now() - last_state < 900ms) manual_clock_.advance(10ms);
    return second_.send(state(2, sequence++)) == SendResult::kSent && is_accepted(2);
  }));
  EXPECT_LT(manual_clock_.now() - last_state, ExchangeServer::kSilence);
}

TEST_F(SecondDevice, IsAcceptedIfItIsTheFirstReconnected) {
  ASSERT_EQ(first_.send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_accepted(1));

  ASSERT_EQ(second_.send(state(1, 1)), SendResult::kSent);  // another connection, same session
  EXPECT_TRUE(is_accepted(1));
  EXPECT_TRUE(is_answered(second_));
}

TEST_F(SecondDevice, IsNotAnsweredBeforeTheFirstState) {
  EXPECT_EQ(mofc_.send(random_message<ForceCommand>(random_)), SendResult::kNoPeer);
}

TEST_P(ExchangeLinkTransport, ADisconnectedDeviceIsDetectedWhenAnswered) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  auto device = std::make_unique<ExchangeClient>(context_, clock_,
                                                 connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device->wait_for_peer(kPatience));
  ASSERT_EQ(device->send(state(1, 0)), SendResult::kSent);
  DeviceState received;
  ASSERT_TRUE(receive(mofc, received));

  device.reset();

  const auto answer = random_message<ForceCommand>(random_);
  EXPECT_TRUE(eventually([&] { return mofc.send(answer) == SendResult::kNoPeer; }));
}

TEST_P(ExchangeLinkSocket, ResumesAfterTheRestartOfEitherEnd) {
  auto mofc = std::make_unique<ExchangeServer>(
      context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  const std::string endpoint = mofc->endpoint();
  auto device =
      std::make_unique<ExchangeClient>(context_, clock_, connect_to(endpoint, "links.exchange"));
  std::uint64_t session = 1;
  std::uint64_t sequence = 0;
  auto round_trip = [&] {
    static_cast<void>(device->send(state(session, sequence++)));
    DeviceState received;
    ForceCommand command;
    TimePoint at;
    if (mofc->receive(received, at) && received.header.session_id == session) {
      static_cast<void>(mofc->send(random_message<ForceCommand>(random_)));
    }
    return device->receive(command, at);
  };
  ASSERT_TRUE(eventually(round_trip));

  // a restarted process has a new session; it is accepted after a second of silence of the old one
  device.reset();
  ++session;
  device =
      std::make_unique<ExchangeClient>(context_, clock_, connect_to(endpoint, "links.exchange"));
  EXPECT_TRUE(eventually(round_trip));

  mofc.reset();
  ASSERT_TRUE(eventually([&] {  // libzmq releases a port shortly after closing
    try {
      mofc =
          std::make_unique<ExchangeServer>(context_, clock_, bind_to(endpoint, "links.exchange"));
    } catch (const SetupError&) {
    }
    return mofc != nullptr;
  }));
  EXPECT_TRUE(eventually(round_trip));
}

}  // namespace
}  // namespace palpate::test
