// The ZeroMQ ends on real sockets: every link over every transport, and what goes wrong with them.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "common/core/inbox.h"
#include "common/core/memory_link.h"
#include "common/link/zmq_links.h"
#include "tests/support/random_messages.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using test::random_message;
using test::same;
using testing::HasSubstr;

constexpr Duration kPatience = 5s;  // for what must happen; a failing test waits this long

enum class Transport { kInproc, kIpc, kTcp };

class LinksTest : public testing::Test {
 protected:
  [[nodiscard]] std::string ipc(const std::string& name) const {
    return "ipc://" + (folder_.path() / name).string();
  }

  /// An endpoint that nobody uses, to bind to; tcp gets a free port.
  std::string fresh_endpoint(Transport transport) {
    const std::string name = "e" + std::to_string(endpoints_++);
    switch (transport) {
      case Transport::kInproc:
        return "inproc://" + name;
      case Transport::kIpc:
        return ipc(name);
      case Transport::kTcp:
        break;
    }
    return "tcp://127.0.0.1:*";
  }

  /// Waits for the event with a deadline; `step` may do something towards it.
  [[nodiscard]] bool eventually(const std::function<bool()>& event) {
    const TimePoint deadline = clock_.now() + kPatience;
    while (!event()) {
      if (clock_.now() > deadline) return false;
      clock_.sleep_until(clock_.now() + 100us);
    }
    return true;
  }

  /// Until the sender knows its receiver. The receiver must be looked at: it takes a connection in
  /// when it is.
  template <class T>
  [[nodiscard]] bool meet(ZmqSender<T>& sender, ZmqSource<T>& source) {
    return eventually([&] {
      source.wait_until(clock_.now());
      return sender.has_subscriber();
    });
  }

  template <class T>
  [[nodiscard]] bool receive(Source<T>& source, T& message) {
    const TimePoint deadline = clock_.now() + kPatience;
    TimePoint received_at;
    while (!source.receive(message, received_at)) {
      if (clock_.now() > deadline) return false;
      source.wait_until(deadline);
    }
    return true;
  }

  /// A DeviceState of one session.
  [[nodiscard]] DeviceState state(std::uint64_t session_id, std::uint64_t sequence) {
    auto message = random_message<DeviceState>(random_);
    message.header.session_id = session_id;
    message.header.sequence = sequence;
    return message;
  }

  test::TempFolder folder_;
  SteadyClock clock_;
  ManualClock manual_clock_;
  Random random_{1};
  ZmqContext context_;

 private:
  int endpoints_ = 0;
};

bool is_same(const TelemetryMessage& a, const TelemetryMessage& b) {
  return a.index() == b.index() && std::visit(
                                       [&](const auto& batch) {
                                         using Batch = std::decay_t<decltype(batch)>;
                                         return same(batch, std::get<Batch>(b));
                                       },
                                       a);
}

std::string transport_name(const testing::TestParamInfo<Transport>& which) {
  if (which.param == Transport::kInproc) return "Inproc";
  return which.param == Transport::kIpc ? "Ipc" : "Tcp";
}

class EveryTransport : public LinksTest, public testing::WithParamInterface<Transport> {};
INSTANTIATE_TEST_SUITE_P(Links, EveryTransport,
                         testing::Values(Transport::kInproc, Transport::kIpc, Transport::kTcp),
                         transport_name);

/// Where the two ends may be two processes.
class EverySocket : public EveryTransport {};
INSTANTIATE_TEST_SUITE_P(Links, EverySocket, testing::Values(Transport::kIpc, Transport::kTcp),
                         transport_name);

// --- each link --------------------------------------------------------------------------------

TEST_P(EveryTransport, ExchangeCarriesTheStateAndItsAnswer) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));

  for (int i = 0; i < 100; ++i) {
    const auto sent = state(5, static_cast<std::uint64_t>(i));
    ASSERT_EQ(device.send(sent), SendResult::kSent);
    DeviceState heard;
    ASSERT_TRUE(receive(mofc, heard));
    ASSERT_TRUE(same(sent, heard));

    const auto answer = random_message<ForceCommand>(random_);
    ASSERT_EQ(mofc.send(answer), SendResult::kSent);
    ForceCommand felt;
    ASSERT_TRUE(receive(device, felt));
    ASSERT_TRUE(same(answer, felt));
  }
  EXPECT_EQ(mofc.rejected() + device.rejected(), 0u);
}

TEST_P(EveryTransport, ToolMotionReachesTheReceiverThatBinds) {
  ZmqSource<ToolMotion> physics(context_, clock_,
                                bind_to(fresh_endpoint(GetParam()), "links.tool_motion"));
  ZmqSender<ToolMotion> mofc(context_, connect_to(physics.endpoint(), "links.tool_motion"));
  ASSERT_TRUE(meet(mofc, physics));

  for (int i = 0; i < 100; ++i) {
    const auto sent = random_message<ToolMotion>(random_);
    ASSERT_EQ(mofc.send(sent), SendResult::kSent);
    ToolMotion received;
    ASSERT_TRUE(receive(physics, received));
    ASSERT_TRUE(same(sent, received));
  }
}

TEST_P(EveryTransport, InteractionReachesTheReceiverThatConnects) {
  ZmqSender<Interaction> physics(context_,
                                 bind_to(fresh_endpoint(GetParam()), "links.interaction"));
  ZmqSource<Interaction> mofc(context_, clock_,
                              connect_to(physics.endpoint(), "links.interaction"));
  ASSERT_TRUE(physics.wait_for_peer(kPatience));

  for (int i = 0; i < 100; ++i) {
    const auto sent = random_message<Interaction>(random_);
    ASSERT_EQ(physics.send(sent), SendResult::kSent);
    Interaction received;
    ASSERT_TRUE(receive(mofc, received));
    ASSERT_TRUE(same(sent, received));
  }
}

TEST_P(EveryTransport, TelemetryOfAllNodesReachesEveryViewer) {
  ZmqSender<DeviceBatch> device(context_, bind_to(fresh_endpoint(GetParam()), "device"));
  ZmqSender<MofcBatch> mofc(context_, bind_to(fresh_endpoint(GetParam()), "mofc"));
  ZmqSender<PhysicsBatch> physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  const std::vector<Attachment> nodes = {connect_to(device.endpoint(), "device"),
                                         connect_to(mofc.endpoint(), "mofc"),
                                         connect_to(physics.endpoint(), "physics")};
  TelemetrySubscriber first(context_, clock_, nodes);
  ASSERT_TRUE(device.wait_for_peer(kPatience));
  ASSERT_TRUE(mofc.wait_for_peer(kPatience));
  ASSERT_TRUE(physics.wait_for_peer(kPatience));
  const auto device_batch = random_message<DeviceBatch>(random_);
  const auto mofc_batch = random_message<MofcBatch>(random_);
  const auto physics_batch = random_message<PhysicsBatch>(random_);
  const std::array<TelemetryMessage, 3> published = {device_batch, mofc_batch, physics_batch};

  ASSERT_EQ(device.send(device_batch), SendResult::kSent);
  ASSERT_EQ(mofc.send(mofc_batch), SendResult::kSent);
  ASSERT_EQ(physics.send(physics_batch), SendResult::kSent);

  std::array<int, 3> seen{};
  TelemetryMessage message;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(receive(first, message));
    ++seen[message.index()];
    EXPECT_TRUE(is_same(message, published[message.index()]));
  }
  EXPECT_EQ(seen, (std::array<int, 3>{1, 1, 1}));

  // a second viewer, later: it gets what is published from then on
  TelemetrySubscriber second(context_, clock_, nodes);
  TimePoint received_at;
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(device.send(device_batch));
    return second.receive(message, received_at);
  }));
}

TEST_P(EveryTransport, ASenderKnowsWhetherAnybodyListens) {
  ZmqSender<DeviceBatch> device(context_, bind_to(fresh_endpoint(GetParam()), "device"));
  EXPECT_FALSE(device.has_subscriber());
  EXPECT_EQ(device.send(random_message<DeviceBatch>(random_)), SendResult::kNoPeer);

  auto viewer = std::make_unique<TelemetrySubscriber>(
      context_, clock_, std::vector{connect_to(device.endpoint(), "device")});
  EXPECT_TRUE(device.wait_for_peer(kPatience));
  EXPECT_EQ(device.send(random_message<DeviceBatch>(random_)), SendResult::kSent);

  viewer.reset();
  EXPECT_TRUE(eventually([&] { return !device.has_subscriber(); }));
}

TEST_P(EveryTransport, AViewerGetsOnlyTheKindsItAsksFor) {
  SceneSender physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(physics.endpoint(), "physics")});
  ASSERT_TRUE(eventually([&] { return physics.has_subscriber<PhysicsBatch>(); }));
  EXPECT_FALSE(physics.has_subscriber<SceneState>());
  const auto scene = random_message<SceneState>(random_);
  const auto mesh = random_message<MeshFrame>(random_);
  EXPECT_EQ(physics.send(scene), SendResult::kNoPeer);
  EXPECT_EQ(physics.send(mesh), SendResult::kNoPeer);

  viewer.subscribe<SceneState>();
  viewer.subscribe<MeshFrame>();
  ASSERT_TRUE(eventually([&] { return physics.has_subscriber<MeshFrame>(); }));
  EXPECT_EQ(physics.send(scene), SendResult::kSent);
  EXPECT_EQ(physics.send(mesh), SendResult::kSent);

  TelemetryMessage message;
  ASSERT_TRUE(receive(viewer, message));
  EXPECT_TRUE(is_same(message, scene));
  ASSERT_TRUE(receive(viewer, message));
  EXPECT_TRUE(is_same(message, mesh));

  viewer.unsubscribe<MeshFrame>();
  EXPECT_TRUE(eventually([&] { return !physics.has_subscriber<MeshFrame>(); }));
  EXPECT_TRUE(physics.has_subscriber<SceneState>());
}

TEST_P(EveryTransport, EachNewViewerOfASceneIsNoticed) {
  SceneSender physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  const std::vector<Attachment> nodes = {connect_to(physics.endpoint(), "physics")};
  TelemetrySubscriber first(context_, clock_, nodes);
  first.subscribe<SceneState>();
  ASSERT_TRUE(eventually([&] { return physics.subscriptions<SceneState>() == 1; }));

  auto second = std::make_unique<TelemetrySubscriber>(context_, clock_, nodes);
  second->subscribe<SceneState>();
  EXPECT_TRUE(eventually([&] { return physics.subscriptions<SceneState>() == 2; }));

  // one of two leaves: the other still wants the scene
  second.reset();
  EXPECT_EQ(physics.send(random_message<SceneState>(random_)), SendResult::kSent);
  TelemetryMessage message;
  EXPECT_TRUE(receive(first, message));
}

TEST_P(EveryTransport, AFrameCanBeForwardedAsItCame) {
  SceneSender physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(physics.endpoint(), "physics")});
  ASSERT_TRUE(eventually([&] { return physics.has_subscriber<PhysicsBatch>(); }));
  const auto sent = random_message<PhysicsBatch>(random_);
  EXPECT_EQ(physics.send(sent), SendResult::kSent);
  TelemetryMessage message;
  ASSERT_TRUE(receive(viewer, message));

  std::vector<std::byte> frame{static_cast<std::byte>(kKindOf<PhysicsBatch>)};
  frame.insert(frame.end(), viewer.payload().begin(), viewer.payload().end());
  PhysicsBatch again;
  ASSERT_EQ(Codec<PhysicsBatch>().decode(frame, again), DecodeError::kNone);
  EXPECT_TRUE(same(again, sent));
}

TEST_P(EveryTransport, HandTargetsOfAllViewersReachTheDevice) {
  ZmqSource<HandTarget> device(context_, clock_, bind_to(fresh_endpoint(GetParam()), "hand_target"),
                               Delivery::kEvery);
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

TEST_F(LinksTest, WaitingForAPeerThatNeverComesEnds) {
  ZmqSender<Interaction> sender(context_, bind_to(fresh_endpoint(Transport::kIpc), "x"));
  ExchangeClient device(context_, clock_, connect_to(fresh_endpoint(Transport::kIpc), "y"));
  EXPECT_FALSE(sender.wait_for_peer(2ms));
  EXPECT_FALSE(device.wait_for_peer(2ms));
  EXPECT_EQ(device.send(state(1, 0)), SendResult::kDropped);
}

// --- queues -----------------------------------------------------------------------------------

// 256, then one in 16 of the other 768: 48.
TEST_P(EverySocket, AMofcThatAnswersNothingIsNotFlooded) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));

  int sent = 0;
  for (std::uint64_t i = 0; i < 1024; ++i) {
    if (device.send(state(1, i)) == SendResult::kSent) ++sent;
  }
  EXPECT_EQ(sent, 304);

  DeviceState heard;
  for (int i = 0; i < sent; ++i) ASSERT_TRUE(receive(mofc, heard));
  ASSERT_EQ(mofc.send(random_message<ForceCommand>(random_)), SendResult::kSent);
  ForceCommand felt;
  ASSERT_TRUE(receive(device, felt));
  for (std::uint64_t i = 1024; i < 1032; ++i) {
    EXPECT_EQ(device.send(state(1, i)), SendResult::kSent);
  }
}

// The alarm rings for the wait it was set for; a later wait, and one without, end in time too.
TEST_F(LinksTest, AWaitThatWasPreparedEndsInTime) {
  ExchangeServer mofc(context_, clock_, bind_to(ipc("x"), "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device.wait_for_peer(kPatience));
  ForceCommand felt;
  TimePoint at;
  const TimePoint prepared = clock_.now() + 2ms;
  device.prepare_wait(prepared);
  for (const TimePoint deadline : {prepared + 1ms, prepared + 2ms}) {
    while (clock_.now() < deadline) {
      EXPECT_FALSE(device.receive(felt, at));
      device.wait_until(deadline);
    }
    EXPECT_LT(clock_.now(), deadline + kPatience);
  }

  // and an answer that comes first ends it at once
  device.prepare_wait(clock_.now() + 2 * kPatience);
  ASSERT_EQ(device.send(state(1, 0)), SendResult::kSent);
  DeviceState heard;
  ASSERT_TRUE(receive(mofc, heard));
  ASSERT_EQ(mofc.send(random_message<ForceCommand>(random_)), SendResult::kSent);
  const TimePoint begin = clock_.now();
  while (!device.receive(felt, at)) device.wait_until(begin + 3 * kPatience);
  EXPECT_LT(clock_.now(), begin + kPatience);
}

/// Messages found in the receiver after 100 were sent 200 µs apart while it did not look.
template <class Context>
std::vector<std::uint64_t> left_after_a_burst(Context& context, const Clock& clock,
                                              const Attachment& bind, Delivery delivery) {
  SteadyClock pace;
  ZmqSource<ToolMotion> source(context, clock, bind, delivery);
  ZmqSender<ToolMotion> sender(context, connect_to(source.endpoint(), "links.tool_motion"));
  const TimePoint patience = pace.now() + kPatience;
  while (!sender.has_subscriber() && pace.now() < patience) source.wait_until(pace.now());
  Random random(3);
  auto message = random_message<ToolMotion>(random);
  for (message.header.sequence = 0; message.header.sequence < 100; ++message.header.sequence) {
    EXPECT_EQ(sender.send(message), SendResult::kSent);
    pace.sleep_until(pace.now() + 200us);
  }
  std::vector<std::uint64_t> sequences;
  TimePoint received_at;
  while (sequences.empty() && pace.now() < patience) {
    while (source.receive(message, received_at)) sequences.push_back(message.header.sequence);
  }
  return sequences;
}

TEST_P(EverySocket, ANewestLinkForgetsWhatWasOvertaken) {
  const auto left = left_after_a_burst(context_, clock_, bind_to(fresh_endpoint(GetParam()), "x"),
                                       Delivery::kNewest);
  // one is kept; another may arrive while it is taken
  ASSERT_FALSE(left.empty());
  EXPECT_LE(left.size(), 3u);
  EXPECT_GE(left.front(), 50u);
}

TEST_P(EverySocket, ALinkWithFaultsQueuesSixtyFour) {
  const auto left = left_after_a_burst(context_, clock_, bind_to(fresh_endpoint(GetParam()), "x"),
                                       Delivery::kEvery);
  ASSERT_GE(left.size(), 32u);
  for (std::size_t i = 1; i < left.size(); ++i) EXPECT_GT(left[i], left[i - 1]);
}

TEST_F(LinksTest, InprocInOneThreadGivesEachMessageAtOnceAndLosesNone) {
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
  for (std::uint64_t i = 0; i < 20'000; ++i) {
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

TEST_F(LinksTest, InprocKeepsManyMessagesUntilTheyAreTaken) {
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

TEST_F(LinksTest, InprocMayConnectBeforeTheOtherEndBinds) {
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

TEST_F(LinksTest, HooksStandForBlockingAndWakingInVirtualTime) {
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

  DeviceState heard;
  TimePoint at;
  ASSERT_TRUE(mofc.receive(heard, at));
  ASSERT_EQ(mofc.send(random_message<ForceCommand>(random_)), SendResult::kSent);
  EXPECT_EQ(woken, 11);
  device.wait_until(manual_clock_.now() + 5ms);  // something is there: no waiting
  EXPECT_EQ(manual_clock_.now(), TimePoint{} + 5ms);
}

// --- fault line -------------------------------------------------------------------------------

TEST_F(LinksTest, AFaultLineDeliversTheSameOverMemoryAndOverZeroMq) {
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

// --- bad frames -------------------------------------------------------------------------------

TEST_P(EveryTransport, BadFramesAreCountedByReasonAndGoodOnesStillPass) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  zmq::socket_t stranger(context_.get(), zmq::socket_type::dealer);
  stranger.set(zmq::sockopt::linger, 0);
  stranger.connect(mofc.endpoint());
  auto frame = [](const auto& message) {
    Codec<std::decay_t<decltype(message)>> codec;
    std::vector<std::byte> bytes(codec.encode(message));
    codec.write(bytes.data());
    return bytes;
  };
  auto send = [&](const std::vector<std::byte>& bytes, zmq::send_flags flags = {}) {
    ASSERT_TRUE(stranger.send(zmq::buffer(bytes), flags));
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
  send(std::vector<std::byte>(5000, std::byte{1}));
  send(version_2);
  send(frame(good), zmq::send_flags::sndmore);  // two parts: neither counts
  send(frame(good));
  send(frame(good));

  DeviceState heard;
  ASSERT_TRUE(receive(mofc, heard));
  EXPECT_TRUE(same(good, heard));
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

TEST_F(LinksTest, CrossWiredEndpointsRefuseEachOther) {
  ZmqSender<Interaction> physics(context_, bind_to("inproc://mixed_up", "links.interaction"));
  ZmqSource<ToolMotion> source(context_, manual_clock_,
                               connect_to("inproc://mixed_up", "links.tool_motion"));
  ASSERT_TRUE(physics.wait_for_peer(kPatience));
  Inbox<ToolMotion> inbox(source, manual_clock_);

  ASSERT_EQ(physics.send(random_message<Interaction>(random_)), SendResult::kSent);

  EXPECT_EQ(inbox.next(), nullptr);
  EXPECT_EQ(source.rejections().latest(), DecodeError::kWrongKind);
  EXPECT_EQ(inbox.counters().rejected, 1u);
}

TEST_F(LinksTest, AFloodOfBadFramesDoesNotHoldTheReceiver) {
  ZmqSource<ToolMotion> source(context_, manual_clock_, bind_to("inproc://flood", "motion"));
  zmq::socket_t stranger(context_.get(), zmq::socket_type::pub);
  stranger.connect("inproc://flood");
  source.wait_until(manual_clock_.now());
  ASSERT_TRUE(eventually([&] {  // until the subscription is through
    stranger.send(zmq::str_buffer("x"));
    ToolMotion message;
    TimePoint at;
    static_cast<void>(source.receive(message, at));
    return source.rejected() > 0;
  }));
  const std::uint64_t before = source.rejected();
  for (int i = 0; i < 500; ++i) stranger.send(zmq::str_buffer("x"));

  ToolMotion message;
  TimePoint at;
  EXPECT_FALSE(source.receive(message, at));
  EXPECT_EQ(source.rejected() - before, 16u);
}

// --- one writer -------------------------------------------------------------------------------

class OneWriter : public LinksTest {
 protected:
  [[nodiscard]] bool is_heard(std::uint64_t session_id) {
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

TEST_F(OneWriter, ASecondDeviceIsRefusedWhileTheFirstIsServed) {
  ASSERT_EQ(first_.send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_heard(1));
  for (std::uint64_t i = 0; i < 5; ++i) {
    ASSERT_EQ(second_.send(state(2, i)), SendResult::kSent);
    EXPECT_FALSE(is_heard(2));
  }

  EXPECT_EQ(mofc_.rejections().second_writer(), 5u);
  EXPECT_EQ(mofc_.rejected(), 5u);
  EXPECT_TRUE(is_answered(first_));
  EXPECT_FALSE(is_answered(second_));
}

TEST_F(OneWriter, ASecondDeviceIsTakenOnceTheFirstWasSilentForASecond) {
  ASSERT_EQ(first_.send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_heard(1));

  manual_clock_.advance(1s - 1ns);
  ASSERT_EQ(second_.send(state(2, 0)), SendResult::kSent);
  EXPECT_FALSE(is_heard(2));
  manual_clock_.advance(1ns);
  ASSERT_EQ(second_.send(state(2, 1)), SendResult::kSent);
  EXPECT_TRUE(is_heard(2));
  EXPECT_TRUE(is_answered(second_));

  // and now the first one is the stranger
  ASSERT_EQ(first_.send(state(1, 1)), SendResult::kSent);
  EXPECT_FALSE(is_heard(1));
}

// The first one has been answered; then its place is tried every 10 ms.
TEST_F(OneWriter, ASecondDeviceIsTakenAtOnceWhenTheFirstHasLeft) {
  auto leaves = std::make_unique<ExchangeClient>(context_, manual_clock_,
                                                 connect_to("inproc://exchange", "links.exchange"));
  ASSERT_EQ(leaves->send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_heard(1));
  ASSERT_TRUE(is_answered(*leaves));
  std::uint64_t sequence = 0;
  ASSERT_EQ(second_.send(state(2, sequence++)), SendResult::kSent);
  ASSERT_FALSE(is_heard(2));  // it is still there, and told again what it knows
  ForceCommand again;
  TimePoint at;
  EXPECT_TRUE(leaves->receive(again, at));

  leaves.reset();
  const TimePoint last_heard = manual_clock_.now();
  EXPECT_TRUE(eventually([&] {  // libzmq ends a connection on a thread of its own
    if (manual_clock_.now() - last_heard < 900ms) manual_clock_.advance(10ms);
    return second_.send(state(2, sequence++)) == SendResult::kSent && is_heard(2);
  }));
  EXPECT_LT(manual_clock_.now() - last_heard, ExchangeServer::kSilence);
}

TEST_F(OneWriter, ADeviceThatReconnectsKeepsItsPlace) {
  ASSERT_EQ(first_.send(state(1, 0)), SendResult::kSent);
  ASSERT_TRUE(is_heard(1));

  ASSERT_EQ(second_.send(state(1, 1)), SendResult::kSent);  // another connection, same session
  EXPECT_TRUE(is_heard(1));
  EXPECT_TRUE(is_answered(second_));
}

TEST_F(OneWriter, NobodyIsAnsweredBeforeTheFirstState) {
  EXPECT_EQ(mofc_.send(random_message<ForceCommand>(random_)), SendResult::kNoPeer);
}

TEST_P(EveryTransport, ADeviceThatIsGoneIsNoticedWhenAnswered) {
  ExchangeServer mofc(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  auto device = std::make_unique<ExchangeClient>(context_, clock_,
                                                 connect_to(mofc.endpoint(), "links.exchange"));
  ASSERT_TRUE(device->wait_for_peer(kPatience));
  ASSERT_EQ(device->send(state(1, 0)), SendResult::kSent);
  DeviceState heard;
  ASSERT_TRUE(receive(mofc, heard));

  device.reset();

  const auto answer = random_message<ForceCommand>(random_);
  EXPECT_TRUE(eventually([&] { return mofc.send(answer) == SendResult::kNoPeer; }));
}

// --- restarts ---------------------------------------------------------------------------------

TEST_P(EverySocket, AnExchangeSurvivesTheRestartOfEitherEnd) {
  auto mofc = std::make_unique<ExchangeServer>(
      context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  const std::string endpoint = mofc->endpoint();
  auto device =
      std::make_unique<ExchangeClient>(context_, clock_, connect_to(endpoint, "links.exchange"));
  std::uint64_t session = 1;
  std::uint64_t sequence = 0;
  auto round_trip = [&] {
    static_cast<void>(device->send(state(session, sequence++)));
    DeviceState heard;
    ForceCommand felt;
    TimePoint at;
    if (mofc->receive(heard, at) && heard.header.session_id == session) {
      static_cast<void>(mofc->send(random_message<ForceCommand>(random_)));
    }
    return device->receive(felt, at);
  };
  ASSERT_TRUE(eventually(round_trip));

  // a new process has a new session; it gets its place after the old one's second of silence
  device.reset();
  ++session;
  device =
      std::make_unique<ExchangeClient>(context_, clock_, connect_to(endpoint, "links.exchange"));
  EXPECT_TRUE(eventually(round_trip));

  mofc.reset();
  ASSERT_TRUE(eventually([&] {  // libzmq gives a port back a moment after the close
    try {
      mofc =
          std::make_unique<ExchangeServer>(context_, clock_, bind_to(endpoint, "links.exchange"));
    } catch (const SetupError&) {
    }
    return mofc != nullptr;
  }));
  EXPECT_TRUE(eventually(round_trip));
}

TEST_P(EverySocket, AOneWayLinkSurvivesTheRestartOfEitherEnd) {
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
        } catch (const SetupError&) {  // libzmq gives a port back a moment after the close
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

TEST_P(EverySocket, ASenderThatConnectsNoticesThatItsReceiverIsGone) {
  auto source = std::make_unique<ZmqSource<ToolMotion>>(
      context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.tool_motion"));
  ZmqSender<ToolMotion> sender(context_, connect_to(source->endpoint(), "links.tool_motion"));
  ASSERT_TRUE(meet(sender, *source));

  source.reset();

  // so nothing queues up that a restarted receiver would take for news
  EXPECT_TRUE(eventually([&] { return !sender.has_subscriber(); }));
}

// A receiver that stalls with full queues for longer than any time-out of a connection: a suspended
// terminal, a slow disk. The sender is silent at the end of the stall, so that a connection made
// anew would find the queue full and itself not yet held up by that.
constexpr int kMoreThanFits = 200;
constexpr Duration kStall = 700ms;

TEST_P(EverySocket, AViewerThatStallsGoesOnAfterwards) {
  ZmqSender<DeviceBatch> node(context_, bind_to(fresh_endpoint(GetParam()), "device"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(node.endpoint(), "device")});
  DeviceBatch batch;
  const auto publish = [&] {
    ++batch.header.sequence;
    static_cast<void>(node.send(batch));
  };
  batch.header.session_id = 1;
  TelemetryMessage message;
  TimePoint received_at;
  ASSERT_TRUE(eventually([&] {
    publish();
    return viewer.receive(message, received_at);
  }));

  for (int i = 0; i < kMoreThanFits; ++i) {
    publish();
    clock_.sleep_until(clock_.now() + 200us);
  }
  clock_.sleep_until(clock_.now() + kStall);
  const std::uint64_t sent = batch.header.sequence;
  while (viewer.receive(message, received_at)) {
  }

  EXPECT_TRUE(eventually([&] {
    publish();
    return viewer.receive(message, received_at) &&
           std::get<DeviceBatch>(message).header.sequence > sent;
  }));
}

TEST_P(EverySocket, AReceiverOfEveryMessageThatStallsGoesOnAfterwards) {
  ZmqSender<Interaction> sender(context_, bind_to(fresh_endpoint(GetParam()), "interaction"));
  ZmqSource<Interaction> source(context_, clock_, connect_to(sender.endpoint(), "interaction"),
                                Delivery::kEvery);
  ASSERT_TRUE(meet(sender, source));
  auto interaction = random_message<Interaction>(random_);
  interaction.header.sequence = 0;
  const auto send = [&] {
    ++interaction.header.sequence;
    static_cast<void>(sender.send(interaction));
  };

  for (int i = 0; i < kMoreThanFits; ++i) {
    send();
    clock_.sleep_until(clock_.now() + 200us);
  }
  clock_.sleep_until(clock_.now() + kStall);
  const std::uint64_t sent = interaction.header.sequence;
  Interaction message;
  TimePoint received_at;
  while (source.receive(message, received_at)) {
  }

  EXPECT_TRUE(eventually([&] {
    send();
    return source.receive(message, received_at) && message.header.sequence > sent;
  }));
}

TEST_P(EverySocket, TheLastTelemetryBatchLeavesBeforeTheNodeEnds) {
  auto device = std::make_unique<ZmqSender<DeviceBatch>>(
      context_, bind_to(fresh_endpoint(GetParam()), "device"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(device->endpoint(), "device")});
  ASSERT_TRUE(device->wait_for_peer(kPatience));
  auto batch = random_message<DeviceBatch>(random_);
  batch.records.assign(1000, DeviceTick{});  // 200 kB: more than the kernel takes at once

  ASSERT_EQ(device->send(batch), SendResult::kSent);
  device.reset();

  TelemetryMessage message;
  ASSERT_TRUE(receive(viewer, message));
  EXPECT_TRUE(same(std::get<DeviceBatch>(message), batch));
}

// --- waiting ----------------------------------------------------------------------------------

TEST_F(LinksTest, WaitingEndsWithinAFractionOfAMillisecondAndNeverEarly) {
  ZmqSource<ToolMotion> source(context_, clock_,
                               bind_to(fresh_endpoint(Transport::kIpc), "links.tool_motion"));
  std::vector<Duration> lateness;
  for (int i = 0; i < 300; ++i) {
    const TimePoint deadline = clock_.now() + 250us;
    source.wait_until(deadline);
    lateness.push_back(clock_.now() - deadline);
  }
  std::sort(lateness.begin(), lateness.end());
  EXPECT_GE(lateness.front(), 0ns);
  // whole milliseconds would be 750 µs late; timer slack is 50 µs
  EXPECT_LT(lateness[150], 400us);
}

TEST_F(LinksTest, WaitingDoesNotSpin) {
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

TEST_P(EveryTransport, EveryMessageWakesTheOtherThread) {
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
      ForceCommand felt;
      if (!receive(device, felt)) return;
      ++answered;
    }
  });

  const TimePoint start = clock_.now();
  const auto answer = random_message<ForceCommand>(random_);
  for (int i = 0; i < 2000; ++i) {
    DeviceState heard;
    if (!receive(mofc, heard)) break;
    EXPECT_EQ(mofc.send(answer), SendResult::kSent);
  }
  other.join();

  EXPECT_EQ(answered, 2000);
  // a wake-up that is missed costs a whole deadline of 5 s
  EXPECT_LT(clock_.now() - start, kPatience);
}

// --- endpoints --------------------------------------------------------------------------------

std::string setup_error(const std::function<void()>& action) {
  try {
    action();
  } catch (const SetupError& error) {
    return error.what();
  }
  return "no error";
}

TEST_F(LinksTest, AnIpcPathHasOneOwnerUntilItsProcessEnds) {
  const std::string endpoint = ipc("exchange");
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {  // only the claim: the parent's libzmq threads do not live here
    const IpcClaim claim(bind_to(endpoint, "links.exchange"));
    std::ofstream(endpoint.substr(6) + ".other");
    char byte = 1;
    if (write(ready[1], &byte, 1) == 1) pause();
    _exit(0);
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);

  EXPECT_EQ(setup_error([&] {
              ExchangeServer second(context_, clock_, bind_to(endpoint, "links.exchange"));
            }),
            "links.exchange = " + endpoint + ": in use by process " + std::to_string(child) +
                "; stop it or give links.exchange another endpoint");

  // killed, so that it leaves everything behind
  kill(child, SIGKILL);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(std::filesystem::exists(folder_.path().string() + "/exchange.lock"));
  EXPECT_EQ(setup_error([&] {
              ExchangeServer next(context_, clock_, bind_to(endpoint, "links.exchange"));
            }),
            "no error");
  close(ready[0]);
  close(ready[1]);
}

TEST_F(LinksTest, AStaleSocketFileIsTakenOver) {
  const std::string endpoint = ipc("exchange");
  {
    zmq::socket_t dead(context_.get(), zmq::socket_type::router);
    dead.bind(endpoint);  // libzmq leaves its file
  }
  ASSERT_TRUE(std::filesystem::is_socket(folder_.path().string() + "/exchange"));

  ExchangeServer mofc(context_, clock_, bind_to(endpoint, "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(endpoint, "links.exchange"));
  EXPECT_TRUE(device.wait_for_peer(kPatience));
}

TEST_F(LinksTest, IpcLeavesNoFilesAndMakesItsFolderForThisUserAlone) {
  const std::string run = folder_.path().string() + "/run/session";
  {
    ExchangeServer mofc(context_, clock_, bind_to("ipc://" + run + "/exchange", "links.exchange"));
    EXPECT_TRUE(std::filesystem::is_socket(run + "/exchange"));
    struct stat status {};
    ASSERT_EQ(stat(run.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777u, 0700u);
  }
  EXPECT_TRUE(std::filesystem::is_empty(run));
}

TEST_F(LinksTest, AFolderOfAnotherUserIsRefused) {
  std::string folder = "/";  // root's
  if (geteuid() == 0) {
    folder = folder_.path().string() + "/theirs";
    std::filesystem::create_directory(folder);
    if (chown(folder.c_str(), 12345, 12345) != 0) GTEST_SKIP() << "may not chown";
  }
  EXPECT_THAT(setup_error([&] {
                ExchangeServer mofc(context_, clock_, bind_to("ipc://" + folder + "/x", "links.x"));
              }),
              HasSubstr("belongs to another user"));
}

TEST_F(LinksTest, AFileThatIsNoSocketIsNotRemoved) {
  std::ofstream(folder_.path().string() + "/notes") << "precious";
  EXPECT_THAT(
      setup_error([&] { ExchangeServer mofc(context_, clock_, bind_to(ipc("notes"), "links.x")); }),
      HasSubstr("no socket lies there"));
  EXPECT_EQ(std::filesystem::file_size(folder_.path().string() + "/notes"), 8u);
  EXPECT_FALSE(std::filesystem::exists(folder_.path().string() + "/notes.lock"));
}

TEST_P(EveryTransport, AnEndpointInUseIsRefusedWithARemedy) {
  ExchangeServer first(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  const std::string message = setup_error([&] {
    ExchangeServer second(context_, clock_, bind_to(first.endpoint(), "links.exchange"));
  });
  EXPECT_THAT(message, HasSubstr(first.endpoint() + ": in use by"));
  EXPECT_THAT(message, HasSubstr("give links.exchange another endpoint"));
}

TEST_F(LinksTest, TcpChoosesAFreePortAndSaysWhich) {
  ExchangeServer a(context_, clock_, bind_to("tcp://127.0.0.1:*", "links.exchange"));
  ExchangeServer b(context_, clock_, bind_to("tcp://127.0.0.1:*", "links.exchange"));
  EXPECT_THAT(a.endpoint(), testing::MatchesRegex("tcp://127.0.0.1:[0-9]+"));
  EXPECT_NE(a.endpoint(), b.endpoint());
}

TEST_F(LinksTest, WhatIsNoEndpointIsRefused) {
  const std::vector<std::string> bad = {"",
                                        "exchange",
                                        "/run/exchange",
                                        "udp://127.0.0.1:5",
                                        "ws://127.0.0.1:80",
                                        "ipc://",
                                        "ipc://@hidden",
                                        "ipc://*",
                                        "ipc:///tmp/",
                                        "tcp://",
                                        "inproc://",
                                        "tcp://nowhere",
                                        "tcp://*:notaport",
                                        "ipc:///tmp/" + std::string(200, 'x')};
  for (const std::string& endpoint : bad) {
    SCOPED_TRACE(endpoint);
    EXPECT_THAT(setup_error([&] {
                  ExchangeServer mofc(context_, clock_, bind_to(endpoint, "links.exchange"));
                }),
                HasSubstr("links.exchange = " + endpoint + ": "));
  }
  ZmqContext insecure(RealtimeConfig{.priority = 0, .cpu = -1}, {.may_be_plain = true});
  EXPECT_THAT(setup_error([&] {
                ExchangeServer mofc(insecure, clock_, bind_to("tcp://192.0.2.1:5555", "links.x"));
              }),
              HasSubstr("this machine does not have that address"));
  EXPECT_THAT(
      setup_error([&] { ExchangeClient device(insecure, clock_, connect_to("tcp://a", "b")); }),
      HasSubstr("give ipc://PATH, tcp://HOST:PORT or inproc://NAME"));
}

TEST_F(LinksTest, ASourceThatKeepsToOneWriterRefusesASecondUntilTheFirstIsSilent) {
  ZmqSource<ToolMotion> source(context_, manual_clock_, bind_to("inproc://one", "motion"));
  source.keep_to_one_writer();
  ZmqSender<ToolMotion> sender(context_, connect_to("inproc://one", "motion"));
  ASSERT_TRUE(eventually([&] {
    source.wait_until(manual_clock_.now());
    return sender.has_subscriber();
  }));
  auto message = random_message<ToolMotion>(random_);
  const auto is_heard = [&](std::uint64_t session_id) {
    message.header.session_id = session_id;
    EXPECT_EQ(sender.send(message), SendResult::kSent);
    ToolMotion received;
    TimePoint at;
    return source.receive(received, at);
  };
  EXPECT_TRUE(is_heard(1));
  manual_clock_.advance(palpate::OneWriter::kSilence - 1ns);
  EXPECT_FALSE(is_heard(2));
  EXPECT_TRUE(is_heard(1));
  EXPECT_EQ(source.rejections().second_writer(), 1u);

  manual_clock_.advance(palpate::OneWriter::kSilence);
  EXPECT_TRUE(is_heard(2));
  EXPECT_FALSE(is_heard(1));
  EXPECT_EQ(source.rejections().second_writer(), 2u);
  EXPECT_EQ(source.rejected(), 2u);
}

// --- context ----------------------------------------------------------------------------------

TEST_F(LinksTest, ARealTimeContextWorksWhetherOrNotTheProcessMay) {
  ZmqContext realtime(RealtimeConfig{.priority = 80, .cpu = 0});
  ZmqContext impossible(RealtimeConfig{.priority = 80, .cpu = 1000});
  EXPECT_FALSE(impossible.is_pinned());
  for (ZmqContext* context : {&realtime, &impossible}) {
    ExchangeServer mofc(*context, clock_, bind_to("tcp://127.0.0.1:*", "links.exchange"));
    ExchangeClient device(*context, clock_, connect_to(mofc.endpoint(), "links.exchange"));
    EXPECT_TRUE(device.wait_for_peer(kPatience));
  }
}

}  // namespace
}  // namespace palpate
