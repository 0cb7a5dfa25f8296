// SPDX-License-Identifier: Apache-2.0
// scene_sender.h — physics_node's end of hop 5.
#pragma once

#include <cstdint>
#include <string>

#include "common/core/ports.h"
#include "common/core/scene_messages.h"
#include "common/link/codec/codec.h"
#include "common/link/socket/link_socket.h"
#include "common/link/subscribers.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// Sends three kinds of message through one socket to those that subscribe to them. A kind without
/// subscribers is neither computed nor encoded.
class SceneSender final : public Sender<PhysicsBatch>,
                          public Sender<SceneState>,
                          public Sender<MeshFrame> {
 public:
  SceneSender(ZmqContext& context, const Attachment& attachment);

  SendResult send(const PhysicsBatch& message) noexcept override;
  SendResult send(const SceneState& message) noexcept override;
  SendResult send(const MeshFrame& message) noexcept override;

  template <class T>
  [[nodiscard]] bool has_subscriber() noexcept {
    subscribers_.take();
    return subscribers_.has(kKindOf<T>);
  }
  /// Number of subscriptions to T so far. If it has increased, a new subscriber needs all of T.
  template <class T>
  [[nodiscard]] std::uint64_t subscriptions() noexcept {
    subscribers_.take();
    return subscribers_.count(kKindOf<T>);
  }
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  LinkSocket socket_;
  Subscribers subscribers_{socket_};
  Codec<PhysicsBatch> batches_;
  Codec<SceneState> scenes_;
  Codec<MeshFrame> meshes_;
};

}  // namespace palpate
