// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/audience/relay.h"

#include <cstring>
#include <variant>

#include "common/core/check.h"
#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {
namespace {

constexpr const char* kFeed = "inproc://palpate.relay.feed";
constexpr const char* kControl = "inproc://palpate.relay.control";

}  // namespace

Relay::Relay(ZmqContext& context, const std::string& endpoint, TelemetrySubscriber& subscriber)
    : subscriber_(subscriber),
      followers_(context, kRelaySender, bind_to(endpoint, std::string(kRelayLink))),
      inside_(context.get(), zmq::socket_type::xsub),
      feed_(context.get(), zmq::socket_type::xpub),
      control_(context.get(), zmq::socket_type::pair),
      controlled_(context.get(), zmq::socket_type::pair) {
  for (zmq::socket_t* socket : {&inside_, &feed_, &control_, &controlled_}) {
    socket->set(zmq::sockopt::linger, 0);
    socket->set(zmq::sockopt::sndhwm, kRelaySender.send_queue);
    socket->set(zmq::sockopt::rcvhwm, kRelaySender.send_queue);
  }
  feed_.set(zmq::sockopt::xpub_verboser, 1);
  feed_.bind(kFeed);
  inside_.connect(kFeed);
  control_.bind(kControl);
  controlled_.connect(kControl);
  subscriber_.subscribe<SceneState>();
  proxy_ = std::thread([this] {
    zmq_proxy_steerable(inside_.handle(), followers_.handle(), nullptr, controlled_.handle());
  });
}

Relay::~Relay() {
  control_.send(zmq::str_buffer("TERMINATE"), zmq::send_flags::none);
  proxy_.join();
}

void Relay::send(MessageKind kind, std::span<const std::byte> payload) {
  zmq::message_t frame(1 + payload.size());
  auto* const bytes = static_cast<std::byte*>(frame.data());
  bytes[0] = static_cast<std::byte>(kind);
  if (!payload.empty()) std::memcpy(bytes + 1, payload.data(), payload.size());
  static_cast<void>(feed_.send(frame, zmq::send_flags::dontwait));
}

void Relay::take(const TelemetryMessage& message, std::span<const std::byte> payload) {
  if (const auto* scene = std::get_if<SceneState>(&message)) {
    if (!mirror_.take(*scene)) return;  // a repetition
    scene_payload_.assign(reinterpret_cast<const char*>(payload.data()), payload.size());
  } else if (const auto* frame = std::get_if<MeshFrame>(&message)) {
    if (!mirror_.take(*frame)) return;
  }
  std::visit([&]<class T>(const T&) { send(kKindOf<T>, payload); }, message);
}

void Relay::pump() {
  zmq::message_t change;
  while (feed_.recv(change, zmq::recv_flags::dontwait)) {
    const std::string_view text(static_cast<const char*>(change.data()), change.size());
    if (!text.empty()) note_subscription(text.front() == 1, text.substr(1));
  }
}

/// @param topic  a kind byte; empty: all kinds. Anything else is of no known program.
void Relay::note_subscription(bool is_wanted, std::string_view topic) {
  if (topic.size() > 1) return;
  const auto concerns = [&](MessageKind kind) {
    return topic.empty() || topic.front() == static_cast<char>(kind);
  };
  if (concerns(MessageKind::kSceneState) && is_wanted) send_scene();
  if (!concerns(MessageKind::kMeshFrame)) return;
  if (is_wanted != has_mesh_follower_) {
    has_mesh_follower_ = is_wanted;
    mirror_.forget_motion();
    if (is_wanted) {
      subscriber_.subscribe<MeshFrame>();
    } else {
      subscriber_.unsubscribe<MeshFrame>();
    }
  } else if (is_wanted) {
    send_meshes();
  }
}

void Relay::send_scene() {
  if (!scene_payload_.empty()) {
    send(MessageKind::kSceneState, std::as_bytes(std::span(scene_payload_)));
  }
}

void Relay::send_meshes() {
  for (const MeshFrame& frame : mirror_.whole_frames()) {
    const std::string payload = payload_of(mesh_codec_, frame);
    send(MessageKind::kMeshFrame, std::as_bytes(std::span(payload)));
  }
}

}  // namespace palpate::viewer
