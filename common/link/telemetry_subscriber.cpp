// SPDX-License-Identifier: Apache-2.0
#include "common/link/telemetry_subscriber.h"

#include <poll.h>

#include <algorithm>
#include <utility>
#include <variant>

#include "common/core/check.h"
#include "common/link/frame_io.h"

namespace palpate {

TelemetrySubscriber::TelemetrySubscriber(ZmqContext& context, const Clock& clock,
                                         const std::vector<Attachment>& attachments)
    : clock_(clock) {
  PALPATE_REQUIRE(!attachments.empty());
  for (const Attachment& attachment : attachments) {
    Node& node = nodes_.emplace_back(context, attachment);
    descriptors_.push_back({.fd = node.socket.descriptor(), .events = POLLIN, .revents = 0});
  }
  next_ = nodes_.begin();
  subscribe<DeviceBatch>();
  subscribe<MofcBatch>();
  subscribe<PhysicsBatch>();
  subscribe<RunState>();
}

template <class T>
bool TelemetrySubscriber::take(Codec<T>& codec, TelemetryMessage& message) noexcept {
  // decode in place if `message` is of this kind already, so that its vectors keep their memory
  auto* held = std::get_if<T>(&message);
  T fresh;
  const DecodeError error = codec.decode(bytes_of(frame_), held != nullptr ? *held : fresh);
  if (error != DecodeError::kNone) {
    rejections_.count(error, codec.peer_major());
    return false;
  }
  if (held == nullptr) message = std::move(fresh);
  return true;
}

std::span<const std::byte> TelemetrySubscriber::payload() const noexcept {
  return bytes_of(frame_).subspan(frame_.size() > 0 ? 1 : 0);
}

void TelemetrySubscriber::send_subscriptions() noexcept {
  for (Node& node : nodes_) node.subscription.send_if_due();
}

/// The next frame of the node whose turn it is, or of another one.
Reception TelemetrySubscriber::receive_frame() noexcept {
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    Node& node = *next_;
    if (++next_ == nodes_.end()) next_ = nodes_.begin();
    const Reception reception = node.socket.receive(frame_);
    if (reception != Reception::kNothing) return reception;
  }
  return Reception::kNothing;
}

bool TelemetrySubscriber::receive(TelemetryMessage& message, TimePoint& received_at) noexcept {
  send_subscriptions();
  for (int i = 0; i < kMaxRejectedPerCall; ++i) {
    const Reception reception = receive_frame();
    if (reception == Reception::kNothing) return false;
    if (reception == Reception::kMalformed || frame_.size() == 0) {
      rejections_.count(DecodeError::kMalformed);
      continue;
    }
    bool is_good = false;
    switch (static_cast<MessageKind>(bytes_of(frame_)[0])) {
      case MessageKind::kDeviceBatch:
        is_good = take(device_, message);
        break;
      case MessageKind::kMofcBatch:
        is_good = take(mofc_, message);
        break;
      case MessageKind::kPhysicsBatch:
        is_good = take(physics_, message);
        break;
      case MessageKind::kSceneState:
        is_good = take(scenes_, message);
        break;
      case MessageKind::kMeshFrame:
        is_good = take(meshes_, message);
        break;
      case MessageKind::kRunState:
        is_good = take(runs_, message);
        break;
      default:
        rejections_.count(DecodeError::kWrongKind);
    }
    if (!is_good) continue;
    received_at = clock_.now();
    return true;
  }
  return false;
}

void TelemetrySubscriber::wait_until(TimePoint deadline) noexcept {
  send_subscriptions();
  for (Node& node : nodes_) {
    if (node.socket.is_ready(ZMQ_POLLIN)) return;
  }
  if (on_wait) {
    on_wait(deadline);
    return;
  }
  const Duration left = std::min(deadline - clock_.now(), Subscription::kInterval);
  if (left <= Duration::zero()) return;
  const timespec timeout{.tv_sec = 0, .tv_nsec = left.count()};
  ppoll(descriptors_.data(), descriptors_.size(), &timeout, nullptr);
}

}  // namespace palpate
