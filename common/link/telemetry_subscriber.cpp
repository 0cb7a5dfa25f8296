#include "common/link/telemetry_subscriber.h"

#include <utility>
#include <variant>

#include "common/link/frame_io.h"

namespace palpate {

TelemetrySubscriber::TelemetrySubscriber(ZmqContext& context, const Clock& clock,
                                         const std::vector<Attachment>& attachments)
    : clock_(clock), socket_(context, kTelemetrySubscriber, attachments) {
  subscribe<DeviceBatch>();
  subscribe<MofcBatch>();
  subscribe<PhysicsBatch>();
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

bool TelemetrySubscriber::receive(TelemetryMessage& message, TimePoint& received_at) noexcept {
  for (int i = 0; i < kMaxRejectedPerCall && socket_.receive(frame_); ++i) {
    if (socket_.drop_more_parts(frame_) || frame_.size() == 0) {
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
  socket_.wait_for_message(on_wait, clock_, deadline);
}

}  // namespace palpate
