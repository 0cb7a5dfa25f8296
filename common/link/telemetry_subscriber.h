// SPDX-License-Identifier: Apache-2.0
// telemetry_subscriber.h — a viewer's end of hop 5.
#pragma once

#include <poll.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <list>
#include <span>
#include <vector>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/rejections.h"
#include "common/link/socket/link_socket.h"
#include "common/link/subscription.h"
#include "common/telemetry/telemetry_message.h"

namespace palpate {

/// Receives the messages of all nodes, each through a socket of its own, or of a relay
/// (kRelayLink): the batches of every node
/// and RunState, SceneState and MeshFrame after subscribe().
class TelemetrySubscriber final : public Source<TelemetryMessage> {
 public:
  TelemetrySubscriber(ZmqContext& context, const Clock& clock,
                      const std::vector<Attachment>& attachments);

  /// Starts receiving T, also from nodes that start later.
  template <class T>
  void subscribe() {
    ++users_[static_cast<std::size_t>(kKindOf<T>)];
    for (Node& node : nodes_) node.subscription.add(kKindOf<T>);
    send_subscriptions();
  }
  /// Ends what one subscribe() began: T is received as long as one user of it is left.
  template <class T>
  void unsubscribe() {
    if (--users_[static_cast<std::size_t>(kKindOf<T>)] > 0) return;
    for (Node& node : nodes_) node.subscription.remove(kKindOf<T>);
    send_subscriptions();
  }

  WaitHook on_wait;

  [[nodiscard]] bool receive(TelemetryMessage& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  /// The encoded protobuf message of the last receive(); valid until the next one.
  [[nodiscard]] std::span<const std::byte> payload() const noexcept;
  [[nodiscard]] const Rejections& rejections() const { return rejections_; }

 private:
  struct Node {
    Node(ZmqContext& context, const Attachment& attachment)
        : socket(context, attachment.setting == kRelayLink ? kRelayReceiver : kTelemetryReceiver,
                 attachment) {}
    LinkSocket socket;
    Subscription subscription{socket};
  };

  void send_subscriptions() noexcept;
  [[nodiscard]] Reception receive_frame() noexcept;
  template <class T>
  [[nodiscard]] bool take(Codec<T>& codec, TelemetryMessage& message) noexcept;

  const Clock& clock_;
  std::list<Node> nodes_;
  std::list<Node>::iterator next_;          // whose turn it is
  std::vector<pollfd> descriptors_;         // of the nodes
  std::array<int, kMessageKinds> users_{};  // by kind: calls of subscribe() without their end
  Codec<DeviceBatch> device_;
  Codec<MofcBatch> mofc_;
  Codec<PhysicsBatch> physics_;
  Codec<SceneState> scenes_;
  Codec<MeshFrame> meshes_;
  Codec<RunState> runs_;
  zmq::message_t frame_;
  Rejections rejections_;
};

}  // namespace palpate
