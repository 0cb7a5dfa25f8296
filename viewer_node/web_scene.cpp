#include "viewer_node/web_scene.h"

#include <string>

#include "common/link/codec/viewer_codec.h"
#include "viewer_node/web_channels.h"

namespace palpate::viewer {
namespace {

Payload copy_of(std::span<const std::byte> bytes) {
  return make_payload({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace

WebScene::WebScene(TelemetrySubscriber& subscriber, WebServer& server)
    : subscriber_(subscriber), server_(server) {
  subscriber_.subscribe<SceneState>();
}

bool WebScene::take(const SceneState& scene, std::span<const std::byte> payload) {
  const bool is_first = !mirror_.scene().has_value();
  if (!mirror_.take(scene)) return false;
  scene_payload_ = copy_of(payload);
  server_.publish(index_of(WebChannel::kScene), wall_clock_ns(), scene_payload_);
  return !is_first;
}

void WebScene::take(const MeshFrame& frame, std::span<const std::byte> payload) {
  if (!mirror_.take(frame)) return;
  ++frame_count_;
  const std::size_t channel = index_of(WebChannel::kMesh);
  if (server_.has_subscriber(channel)) {
    server_.publish(channel, wall_clock_ns(), copy_of(payload));
  }
}

void WebScene::send_scene_to(std::uint64_t client) {
  if (!scene_payload_) return;
  server_.send_to(client, index_of(WebChannel::kScene), wall_clock_ns(), scene_payload_);
}

void WebScene::send_meshes_to(std::uint64_t client) {
  for (const MeshFrame& frame : mirror_.whole_frames()) {
    server_.send_to(client, index_of(WebChannel::kMesh), wall_clock_ns(),
                    make_payload(payload_of(mesh_codec_, frame)));
  }
}

void WebScene::pump() {
  const bool is_needed = server_.has_subscriber(index_of(WebChannel::kMesh)) ||
                         server_.has_subscriber(index_of(WebChannel::kPoints));
  if (is_needed == is_subscribed_) return;
  is_subscribed_ = is_needed;
  if (is_needed) {
    mirror_.forget_motion();
    subscriber_.subscribe<MeshFrame>();
  } else {
    subscriber_.unsubscribe<MeshFrame>();
  }
}

}  // namespace palpate::viewer
