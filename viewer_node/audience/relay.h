// SPDX-License-Identifier: Apache-2.0
// relay.h — passes hop 5 on to any number of viewer_nodes: the nodes of the session serve one
// receiver, however many follow.
//
//   in   hop 5  all messages, through the viewer's TelemetrySubscriber
//   out  the same frames, unchanged, published by libzmq's XSUB/XPUB proxy; the kind byte is the
//        topic
//
// MeshFrame is subscribed to while somebody follows it. A new follower gets the scene and the
// meshes as they are: all followers get them, and those that know them ignore the repetition.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <thread>
#include <zmq.hpp>

#include "common/link/telemetry_subscriber.h"
#include "viewer_node/feed/scene_mirror.h"

namespace palpate::viewer {

class Relay {
 public:
  /// Binds; throws SetupError. References must outlive it.
  Relay(ZmqContext& context, const std::string& endpoint, TelemetrySubscriber& subscriber);
  ~Relay();
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  /// Passes a message on. @param payload  the same message as received
  void take(const TelemetryMessage& message, std::span<const std::byte> payload);
  /// Serves new followers. Call it several times a second.
  void pump();
  /// With the actual port instead of "*".
  [[nodiscard]] const std::string& endpoint() const { return followers_.endpoint(); }

 private:
  void send(MessageKind kind, std::span<const std::byte> payload);
  void note_subscription(bool is_wanted, std::string_view topic);
  void send_scene();
  void send_meshes();

  TelemetrySubscriber& subscriber_;
  LinkSocket followers_;  // XPUB; the proxy's thread uses it
  zmq::socket_t inside_;  // XSUB, likewise
  zmq::socket_t feed_;  // XPUB: what the proxy distributes, and the subscriptions that it passes on
  zmq::socket_t control_;
  zmq::socket_t controlled_;  // the proxy's end
  SceneMirror mirror_;
  std::string scene_payload_;  // "" before the first scene
  Codec<MeshFrame> mesh_codec_;
  bool has_mesh_follower_ = false;
  std::thread proxy_;
};

}  // namespace palpate::viewer
