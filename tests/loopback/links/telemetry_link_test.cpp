// SPDX-License-Identifier: Apache-2.0
// Telemetry and scene (hop 5) over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <memory>
#include <variant>
#include <vector>

#include "common/link/codec/codec.h"
#include "common/link/scene_sender.h"
#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "tests/loopback/links/link_fixture.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

using TelemetryLink = LinksTest;

class TelemetryLinkTransport : public EveryTransport {};
INSTANTIATE_TEST_SUITE_P(Links, TelemetryLinkTransport, kEveryTransport, transport_name);

class TelemetryLinkSocket : public EveryTransport {};
INSTANTIATE_TEST_SUITE_P(Links, TelemetryLinkSocket, kEverySocket, transport_name);

bool is_same(const TelemetryMessage& a, const TelemetryMessage& b) {
  return a.index() == b.index() && std::visit(
                                       [&](const auto& batch) {
                                         using Batch = std::decay_t<decltype(batch)>;
                                         return same(batch, std::get<Batch>(b));
                                       },
                                       a);
}

TEST_P(TelemetryLinkTransport, TelemetryOfAllNodesReachesEveryViewer) {
  ZmqSender<DeviceBatch> device(context_, bind_to(fresh_endpoint(GetParam()), "device"));
  ZmqSender<MofcBatch> mofc(context_, bind_to(fresh_endpoint(GetParam()), "mofc"));
  ZmqSender<PhysicsBatch> physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  const std::vector<Attachment> nodes = {connect_to(device.endpoint(), "device"),
                                         connect_to(mofc.endpoint(), "mofc"),
                                         connect_to(physics.endpoint(), "physics")};
  TelemetrySubscriber first(context_, clock_, nodes);
  ASSERT_TRUE(meet(device, first));
  ASSERT_TRUE(meet(mofc, first));
  ASSERT_TRUE(meet(physics, first));
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

  // a viewer that connects later receives what is published from then on
  TelemetrySubscriber second(context_, clock_, nodes);
  TimePoint received_at;
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(device.send(device_batch));
    return second.receive(message, received_at);
  }));
}

TEST_P(TelemetryLinkTransport, ASenderKnowsWhetherThereAreSubscribers) {
  ZmqSender<DeviceBatch> device(context_, bind_to(fresh_endpoint(GetParam()), "device"));
  EXPECT_FALSE(device.has_subscriber());
  EXPECT_EQ(device.send(random_message<DeviceBatch>(random_)), SendResult::kNoPeer);

  auto viewer = std::make_unique<TelemetrySubscriber>(
      context_, clock_, std::vector{connect_to(device.endpoint(), "device")});
  EXPECT_TRUE(meet(device, *viewer));
  EXPECT_EQ(device.send(random_message<DeviceBatch>(random_)), SendResult::kSent);

  viewer.reset();
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(device.send(random_message<DeviceBatch>(random_)));
    return !device.has_subscriber();
  }));
}

TEST_P(TelemetryLinkSocket, ASilentSubscriberIsForgottenAndComesBack) {
  ZmqSender<DeviceBatch> device(context_, bind_to(fresh_endpoint(GetParam()), "device"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(device.endpoint(), "device")});
  TimePoint last;  // before the sender heard of the viewer for the last time
  ASSERT_TRUE(eventually([&] {
    last = clock_.now();
    viewer.wait_until(last);
    return device.has_subscriber();
  }));

  EXPECT_TRUE(eventually([&] { return !device.has_subscriber(); }));
  EXPECT_GE(clock_.now() - last, Subscribers::kSilence - 2 * Subscription::kInterval);
  EXPECT_TRUE(meet(device, viewer));
}

TEST_P(TelemetryLinkTransport, AViewerReceivesOnlyTheKindsItSubscribesTo) {
  SceneSender physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(physics.endpoint(), "physics")});
  ASSERT_TRUE(eventually([&] {
    viewer.wait_until(clock_.now());
    return physics.has_subscriber<PhysicsBatch>();
  }));
  EXPECT_FALSE(physics.has_subscriber<SceneState>());
  const auto scene = random_message<SceneState>(random_);
  const auto mesh = random_message<MeshFrame>(random_);
  EXPECT_EQ(physics.send(scene), SendResult::kNoPeer);
  EXPECT_EQ(physics.send(mesh), SendResult::kNoPeer);

  viewer.subscribe<SceneState>();
  viewer.subscribe<MeshFrame>();
  ASSERT_TRUE(eventually([&] {
    viewer.wait_until(clock_.now());
    return physics.has_subscriber<MeshFrame>();
  }));
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

// The recording of a viewer goes on when the last page has closed.
TEST_P(TelemetryLinkTransport, AKindIsReceivedUntilItsLastUserLeaves) {
  SceneSender physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(physics.endpoint(), "physics")});
  const auto becomes = [&](const std::function<bool()>& is_so) {
    return eventually([&] {
      viewer.wait_until(clock_.now());
      return is_so();
    });
  };
  viewer.subscribe<MeshFrame>();
  viewer.subscribe<MeshFrame>();
  ASSERT_TRUE(becomes([&] { return physics.has_subscriber<MeshFrame>(); }));
  viewer.unsubscribe<MeshFrame>();
  viewer.subscribe<SceneState>();  // sent later: once it has arrived, the end would have, too
  ASSERT_TRUE(becomes([&] { return physics.has_subscriber<SceneState>(); }));
  EXPECT_TRUE(physics.has_subscriber<MeshFrame>());

  viewer.unsubscribe<MeshFrame>();
  EXPECT_TRUE(becomes([&] { return !physics.has_subscriber<MeshFrame>(); }));
}

TEST_P(TelemetryLinkTransport, EachNewSubscriberOfASceneIsCounted) {
  SceneSender physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  const std::vector<Attachment> nodes = {connect_to(physics.endpoint(), "physics")};
  TelemetrySubscriber first(context_, clock_, nodes);
  first.subscribe<SceneState>();
  const auto count_becomes = [&](TelemetrySubscriber& viewer, std::uint64_t count) {
    return eventually([&] {
      first.wait_until(clock_.now());  // or it is forgotten
      viewer.wait_until(clock_.now());
      return physics.subscriptions<SceneState>() == count;
    });
  };
  ASSERT_TRUE(count_becomes(first, 1));

  auto second = std::make_unique<TelemetrySubscriber>(context_, clock_, nodes);
  second->subscribe<SceneState>();
  EXPECT_TRUE(count_becomes(*second, 2));

  // one of two disconnects: the other is still subscribed
  second.reset();
  EXPECT_EQ(physics.send(random_message<SceneState>(random_)), SendResult::kSent);
  TelemetryMessage message;
  EXPECT_TRUE(receive(first, message));
}

TEST_P(TelemetryLinkTransport, AFrameCanBeForwardedUnchanged) {
  SceneSender physics(context_, bind_to(fresh_endpoint(GetParam()), "physics"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(physics.endpoint(), "physics")});
  ASSERT_TRUE(eventually([&] {
    viewer.wait_until(clock_.now());
    return physics.has_subscriber<PhysicsBatch>();
  }));
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

TEST_P(TelemetryLinkSocket, TheLastBatchIsSentBeforeTheNodeEnds) {
  const QuietMachine machine;
  auto device = std::make_unique<ZmqSender<DeviceBatch>>(
      context_, bind_to(fresh_endpoint(GetParam()), "device"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(device->endpoint(), "device")});
  ASSERT_TRUE(meet(*device, viewer));
  auto batch = random_message<DeviceBatch>(random_);
  batch.records.assign(1000, DeviceTick{});  // 200 kB: more than the kernel buffers hold

  ASSERT_EQ(device->send(batch), SendResult::kSent);
  device.reset();

  // a socket that is closed sends for 200 ms, which its thread may not get on a busy machine
  TelemetryMessage message;
  if (!receive(viewer, message) && !machine.may_check("the last batch")) return;
  EXPECT_TRUE(same(std::get<DeviceBatch>(message), batch));
}

}  // namespace
}  // namespace palpate::test
