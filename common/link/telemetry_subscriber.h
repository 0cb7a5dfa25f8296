// telemetry_subscriber.h — a viewer's end of hop 5.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/rejections.h"
#include "common/link/socket/link_socket.h"
#include "common/telemetry/telemetry_message.h"

namespace palpate {

/// Receives the messages of all nodes through one socket: the batches of every node, SceneState and
/// MeshFrame after subscribe().
class TelemetrySubscriber final : public Source<TelemetryMessage> {
 public:
  TelemetrySubscriber(ZmqContext& context, const Clock& clock,
                      const std::vector<Attachment>& attachments);

  /// Starts or stops receiving T, also from nodes that start later.
  template <class T>
  void subscribe() {
    socket_.subscribe(kKindOf<T>);
  }
  template <class T>
  void unsubscribe() {
    socket_.unsubscribe(kKindOf<T>);
  }

  WaitHook on_wait;

  [[nodiscard]] bool receive(TelemetryMessage& message, TimePoint& received_at) noexcept override;
  void wait_until(TimePoint deadline) noexcept override;
  [[nodiscard]] std::uint64_t rejected() const noexcept override { return rejections_.total(); }

  /// The encoded protobuf message of the last receive(); valid until the next one.
  [[nodiscard]] std::span<const std::byte> payload() const noexcept;
  [[nodiscard]] const Rejections& rejections() const { return rejections_; }

 private:
  template <class T>
  [[nodiscard]] bool take(Codec<T>& codec, TelemetryMessage& message) noexcept;

  const Clock& clock_;
  LinkSocket socket_;
  Codec<DeviceBatch> device_;
  Codec<MofcBatch> mofc_;
  Codec<PhysicsBatch> physics_;
  Codec<SceneState> scenes_;
  Codec<MeshFrame> meshes_;
  zmq::message_t frame_;
  Rejections rejections_;
};

}  // namespace palpate
